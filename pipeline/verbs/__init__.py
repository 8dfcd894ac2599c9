"""Verbs of the command line: what each does, its options and examples, declared once for all who need them.

The verb NAME is carried out by the function ``run`` of the module ``pipeline.NAME``. Nothing here imports what
computes: help and completion have the time of a key stroke.
"""

from pipeline.verbs.campaigns import (
    CompareOptions,
    DiagnoseOptions,
    IdentifyOptions,
    ImproveOptions,
    PredictOptions,
    TemplateOptions,
)
from pipeline.verbs.options import Options
from pipeline.verbs.stores import (
    ContrastOptions,
    JournalOptions,
    PackOptions,
    ReportOptions,
    StatusOptions,
    VerifyOptions,
)
from pipeline.verbs.studies import DatasetOptions, PaperOptions, PointOptions, SweepOptions

#: What a word that stands where a verb does, and is none, answers.
ANSWERS = {
    "help": "help VERB, or VERB --help: what a verb does, its options with choices and defaults, examples",
    "completion": "completion bash|zsh|fish: what makes a shell complete the words of this program",
    "version": "the program's version, and those of what its numbers depend on",
}
VERBS: dict[str, type[Options]] = {
    kind.verb(): kind
    for kind in (
        SweepOptions,
        DatasetOptions,
        PointOptions,
        CompareOptions,
        DiagnoseOptions,
        ImproveOptions,
        PredictOptions,
        IdentifyOptions,
        PaperOptions,
        TemplateOptions,
        ContrastOptions,
        ReportOptions,
        VerifyOptions,
        PackOptions,
        JournalOptions,
        StatusOptions,
    )
}
