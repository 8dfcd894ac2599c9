"""A model held against a campaign: how good it is, as described and calibrated, and where it fails."""

from functools import partial
from pathlib import Path

from distributed import Client
from pydantic import Field
from threadpoolctl import threadpool_limits

from chatter_core.evidence import Comparison, calibrate
from chatter_core.evidence.assessment import Assessment, as_described, assess, interval
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.boundary import field, setups
from chatter_core.evidence.held_out import groups, held_out
from pipeline import comparison_page, model_file
from pipeline.campaigns import CampaignOptions, cluster_of, options_of, read
from pipeline.cluster import open_client
from pipeline.configuration import EFFECTS, make_folder, sort_words
from pipeline.jobs import Job, spread

#: Setups of the cuts of which lobes are drawn, those with most cuts.
DRAWN_SETUPS = 4


class CompareOptions(CampaignOptions):
    """What ``compare`` takes."""

    output: Path | None = Field(default=None, description="folder for the answer")


def run(words: list[str]) -> int:
    """Compare a model with a campaign and write what was found; return the exit code."""
    sorted_words = sort_words(words, (*CompareOptions.model_fields, EFFECTS))
    options = options_of(sorted_words, CompareOptions, "compare")
    assert isinstance(options, CompareOptions)
    cluster = cluster_of(sorted_words)
    name = options.campaign.resolve().name
    output = options.output or Path("results") / f"compare-{name}"
    with threadpool_limits(1):
        model, belief, content = read(options, sorted_words)
        make_folder(output)
        comparison = Comparison(model=model)
        with open_client(cluster) as client:
            found = compute(client, comparison, belief)
        written = comparison_page.write(found, name, output)
        model_file.write(output / "model.yaml", model.campaign.machine, found.refitted.fit, content)
    print(comparison_page.summary(found))
    for path in [*written, output / "model.yaml"]:
        print(f"written: {path}")
    return 0


def compute(client: Client | None, comparison: Comparison, belief: Belief) -> Assessment:
    """Return everything that is known of how a model and a campaign agree.

    belief: what is known of the model's parameters before the campaign.
    """
    model = comparison.model
    before = belief.about(model)
    described, fit = spread(
        client,
        [
            Job(name="model as described", call=partial(as_described, comparison, belief)),
            Job(name="calibration", call=partial(calibrate, comparison, start=before.estimate)),
        ],
    )
    known = fitted(fit)
    parameters = [p.name for p in model.parameters if p.touches != "measurement"]
    kinds = range(min(len(setups(model)), DRAWN_SETUPS))
    jobs = {
        "held_out": [
            Job(name=f"cuts held out, group {group + 1}", call=partial(held_out, comparison, before.estimate, group))
            for group in range(groups(model.campaign))
        ],
        "intervals": [Job(name=f"interval of {p}", call=partial(interval, comparison, fit, p)) for p in parameters],
        "described": [
            Job(name="lobes as described", call=partial(field, model, before.sure(), kind)) for kind in kinds
        ],
        "refitted": [Job(name="lobes as calibrated", call=partial(field, model, known, kind)) for kind in kinds],
    }
    answers = iter(spread(client, [job for some in jobs.values() for job in some]))
    parts = {name: [next(answers) for _ in some] for name, some in jobs.items()}
    return assess(
        comparison,
        described=(described, before, parts["described"]),
        refitted=(fit, known, parts["refitted"]),
        held_out=parts["held_out"],
        intervals=dict(zip(parameters, parts["intervals"], strict=True)),
    )
