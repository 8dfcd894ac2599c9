"""Plots that a page answers with: hover, zoom, and choices that change what is shown. Everything stands in the page.

A plot shows what belongs to one combination of choices. Its data for all combinations lie beside it in the page, and
a script there exchanges them.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.embed import components
from bokeh.models import ColumnDataSource, CustomJS, HoverTool, Legend, Model, Select
from bokeh.plotting import figure
from bokeh.resources import Resources

#: What stands between the parts of a key where the page knows it.
BETWEEN = "|"
#: Parts of the plot library that pages need.
PARTS = ["bokeh", "bokeh-widgets"]
HEIGHT = 380
#: Width of a choice, and of one that reads as a sentence.
SELECT_WIDTH, WIDE = 220, 460
#: No wider than a phone's page.
ON_PHONES = {"max-width": "calc(100vw - 3rem)"}
#: Names of lines side by side in a key, and characters of them with their marks, as many as fit on a phone.
ABREAST, ACROSS, OF_A_MARK = 4, 52, 4
TOOLS = "pan,wheel_zoom,box_zoom,reset,save"
#: Widgets live in shadows of their own; the page's colours reach in there as properties.
WIDGET_STYLE = (
    ":host { color: var(--ink); } "
    ".bk-input, select.bk-input { color: var(--ink); background-color: var(--page); border-color: var(--line); }"
)
#: Exchanges what every plot shows for what belongs to the choices.
EXCHANGE = """
const key = choices.map((choice) => choice.value).join(between)
shown.forEach((source, i) => {
  const data = {...source.data}
  for (const [name, values] of Object.entries(all[i][key])) data[name] = values
  source.data = data
})
"""

#: Values of the choices, in their order.
Key = tuple[str, ...]
Columns = Mapping[str, Any]


class Choices:
    """Choices of a page, and the sources that follow them."""

    def __init__(
        self, titles: Mapping[str, Mapping[str, str]], first: Mapping[str, str], width: int = SELECT_WIDTH
    ) -> None:
        """Make a choice for each title: value -> how it reads; first: which value is shown first."""
        self.first: Key = tuple(first[title] for title in titles)
        self.selects = [
            Select(
                title=title,
                value=first[title],
                options=list(options.items()),
                stylesheets=[WIDGET_STYLE],
                width=width,
                styles=ON_PHONES,
                visible=len(options) > 1,
            )
            for title, options in titles.items()
        ]
        self.shown: list[ColumnDataSource] = []
        self.all: list[dict[str, dict[str, Any]]] = []

    def source(self, data: Mapping[Key, Columns], common: Columns) -> ColumnDataSource:
        """Return a source that shows the columns of the first choice, and of another once that is made.

        data: by key, the same columns for each; common: columns that are the same for all.
        """
        shown = ColumnDataSource({**common, **data[self.first]})
        self.shown.append(shown)
        self.all.append({BETWEEN.join(key): dict(columns) for key, columns in data.items()})
        return shown

    def named(self, of: str) -> dict[str, Model]:
        """Return the choices that there are to make, by names that say of what."""
        return {f"{of}_{select.title}": select for select in self.selects if select.visible}

    def bind(self) -> None:
        """Let the choices change what is shown, once all sources are made."""
        exchange = CustomJS(
            args={"choices": self.selects, "shown": self.shown, "all": self.all, "between": BETWEEN}, code=EXCHANGE
        )
        for select in self.selects:
            select.js_on_change("value", exchange)


@dataclass(frozen=True, kw_only=True)
class Embedded:
    """Plots as a page holds them: the library's script, the data's, and a place for each plot by its name."""

    library: str
    script: str
    places: dict[str, str]


def embed(models: Mapping[str, Model]) -> Embedded:
    """Return plots and choices, by name, as a page holds them."""
    script, places = components(dict(models), wrap_script=True)
    library = Resources(mode="inline", components=PARTS).render_js()
    return Embedded(library=library, script=script, places=places)


def plot(title: str, x: str, y: str, height: int = HEIGHT, **options: Any) -> figure:
    """Return an empty plot with labels at its axes; colours of text and lines are the page's."""
    made = figure(
        title=title,
        height=height,
        sizing_mode="stretch_width",
        tools=TOOLS,
        active_drag="box_zoom",
        active_scroll=None,
        x_axis_label=x,
        y_axis_label=y,
        background_fill_color=None,
        border_fill_color=None,
        outline_line_color=None,
        **options,
    )
    made.toolbar.logo = None
    made.toolbar.autohide = True
    return made


def hover(renderers: Sequence[Any], rows: Sequence[tuple[str, str]]) -> HoverTool:
    """Return what is told beside the pointer: rows of a title and a column."""
    printed = {column: "printf" for _, told in rows for column in re.findall(r"(@\w+)\{%", told)}
    return HoverTool(renderers=list(renderers), tooltips=list(rows), formatters=printed)


def add_key(made: figure, entries: Mapping[str, Sequence[Any]]) -> None:
    """Add a key that lies flat above a plot, of renderers by name; a click on a name hides or shows its own."""
    key = Legend(items=[(name, list(renderers)) for name, renderers in entries.items()])
    key.orientation, key.location, key.margin, key.padding = "horizontal", "left", 0, 0
    key.ncols = max(1, min(ABREAST, ACROSS // (max(map(len, entries)) + OF_A_MARK)))
    key.click_policy = "hide"
    key.background_fill_alpha, key.border_line_alpha = 0.0, 0.0
    made.add_layout(key, "above")


def numbers(values: Any) -> np.ndarray:
    """Return values with as many digits as a plot can show, which halves a page."""
    return np.asarray(values, dtype=np.float32)
