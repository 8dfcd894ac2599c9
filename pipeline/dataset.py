"""Data sets and parameter studies: machines and cuts of a design, each with its limit depths over speed."""

from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.reading import load_value, load_yaml, sentences, shown
from pipeline.configuration import compose_settings, repeated, words_for
from pipeline.design import CUT_PARTS, DatasetSettings, Level, first_of_cuts, varied_of
from pipeline.execution import execute_words
from pipeline.idle_effects import remark_idle
from pipeline.keys import parts_of
from pipeline.places import DATASET
from pipeline.verbs.options import no_address
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
    sorted_words = words_for(DatasetOptions, own.others)
    options = DatasetOptions.read(sorted_words.options)
    changes = {} if own.design is None else {"design": load_yaml(own.design)}
    settings = compose_settings(
        sorted_words, DatasetSettings, changes, partial(_let_vary, varied=own.varied, formulas=own.formulas)
    )
    design = settings.design
    remark_idle(
        settings.effects,
        at_rest=design.modal_parameters == "static",
        modes=design.mode_count,
        rest="design.modal_parameters=static",
        count="design.mode_count",
    )
    budget = None if options.budget_hours is None else SECONDS_AN_HOUR * options.budget_hours
    wanted = {"retry_failed": options.retry_failed == "true", "report": options.report == "true"}
    return execute_words(settings, sorted_words, words, root=DATASET, budget=budget, **wanted)


def own_words(words: list[str]) -> OwnWords:
    """Sort out the words that only this verb knows.

    Raises InvalidInput for a design that is an address, and for what is said twice.
    """
    if problems := repeated(words):
        raise InvalidInput(problems)
    varied, words = _taken(VARY, words)
    formulas, words = _taken(FORMULA, words)
    files = [word for word in words if word.startswith("design=") and word.endswith((".yaml", ".yml"))]
    named = files[0].removeprefix("design=") if files else ""
    if problems := no_address("design", named):
        raise InvalidInput(problems)
    design = Path(named) if named else None
    return OwnWords(varied, formulas, design, [word for word in words if word not in files])


def _taken(first: str, words: list[str]) -> tuple[dict[str, str], list[str]]:
    """Return what words with such a beginning say, by their keys, and the words without them."""
    own = [word for word in words if word.startswith(first) and "=" in word]
    said = dict(word.removeprefix(first).split("=", 1) for word in own)
    return said, [word for word in words if word not in own]


def _let_vary(data: dict[str, Any], varied: dict[str, str], formulas: dict[str, str]) -> None:
    """Put what ``vary.KEY=VALUE`` and ``formula.KEY=FORMULA`` words say into a design.

    What varies takes the place of all that varied before, and of its formulas; formulas alone come to those there are,
    of the cut where they name what differs from cut to cut.

    Raises InvalidInput for a value that is no distribution and no list, and for levels that are none.
    """
    design = data.get("design") or {}
    if varied:
        data["design"] = {**design, "machine": {"vary": _levels(varied), "formulas": formulas}, "cut": {}}
    elif formulas:
        data["design"] = _with_formulas(design, formulas)


def _with_formulas(design: dict[str, Any], formulas: dict[str, str]) -> dict[str, Any]:
    """Return a design with further formulas, each in the place of one of the same key."""
    levels = {name: _level(design, name) for name in ("machine", "cut")}
    of = {name: dict(level.formulas) for name, level in levels.items()}
    for key, text in formulas.items():
        here = "cut" if _is_of_cuts(key, text, (*levels["cut"].vary, *of["cut"])) else "machine"
        of["cut" if here == "machine" else "machine"].pop(key, None)
        of[here][key] = text
    return {**design, **{name: {**(design.get(name) or {}), "formulas": of[name]} for name in of}}


def _level(design: dict[str, Any], name: str) -> Level:
    """Return a level of a design that was not read as a whole yet; raise InvalidInput where it is none."""
    try:
        return Level.model_validate(design.get(name) or {})
    except ValidationError as error:
        raise InvalidInput([f"design.{name}: {sentence}" for sentence in sentences(error, Level)]) from None


def _is_of_cuts(key: str, text: str, of_cuts: tuple[str, ...]) -> bool:
    """Return whether a formula can be of a cut, and names what differs from cut to cut."""
    try:
        return parts_of(key)[0] in CUT_PARTS and first_of_cuts(text, of_cuts) is not None
    except ValueError:
        # No key, or no formula: told once the design is read as a whole.
        return False


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
