"""The main job: a grid of operating points into a store."""

from pipeline.configuration import BASES, compose_settings, sort_words
from pipeline.execution import execute_words
from pipeline.places import LOBES
from pipeline.verbs.studies import SweepOptions

#: Words of a sweep beside those of its study.
OPTIONS = tuple(SweepOptions.fields())


def run(words: list[str]) -> int:
    """Run a sweep from the words of a command line; return the exit code."""
    sorted_words = sort_words(words, OPTIONS)
    options = SweepOptions.read(sorted_words.options)
    if "base" in sorted_words.options:
        sorted_words.values.append(f"grid.modal_parameters=[{BASES[options.base]}]")
    settings = compose_settings(sorted_words)
    retry = options.retry_failed == "true"
    return execute_words(settings, sorted_words, words, root=LOBES, retry_failed=retry)
