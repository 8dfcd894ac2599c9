"""Data sets and parameter studies: machines and cuts of a design, each with its limit depths over speed."""

from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from chatter_core.errors import InvalidInput
from chatter_core.reading import load_value, load_yaml, shown
from pipeline.configuration import compose_settings, sort_words
from pipeline.design import DatasetSettings, varied_of
from pipeline.execution import execute_words
from pipeline.places import DATASET
from pipeline.verbs.studies import FORMULA, VARY, DatasetOptions

SECONDS_AN_HOUR = 3600.0


class OwnWords(NamedTuple):
    """Words of a command line by what they say of a design, and the ones that every verb may have."""

    varied: dict[str, str]
    formulas: dict[str, str]
    design: Path | None
    others: list[str]


def run(words: list[str]) -> int:
    """Compute a data set from the words of a command line; return the exit code."""
    own = own_words(words)
    sorted_words = sort_words(own.others, DatasetOptions.fields())
    options = DatasetOptions.read(sorted_words.options)
    changes = {} if own.design is None else {"design": load_yaml(own.design)}
    settings = compose_settings(
        sorted_words, DatasetSettings, changes, partial(_let_vary, varied=own.varied, formulas=own.formulas)
    )
    budget = None if options.budget_hours is None else SECONDS_AN_HOUR * options.budget_hours
    retry = options.retry_failed == "true"
    return execute_words(settings, sorted_words, words, root=DATASET, retry_failed=retry, budget=budget)


def own_words(words: list[str]) -> OwnWords:
    """Sort out the words that only this verb knows; of several files of designs the last one counts."""
    varied, words = _taken(VARY, words)
    formulas, words = _taken(FORMULA, words)
    files = [word for word in words if word.startswith("design=") and word.endswith((".yaml", ".yml"))]
    design = Path(files[-1].removeprefix("design=")) if files else None
    return OwnWords(varied, formulas, design, [word for word in words if word not in files])


def _taken(first: str, words: list[str]) -> tuple[dict[str, str], list[str]]:
    """Return what words with such a beginning say, by their keys, and the words without them."""
    own = [word for word in words if word.startswith(first) and "=" in word]
    said = dict(word.removeprefix(first).split("=", 1) for word in own)
    return said, [word for word in words if word not in own]


def _let_vary(data: dict[str, Any], varied: dict[str, str], formulas: dict[str, str]) -> None:
    """Put what ``vary.KEY=VALUE`` and ``formula.KEY=FORMULA`` words say into a design.

    What varies takes the place of all that varied before, and of its formulas; formulas alone come to those there are.

    Raises InvalidInput for a value that is no distribution and no list.
    """
    design = data.get("design") or {}
    if varied:
        data["design"] = {**design, "machine": {"vary": _levels(varied), "formulas": formulas}, "cut": {}}
    elif formulas:
        machine = design.get("machine") or {}
        data["design"] = {**design, "machine": {**machine, "formulas": {**(machine.get("formulas") or {}), **formulas}}}


def _levels(varied: dict[str, str]) -> dict[str, Any]:
    levels, problems = dict[str, Any](), []
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
    return {key: varied_of(one) for key, one in levels.items()}
