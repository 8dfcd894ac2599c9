"""The plot of limit depths by the values of an input that is chosen."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from bokeh.models import Legend, LegendItem, Model
from bokeh.plotting import figure

from pipeline.by_value import OfValue
from pipeline.dataset_figures import ordered_colours
from pipeline.plots import ABREAST, WIDE, Choices, Key, hover, numbers, plot


def lines_by_value(
    speed: np.ndarray, values: Mapping[str, Sequence[OfValue]]
) -> tuple[figure, Choices, dict[str, Model]]:
    """Return limit depths over speed [rpm], a line and a band for each value of the input; its choice."""
    first = next(iter(values))
    choices = Choices({"by": {key: key for key in values}}, {"by": first}, width=WIDE)
    of = first if len(values) == 1 else "the values of an input"
    made = plot(f"Limit depths by {of}", "spindle speed [rpm]", "limit depth [mm]", height=440)
    made.y_range.start = 0.0
    data: dict[Key, dict[str, Any]] = {(key,): _columns(numbers(speed), own) for key, own in values.items()}
    source = choices.source(data, {})
    made.patches("around", "range", source=source, fill_color="colour", fill_alpha=0.08, line_alpha=0.0)
    lines = made.multi_line("speeds", "middle", source=source, line_color="colour", line_width=2)
    rows = [
        ("value", "@name, cuts: @cuts"),
        ("spindle speed", "$snap_x{0} rpm"),
        ("limit depth", "$snap_y{0.000} mm"),
    ]
    made.add_tools(hover([lines], rows))
    # Its names are read from the data: they change with what is chosen.
    key = Legend(
        items=[LegendItem(label={"field": "name"}, renderers=[lines])], orientation="horizontal", ncols=ABREAST
    )
    key.location, key.margin, key.padding, key.background_fill_alpha, key.border_line_alpha = "left", 0, 0, 0.0, 0.0
    made.add_layout(key, "above")
    return made, choices, {}


def _columns(speed: np.ndarray, values: Sequence[OfValue]) -> dict[str, Any]:
    """Return a row for each value: its line, and the outline of its band."""
    outlines = [_outline(speed, own) for own in values]
    return {
        "name": [own.name for own in values],
        "cuts": [own.cuts for own in values],
        "colour": ordered_colours(len(values)),
        "speeds": [speed] * len(values),
        "middle": [numbers(own.middle) for own in values],
        "around": [around for around, _ in outlines],
        "range": [range_ for _, range_ in outlines],
    }


def _outline(speed: np.ndarray, own: OfValue) -> tuple[np.ndarray, np.ndarray]:
    """Return the outline of a band, its lower edge and back along the upper one, without what is not known."""
    known = ~np.isnan(own.middle)
    there, back = np.flatnonzero(known), np.flatnonzero(known)[::-1]
    return np.concatenate([speed[there], speed[back]]), numbers(np.concatenate([own.low[there], own.high[back]]))
