"""Diagnose, add what is missing, calibrate again, and go on until nothing more is supported."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
from distributed import Client
from pydantic import Field
from threadpoolctl import threadpool_limits

from chatter_core.evidence import CampaignModel, Comparison
from chatter_core.evidence.assessment import Version, as_described, version
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import ERRORS, Score
from pipeline import diagnosis_document, diagnosis_page, improvement_figure, model_file
from pipeline.campaigns import CampaignOptions, cluster_of, model_of, options_of, read
from pipeline.cluster import open_client
from pipeline.configuration import EFFECTS, make_folder, sort_words
from pipeline.diagnosis import Diagnosis, check_enough, diagnose
from pipeline.model_file import Content

#: Effects are added so many times at most.
MOST_STEPS = 3


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


def write(found: Improvement, campaign: str, output: Path) -> list[Path]:
    """Write model, history, diagnoses, figures and page; return the paths."""
    first, last = found.diagnoses[0], found.diagnoses[-1]
    written = diagnosis_page.write(first, campaign, output)
    document = diagnosis_document.document(last, campaign)
    final = diagnosis_document.write(document, output / "diagnosis_last.json")
    history = output / "history.csv"
    found.history.to_csv(history, index=False, float_format="%.6g")
    picture = output / "figures" / "history.png"
    improvement_figure.history(found.history).savefig(picture, dpi=150)
    model = output / "model.yaml"
    model_file.write(model, found.final.comparison.model.campaign.machine, found.final.fit, found.content)
    return [*written, final, history, picture, model]
