"""A diagnosis for people: a page, and its gist on a terminal."""

from pathlib import Path

from chatter_core.evidence.power import ENOUGH
from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import Score
from pipeline import diagnosis_document, diagnosis_figures, page
from pipeline.answer_folder import PAGE
from pipeline.comparison_document import origin, unjudged
from pipeline.comparison_page import NAMES, PLOTTED, captions, plots_of
from pipeline.diagnosis import Diagnosis
from pipeline.diagnosis_document import held_out_score

FOLDER = "figures"
CAPTIONS = {
    "ranking": "Probability of each effect and of nothing missing, and the evidence for it; below them the pairs that "
    "lead, where any was tried.",
    "corrections": "What the measurements want to change: the factor of a quantity with its band, over the range "
    "measured (marks). Of damping and force over what was described (dashed: by calibration alone), of stiffness over "
    "what calibration makes of it. Grey: not wanted.",
    "lobes": "Boundary of stability and measured cuts, by the calibrated base model and with what is missing.",
    "receptances": "Receptance of the tool tip, measured, by the calibrated base model, and with what is missing.",
    "residuals": "What is left of margins and chatter frequencies with what is missing added.",
    "pulls": "Parameters of the calibration with what is missing added, in widths of what is plausible.",
    "power": "What an effect of usual size would have left in these measurements, by quantity and together (grey). "
    "Where grey ends before the dashed line it could not have been told.",
}
#: Everything that there may be to write.
FILES = (
    diagnosis_document.DOCUMENT,
    diagnosis_document.POWER,
    *(f"{FOLDER}/{name}.png" for name in CAPTIONS),
    PAGE,
)
#: Effects that are told on a terminal.
TOLD = 5


def write(found: Diagnosis, campaign: str, given: str | None, output: Path) -> list[Path]:
    """Write data, figures and page of a diagnosis; return the paths. given: the file of the model, None for none."""
    document = diagnosis_document.document(found, campaign, given)
    written = [
        diagnosis_document.write(document, output / diagnosis_document.DOCUMENT),
        diagnosis_document.write_power(found, output / diagnosis_document.POWER),
    ]
    pictures = diagnosis_figures.write(found, output / FOLDER)
    page.write(
        output / PAGE,
        "diagnosis.html",
        title=f"What is missing: {campaign}",
        origin=origin(given, found.content),
        document=document,
        unjudged=unjudged(found.judged[NOTHING].failures),
        held_out=NAMES[diagnosis_document.held_out_quantity(found) or "outcome"],
        rows=ranking_rows(found),
        not_tried=not_tried(found) if found.not_tried else "",
        plots=plots_of(found.before_and_after),
        captions=captions(found.base.comparison.model.campaign),
        figures=page.embedded([path for path in pictures if path.stem not in PLOTTED], CAPTIONS),
    )
    return [*written, *pictures, output / PAGE]


def ranking_rows(found: Diagnosis) -> list[list[str]]:
    """Return a row for each entry of the ranking: name, probability, evidence, errors held out, parameters."""
    rows = []
    before = held_out_score(found, NOTHING)
    for one in [*found.ranking, *([found.pair] if found.pair is not None else [])]:
        after = held_out_score(found, one.name)
        told = []
        for candidate in one.best.candidates:
            for name, values in diagnosis_document.effect_parameters(found, one.best, candidate.name).items():
                unit = "" if values["unit"] == "1" else f" {values['unit']}"
                span = f"{values['low']:.3g} to {values['high']:.3g}"
                told.append(f"{name} {values['estimate']:.3g} ({span}){unit}")
            told += [f"{key} {value}" for key, value in candidate.settings.items()]
        change = "" if after is None or before is None else f"{_hundredths(before)} to {_hundredths(after)} %"
        # A pair stands beside the ranking, by its evidence.
        probability = "" if one is found.pair else f"{one.probability:.3f}"
        rows.append([one.name, probability, one.told_gain, change, "; ".join(told)])
    return rows


def _hundredths(score: Score) -> str:
    return ("at least " if score.at_least else "") + f"{100.0 * score.value:.1f}"


def not_tried(found: Diagnosis) -> str:
    """Return a sentence about the effects that cannot act on the machine, and why."""
    by_reason: dict[str, list[str]] = {}
    for name, reason in found.not_tried.items():
        by_reason.setdefault(reason, []).append(name)
    return "Not tried: " + "; ".join(f"{', '.join(names)}: {reason}" for reason, names in by_reason.items()) + "."


def power_lines(found: Diagnosis) -> list[str]:
    """Return as text what the measurements could have shown."""
    told = [f"Of usual size an effect would have left so many nats in these measurements; {ENOUGH:g} are seen:"]
    return told + [f"  {max(one.nats, 0.0):>8.1f}  {one.candidate}" for one in found.powers]


def summary(found: Diagnosis) -> str:
    """Return the gist as text for a terminal."""
    lines = ["", f"verdict: {found.verdict.kind}", found.verdict.text, *diagnosis_document.unsettled(found), ""]
    widths = (42, 13, 10, 22)
    of_limits = diagnosis_document.held_out_quantity(found) == "limit_depth"
    header = ["missing", "probability", "nats", "held-out error" + (" of limit depths" if of_limits else "")]
    rows = ranking_rows(found)
    of_pair = rows[len(found.ranking) :]
    for row in [header, *(row[:4] for row in [*rows[:TOLD], *of_pair])]:
        lines.append("".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip())
    for line in unjudged(found.judged[NOTHING].failures):
        lines += ["", line]
    lines += ["", found.corrections.text] if found.corrections is not None else []
    lines += ["", not_tried(found)] if found.not_tried else []
    lines += ["", *power_lines(found)] if found.verdict.kind == "underpowered" else []
    trial = diagnosis_document.next_trial_data(found)
    lines += ["", trial["text"]] if trial is not None else []
    return "\n".join([*lines, ""])
