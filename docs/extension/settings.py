"""Every setting: the keys that are declared, and the choices that are shipped, with their own comments."""

from chatter_core.floquet import MethodSettings
from extension.tables import block, keys
from pipeline.configuration import CONFIGS, groups
from pipeline.design import Design, Level
from pipeline.settings import Axis, Cluster, Grid, QueueJobs

#: Group -> what declares its keys, each under the key that leads to it.
DECLARED = {
    "grid": {"grid": Grid, "an axis of the grid": Axis},
    "method": {"method": MethodSettings},
    "cluster": {"cluster": Cluster, "cluster.job": QueueJobs},
    "design": {"design": Design, "design.machine and design.cut": Level},
}


def text() -> str:
    """Return the root of all settings, and a section for each group."""
    root = block((CONFIGS / "config.yaml").read_text(encoding="utf-8"), "yaml")
    return root + "".join(_section(group, choices) for group, choices in groups().items())


def _section(group: str, choices: list[str]) -> str:
    declared = "".join(f"\nKeys of {place}:\n\n{keys(model)}" for place, model in DECLARED.get(group, {}).items())
    shipped = "".join(
        f"\n`{group}={choice}`\n\n{block((CONFIGS / group / f'{choice}.yaml').read_text(encoding='utf-8'), 'yaml')}"
        for choice in choices
    )
    return f"\n## {group}\n{declared}{shipped}"
