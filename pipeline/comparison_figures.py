"""Figures of a comparison: lobes with the trials on them, receptances, residuals and pulls."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from chatter_core.evidence.assessment import WIDTHS, Assessment, Version
from chatter_core.evidence.boundary import Field
from chatter_core.evidence.likelihood import frequency_residual
from chatter_core.evidence.measured import OUTCOMES, Trials
from chatter_core.evidence.scores import COVERAGE
from chatter_core.machine import Machine
from chatter_core.units import si_factor
from pipeline.figures import COLOURS

RPM, MILLIMETRE, HERTZ = si_factor("x_rpm"), si_factor("x_mm"), si_factor("x_hz")
DESCRIBED, CALIBRATED, WRONG, RIGHT, MEASURED = "#888888", COLOURS[0], COLOURS[1], COLOURS[2], "0.55"
#: Marks of the outcomes.
MARKS = {"stable": "o", "marginal": "d", "chatter": "X"}
#: Folder of the figures, and those that there may be.
FOLDER, NAMES = "figures", ("lobes", "receptances", "residuals", "pulls")
#: Decades of a receptance below its largest that are shown.
DECADES = 2.5
#: Entries of the legend that belong to lobes alone.
_BOUNDARIES = ("boundary as described", "calibrated", f"{100 * COVERAGE:.0f} % band")
#: Panels in a row.
COLUMNS = 2
UNIT = "\N{MICRO SIGN}m/N"


def write(found: Assessment, folder: Path) -> list[Path]:
    """Write every figure for which something was measured, and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    campaign = found.comparison.model.campaign
    wanted: dict[str, Callable[[Assessment], Figure]] = {}
    if found.refitted.fields:
        wanted["lobes"] = lobes
    if campaign.receptances:
        wanted["receptances"] = receptances
    if campaign.trials is not None:
        wanted["residuals"] = residuals
    wanted["pulls"] = pulls
    paths = []
    for name, draw in wanted.items():
        path = folder / f"{name}.png"
        draw(found).savefig(path, dpi=150)
        paths.append(path)
    return paths


def lobes(found: Assessment) -> Figure:
    """Draw the boundary and the trials, as described above and calibrated below, for each setup of the cuts."""
    pairs = list(zip(found.described.fields, found.refitted.fields, strict=True))
    figure = Figure(figsize=(10.0, 7.6 * len(pairs)), layout="constrained")
    panels = figure.subplots(2 * len(pairs), 1, squeeze=False)[:, 0]
    for number, fields in enumerate(pairs):
        above, below = panels[2 * number : 2 * number + 2]
        for axes, version, field in ((above, found.described, fields[0]), (below, found.refitted, fields[1])):
            _boundary(axes, field, version is found.refitted)
            trials = found.comparison.model.campaign.trials
            if trials is not None:
                _trials(axes, trials, version, field)
            _limits(axes, found, field)
            axes.set_title(_setup(field.machine), loc="right", fontsize="small")
            axes.set_ylabel("axial depth [mm]")
        above.set_title("Model as described", loc="left", fontweight="bold")
        below.set_title("Calibrated", loc="left", fontweight="bold")
        below.set_xlabel("spindle speed [rpm]")
    figure.legend(handles=_key(found), loc="outside lower center", ncols=4, frameon=False)
    return figure


def _boundary(axes: Axes, field: Field, calibrated: bool) -> None:
    """Draw a boundary, and the band in which the calibrated one lies."""
    place = (field.spindle_speed / RPM, field.axial_depth / MILLIMETRE)
    colour = CALIBRATED if calibrated else DESCRIBED
    if calibrated:
        with np.errstate(divide="ignore", invalid="ignore"):
            standard = (field.growth / field.deviation).T
        axes.contourf(*place, standard, levels=[-WIDTHS, WIDTHS], colors=[colour], alpha=0.18)
    axes.contour(*place, field.growth.T, levels=[0.0], colors=colour, linewidths=1.6)


def _trials(axes: Axes, trials: Trials, version: Version, field: Field) -> None:
    """Draw the trials of a setup, coloured by whether the model tells them right."""
    for code, name in enumerate(OUTCOMES):
        for colour, told in ((RIGHT, True), (WRONG, False)):
            some = field.trials[(trials.outcome[field.trials] == code)]
            some = some[_told_right(trials, version)[some] == told]
            axes.plot(
                trials.spindle_speed[some] / RPM,
                trials.axial_depth[some] / MILLIMETRE,
                MARKS[name],
                color=colour,
                markersize=7.0 if name == "chatter" else 5.5,
                markerfacecolor=colour if name == "chatter" else "white",
                markeredgecolor=colour if name != "chatter" else "white",
                markeredgewidth=0.6 if name == "chatter" else 1.4,
            )


def _told_right(trials: Trials, version: Version) -> np.ndarray:
    """Return whether each trial (trial,) is told right; a marginal one is neither."""
    chatters = version.told.margin > 0.0
    stable, chatter = (trials.outcome == OUTCOMES.index(name) for name in ("stable", "chatter"))
    return np.asarray(np.where(stable, ~chatters, np.where(chatter, chatters, True)))


def _limits(axes: Axes, found: Assessment, field: Field) -> None:
    limits = found.comparison.model.campaign.limits
    if limits is not None and any(field is one.fields[0] for one in (found.described, found.refitted)):
        axes.errorbar(
            limits.spindle_speed / RPM,
            limits.limit_depth / MILLIMETRE,
            limits.uncertainty / MILLIMETRE,
            fmt="s",
            color="black",
            markersize=3.5,
            linewidth=1.0,
        )


def _setup(machine: Machine) -> str:
    """Return how cuts were set up, in words."""
    process, spindle = machine.process, machine.spindle
    preload = f", preload {spindle.preload:.0f} N" if spindle is not None else ""
    feed = process.feed_per_tooth / MILLIMETRE
    return f"{process.direction} milling, a/D {process.radial_immersion:g}, {feed:g} mm a tooth{preload}"


def _key(found: Assessment) -> list[Line2D | Patch]:
    """Return the entries of the legend."""
    entries: list[Line2D | Patch] = [
        Line2D([], [], color=DESCRIBED, label=_BOUNDARIES[0]),
        Line2D([], [], color=CALIBRATED, label=_BOUNDARIES[1]),
        Patch(color=CALIBRATED, alpha=0.18, label=_BOUNDARIES[2]),
    ]
    if found.comparison.model.campaign.trials is not None:
        entries += [
            Line2D([], [], linestyle="", marker=mark, color="black", label=name, markerfacecolor="none")
            for name, mark in MARKS.items()
        ]
        entries += [Patch(color=RIGHT, label="told right"), Patch(color=WRONG, label="told wrongly")]
    return entries


def receptances(found: Assessment) -> Figure:
    """Draw the magnitude of every receptance, measured and predicted."""
    measured = found.comparison.model.campaign.receptances
    rows = -(-len(measured) // COLUMNS)
    figure = Figure(figsize=(11.0, 2.9 * rows + 0.6), layout="constrained")
    figure.suptitle("Receptance of the tool tip", fontweight="bold", x=0.01, ha="left")
    panels = figure.subplots(rows, COLUMNS, squeeze=False)
    for axes in panels.flat[len(measured) :]:
        axes.set_visible(False)
    versions = ((found.described, DESCRIBED, "--", "as described"), (found.refitted, CALIBRATED, "-", "calibrated"))
    for number, (axes, one) in enumerate(zip(panels.flat, measured, strict=False)):
        hertz, size = one.frequency / HERTZ, np.abs(one.value) / si_factor("x_um")
        axes.semilogy(hertz, size, ".", color=MEASURED, markersize=2.5, label="measured")
        for version, colour, line, label in versions:
            predicted = np.abs(version.compared.prediction.receptances[number]) / si_factor("x_um")
            axes.semilogy(hertz, predicted, line, color=colour, linewidth=1.2, label=label)
        axes.set_ylim(size.max() / 10.0**DECADES, size.max() * 2.0)
        if len(hertz) > 1:
            axes.set_xlim(hertz[0], hertz[-1])
        axes.set_title(str(one), loc="right", fontsize="small")
        axes.set_ylabel(f"magnitude [{UNIT}]")
        axes.set_xlabel("frequency [Hz]")
        axes.grid(alpha=0.3)
    handles, labels = panels.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def residuals(found: Assessment) -> Figure:
    """Draw margins and chatter frequencies of the calibrated model over speed, depth, and order of the trials."""
    trials = found.comparison.model.campaign.trials
    assert trials is not None
    figure = Figure(figsize=(11.0, 6.5), layout="constrained")
    figure.suptitle("What is left after calibration", fontweight="bold", x=0.01, ha="left")
    panels = figure.subplots(2, 3, sharey="row")
    places = (
        ("spindle speed [rpm]", trials.spindle_speed / RPM),
        ("axial depth [mm]", trials.axial_depth / MILLIMETRE),
        ("trial", trials.trial.astype(float)),
    )
    apart = _frequency_residuals(found, trials)
    for column, (label, place) in enumerate(places):
        _margins(panels[0, column], place, trials, found.refitted)
        panels[1, column].plot(place, apart, ".", color=CALIBRATED, markersize=7)
        panels[1, column].axhline(0.0, color="black", linewidth=0.8)
        for axes in panels[:, column]:
            axes.set_xlabel(label)
            axes.grid(alpha=0.3)
    panels[0, 0].set_ylabel("ln(depth / limit depth)\nas predicted; above 0: chatter")
    panels[1, 0].set_ylabel("chatter frequency,\nmeasured - predicted [Hz]")
    handles = [entry for entry in _key(found) if entry.get_label() not in _BOUNDARIES]
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
    return figure


def _margins(axes: Axes, place: np.ndarray, trials: Trials, version: Version) -> None:
    right = _told_right(trials, version)
    for code, name in enumerate(OUTCOMES):
        for colour, told in ((RIGHT, True), (WRONG, False)):
            some = (trials.outcome == code) & (right == told)
            axes.plot(
                place[some],
                version.told.margin[some],
                MARKS[name],
                color=colour,
                markersize=6,
                markerfacecolor=colour if name == "chatter" else "white",
            )
    axes.axhline(0.0, color="black", linewidth=0.8)


def _frequency_residuals(found: Assessment, trials: Trials) -> np.ndarray:
    """Return measured minus predicted chatter frequency (trial,) [Hz], NaN where none was measured."""
    tooth_passing = found.comparison.model.campaign.machine.tool.teeth * trials.spindle_speed
    apart = frequency_residual(trials.chatter_frequency, found.refitted.told.chatter_frequency, tooth_passing)
    return np.where(np.isfinite(trials.chatter_frequency), apart, np.nan) / HERTZ


def pulls(found: Assessment) -> Figure:
    """Draw how far each parameter had to be moved, in widths of what is plausible, with its interval."""
    fit = found.refitted.fit
    height = 1.2 + 0.26 * len(fit.parameters)
    figure = Figure(figsize=(8.0, height), layout="constrained")
    axes = figure.subplots()
    rows = np.arange(len(fit.parameters))[::-1]
    for limit, colour in ((3.0, "0.95"), (1.0, "0.88")):
        axes.axvspan(-limit, limit, color=colour, zorder=0)
    for row, parameter, pull in zip(rows, fit.parameters, fit.pull, strict=True):
        limits = found.intervals[parameter.name]
        ends = [(end - parameter.prior_mean) / parameter.prior_width for end in (limits.low, limits.high)]
        colour = WRONG if abs(pull) > 3.0 else CALIBRATED
        axes.plot(ends, [row, row], color=colour, linewidth=1.6)
        axes.plot([pull], [row], "o", color=colour, markersize=5)
    axes.set_yticks(rows, [parameter.name.replace("_", " ") for parameter in fit.parameters], fontsize="small")
    axes.set_ylim(-0.8, len(rows) - 0.2)
    axes.set_xlabel("pull: fitted value in widths of what is plausible before measuring (grey: 1 and 3)")
    axes.set_title("How far the calibration moved each parameter", loc="left", fontweight="bold")
    axes.grid(alpha=0.3, axis="x")
    return figure
