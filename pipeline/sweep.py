"""The main job: a grid of operating points into a store."""

from pipeline.configuration import compose_settings, modal_parameters_of, words_for
from pipeline.execution import execute_words
from pipeline.idle_effects import remark_idle
from pipeline.places import LOBES
from pipeline.verbs.studies import SweepOptions

#: The key that says what a base model says, too.
PARAMETERS = "grid.modal_parameters"


def run(words: list[str]) -> int:
    """Run a sweep from the words of a command line; return the exit code."""
    sorted_words = words_for(SweepOptions, words)
    options = SweepOptions.read(sorted_words.options)
    if "base" in sorted_words.options:
        beside = [word for word in sorted_words.values if word.startswith(PARAMETERS)]
        sorted_words.values.append(f"{PARAMETERS}=[{modal_parameters_of(options.base, beside)}]")
    settings = compose_settings(sorted_words)
    grid = settings.grid
    fewest = int(grid.mode_count.points()[0])
    remark_idle(settings.effects, at_rest="static" in grid.modal_parameters, modes=fewest, count="grid.mode_count")
    wanted = {"retry_failed": options.retry_failed == "true", "report": options.report == "true"}
    return execute_words(settings, sorted_words, words, root=LOBES, **wanted)
