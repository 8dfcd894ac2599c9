"""A comparison for people: a page, and its gist on a terminal."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from chatter_core.evidence import Campaign
from chatter_core.evidence.assessment import Assessment, Version
from chatter_core.evidence.failures import Failure
from chatter_core.evidence.scores import COVERAGE, ERRORS, Score
from pipeline import comparison_document, comparison_figures, page
from pipeline.answer_folder import PAGE
from pipeline.model_file import Content

if TYPE_CHECKING:
    from pipeline.plots import Embedded

CAPTIONS = {
    "residuals": "Above: where the calibrated model puts each cut, as distance from the boundary; below: how far "
    "measured chatter frequencies lie from the nearest line of the critical motion.",
    "pulls": "Parameters of the calibration in widths of what is plausible before measuring. Beyond three the fit "
    "bends a parameter to stand in for something that the model lacks.",
}
#: Plots that a page has in the place of pictures.
PLOTTED = {
    "lobes": "The boundary by the version of the model that is chosen; of a calibrated one with the band in which it "
    "lies as far as its parameters are uncertain.",
    "receptances": "Predictions hold the sensor's fitted gain, phase and frequency scale.",
}
#: What lies on the boundary.
JUDGED = " Cuts as they were judged: green where the model tells them right, red where wrongly."
LIMITS = " Limit depths as they were measured, with their standard uncertainty."
#: Everything that there may be to write.
FILES = (
    comparison_document.DOCUMENT,
    comparison_document.TRIALS,
    *(f"{comparison_figures.FOLDER}/{name}.png" for name in comparison_figures.NAMES),
    PAGE,
)
#: Failures that are told on a terminal.
TOLD_FAILURES = 5
#: Names of the quantities for readers.
NAMES = {
    "outcome": "outcome, balanced",
    "log_loss": "log-loss",
    "depth_margin": "depth margin",
    "chatter_frequency": "chatter frequency",
    "limit_depth": "limit depth",
    "receptance": "receptance",
    "natural_frequency": "natural frequency",
    "damping_ratio": "damping ratio",
    "bearing_stiffness": "bearing stiffness",
}
#: What the headlines say of errors, and of what was held out.
HEADS = {
    "outcome": ("Told wrongly, mean of stable cuts and of those with chatter", "cuts that were held out"),
    "limit_depth": ("Limit depths off, root mean square of ln(measured / predicted)", "those that were held out"),
    "receptance": ("Receptances not met, share of their size", ""),
}
#: Quantities told in per cent.
PER_CENT = ("outcome", "depth_margin", "limit_depth", "receptance", "natural_frequency", "damping_ratio",
            "bearing_stiffness")  # fmt: skip


def write(found: Assessment, campaign: str, given: str | None, content: Content, output: Path) -> list[Path]:
    """Write data, figures and page of a comparison; return the paths.

    given: the file of the model, None for none; content: what the model is made of.
    """
    written = comparison_document.write(found, campaign, given, content, output)
    measured = found.comparison.model.campaign
    pictures = comparison_figures.write(found, output / comparison_figures.FOLDER)
    page.write(
        output / PAGE,
        "comparison.html",
        title=f"Model and measurements: {campaign}",
        subtitle=_measured(found),
        headlines=[*comparison_document.origin(given, content), *headlines(found)],
        columns=["quantity", "as described", "calibrated", "held out", "what it is"],
        rows=error_rows(found),
        failures=[
            ("Calibrated", [failure.text for failure in _that_count(found.refitted)]),
            ("As described", [failure.text for failure in _that_count(found.described)]),
        ],
        plots=plots_of(found),
        captions=captions(measured),
        figures=page.embedded([path for path in pictures if path.stem not in PLOTTED], CAPTIONS),
        parameters=_parameter_rows(found),
        reliability=comparison_document.reliability(found),
        coverage=f"{100 * COVERAGE:.0f} %",
        groups=found.held_out_groups,
        judged=judged(measured),
        remarks=[*measured.remarks, *comparison_document.unjudged(found.refitted.failures)],
        fit=found.refitted.fit,
    )
    return [*written, *pictures, output / PAGE]


def judged(campaign: Campaign) -> str:
    """Return in words by which cuts a model is judged, "" where nothing was cut."""
    tables = {"cuts": campaign.trials, "limit depths": campaign.limits}
    return " and ".join(name for name, table in tables.items() if table is not None)


def captions(campaign: Campaign) -> dict[str, str]:
    """Return what is said below the plots of a page."""
    told = (JUDGED if campaign.trials is not None else "") + (LIMITS if campaign.limits is not None else "")
    return {**PLOTTED, "lobes": PLOTTED["lobes"] + told}


def plots_of(found: Assessment | None) -> "Embedded | None":
    """Return the plots of a page that holds two versions of a model side by side, None where there are none."""
    if found is None:
        return None
    # The plot library takes a second, and is wanted when all else is done.
    from pipeline.comparison_plots import comparison_plots
    from pipeline.plots import embed

    made = comparison_plots(found)
    return embed(made) if made else None


def summary(found: Assessment) -> str:
    """Return the gist as text for a terminal."""
    lines = ["", _measured(found), ""]
    widths = (20, 28, 28, 28)
    header = ("error of", "as described", "calibrated", "held out")
    for row in [header, *(row[:4] for row in error_rows(found))]:
        lines.append("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    lines += ["", *headlines(found)]
    failing = _that_count(found.refitted)
    for failure in failing[:TOLD_FAILURES]:
        lines.append(f"- {failure.text}")
    more = len(failing) - TOLD_FAILURES
    if more > 0:
        lines.append(f"- and {more} more in the report")
    lines += comparison_document.unjudged(found.refitted.failures)
    return "\n".join([*lines, ""])


def _that_count(version: Version) -> list[Failure]:
    return [failure for failure in version.failures if failure.counts]


def headlines(found: Assessment) -> list[str]:
    """Return the gist in sentences."""
    told = []
    for name, (words, held_out) in HEADS.items():
        if name in found.refitted.scores:
            before, after = (_head(version.scores[name]) for version in (found.described, found.refitted))
            held = found.held_out_scores.get(name)
            then = f", {_head(held)} on {held_out}" if held is not None else ""
            told.append(f"{words}: {before} by the model as described, {after} once calibrated{then}.")
    told += comparison_document.cautions(found.refitted.fit, "The calibration")
    cut = judged(found.comparison.model.campaign)
    if cut and found.held_out is None:
        told.append(f"{cut.capitalize()} at three speeds or more are needed to hold some out.")
    count = len(_that_count(found.refitted))
    told.append(
        "After calibration no failure was found that noise does not explain; few data show few."
        if not count
        else f"After calibration the model fails beyond what noise explains, found in {count} "
        f"way{'s' if count > 1 else ''}:"
    )
    return told


def error_rows(found: Assessment) -> list[list[str]]:
    """Return a row for each measured quantity: name, errors with intervals, and meaning."""
    return [
        [
            NAMES[name],
            _shown(name, found.described.scores[name]),
            _shown(name, found.refitted.scores[name]),
            _shown(name, found.held_out_scores.get(name)),
            f"{meaning} ({_data(found, name)})",
        ]
        for name, (_, meaning) in ERRORS.items()
        if name in found.refitted.scores
    ]


def _data(found: Assessment, name: str) -> str:
    """Return how many data of a quantity there are, and for how many each version of the model has no answer."""
    versions = {"as described": found.described.scores, "calibrated": found.refitted.scores}
    lost = {version: scores[name].unanswered for version, scores in versions.items()}
    if name in found.held_out_scores:
        lost["held out"] = found.held_out_scores[name].unanswered
    told = f"{found.refitted.scores[name].count} data"
    if not any(lost.values()):
        return told
    without = ", ".join(f"{count} {version}" for version, count in lost.items())
    return f"{told}; without an answer, and counted as wrong: {without}"


def _measured(found: Assessment) -> str:
    told = comparison_document.measured(found.comparison.model.campaign)
    labels = ", ".join(f"{count} {name}" for name, count in told["trials"].items() if count)
    parts = [f"{sum(told['trials'].values())} cuts ({labels})"] if told["trials"] else []
    for key, name in (
        ("chatter_frequencies", "chatter frequencies"),
        ("receptances", "receptances"),
        ("limit_depths", "limit depths"),
        ("natural_frequencies", "natural frequencies"),
        ("bearing_stiffnesses", "bearing stiffnesses"),
    ):
        count = len(told[key]) if isinstance(told[key], list) else told[key]
        parts += [f"{count} {name}"] if count else []
    return "Measured: " + ", ".join(parts)


def _shown(name: str, score: Score | None) -> str:
    if score is None or not math.isfinite(score.value):
        return ""
    unit, least = " Hz" if name == "chatter_frequency" else "", "at least " if score.at_least else ""
    value, low, high = (
        _percent(number) if name in PER_CENT else f"{number:.3g}" for number in (score.value, score.low, score.high)
    )
    # One datum has no scatter.
    return f"{least}{value}{unit}" + (f" ({low} to {high})" if math.isfinite(score.low + score.high) else "")


def _head(score: Score) -> str:
    return ("at least " if score.at_least else "") + _percent(score.value)


def _percent(value: float) -> str:
    return f"{100.0 * value:.1f} %"


def _parameter_rows(found: Assessment) -> list[list[str]]:
    """Return a row for each parameter of the machine and of the trials."""
    rows: list[list[str]] = []
    for name, told in comparison_document.calibration(found).items():
        values: dict[str, Any] = told.get("factor", told)
        unit = "" if told["unit"] in ("1", "ln") else f" {told['unit']}"
        interval = f"{values['low']:.4g} to {values['high']:.4g}{unit}"
        how = told["interval_by"] + (", at its bound" if told["at_bound"] else "")
        shown = f"{values['estimate']:.4g}{unit}"
        rows.append([name.replace("_", " "), shown, interval, how, f"{told['pull']:+.2f}", told["meaning"]])
    return rows
