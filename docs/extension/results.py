"""Every variable of the stores, and what their codes mean."""

from chatter_core.variables import BIFURCATION, CELL_STATUS, DATASET, STATUS, STRUCTURE, SWEEP, Variable
from extension.docstrings import as_markdown
from extension.tables import table


def text() -> str:
    """Return tables of the variables of sweeps and data sets, and of their codes."""
    sweep = {**SWEEP, "status": CELL_STATUS}
    return (
        f"### Of a sweep, cell by cell\n\n{_variables(sweep)}\n"
        f"### Of a sweep, over speed and preload\n\n{_variables(STRUCTURE)}\n"
        f"### Of a data set\n\n{_variables(DATASET)}\n"
        f"### Codes\n\n{_codes('status', STATUS)}\n{_codes('bifurcation', BIFURCATION)}\n"
    )


def _variables(variables: dict[str, Variable]) -> str:
    rows = (
        [f"`{name}`", ", ".join(one.dims), "" if one.unit == "1" else one.unit, as_markdown(one.doc)]
        for name, one in variables.items()
    )
    return table(["variable", "over", "unit", "meaning"], rows)


def _codes(name: str, codes: dict[str, int]) -> str:
    return table([name, "code"], ([f"`{word}`", code] for word, code in codes.items()))
