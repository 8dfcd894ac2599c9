"""Corrections without a formula: fitted where a diagnosis explains nothing, as data and as a figure."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullFormatter

from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.corrections import (
    Told,
    checks_failed,
    corrections_of,
    fit_correction,
    measured_places,
    mending,
    told,
)
from chatter_core.evidence.pursuit import refit
from chatter_core.units import si_factor, split_key
from pipeline.cluster import Workers
from pipeline.comparison_document import fit_data
from pipeline.figures import COLOURS
from pipeline.jobs import Job, spread
from pipeline.telling import plain

#: Panels in a row; colour of what the measurements do not ask for.
COLUMNS, NOT_WANTED = 2, "0.6"
#: The axis of factors reaches this far to both sides at least.
LEAST_REACH = 1.25
#: Intervals along the axis of places, at most.
MOST_TICKS = 6


@dataclass(frozen=True, kw_only=True)
class Corrections:
    """Every correction that a campaign can tell of, the most probable first, and in words what they mend."""

    campaign: Campaign
    found: tuple[Told, ...]
    text: str


def correct(workers: Workers | None, base: Hypothesis) -> Corrections:
    """Fit every correction to what a base model leaves."""
    model = base.comparison.model
    offered = corrections_of(model, base.fit.estimate)
    fits = spread(workers, [Job(name=str(one), call=partial(fit_correction, base, one)) for one in offered])
    # The base model gets the same chance to arrive as what is held against it.
    for one in sorted(fits, key=lambda one: -float(one.log_evidence))[:1]:
        base = refit(base, one.fit)
    failed = len(checks_failed(base.comparison, base.fit))
    found = sorted((told(base.fit, failed, one) for one in fits), key=lambda one: -one.gain)
    return Corrections(campaign=model.campaign, found=tuple(found), text=mending(found))


def data(corrections: Corrections | None) -> list[dict[str, Any]]:
    """Return corrections as plain data; none where none were asked for."""
    return [_data(one) for one in corrections.found] if corrections is not None else []


def _data(one: Told) -> dict[str, Any]:
    correction = one.corrected.correction
    return {
        "quantity": correction.quantity.name,
        "against": correction.axis.name,
        "unit": _unit(correction.axis.name) or "1",
        "evidence_nats": float(one.gain),
        "wanted": one.wanted,
        "checks_left": len(one.corrected.left),
        "fit": fit_data(one.corrected.fit),
        "places": one.places.tolist(),
        "level_without": one.level,
        "factor": plain(one.factor),
        "low": plain(one.low),
        "high": plain(one.high),
        "text": one.text,
    }


def figure(corrections: Corrections) -> Figure:
    """Draw every correction: the factor with its band over the measured range, 1, and what calibration alone has."""
    found = corrections.found
    rows = -(-len(found) // COLUMNS)
    drawn = Figure(figsize=(10.0, 0.9 + 2.9 * rows), layout="constrained")
    drawn.suptitle("What the measurements want to change", fontweight="bold", x=0.01, ha="left")
    panels = drawn.subplots(rows, COLUMNS, squeeze=False).ravel()
    for axes, one in zip(panels, found, strict=False):
        _panel(axes, one, corrections.campaign)
    for axes in panels[len(found) :]:
        axes.set_visible(False)
    return drawn


def _panel(axes: Axes, one: Told, campaign: Campaign) -> None:
    """Draw one correction, grey where it is not wanted."""
    correction = one.corrected.correction
    colour = COLOURS[0] if one.wanted else NOT_WANTED
    if one.corrected.climbed:
        axes.fill_between(one.places, one.low, one.high, color=colour, alpha=0.25, linewidth=0.0)
        axes.plot(one.places, one.factor, color=colour, linewidth=1.8)
    else:
        axes.text(0.5, 0.85, "not fitted: hopeless", transform=axes.transAxes, ha="center", color=colour)
    axes.axhline(1.0, color="black", linewidth=0.8)
    axes.axhline(one.level, color="black", linewidth=0.8, linestyle="--")
    unit = si_factor(correction.axis.name)
    measured = np.unique(measured_places(campaign, correction.quantity, correction.axis)) / unit
    axes.plot(
        measured, np.zeros(len(measured)), "|", color="black", transform=axes.get_xaxis_transform(), clip_on=False
    )
    axes.set_yscale("log")
    # What was not climbed has no band: these minima and maxima leave NaN out.
    lowest, highest = np.fmin(1.0 / LEAST_REACH, 0.95 * one.low.min()), np.fmax(LEAST_REACH, 1.05 * one.high.max())
    axes.set_ylim(float(lowest), float(highest))
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 1.25, 1.5, 2.0, 3.0, 5.0, 8.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.3g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title(correction.quantity.words, loc="left", fontweight="bold" if one.wanted else "normal")
    axes.set_title(f"{one.gain:+.1f} nats{'' if one.wanted else ', not wanted'}", loc="right", fontsize="small")
    axes.set_ylabel("factor")
    axes.xaxis.set_major_locator(MaxNLocator(MOST_TICKS))
    label = _unit(correction.axis.name)
    axes.set_xlabel(correction.axis.words + (f" [{label}]" if label else ""))
    axes.grid(alpha=0.3)


def _unit(axis: str) -> str:
    return split_key(axis)[1]
