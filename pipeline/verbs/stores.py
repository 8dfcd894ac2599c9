"""Verbs that look at a study which is there already."""

from pydantic import Field

from pipeline.verbs.options import DirectoryPath, PlaceOptions, Truth

OVERNIGHT = "results/overnight-1234abcd"


class ReportOptions(PlaceOptions):
    """Write tables, figures and report of a computed study again."""

    examples = (f"report output={OVERNIGHT}", "report store=s3://bucket/machines/first")


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
