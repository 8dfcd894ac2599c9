"""A model held against a campaign: how good it is, as described and calibrated, and where it fails."""

import json
import sys
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from distributed import Client
from pydantic import Field
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from chatter_core.evidence import Comparison, calibrate
from chatter_core.evidence.assessment import Assessment, as_described, assess, interval
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.reading import printable, shown
from pipeline import comparison_document, comparison_figures, comparison_page, model_file
from pipeline.campaigns import CampaignOptions, cluster_of, options_of, read
from pipeline.cluster import open_client
from pipeline.configuration import EFFECTS, make_folder, sort_words
from pipeline.jobs import Job, spread_parts
from pipeline.locking import locked, remove_empty
from pipeline.pieces import held_out_jobs, lobe_jobs

#: Where the calibrated model is written.
MODEL = "model.yaml"


class CompareOptions(CampaignOptions):
    """What ``compare`` takes."""

    output: Path | None = Field(default=None, description="folder for the answer")


def run(words: list[str]) -> int:
    """Compare a model with a campaign and write what was found; return the exit code."""
    sorted_words = sort_words(words, (*CompareOptions.model_fields, EFFECTS))
    options = options_of(sorted_words, CompareOptions, "compare")
    assert isinstance(options, CompareOptions)
    cluster = cluster_of(sorted_words)
    name = printable(options.campaign.resolve().name)
    output = options.output or Path("results") / f"compare-{name}"
    existed = output.exists()
    with threadpool_limits(1):
        model, belief, content = read(options, sorted_words)
        _refuse_loss(output, options, name)
        make_folder(output)
        try:
            with locked(output):
                with open_client(cluster) as client:
                    found = compute(client, Comparison(model=model), belief)
                written = _write(found, content, name, output)
        except BaseException as error:
            if not existed:
                remove_empty(output)
            if isinstance(error, OSError):
                raise InvalidInput([f"output: {output} cannot be written: {error.strerror or error}"]) from None
            raise
    print(comparison_page.summary(found))
    for path in written:
        print(f"written: {path}")
    lost = found.refitted.compared.prediction.failed
    if lost:
        print(f"error: the calibrated model has no answer for {lost} data; they count as far off", file=sys.stderr)
    return 1 if lost else 0


def _refuse_loss(output: Path, options: CompareOptions, name: str) -> None:
    """Raise InvalidInput where the answer would take the place of what was measured, or of another answer."""
    if output.resolve() == options.campaign.resolve():
        raise InvalidInput([f"output: {output} is the folder of the campaign itself; name another"])
    if options.model is not None and (output / MODEL).resolve() == options.model.resolve():
        raise InvalidInput([f"output: {output} holds the model that is compared; name another folder"])
    try:
        before = json.loads((output / comparison_document.DOCUMENT).read_text(encoding="utf-8"))["campaign"]
    except (OSError, ValueError, KeyError, TypeError):
        return
    if before != name:
        raise InvalidInput(
            [f"output: {output} holds the comparison with campaign {shown(before)}; name another folder"]
        )


def _write(found: Assessment, content: model_file.Content, name: str, output: Path) -> list[Path]:
    """Write everything and return the paths.

    It is written beside its place and then moved: a disk that fills up, or a signal, leaves what was there before.
    """
    with TemporaryDirectory(prefix=".writing-", dir=output) as folder:
        beside = Path(folder)
        paths = comparison_page.write(found, name, beside)
        model_file.write(beside / MODEL, found.comparison.model.campaign.machine, found.refitted.fit, content)
        written = [output / path.relative_to(beside) for path in (*paths, beside / MODEL)]
        (output / comparison_figures.FOLDER).mkdir(exist_ok=True)
        for path in written:
            (beside / path.relative_to(output)).replace(path)
    # What an earlier comparison had to show, and this one has not, would speak of other measurements.
    for path in (output / known for known in comparison_page.FILES):
        if path not in written:
            path.unlink(missing_ok=True)
    return written


def compute(client: Client | None, comparison: Comparison, belief: Belief) -> Assessment:
    """Return everything that is known of how a model and a campaign agree.

    belief: what is known of the model's parameters before the campaign.
    """
    model = comparison.model
    before = belief.about(model)
    first = spread_parts(
        client,
        {
            "calibrated": [Job(name="calibration", call=partial(calibrate, comparison, start=before.estimate))],
            "described": [Job(name="model as described", call=partial(as_described, comparison, belief))],
            "held_out": held_out_jobs(comparison, before.estimate),
            "lobes": lobe_jobs(model, before.sure(), "lobes as described"),
        },
    )
    (fit,), (described,) = first["calibrated"], first["described"]
    known = fitted(fit)
    parameters = [p.name for p in model.parameters if p.touches != "measurement"]
    second = spread_parts(
        client,
        {
            "intervals": [Job(name=f"interval of {p}", call=partial(interval, comparison, fit, p)) for p in parameters],
            "lobes": lobe_jobs(model, known, "lobes as calibrated"),
        },
    )
    return assess(
        comparison,
        described=(described, before, first["lobes"]),
        refitted=(fit, known, second["lobes"]),
        held_out=first["held_out"],
        intervals=dict(zip(parameters, second["intervals"], strict=True)),
    )
