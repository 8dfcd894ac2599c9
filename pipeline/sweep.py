"""The main job: a grid of operating points into a store."""

from pipeline import places
from pipeline.configuration import EFFECTS, EFFECTS_PATH, compose_settings, modal_parameters_of, sort_words
from pipeline.execution import execute_words
from pipeline.places import LOBES

OPTIONS = (*places.OPTIONS, "retry_failed", EFFECTS, EFFECTS_PATH, "base")


def run(words: list[str]) -> int:
    """Run a sweep from the words of a command line; return the exit code."""
    sorted_words = sort_words(words, OPTIONS)
    if "base" in sorted_words.options:
        bearings = modal_parameters_of(sorted_words.options["base"])
        sorted_words.values.append(f"grid.modal_parameters=[{bearings}]")
    settings = compose_settings(sorted_words)
    return execute_words(settings, sorted_words.options, words, root=LOBES)
