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
from chatter_core.evidence.likelihood import frequency_residual, line_errors
from chatter_core.evidence.measured import OUTCOMES, Receptance, Trials, measuring_ranges
from chatter_core.evidence.scores import COVERAGE
from chatter_core.machine import Machine
from chatter_core.units import si_factor
from pipeline.figures import COLOURS

RPM, MILLIMETRE, HERTZ = si_factor("x_rpm"), si_factor("x_mm"), si_factor("x_hz")
DESCRIBED, CALIBRATED, WRONG, RIGHT, MEASURED = "#888888", COLOURS[0], COLOURS[1], COLOURS[2], "0.55"
#: Of a marginal cut, which is told neither right nor wrongly.
NEITHER = "#555555"
#: Marks of the outcomes.
MARKS = {"stable": "o", "marginal": "d", "chatter": "X"}
#: Folder of the figures, and those that there may be.
FOLDER, NAMES = "figures", ("lobes", "receptances", "residuals", "pulls")
#: Decades of a receptance below its largest that are shown.
DECADES = 2.5
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
    """Draw the boundary and the trials by both versions of a model, one above the other, for each setup of the cuts."""
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
            axes.set_title(setup_text(field.machine), loc="right", fontsize="small")
            axes.set_ylabel("axial depth [mm]")
        above.set_title(found.described.title, loc="left", fontweight="bold")
        below.set_title(found.refitted.title, loc="left", fontweight="bold")
        below.set_xlabel("spindle speed [rpm]")
    figure.legend(
        handles=[*_boundary_key(found), *_trial_key(found), *_limit_key(found)],
        loc="outside lower center",
        ncols=3,
        frameon=False,
    )
    return figure


def _boundary(axes: Axes, field: Field, calibrated: bool) -> None:
    """Draw a boundary, and the band in which the calibrated one lies."""
    place = (field.spindle_speed / RPM, field.axial_depth / MILLIMETRE)
    colour = CALIBRATED if calibrated else DESCRIBED
    if calibrated:
        with np.errstate(divide="ignore", invalid="ignore"):
            standard = (field.growth / field.deviation).T
        axes.contourf(*place, standard, levels=[-WIDTHS, WIDTHS], colors=[colour], alpha=0.18)
    axes.set(xlim=(place[0][0], place[0][-1]), ylim=(0.0, place[1][-1]))
    if (field.growth < 0.0).all():
        axes.text(
            0.98, 0.94, "stable at every depth shown", transform=axes.transAxes, ha="right", va="top", color=colour
        )
        return
    axes.contour(*place, field.growth.T, levels=[0.0], colors=colour, linewidths=1.6)


def _trials(axes: Axes, trials: Trials, version: Version, field: Field) -> None:
    """Draw the trials of a setup, coloured by whether the model tells them right."""
    colours = trial_colours(trials, version.told.margin)
    for code, name in enumerate(OUTCOMES):
        for colour in (RIGHT, WRONG, NEITHER):
            some = field.trials[(trials.outcome == code)[field.trials] & (colours == colour)[field.trials]]
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


def trial_colours(trials: Trials, margin: np.ndarray) -> np.ndarray:
    """Return the colour of each trial (trial,): told right, wrongly as without an answer, or marginal and neither."""
    stable, chatter = (trials.outcome == OUTCOMES.index(name) for name in ("stable", "chatter"))
    right = np.where(stable, margin <= 0.0, margin > 0.0)
    return np.where(stable | chatter, np.where(right, RIGHT, WRONG), NEITHER)


def _limits(axes: Axes, found: Assessment, field: Field) -> None:
    measured = found.comparison.model.campaign.limits
    if measured is not None and len(field.limits):
        limits = measured.at(field.limits)
        axes.errorbar(
            limits.spindle_speed / RPM,
            limits.limit_depth / MILLIMETRE,
            limits.uncertainty / MILLIMETRE,
            fmt="s",
            color="black",
            markersize=3.5,
            linewidth=1.0,
        )


def setup_text(machine: Machine) -> str:
    """Return how cuts were set up, in words."""
    process, spindle = machine.process, machine.spindle
    preload = f", preload {spindle.preload:.0f} N" if spindle is not None else ""
    feed = process.feed_per_tooth / MILLIMETRE
    return f"{process.direction} milling, a/D {process.radial_immersion:g}, {feed:g} mm a tooth{preload}"


def _boundary_key(found: Assessment) -> list[Line2D | Patch]:
    """Return the entries of the legend for boundaries."""
    lines = [Line2D([], [], color=colour, label=f"boundary, {name}") for _, colour, _, name in _versions(found)]
    return [*lines, Patch(color=CALIBRATED, alpha=0.18, label=f"{100 * COVERAGE:.0f} % band of it")]


def _trial_key(found: Assessment) -> list[Line2D | Patch]:
    """Return the entries of the legend for cuts, of outcomes that there are; none where there are none."""
    trials = found.comparison.model.campaign.trials
    if trials is None:
        return []
    seen = [name for code, name in enumerate(OUTCOMES) if (trials.outcome == code).any()]
    marks = [
        Line2D([], [], linestyle="", marker=MARKS[name], color="black", label=name, markerfacecolor="none")
        for name in seen
    ]
    colours = {"told right": RIGHT, "told wrongly": WRONG}
    if "marginal" in seen:
        colours["marginal: neither right nor wrong"] = NEITHER
    return [*marks, *(Patch(color=colour, label=name) for name, colour in colours.items())]


def _limit_key(found: Assessment) -> list[Line2D]:
    """Return the entry of the legend for limit depths; none where none was measured."""
    if found.comparison.model.campaign.limits is None:
        return []
    mark = Line2D([], [], color="black", marker="s", markersize=3.5, label="limit depth, measured, and its uncertainty")
    return [mark]


def receptances(found: Assessment) -> Figure:
    """Draw every receptance, measured and predicted, and below how far they are apart, over frequency."""
    measured = found.comparison.model.campaign.receptances
    columns = min(COLUMNS, len(measured))
    rows = -(-len(measured) // columns)
    figure = Figure(figsize=(11.0, 4.2 * rows + 0.6), layout="constrained")
    figure.suptitle("Receptance of the tool tip", fontweight="bold", x=0.01, ha="left")
    panels = figure.subplots(2 * rows, columns, squeeze=False, height_ratios=[2.0, 1.0] * rows)
    above, below = panels[::2].ravel(), panels[1::2].ravel()
    for axes in (*above[len(measured) :], *below[len(measured) :]):
        axes.set_visible(False)
    for number, one in enumerate(measured):
        _magnitude(above[number], found, number, one)
        _receptance_residual(below[number], found, number, one)
    handles, labels = above[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    return figure


def _magnitude(axes: Axes, found: Assessment, number: int, measured: Receptance) -> None:
    hertz, size = measured.frequency / HERTZ, np.abs(measured.value) / si_factor("x_um")
    axes.semilogy(hertz, size, ".", color=MEASURED, markersize=2.5, label="measured")
    for version, colour, line, label in _versions(found):
        predicted = np.abs(version.compared.prediction.receptances[number]) / si_factor("x_um")
        axes.semilogy(hertz, predicted, line, color=colour, linewidth=1.2, label=label)
    axes.set_ylim(size.max() / 10.0**DECADES, size.max() * 2.0)
    if len(hertz) > 1:
        axes.set_xlim(hertz[0], hertz[-1])
    axes.set_title(str(measured), loc="right", fontsize="small")
    axes.set_ylabel(f"magnitude [{UNIT}]")
    axes.grid(alpha=0.3)


def _receptance_residual(axes: Axes, found: Assessment, number: int, measured: Receptance) -> None:
    """Draw the root mean square of both parts of the difference, in standard deviations of a part."""
    hertz = measured.frequency / HERTZ
    errors = line_errors(measured.value, measuring_ranges(found.comparison.model.campaign.receptances)[number])
    for version, colour, line, _ in _versions(found):
        apart = measured.value - version.compared.prediction.receptances[number]
        standard = np.abs(apart) / (np.sqrt(2.0) * errors)
        axes.plot(hertz, standard, line, color=colour, linewidth=1.0)
    axes.axhline(1.0, color="black", linewidth=0.8)
    if len(hertz) > 1:
        axes.set_xlim(hertz[0], hertz[-1])
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("difference\n[deviations]")
    axes.set_xlabel("frequency [Hz]")
    axes.grid(alpha=0.3)


def _versions(found: Assessment) -> tuple[tuple[Version, str, str, str], ...]:
    """Return both versions of the model, with colour, line and name."""
    return (
        (found.described, DESCRIBED, "--", found.described.title.lower()),
        (found.refitted, CALIBRATED, "-", found.refitted.title.lower()),
    )


def residuals(found: Assessment) -> Figure:
    """Draw margins and chatter frequencies of the calibrated model over speed, depth, frequency and trial order."""
    trials = found.comparison.model.campaign.trials
    assert trials is not None
    heard = bool(np.isfinite(trials.chatter_frequency).any())
    places = [
        ("spindle speed [rpm]", trials.spindle_speed / RPM),
        ("axial depth [mm]", trials.axial_depth / MILLIMETRE),
        ("trial", trials.trial.astype(float)),
        *([("measured chatter frequency [Hz]", trials.chatter_frequency / HERTZ)] if heard else []),
    ]
    figure = Figure(figsize=(3.5 * len(places), 6.5 if heard else 3.8), layout="constrained")
    figure.suptitle("What is left after calibration", fontweight="bold", x=0.01, ha="left")
    panels = figure.subplots(1 + heard, len(places), sharey="row", squeeze=False)
    for column, (label, place) in enumerate(places):
        _margins(panels[0, column], place, trials, found.refitted)
        if heard:
            panels[1, column].plot(place, _frequency_residuals(found, trials), ".", color=CALIBRATED, markersize=7)
            panels[1, column].axhline(0.0, color="black", linewidth=0.8)
            panels[1, 0].set_ylabel("chatter frequency,\nmeasured - predicted [Hz]")
        for axes in panels[:, column]:
            axes.set_xlabel(label)
            axes.grid(alpha=0.3)
    panels[0, 0].set_ylabel("ln(depth / limit depth)\nas predicted; above 0: chatter")
    figure.legend(handles=_trial_key(found), loc="outside lower center", ncols=6, frameon=False)
    return figure


def _margins(axes: Axes, place: np.ndarray, trials: Trials, version: Version) -> None:
    colours = trial_colours(trials, version.told.margin)
    for code, name in enumerate(OUTCOMES):
        for colour in (RIGHT, WRONG, NEITHER):
            some = (trials.outcome == code) & (colours == colour)
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
