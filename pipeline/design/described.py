"""A description with the numbers of a design in it: one machine, or one cut of it."""

from copy import deepcopy
from typing import Any

import numpy as np

from pipeline.design.expressions import formula
from pipeline.design.settings import Level
from pipeline.keys import put

Description = dict[str, Any]


def described(base: Description, level: Level, numbers: np.ndarray) -> Description:
    """Return a description with drawn numbers (key,) of a level put in, and its formulas computed.

    base: nested plain data, the parts of a machine and ``effects``. Raises ValueError, in one sentence naming the key.
    """
    found = deepcopy(base)
    for (key, varied), number in zip(level.vary.items(), numbers, strict=True):
        _put(found, key, varied.value(float(number)))
    for key, text in level.formulas.items():
        try:
            value = formula(text).number(found)
        except ValueError as error:
            raise ValueError(f"formulas.{key}: {error}") from None
        _put(found, key, value)
    return found


def satisfies(description: Description, level: Level) -> bool:
    """Return whether a description satisfies the constraints of a level; raise ValueError for one that says nothing."""
    return all(formula(text).holds(description) for text in level.constraints)


def _put(description: Description, key: str, value: Any) -> None:
    try:
        put(description, key, value)
    except ValueError as error:
        raise ValueError(f"{key} cannot be put there: {error}") from None
