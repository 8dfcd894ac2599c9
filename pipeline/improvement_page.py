"""An improvement for people: how the error fell, what each diagnosis said, and the model before and after."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import ERRORS
from pipeline import comparison_figures, diagnosis_document, diagnosis_figures, diagnosis_page, improvement_figure, page
from pipeline.answer_folder import PAGE
from pipeline.comparison_document import origin, unjudged
from pipeline.comparison_page import NAMES, PER_CENT, PLOTTED, captions, plots_of
from pipeline.diagnosis import Diagnosis
from pipeline.diagnosis_document import DOCUMENT, POWER
from pipeline.diagnosis_page import FOLDER
from pipeline.improvement import MOST_STEPS, Improvement

#: Files beside those of a diagnosis: errors of every version of the model, their picture, and the last diagnosis.
HISTORY, PICTURE, LAST = "history.csv", f"{FOLDER}/history.png", "diagnosis_last.json"
#: Everything that there may be to write.
FILES = (*diagnosis_page.FILES, LAST, HISTORY, PICTURE)
CAPTIONS = {
    **diagnosis_page.CAPTIONS,
    "history": "Error of every quantity by each version of the model, on the data that it was fitted to and on those "
    "held out. What calibration alone mends is no merit of an effect: compare with the calibrated base model.",
    "lobes": "Boundary of stability and measured cuts, by the calibrated base model and by the final one.",
    "receptances": "Receptance of the tool tip, measured, by the calibrated base model, and by the final one.",
    "residuals": "What is left of margins and chatter frequencies by the final model.",
    "pulls": "Parameters of the final model, in widths of what is plausible.",
}


#: What the verdicts mean in the head of a step.
MEANINGS = {
    "none": "nothing is missing",
    "effect": "an effect is missing",
    "ambiguous": "one of several effects is missing",
    "unexplained": "something is missing that no effect explains",
    "underpowered": "these measurements cannot tell",
}
#: Quantities of which the gist tells, the first that was measured.
HEADS = {
    "outcome": "Outcomes told wrongly",
    "limit_depth": "Error of limit depths",
    "receptance": "Error of receptances",
    "natural_frequency": "Error of natural frequencies",
    "bearing_stiffness": "Error of bearing stiffnesses",
}


@dataclass(frozen=True, kw_only=True)
class Step:
    """A diagnosis in short: of which model, its verdict, why, with what care; what that fits, fails and asks for."""

    title: str
    text: str
    cautions: list[str]
    rows: list[list[str]]
    fails: list[str]
    next_trial: str


def write(found: Improvement, campaign: str, given: str | None, output: Path) -> list[Path]:
    """Write history, diagnoses, figures and page of an improvement; return the paths; given: file of the model."""
    first, last = found.diagnoses[0], found.diagnoses[-1]
    documents = [diagnosis_document.document(one, campaign, given) for one in found.diagnoses]
    written = [
        diagnosis_document.write(documents[0], output / DOCUMENT),
        diagnosis_document.write_power(first, output / POWER),
        diagnosis_document.write(documents[-1], output / LAST),
        output / HISTORY,
    ]
    found.history.to_csv(output / HISTORY, index=False, float_format="%.6g")
    of_the_first = diagnosis_figures.write(first, output / FOLDER)
    improvement_figure.history(found.history).savefig(output / PICTURE, dpi=150)
    shown = found.before_and_after
    compared = comparison_figures.write(shown, output / FOLDER) if shown is not None else []
    page.write(
        output / PAGE,
        "improvement.html",
        title=f"What was missing: {campaign}",
        lead=[*origin(given, first.content), *lead(found)],
        columns=error_columns(found.history),
        rows=error_rows(found.history),
        history=page.embedded([output / PICTURE], CAPTIONS),
        steps=[step(*each) for each in zip(found.diagnoses, documents, strict=True)],
        plots=plots_of(shown),
        captions=captions(first.base.comparison.model.campaign),
        compared=page.embedded([path for path in compared if path.stem not in PLOTTED], CAPTIONS),
        first=page.embedded(of_the_first, CAPTIONS),
        power=documents[0]["power"],
        calibration=diagnosis_document.parameters_of(last.base, set()),
    )
    return [*written, *of_the_first, output / PICTURE, *compared, output / PAGE]


def lead(found: Improvement) -> list[str]:
    """Return the gist in sentences."""
    added = _readable(", ".join(found.added))
    told = [f"Added to the model: {added}." if added else "Nothing was added to the model."]
    told += [_readable(line) for line in found.stand_for]
    told += headline(found.history)
    verdict = _readable(found.diagnoses[-1].verdict.text)
    told.append(f"In the end: {verdict[0].lower()}{verdict[1:]}")
    if found.unfinished:
        told.append(f"It is not added any more: {MOST_STEPS} times is the most.")
    return told


def headline(table: pd.DataFrame) -> list[str]:
    """Return the error of the first quantity that was measured, by every version of the model, as a sentence."""
    for name, words in HEADS.items():
        held_out = "on limit depths held out" if name == "limit_depth" else "on cuts held out"
        for kind, where in (("held_out", held_out), ("in_sample", "on the data of the fit")):
            if f"{name}_{kind}" in table:
                steps = zip(table["effect"], table[f"{name}_{kind}"], strict=True)
                known = [(effect, value) for effect, value in steps if np.isfinite(value)]
                told = ", ".join(f"{_shown(name, value)} {_version(effect)}" for effect, value in known)
                return [f"{words}, {where}: {told}."]
    return []


def _readable(text: str) -> str:
    """Return text in which effects' names stand as words."""
    return text.replace("_", " ")


def _version(effect: str) -> str:
    """Return a version of the model as it stands in a sentence."""
    return effect if effect in ("as described", "calibrated") else f"with {_readable(effect)}"


def error_columns(table: pd.DataFrame) -> list[str]:
    """Return the heads of the table of errors."""
    return ["model", *(NAMES[name] for name in _quantities(table)), "log evidence"]


def error_rows(table: pd.DataFrame) -> list[list[str]]:
    """Return a row for each version of the model: its errors, in brackets those on cuts held out, and its evidence."""
    return [
        [
            _readable(row["effect"]),
            *(_both(name, row) for name in _quantities(table)),
            f"{row['log_evidence']:.1f}",
        ]
        for _, row in table.iterrows()
    ]


def _quantities(table: pd.DataFrame) -> list[str]:
    return [name for name in ERRORS if f"{name}_in_sample" in table]


def _both(name: str, row: "pd.Series[Any]") -> str:
    inside, outside = (row.get(f"{name}_{kind}", np.nan) for kind in ("in_sample", "held_out"))
    return _shown(name, inside) + (f" ({_shown(name, outside)})" if np.isfinite(outside) else "")


def _shown(name: str, value: float) -> str:
    if not np.isfinite(value):
        return ""
    if name in PER_CENT:
        return f"{100.0 * value:.1f} %"
    return f"{value:.3g}" + (" Hz" if name == "chatter_frequency" else "")


def step(found: Diagnosis, document: dict[str, Any]) -> Step:
    """Return a diagnosis in short; document: the same as plain data."""
    model = _readable(" + ".join(found.content.effects))
    named = [one for one in document["ranking"] if one["effect"] in found.verdict.missing]
    pair = document["pair"]
    if pair is not None and found.best.name == pair["effect"]:
        named = [pair]
    return Step(
        title=f"{'With ' + model if model else 'Base model'}: {MEANINGS[found.verdict.kind]}",
        text=_readable(found.verdict.text),
        cautions=[*map(_readable, document["cautions"]), *unjudged(found.judged[NOTHING].failures)],
        rows=[row for one in named for row in _parameter_rows(one)],
        fails=[_readable(failure["text"]) for failure in document["still_fails"] if failure["counts"]],
        next_trial=_readable(document["next_trial"]["text"]) if document["next_trial"] is not None else "",
    )


def _parameter_rows(one: dict[str, Any]) -> list[list[str]]:
    """Return a row for each parameter of an entry of the ranking."""
    return [
        [
            _readable(one["effect"]),
            "" if one["probability"] is None else f"{one['probability']:.2f}",
            _readable(name),
            f"{told['estimate']:.3g}",
            f"{told['low']:.3g} to {told['high']:.3g}",
            "" if told["unit"] == "1" else told["unit"],
            told["meaning"],
        ]
        for name, told in one["parameters"].items()
    ]
