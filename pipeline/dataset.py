"""Data sets and parameter studies: machines and cuts of a design, each with its limit depths over speed."""

from pathlib import Path
from typing import Any

from chatter_core.errors import InvalidInput
from chatter_core.reading import load_value, load_yaml, shown
from pipeline.configuration import compose_settings, sort_words
from pipeline.design import DatasetSettings, varied_of
from pipeline.execution import execute_words
from pipeline.places import DATASET
from pipeline.verbs.studies import VARY, DatasetOptions

SECONDS_AN_HOUR = 3600.0


def run(words: list[str]) -> int:
    """Compute a data set from the words of a command line; return the exit code."""
    varied = dict(word.removeprefix(VARY).split("=", 1) for word in words if word.startswith(VARY) and "=" in word)
    files = [word for word in words if word.startswith("design=") and word.endswith((".yaml", ".yml"))]
    others = [word for word in words if word not in files and not (word.startswith(VARY) and "=" in word)]
    sorted_words = sort_words(others, DatasetOptions.fields())
    options = DatasetOptions.read(sorted_words.options)
    changes = {"design": load_yaml(Path(files[-1].removeprefix("design=")))} if files else {}
    settings = compose_settings(sorted_words, DatasetSettings, changes, lambda data: _let_vary(data, varied))
    budget = None if options.budget_hours is None else SECONDS_AN_HOUR * options.budget_hours
    retry = options.retry_failed == "true"
    return execute_words(settings, sorted_words, words, root=DATASET, retry_failed=retry, budget=budget)


def _let_vary(data: dict[str, Any], varied: dict[str, str]) -> None:
    """Put what ``vary.KEY=VALUE`` words say into a design; it takes the place of what varied before.

    Raises InvalidInput for a value that is no distribution and no list.
    """
    if not varied:
        return
    levels, problems = {}, []
    for key, text in varied.items():
        try:
            levels[key] = load_value(text)
        except ValueError as error:
            problems.append(f"{VARY}{key}: found {shown(text)}: {error}")
            continue
        if not isinstance(levels[key], list | dict):
            problems.append(f"{VARY}{key}: found {shown(text)}, allowed: a list of values, or a distribution")
    if problems:
        raise InvalidInput(problems)
    design = data.get("design") or {}
    data["design"] = {**design, "machine": {"vary": {key: varied_of(one) for key, one in levels.items()}}, "cut": {}}
