"""The cut that removes most on the line that a plot shows, for margins that are chosen in the page."""

from typing import Any

import numpy as np
from bokeh.models import ColumnDataSource, CustomJS, Model, Slider
from bokeh.plotting import figure

from pipeline.best_cuts import safe_depth
from pipeline.plots import WIDGET_STYLE, hover
from pipeline.settings import Margins

#: Columns of a line from which its best cut follows: speed [rpm], limit depth with what is not known as NaN [mm], and
#: what is removed for each mm of depth [cm3/min].
SPEED, KNOWN, RATE = "speed", "known", "rate_of_a_mm"
#: Largest margins that a page offers, and the steps between them [%].
FARTHEST_DEPTH, FARTHEST_SPEED, STEP = 60.0, 20.0, 0.5
WIDTH = 220
#: What ``safe_depth`` and the largest rate are in Python, for the line that is shown.
FIND = """
const {[names[0]]: speed, [names[1]]: known, [names[2]]: rate} = line.data
const near = 0.01 * of_speed.value, last = speed.length - 1
// Between two speeds the boundary runs straight.
const between = (a, at) => known[a] + (at - speed[a]) / (speed[a + 1] - speed[a]) * (known[a + 1] - known[a])
let found = {speed: NaN, depth: NaN, rate: -Infinity}
for (let i = 0; i <= last; i++) {
  const low = speed[i] * (1 - near), high = speed[i] * (1 + near)
  if (low < speed[0] || high > speed[last]) continue
  let least = known[i], first = i, end = i
  // Math.min of anything and NaN is NaN: near what is not known nothing is recommended.
  while (first > 0 && speed[first - 1] >= low - 1e-9 * speed[i]) least = Math.min(least, known[--first])
  while (end < last && speed[end + 1] <= high + 1e-9 * speed[i]) least = Math.min(least, known[++end])
  if (speed[first] > low + 1e-9 * low) least = Math.min(least, between(first - 1, low))
  if (speed[end] < high - 1e-9 * high) least = Math.min(least, between(end, high))
  const depth = (1 - 0.01 * of_depth.value) * least
  if (rate[i] * depth > found.rate) found = {speed: speed[i], depth, rate: rate[i] * depth}
}
best.data = Object.fromEntries(Object.entries(found).map(([name, value]) => [name, [value]]))
"""


def add_best_cut(made: figure, line: ColumnDataSource, margins: Margins) -> tuple[Any, dict[str, Model]]:
    """Mark the best cut of the line that a source shows, at first with these margins; return mark and sliders."""
    best = ColumnDataSource(_found(line, margins))
    marker = made.scatter("speed", "depth", source=best, marker="star", size=18, color="#E69F00")
    rows = [
        ("largest removal rate", "@rate{0.0} cm\N{SUPERSCRIPT THREE}/min"),
        ("spindle speed", "@speed{0} rpm"),
        ("axial depth", "@depth{0.000} mm"),
    ]
    made.add_tools(hover([marker], rows))
    sliders = {
        "of_depth": _slider("margin in depth, %", margins.depth, FARTHEST_DEPTH),
        "of_speed": _slider("margin in speed, %", margins.speed, FARTHEST_SPEED),
    }
    find = CustomJS(args={"line": line, "best": best, "names": [SPEED, KNOWN, RATE], **sliders}, code=FIND)
    line.js_on_change("data", find)
    for slider in sliders.values():
        slider.js_on_change("value", find)
    return marker, sliders


def _found(line: ColumnDataSource, margins: Margins) -> dict[str, list[float]]:
    """Return the best cut of a line; NaN where none is safe."""
    speed, known, rate = (np.asarray(line.data[name], dtype=float) for name in (SPEED, KNOWN, RATE))
    depth = safe_depth(known, speed, margins)
    removed = np.nan_to_num(rate * depth, nan=-np.inf)
    best = int(removed.argmax())
    place = [speed[best], depth[best], removed[best]] if np.isfinite(removed[best]) else [np.nan] * 3
    return dict(zip(("speed", "depth", "rate"), ([float(one)] for one in place), strict=True))


def _slider(title: str, value: float, most: float) -> Slider:
    options = {"start": 0.0, "end": max(most, value), "step": STEP, "value": value}
    return Slider(title=title, width=WIDTH, stylesheets=[WIDGET_STYLE], **options)
