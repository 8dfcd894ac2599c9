"""What is missing in a model, from a campaign: the verb."""

from pathlib import Path

from pydantic import Field
from threadpoolctl import threadpool_limits

from pipeline import diagnosis_page
from pipeline.campaigns import CampaignOptions, cluster_of, options_of, read
from pipeline.cluster import open_client
from pipeline.configuration import EFFECTS, make_folder, sort_words
from pipeline.diagnosis import check_enough, diagnose, with_pictures


class DiagnoseOptions(CampaignOptions):
    """What ``diagnose`` takes."""

    output: Path | None = Field(default=None, description="folder for the answer")


def run(words: list[str]) -> int:
    """Diagnose a campaign and write what was found; return the exit code."""
    sorted_words = sort_words(words, (*DiagnoseOptions.model_fields, EFFECTS))
    options = options_of(sorted_words, DiagnoseOptions, "diagnose")
    assert isinstance(options, DiagnoseOptions)
    cluster = cluster_of(sorted_words)
    name = options.campaign.resolve().name
    output = options.output or Path("results") / f"diagnose-{name}"
    with threadpool_limits(1):
        model, belief, content = read(options, sorted_words)
        check_enough(model)
        make_folder(output)
        with open_client(cluster) as client:
            found = with_pictures(client, diagnose(client, model, belief, content))
        written = diagnosis_page.write(found, name, output)
    print(diagnosis_page.summary(found))
    for path in written:
        print(f"written: {path}")
    return 0
