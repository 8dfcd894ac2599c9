"""Diagnose, add what is missing, calibrate again, and go on until nothing more is supported."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from distributed import Client
from pydantic import Field
from threadpoolctl import threadpool_limits

from chatter_core.evidence import CampaignModel, Comparison
from chatter_core.evidence.assessment import as_described
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import ERRORS, Score, cut_scores, structure_scores, told
from pipeline import diagnosis_document, diagnosis_page, improvement_figure, model_file
from pipeline.campaigns import CampaignOptions, cluster_of, model_of, options_of, read
from pipeline.cluster import open_client
from pipeline.configuration import EFFECTS, make_folder, sort_words
from pipeline.diagnosis import Diagnosis, check_enough, diagnose, name_of
from pipeline.model_file import Content

#: Effects are added so many times at most.
MOST_STEPS = 3
#: Verdicts after which the best supported effect is added although others are tied with it.
ADDED_AFTER = ("effect", "ambiguous")


class ImproveOptions(CampaignOptions):
    """What ``improve`` takes."""

    output: Path | None = Field(default=None, description="folder for the answer")


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
    sorted_words = sort_words(words, (*ImproveOptions.model_fields, EFFECTS))
    options = options_of(sorted_words, ImproveOptions, "improve")
    assert isinstance(options, ImproveOptions)
    cluster = cluster_of(sorted_words)
    name = options.campaign.resolve().name
    output = options.output or Path("results") / f"improve-{name}"
    with threadpool_limits(1):
        model, belief, content = read(options, sorted_words)
        check_enough(model)
        make_folder(output)
        with open_client(cluster) as client:
            found = improve(client, model, belief, content)
        written = write(found, name, output)
    print(diagnosis_page.summary(found.diagnoses[0]))
    print(found.history.to_string(index=False, float_format=lambda value: f"{value:.3g}", na_rep=""))
    for path in written:
        print(f"written: {path}")
    return 0


def improve(client: Client | None, model: CampaignModel, belief: Belief, content: Content) -> Improvement:
    """Return a model with what is missing added, step by step."""
    nominal = as_described(Comparison(model=model), belief)
    rows = [_row(0, "as described", Hypothesis(candidates=(), comparison=Comparison(model=model), fit=nominal), {})]
    diagnoses: list[Diagnosis] = []
    while True:
        found = diagnose(client, model, belief, content)
        if not diagnoses:
            rows.append(_row(1, "calibrated", found.base, found.held_out.get(NOTHING, {})))
        diagnoses.append(found)
        if found.verdict.kind not in ADDED_AFTER or len(diagnoses) > MOST_STEPS:
            break
        best = found.best
        for candidate in best.candidates:
            content = content.with_effect(candidate.name, candidate.settings)
        step = len(diagnoses) + 1
        rows.append(_row(step, " + ".join(content.effects), best, found.held_out.get(name_of(best), {})))
        model, belief = model_of(model.campaign, content), fitted(best.fit)
    return Improvement(diagnoses=diagnoses, final=diagnoses[-1].base, content=content, history=pd.DataFrame(rows))


def _row(step: int, effect: str, hypothesis: Hypothesis, held_out: dict[str, Score]) -> dict[str, Any]:
    """Return a row of the history: errors in and out of sample by quantity."""
    comparison, values = hypothesis.comparison, hypothesis.fit.estimate
    compared = comparison.compare(values)
    campaign = comparison.model.campaign
    said = told(comparison, values, compared.prediction)
    scores = {**cut_scores(campaign, said), **structure_scores(campaign, compared)}
    inside = {f"{name}_in_sample": scores[name].value for name in ERRORS if name in scores}
    outside = {f"{name}_held_out": held_out[name].value for name in ERRORS if name in held_out}
    return {"step": step, "effect": effect, **inside, **outside, "log_evidence": hypothesis.fit.log_evidence}


def write(found: Improvement, campaign: str, output: Path) -> list[Path]:
    """Write model, history, diagnoses, figures and page; return the paths."""
    first, last = found.diagnoses[0], found.diagnoses[-1]
    written = diagnosis_page.write(first, campaign, output)
    final = output / "diagnosis_last.json"
    document = diagnosis_document.document(last, campaign)
    final.write_text(json.dumps(document, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    history = output / "history.csv"
    found.history.to_csv(history, index=False, float_format="%.6g")
    picture = output / "figures" / "history.png"
    improvement_figure.history(found.history).savefig(picture, dpi=150)
    model = output / "model.yaml"
    model_file.write(model, found.final.comparison.model.campaign.machine, found.final.fit, found.content)
    return [*written, final, history, picture, model]
