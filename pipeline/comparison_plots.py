"""The plots of a comparison's page: lobes with the trials on them, and receptances, by both versions of the model."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from bokeh.models import Model
from bokeh.plotting import figure
from bokeh.plotting.contour import contour_data

from chatter_core.evidence.assessment import WIDTHS, Assessment, Version
from chatter_core.evidence.boundary import Field
from chatter_core.evidence.measured import OUTCOMES, Limits, Trials
from chatter_core.units import si_factor
from pipeline.comparison_figures import (
    CALIBRATED,
    DECADES,
    DESCRIBED,
    HERTZ,
    MILLIMETRE,
    RPM,
    setup_text,
    trial_colours,
)
from pipeline.plots import Choices, Key, add_key, hover, numbers, plot

MODEL, CUTS, RESPONSE = "model", "cuts", "response"
#: Marks of the outcomes.
MARKS = {"stable": "circle", "marginal": "diamond", "chatter": "x"}
#: Most lines of a receptance that a page holds.
MOST_LINES = 2000
MEASURED = "#8c8c8c"


def comparison_plots(found: Assessment) -> dict[str, Model]:
    """Return choices and plots by name, as far as something was measured, in the order of the page."""
    made: dict[str, Model] = {}
    if found.refitted.fields:
        made |= _lobes(found)
    if found.comparison.model.campaign.receptances:
        made |= _receptances(found)
    return made


def _versions(found: Assessment) -> dict[str, Version]:
    """Return both versions of the model by the value of their choice, the one that is shown first at the end."""
    return {"before": found.described, "after": found.refitted}


def _lobes(found: Assessment) -> dict[str, Model]:
    """Return the boundary, the band in which it lies, and on it the trials and the limit depths that were measured."""
    setups = {str(number): setup_text(field.machine) for number, field in enumerate(found.refitted.fields)}
    titles = {name: version.title for name, version in _versions(found).items()}
    choices = Choices({MODEL: titles, CUTS: setups}, {MODEL: "after", CUTS: "0"}, width=320)
    trials, limits = found.comparison.model.campaign.trials, found.comparison.model.campaign.limits
    what = "Limit depths" if trials is None else "Cuts"
    made = plot(f"{what} and the boundary of stability", "spindle speed [rpm]", "axial depth [mm]", height=460)
    cases = list(_cases(found))
    bands = choices.source({key: _band(version, field, found) for key, version, field in cases}, {})
    made.multi_polygons("xs", "ys", source=bands, color=CALIBRATED, fill_alpha=0.18, line_width=0)
    lines = choices.source({key: _boundary(field) for key, _, field in cases}, {})
    boundary = made.multi_line("xs", "ys", source=lines, color=CALIBRATED, line_width=2)
    entries = {"boundary": [boundary]}
    if limits is not None:
        entries["limit depths"] = _limits(
            made, choices, {key: _limit_columns(limits, field) for key, _, field in cases}
        )
    if trials is not None:
        marks = _trials(made, choices, [(key, _trial_columns(trials, version, field)) for key, version, field in cases])
        entries |= {name: [mark] for name, mark in marks.items()}
    add_key(made, entries)
    field = found.refitted.fields[0]
    made.x_range.start, made.x_range.end = (float(field.spindle_speed[i] / RPM) for i in (0, -1))
    made.y_range.start, made.y_range.end = 0.0, float(field.axial_depth[-1] / MILLIMETRE)
    choices.bind()
    return {**choices.named("lobes"), "lobes": made}


def _cases(found: Assessment) -> Iterator[tuple[Key, Version, Field]]:
    """Yield version and field of every combination of choices."""
    for name, version in _versions(found).items():
        for number, field in enumerate(version.fields):
            yield (name, str(number)), version, field


def _places(field: Field) -> tuple[np.ndarray, np.ndarray]:
    return field.spindle_speed / RPM, field.axial_depth / MILLIMETRE


def _boundary(field: Field) -> dict[str, Any]:
    """Return the lines on which ln|mu| is zero."""
    lines = contour_data(*_places(field), field.growth.T, [0.0], want_fill=False).line_data
    return {"xs": list(lines.xs), "ys": list(lines.ys)}


def _band(version: Version, field: Field, found: Assessment) -> dict[str, Any]:
    """Return the areas in which the boundary lies; none for a model that was not calibrated."""
    if version is not found.refitted:
        return {"xs": [], "ys": []}
    with np.errstate(divide="ignore", invalid="ignore"):
        standard = (field.growth / field.deviation).T
    areas = contour_data(*_places(field), standard, [-WIDTHS, WIDTHS], want_line=False).fill_data
    return {"xs": list(areas.xs), "ys": list(areas.ys)}


def _trial_columns(trials: Trials, version: Version, field: Field) -> dict[str, np.ndarray]:
    """Return the trials of a field as columns."""
    own, told = field.trials, version.told
    return {
        "trial": trials.trial[own],
        "outcome": trials.outcome[own],
        "speed": trials.spindle_speed[own] / RPM,
        "depth": trials.axial_depth[own] / MILLIMETRE,
        "colour": trial_colours(trials, told.margin)[own],
        "probability": told.probability[own, -1],
        "heard": trials.chatter_frequency[own] / HERTZ,
        "said": told.chatter_frequency[own] / HERTZ,
    }


def _trials(made: figure, choices: Choices, cases: Sequence[tuple[Key, dict[str, np.ndarray]]]) -> dict[str, Any]:
    """Add the trials, a mark for each outcome; return the marks."""
    marks = {}
    for name, marker in MARKS.items():
        code = OUTCOMES.index(name)
        data = {
            key: {column: values[own["outcome"] == code] for column, values in own.items() if column != "outcome"}
            for key, own in cases
        }
        if not any(len(own["trial"]) for own in data.values()):
            continue
        filled = {"fill_alpha": 0.0, "line_width": 2} if name != "chatter" else {"line_width": 3}
        marks[name] = made.scatter(
            "speed", "depth", source=choices.source(data, {}), marker=marker, size=9, color="colour", **filled
        )
        heard = [("chatter frequency", "@heard{0} Hz, predicted @said{0} Hz")] if name == "chatter" else []
        rows = [
            ("trial @trial", name),
            ("cut", "@speed{0} rpm, @depth{0.000} mm"),
            ("predicted", "chatter with @probability{0 %}"),
            *heard,
        ]
        made.add_tools(hover([marks[name]], rows))
    return marks


def _limit_columns(limits: Limits, field: Field) -> dict[str, np.ndarray]:
    """Return the limit depths of a field as columns, with what lies a standard uncertainty beside them."""
    own = limits.at(field.limits)
    depth, apart = own.limit_depth / MILLIMETRE, own.uncertainty / MILLIMETRE
    return {"speed": own.spindle_speed / RPM, "depth": depth, "low": depth - apart, "high": depth + apart}


def _limits(made: figure, choices: Choices, cases: dict[Key, dict[str, np.ndarray]]) -> list[Any]:
    """Add the limit depths that were measured; return their marks and uncertainties."""
    source = choices.source(cases, {})
    bars = made.segment("speed", "low", "speed", "high", source=source, color=MEASURED, line_width=2)
    marks = made.scatter("speed", "depth", source=source, marker="square", size=7, color=MEASURED)
    made.add_tools(hover([marks], [("limit depth", "@depth{0.000} mm at @speed{0} rpm")]))
    return [bars, marks]


def _receptances(found: Assessment) -> dict[str, Model]:
    """Return the magnitude of a receptance, measured and by both versions of the model."""
    measured, micro = found.comparison.model.campaign.receptances, si_factor("x_um")
    choices = Choices({RESPONSE: {str(i): str(one) for i, one in enumerate(measured)}}, {RESPONSE: "0"}, width=320)
    data: dict[Key, dict[str, np.ndarray]] = {}
    for number, one in enumerate(measured):
        kept = slice(None, None, -(-len(one.frequency) // MOST_LINES))
        both = {
            name: numbers(np.abs(version.compared.prediction.receptances[number])[kept] / micro)
            for name, version in _versions(found).items()
        }
        size = np.abs(one.value) / micro
        shown = np.where(size > size.max() / 10.0**DECADES, size, np.nan)
        data[(str(number),)] = {
            "frequency": numbers(one.frequency[kept] / HERTZ), "measured": numbers(shown[kept]), **both
        }  # fmt: skip
    source = choices.source(data, {})
    made = plot("Receptance of the tool tip", "frequency [Hz]", "magnitude [\N{MICRO SIGN}m/N]", y_axis_type="log")
    points = made.scatter("frequency", "measured", source=source, size=3, color=MEASURED)
    titles = {name: version.title for name, version in _versions(found).items()}
    lines = {
        titles["before"]: made.line("frequency", "before", source=source, color=DESCRIBED, line_dash="dashed"),
        titles["after"]: made.line("frequency", "after", source=source, color=CALIBRATED, line_width=2),
    }
    made.add_tools(
        hover(
            [points],
            [("frequency", "@frequency{0.0} Hz"), ("measured", "@measured{0.000}"), *(
                (titles[name], f"@{name}{{0.000}}") for name in titles
            )],
        )
    )  # fmt: skip
    add_key(made, {"measured": [points], **{title: [line] for title, line in lines.items()}})
    choices.bind()
    return {**choices.named("receptances"), "receptances": made}
