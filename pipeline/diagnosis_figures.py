"""Figures of a diagnosis: the ranking, and what could have been seen."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullLocator, StrMethodFormatter

from chatter_core.evidence.power import ENOUGH
from chatter_core.evidence.ranking import NOTHING
from pipeline import comparison_figures, corrections
from pipeline.diagnosis import Diagnosis
from pipeline.figures import COLOURS

#: An axis of what could have been seen reaches as far at least [nats].
LEAST_REACH = 200.0
#: Pairs that are drawn below single effects, those that lead.
PAIRS_DRAWN = 3
#: Share of a row that the bars of quantities fill, and that of them together behind these.
WITHIN, TOGETHER = 0.6, 0.84
#: Marks on axes of evidence, as far as an axis reaches [nats]: they are apart, near zero as well as far from it.
MARKS = (-10.0, -5.0, 0.0, 5.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 10_000.0)


def write(found: Diagnosis, folder: Path) -> list[Path]:
    """Write every figure and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in {"ranking": ranking, "power": power}.items():
        path = folder / f"{name}.png"
        draw(found).savefig(path, dpi=150)
        paths.append(path)
    if found.corrections is not None and found.corrections.found:
        paths.append(folder / "corrections.png")
        corrections.figure(found.corrections).savefig(paths[-1], dpi=150)
    if found.before_and_after is not None:
        paths += comparison_figures.write(found.before_and_after, folder)
    return paths


def ranking(found: Diagnosis) -> Figure:
    """Draw the probability and the evidence of every effect, and the evidence of the pairs that lead."""
    shown = [*found.ranking, *found.pairs[:PAIRS_DRAWN]]
    names = [one.name.replace("_", " ") if one.name != NOTHING else "nothing missing" for one in shown]
    figure = Figure(figsize=(10.0, 1.4 + 0.32 * len(shown)), layout="constrained")
    figure.suptitle("What is missing", fontweight="bold", x=0.01, ha="left")
    left, right = figure.subplots(1, 2, sharey=True)
    rows = np.arange(len(shown))[::-1]
    named = {*found.verdict.missing, found.supported.name}
    colours = [COLOURS[1] if one.name in named else COLOURS[0] for one in shown]
    left.barh(rows[: len(found.ranking)], [one.probability for one in found.ranking], color=colours)
    for row in rows[len(found.ranking) :]:
        left.text(0.01, row, "a pair, by its evidence alone", va="center", fontsize="small", color="0.4")
    left.set_yticks(rows, names)
    left.set_xlim(0.0, 1.0)
    left.set_xlabel("probability")
    gains = np.array([one.gain for one in shown])
    right.barh(rows, gains, color=colours)
    right.axvline(0.0, color="black", linewidth=0.8)
    _scale_by_nats(right)
    # What is no evidence looks like none; what is any says how much, for on such an axis lengths say little.
    right.set_xlim(-1.5 * ENOUGH, max(float(gains.max()) * 1.3, 3.0 * ENOUGH))
    right.set_ylim(-0.7, len(rows) - 0.3)
    for row, one in zip(rows, shown, strict=True):
        right.text(1.02, row, one.told_gain, transform=right.get_yaxis_transform(), va="center", fontsize="small")
    right.set_xlabel("evidence over that of the base model [nats]")
    for axes in (left, right):
        axes.grid(alpha=0.3, axis="x")
    return figure


def power(found: Diagnosis) -> Figure:
    """Draw what each effect of usual size would have left in the campaign, by kind of measurement."""
    powers = found.powers[::-1]
    quantities = sorted({name for one in powers for name in one.by_quantity})
    figure = Figure(figsize=(10.0, 1.6 + 0.36 * len(powers)), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(powers))
    together = np.array([max(one.nats, 0.0) for one in powers])
    axes.barh(rows, together, height=TOGETHER, color="0.85", label="together")
    # On such an axis a bar shows what it is worth only where it begins at nothing, so they do not stand on each other.
    height, reach = WITHIN / max(len(quantities), 1), float(together.max(initial=LEAST_REACH))
    for number, (colour, quantity) in enumerate(zip(COLOURS, quantities, strict=False)):
        place = rows + 0.5 * WITHIN - (number + 0.5) * height
        share = [max(one.by_quantity.get(quantity, 0.0), 0.0) for one in powers]
        axes.barh(place, share, height=height, color=colour, label=quantity.replace("_", " "))
        # One may be more than all together: others may speak against the effect.
        reach = max(reach, *share)
    axes.axvline(ENOUGH, color="black", linestyle="--", linewidth=1.0)
    axes.set_yticks(rows, [str(one.candidate).replace("_", " ") for one in powers], fontsize="small")
    axes.set_ylim(-0.7, len(rows) - 0.3)
    _scale_by_nats(axes)
    axes.set_xlim(0.0, 1.3 * reach)
    axes.set_xlabel("log-likelihood that nothing else could make up for [nats]; dashed: needed to be seen")
    axes.set_title("What these measurements could have shown", loc="left", fontweight="bold")
    axes.legend(frameon=False, loc="lower right")
    axes.grid(alpha=0.3, axis="x")
    return figure


def _scale_by_nats(axes: Axes) -> None:
    """Make an axis straight up to what is ENOUGH to both sides and logarithmic beyond."""
    axes.set_xscale("symlog", linthresh=ENOUGH)
    axes.xaxis.set_major_locator(FixedLocator(MARKS))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())
