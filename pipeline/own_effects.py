"""Effects of the user's own before anything is fitted: their yaml is read, and each law is tried once."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from chatter_core.effects import Effect, activate
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Comparison
from chatter_core.evidence.candidates import Candidate, extended
from pipeline.configuration import configured_values

#: An effect of the user's own that leaves more than this share of the data without an answer is no law of theirs.
MOST_LOST = 0.5


def check_own(comparison: Comparison, candidates: Sequence[Candidate]) -> None:
    """Raise InvalidInput where an effect of the user's own fails, or leaves most data without an answer.

    Every one is tried before anything is fitted, so that a slip in its files is told at once.
    """
    own = [(one, one.term.own_file) for one in candidates if isinstance(one.term, Effect) and one.term.own_file]
    _check_values(file for _, file in own)
    strict = replace(comparison, model=replace(comparison.model, forgiving=False))
    before, problems = strict.compare(strict.model.nulls).prediction if own else None, []
    for one, file in own:
        assert before is not None
        tried, raised = extended(strict, [one]), {p.name: p.aside(1.0) for p in one.amplitudes}
        values = [raised.get(p.name, p.null) for p in tried.parameters]
        lost = tried.compare(np.array(values)).prediction.failed - before.failed
        if lost > MOST_LOST * before.asked:
            sizes = ", ".join(f"{name} {value:g}" for name, value in raised.items())
            problems.append(f"effects_path: {file}: at {sizes} it leaves {lost} data without an answer")
    if problems:
        raise InvalidInput(problems)


def _check_values(files: Iterable[Path]) -> None:
    """Raise InvalidInput with what is wrong in the yaml beside each of these files."""
    problems = []
    for file in sorted({*files}):
        name, values = file.stem, file.with_suffix(".yaml")
        try:
            activate(name, configured_values(name, file.parent), file.parent)
        except InvalidInput as error:
            told = [problem.removeprefix(f"effects.{name}.") for problem in error.problems]
            problems += [one if str(values) in one else f"{values}: {one}" for one in told]
    if problems:
        raise InvalidInput(problems)
