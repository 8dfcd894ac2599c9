"""The falling error, version by version of a model."""

import pandas as pd
from matplotlib.figure import Figure

from pipeline.figures import COLOURS

#: Quantities that are drawn: column, label, factor.
SHOWN = (
    ("outcome", "cuts told wrongly, balanced [%]", 100.0),
    ("chatter_frequency", "chatter frequency, median error [Hz]", 1.0),
    ("receptance", "receptance, relative error [%]", 100.0),
)


def history(table: pd.DataFrame) -> Figure:
    """Draw the errors of every version of the model, on the data that it was fitted to and on cuts held out."""
    shown = [one for one in SHOWN if f"{one[0]}_in_sample" in table]
    figure = Figure(figsize=(4.2 * max(len(shown), 1) + 1.0, 4.2), layout="constrained")
    figure.suptitle("The falling error", fontweight="bold", x=0.01, ha="left")
    panels = figure.subplots(1, max(len(shown), 1), squeeze=False)[0]
    for axes, (name, label, factor) in zip(panels, shown, strict=False):
        for colour, kind, words in ((COLOURS[0], "in_sample", "in sample"), (COLOURS[1], "held_out", "held out")):
            if f"{name}_{kind}" in table:
                values = factor * table[f"{name}_{kind}"]
                axes.plot(table["step"], values, "o-", color=colour, label=words)
        axes.set_xticks(table["step"], [text.replace("_", " ").replace(" + ", "\n+ ") for text in table["effect"]])
        axes.tick_params(axis="x", labelrotation=20)
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
    panels[0].legend(frameon=False)
    return figure
