"""The errors of a model, version by version."""

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chatter_core.evidence.scores import ERRORS
from pipeline.comparison_page import NAMES, PER_CENT
from pipeline.figures import COLOURS

#: Quantities that are drawn, as far as they were measured: all whose errors have a meaning by themselves.
SHOWN = tuple(name for name in ERRORS if name != "log_loss")
#: Panels in a row.
COLUMNS = 3
#: On which data an error is: columns of the table, colour, words, mark and its size, width of the line. Both are seen
#: where they are alike.
KINDS = (
    ("in_sample", COLOURS[0], "on the data of the fit", "s-", 9.0, 3.0),
    ("held_out", COLOURS[1], "on data held out", "o-", 5.0, 1.2),
)


def history(table: pd.DataFrame) -> Figure:
    """Draw the errors of every version of the model, on the data that it was fitted to and on those held out."""
    shown = [name for name in SHOWN if f"{name}_in_sample" in table]
    rows = -(-len(shown) // COLUMNS)
    columns = -(-len(shown) // rows)
    figure = Figure(figsize=(11.0, 3.6 * rows + 0.8), layout="constrained")
    figure.suptitle("Error of each version of the model", fontweight="bold", x=0.01, ha="left")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, name in zip(panels, shown, strict=False):
        _errors(axes, table, name)
    for axes in panels[len(shown) :]:
        axes.set_visible(False)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(KINDS), frameon=False)
    return figure


def _errors(axes: Axes, table: pd.DataFrame, name: str) -> None:
    factor, unit = (100.0, "%") if name in PER_CENT else (1.0, "Hz")
    for kind, colour, words, mark, size, width in KINDS:
        if f"{name}_{kind}" in table:
            error = factor * table[f"{name}_{kind}"]
            axes.plot(table["step"], error, mark, color=colour, label=words, markersize=size, linewidth=width)
    labels = [text.replace("_", " ").replace(" + ", "\n+ ") for text in table["effect"]]
    axes.set_xticks(table["step"], labels, rotation=25, ha="right", rotation_mode="anchor", fontsize="small")
    axes.set_xlim(-0.3, len(table) - 0.7)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(f"{NAMES[name]} [{unit}]")
    axes.grid(alpha=0.3)
