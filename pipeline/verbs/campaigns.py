"""Verbs of a measurement campaign: lay one out, read modes from it, judge a model by it, predict with a model."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, ClassVar, Self

from pydantic import Field, model_validator

from pipeline.verbs.options import MACHINE, BaseOptions, CsvPath, DirectoryPath, Options, YamlPath

MODEL = "calibrated model, which compare, diagnose and improve write; without it machine.yaml as it stands"


class CampaignOptions(BaseOptions):
    """Which campaign, seen through which model."""

    groups: ClassVar[tuple[str, ...]] = ("cluster",)

    campaign: DirectoryPath = Field(description="folder of the campaign")
    model: YamlPath | None = Field(default=None, description=MODEL)
    modes: int | None = Field(default=None, ge=1, le=100, description="modes of each axis that the base model keeps")


class JudgingOptions(CampaignOptions):
    """Which campaign, seen through which model, and where the answer goes."""

    output: DirectoryPath | None = Field(default=None, description="folder for the answer")


class CompareOptions(JudgingOptions):
    """Hold a model against a campaign: how good it is, as described and calibrated, and where it fails.

    Writes a page with pictures, comparison.json, a table of the trials, and the calibrated model, model.yaml.
    """

    examples = (
        "compare campaign=my_campaign",
        "compare campaign=my_campaign model=results/improved/model.yaml",
        "compare campaign=my_campaign 'effects=[process_damping]' base=static_bearing",
    )


class DiagnoseOptions(JudgingOptions):
    """Tell which physical effect is missing in a model, by a campaign.

    Writes a page with pictures, diagnosis.json, a table of what the measurements could have shown, and model.yaml.
    """

    examples = (
        "diagnose campaign=my_campaign",
        "diagnose campaign=my_campaign effects_path=my_effects",
        "diagnose campaign=my_campaign cluster=threads format=json",
    )


class ImproveOptions(JudgingOptions):
    """Diagnose, add what is missing, calibrate again, until nothing more is supported.

    Writes model.yaml for predict, the diagnoses, history.csv and a picture of the falling error.
    """

    examples = (
        "improve campaign=my_campaign output=results/improved",
        "improve campaign=docs/examples/paper_campaign base=static_bearing modes=1",
    )


class PredictOptions(CampaignOptions):
    """Tell what a model says of cuts that are planned: a table of them, with what is predicted beside it."""

    examples = (
        "predict campaign=my_campaign model=model.yaml trials=plan.csv predictions=out.csv",
        "predict campaign=my_campaign trials=plan.csv predictions=out.csv quiet=true",
    )
    groups: ClassVar[tuple[str, ...]] = ()
    instead: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"output": "not for predict, which writes one table and no folder; name it by predictions=FILE.csv"}
    )

    trials: CsvPath = Field(description="table of planned cuts: as stability.csv, but not judged")
    predictions: CsvPath = Field(description="table to write")


class IdentifyOptions(Options):
    """Identify tip modes in measured receptances, as a machine file with uncertainties."""

    examples = (
        "identify frf=path/to/frf.csv machine=path/to/machine.yaml output=machine_tip.yaml",
        "identify frf=path/to/frf.uff modes=3 highest_frequency_hz=4000",
        "identify campaign=my_campaign output=machine_tip.yaml",
    )
    groups: ClassVar[tuple[str, ...]] = MACHINE

    frf: Annotated[Path, "FILE.csv|FILE.uff"] | None = Field(
        default=None, description="file of receptances at the tool tip, CSV or universal"
    )
    campaign: DirectoryPath | None = Field(default=None, description="folder of a campaign, with its machine")
    modes: int | None = Field(default=None, ge=1, description="modes of every receptance")
    lowest_frequency_hz: float = Field(default=0.0, ge=0, le=1e6, description="lines below are left out")
    highest_frequency_hz: float = Field(default=1e6, gt=0, le=1e6, description="lines above are left out")
    output: YamlPath = Field(default=Path("results/identify/machine_tip.yaml"), description="machine file to write")

    @model_validator(mode="after")
    def _is_a_band(self) -> Self:
        if self.lowest_frequency_hz >= self.highest_frequency_hz:
            raise ValueError(
                f"lowest_frequency_hz: found {self.lowest_frequency_hz:g}, allowed: less than highest_frequency_hz, "
                f"which is {self.highest_frequency_hz:g}"
            )
        return self


class TemplateOptions(Options):
    """Write an empty measurement campaign to fill in, every file, key and column explained."""

    examples = ("template output=my_campaign", "template output=campaigns/lathe_hall/2026_11 quiet=true")

    output: DirectoryPath = Field(description="a new folder for the campaign")
