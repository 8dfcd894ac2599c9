"""Verbs that look at a study which is there already."""

from pydantic import Field

from pipeline.verbs.options import DirectoryPath, MarginOptions, PlaceOptions, StudyPlace, Truth

OVERNIGHT = "results/overnight-1234abcd"


class ReportOptions(MarginOptions, PlaceOptions):
    """Write tables, figures and report of a computed study again."""

    examples = (f"report output={OVERNIGHT}", "report store=s3://bucket/machines/first")


class ContrastOptions(MarginOptions):
    """Hold two studies against each other: what was asked otherwise, and how the boundary moved.

    Two sweeps, or two data sets of one design. Writes a page, a figure and tables.
    """

    examples = (
        "contrast first=results/smoke-1234abcd second=results/smoke-5678abcd",
        "contrast first=results/before second=s3://bucket/machines/after output=results/contrast",
    )

    first: StudyPlace = Field(description="the study that is the measure: its folder, or its address")
    second: StudyPlace = Field(description="the study that is held against it")
    output: DirectoryPath | None = Field(default=None, description="folder for the answer")


class StatusOptions(PlaceOptions):
    """Tell how far a study is that is being computed, or was: done, failed, rate, time left."""

    examples = (f"status output={OVERNIGHT}", f"status output={OVERNIGHT} format=json")


class JournalOptions(PlaceOptions):
    """Tell what happened in the runs of a study, in sentences: begun, stopped, failed and why."""

    examples = (f"journal output={OVERNIGHT}", f"journal output={OVERNIGHT} format=json")


class VerifyOptions(PlaceOptions):
    """Read every byte of a computed study back, name what is damaged, and make it anew with repair=true."""

    examples = (f"verify output={OVERNIGHT}", f"verify output={OVERNIGHT} repair=true")

    repair: Truth = Field(default="false", description="what is damaged is made anew")
    effects_path: DirectoryPath | None = Field(
        default=None, description="folder with effects of your own that the study has; what lies there is run"
    )


class PackOptions(PlaceOptions):
    """Put a finished study's chunks into few files, each still with its own checksum."""

    examples = (f"pack output={OVERNIGHT}", f"pack output={OVERNIGHT} quiet=true")
