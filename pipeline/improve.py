"""Diagnose, add what is missing, calibrate again, and go on until nothing more is supported."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from distributed import Client

from chatter_core.evidence import CampaignModel, Comparison
from chatter_core.evidence.assessment import Version, as_described, version
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import ERRORS, Score
from pipeline import diagnosis_document, diagnosis_page, improvement_figure, judging, model_file
from pipeline.campaigns import Asked, model_of
from pipeline.diagnosis import Diagnosis, check_enough, diagnose
from pipeline.judging import MODEL, Verb
from pipeline.model_file import Content

#: Files beside those of a diagnosis: of the last one, errors of every version of the model, and their picture.
LAST, HISTORY, PICTURE = "diagnosis_last.json", "history.csv", f"{diagnosis_page.FOLDER}/history.png"
#: Effects are added so many times at most.
MOST_STEPS = 3


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """What became of a model.

    diagnoses: in turn; final: the hypothesis in the end, and content: what it is made of; history:
    a row for each version of the model.
    """

    diagnoses: list[Diagnosis]
    final: Hypothesis
    content: Content
    history: pd.DataFrame


def run(words: list[str]) -> int:
    """Improve a model by a campaign and write what was found; return the exit code."""
    return judging.run(VERB, words)


def improve(client: Client | None, asked: Asked) -> Improvement:
    """Return a model with what is missing added, step by step."""
    model, belief, content = asked.model, asked.belief, asked.content
    rows = [_row("as described", _as_described(model, belief), {})]
    diagnoses: list[Diagnosis] = []
    start = belief
    while True:
        found = diagnose(client, model, belief, content, start)
        if not diagnoses:
            rows.append(_row("calibrated", found.version(found.base), found.held_out.get(NOTHING, {})))
        diagnoses.append(found)
        best = found.supported
        if best is found.base or len(diagnoses) > MOST_STEPS:
            break
        content = found.supported_content
        rows.append(_row(" + ".join(content.effects), found.version(best), found.held_out.get(best.name, {})))
        model, start = model_of(model.campaign, content), fitted(best.fit)
    return Improvement(diagnoses=diagnoses, final=diagnoses[-1].base, content=content, history=_history(rows))


def _history(rows: list[dict[str, Any]]) -> pd.DataFrame:
    return pd.DataFrame(rows).rename_axis("step").reset_index()


def _as_described(model: CampaignModel, belief: Belief) -> Version:
    """Return the model as described, held against the campaign."""
    comparison = Comparison(model=model)
    return version("As described", comparison, as_described(comparison, belief), belief.about(model), ())


def _row(effect: str, found: Version, held_out: dict[str, Score]) -> dict[str, Any]:
    """Return a row of the history: errors in and out of sample by quantity."""
    inside = {f"{name}_in_sample": found.scores[name].value for name in ERRORS if name in found.scores}
    outside = {f"{name}_held_out": held_out[name].value for name in ERRORS if name in held_out}
    return {"effect": effect, **inside, **outside, "log_evidence": found.fit.log_evidence}


def summary(found: Improvement) -> str:
    """Return the gist as text for a terminal."""
    table = found.history.to_string(index=False, float_format=lambda value: f"{value:.3g}", na_rep="")
    return f"{diagnosis_page.summary(found.diagnoses[0])}\n{table}"


def _write(found: Improvement, asked: Asked, output: Path) -> list[Path]:
    """Write model, history, diagnoses, figures and page; return the paths."""
    first, last = found.diagnoses[0], found.diagnoses[-1]
    written = diagnosis_page.write(first, asked.name, output)
    final = diagnosis_document.write(diagnosis_document.document(last, asked.name), output / LAST)
    history = output / HISTORY
    found.history.to_csv(history, index=False, float_format="%.6g")
    picture = output / PICTURE
    improvement_figure.history(found.history).savefig(picture, dpi=150)
    model_file.write(output / MODEL, asked.model.campaign.machine, found.final.fit, found.content)
    return [*written, final, history, picture, output / MODEL]


def _lost(found: Improvement) -> int:
    return found.diagnoses[-1].version(found.final).compared.prediction.failed


VERB = Verb(
    name="improve",
    files=(*diagnosis_page.FILES, LAST, HISTORY, PICTURE, MODEL),
    check=check_enough,
    compute=improve,
    write=_write,
    summary=summary,
    lost=_lost,
)
