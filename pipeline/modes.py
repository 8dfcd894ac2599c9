"""How many modes are asked for, told by the key that asks: the chain speaks of mode_count, whoever does."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from chatter_core.chain import structure
from chatter_core.effects import REFERENCE_SPEED
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine


@contextmanager
def modes_called(key: str) -> Iterator[None]:
    """Tell what is wrong with mode_count by another key."""
    try:
        yield
    except InvalidInput as error:
        raise InvalidInput([problem.replace("mode_count:", f"{key}:", 1) for problem in error.problems]) from None


def check_modes(machine: Machine, mode_count: int, key: str) -> None:
    """Raise InvalidInput where a machine has fewer modes than are asked for; whether it has hangs on no speed.

    What else is wrong with it is left to whoever computes it.
    """
    try:
        with modes_called(key):
            structure(machine, np.array([REFERENCE_SPEED]), mode_count=mode_count)
    except InvalidInput as error:
        if problems := [problem for problem in error.problems if problem.startswith(f"{key}:")]:
            raise InvalidInput(problems) from None
