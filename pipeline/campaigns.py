"""What the verbs that take a campaign have in common: options, reading, and what the reader says."""

from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.evidence import Campaign, CampaignModel, base_model, read_campaign
from chatter_core.evidence.belief import Belief
from chatter_core.reading import sentences, shown
from pipeline import model_file
from pipeline.configuration import Words, compose_settings
from pipeline.settings import Cluster


class CampaignOptions(BaseModel):
    """Which campaign, seen through which model."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    campaign: Path = Field(description="folder of the campaign")
    model: Path | None = Field(default=None, description="calibrated model; without it machine.yaml as it stands")


def options_of(words: Words, kind: type[CampaignOptions], verb: str) -> CampaignOptions:
    """Return the options of a verb.

    Raises InvalidInput for a missing or wrong option, and for words that belong to other verbs: the campaign's
    own machine is taken.
    """
    foreign = [*(key for key in words.choices if key != "cluster"), *(["machine"] if words.machine_file else [])]
    foreign += [word.partition("=")[0] for word in words.values if not word.startswith("cluster.")]
    problems = [f"{key}: is empty; allowed: a path" for key, value in words.options.items() if not value]
    if problems:
        raise InvalidInput(problems)
    if foreign:
        raise InvalidInput([f"{word}: not for {verb}, which takes the campaign's own machine.yaml" for word in foreign])
    try:
        return kind.model_validate(words.options)
    except ValidationError as error:
        raise InvalidInput(sentences(error, kind)) from None


def cluster_of(words: Words) -> Cluster:
    """Return where the verb's work is computed."""
    return compose_settings(words).cluster


def read(options: CampaignOptions) -> tuple[CampaignModel, Belief]:
    """Return the campaign's model with what is known of its parameters, and tell what the reader found odd.

    Raises InvalidInput with the findings of all files.
    """
    campaign = read_campaign(options.campaign)
    model = base_model(campaign)
    belief = model_file.belief_of(options.model, model)
    for line in remarks(campaign):
        print(line)
    return model, belief


def remarks(campaign: Campaign) -> list[str]:
    """Return what the reader of a campaign has to tell."""
    told = [f"remark: {remark}" for remark in campaign.remarks]
    return told + [f"unknown column, not used: {shown(column)}" for column in campaign.unknown_columns]
