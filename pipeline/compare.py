"""A model held against a campaign: how good it is, as described and calibrated, and where it fails."""

from functools import partial
from pathlib import Path
from typing import Any

from chatter_core.evidence import CampaignModel, Comparison, calibrate
from chatter_core.evidence.assessment import Assessment, as_described, assess
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.fit import Fit
from pipeline import comparison_document, comparison_page, judging, model_file
from pipeline.campaigns import Asked
from pipeline.cluster import Workers
from pipeline.jobs import Job, spread_parts
from pipeline.judging import MODEL, Verb
from pipeline.pieces import held_out_jobs, interval_jobs, intervals, lobe_jobs, lobes
from pipeline.profiling import fitted_from, highest
from pipeline.verbs.campaigns import CompareOptions


def run(words: list[str]) -> int:
    """Compare a model with a campaign and write what was found; return the exit code."""
    return judging.run(VERB, words)


def anything_will_do(model: CampaignModel) -> None:
    """Refuse nothing: the campaign's reader has made sure that something was measured."""


def _compare(workers: Workers | None, asked: Asked) -> Assessment:
    return compute(workers, Comparison(model=asked.model), asked.belief)


def _write(found: Assessment, asked: Asked, output: Path) -> list[Path]:
    paths = comparison_page.write(found, asked.name, asked.given, asked.content, output)
    model_file.write(output / MODEL, asked.model.campaign, found.refitted.fit, asked.content)
    return [*paths, output / MODEL]


def compute(workers: Workers | None, comparison: Comparison, belief: Belief) -> Assessment:
    """Return everything that is known of how a model and a campaign agree.

    belief: what is known of the model's parameters before the campaign.
    """
    model = comparison.model
    before = belief.about(model)
    first = spread_parts(
        workers,
        {
            "calibrated": [Job(name="calibration", call=partial(calibrate, comparison, start=before.estimate))],
            "described": [Job(name="model as described", call=partial(as_described, comparison, belief))],
            "lobes": lobe_jobs(model, before.sure(), "lobes as described"),
        },
    )
    (fit,), (described,) = first["calibrated"], first["described"]
    parameters = [p.name for p in model.parameters if p.touches != "measurement"]
    second = _told_of(workers, comparison, fit, before, parameters)
    if (higher := highest(second["intervals"])) is not None:
        # A calibration that lies below what its own profiles come upon is none.
        fit = fitted_from(workers, Hypothesis(candidates=(), comparison=comparison, fit=fit), higher).fit
        second = _told_of(workers, comparison, fit, before, parameters)
    return assess(
        comparison,
        described=(described, before, lobes(first["lobes"])),
        refitted=(fit, fitted(fit), lobes(second["lobes"])),
        held_out=second["held_out"],
        intervals=intervals(fit, parameters, second["intervals"]),
    )


def _told_of(
    workers: Workers | None, comparison: Comparison, fit: Fit, before: Belief, parameters: list[str]
) -> dict[str, list[Any]]:
    """Return what is told of a calibration: cuts held out, ends of intervals of parameters, and lobes."""
    return spread_parts(
        workers,
        {
            "held_out": held_out_jobs(comparison, fit.estimate, before.estimate),
            "intervals": interval_jobs(comparison, fit, parameters),
            "lobes": lobe_jobs(comparison.model, fitted(fit), "lobes as calibrated"),
        },
    )


VERB = Verb(
    options=CompareOptions,
    files=(*comparison_page.FILES, MODEL),
    check=anything_will_do,
    compute=_compare,
    write=_write,
    summary=comparison_page.summary,
    facts=lambda found, asked: {
        "comparison": comparison_document.document(found, asked.name, asked.given, asked.content)
    },
    lost=lambda found: found.refitted.compared.prediction.failed,
)
