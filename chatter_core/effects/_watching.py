"""Users' laws as the chain asks them: lent what they may read and not change, and watched in what they return.

A slip in a user's file is told with its file and line, as any other input that is not right; what goes wrong in the
program's own effects is a fault of the program, and stays one.
"""

from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from chatter_core.effects._values import wrong
from chatter_core.errors import OwnLawFails
from chatter_core.machine import Machine
from chatter_core.own_laws import told

if TYPE_CHECKING:
    from chatter_core.effects._base import Effect


def watched(effect: "Effect", before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
    """Return the stage as a user's effect makes it; whatever fails in the user's file is told with its line.

    Raises OwnLawFails where the law raises, now or when the chain asks it, writes into what it was given, or returns
    what no chain could use.

    See docs/physics.md#effects.
    """
    file, arrow = effect.own_file, effect.acts_on
    assert file is not None

    def lent(*arguments: Any) -> Any:
        return _shut(before(*map(_opened, arguments)))

    try:
        law = told(file, effect.transform, lent, machine, values)
    except OwnLawFails as failure:
        if not failure.hangs_on_values:
            raise
        # Whoever asks this arrow is told, and what does not hang on it has its answer.
        return partial(_raise, failure)
    if not callable(law):
        needed = "needed: a function as it was given"
        raise OwnLawFails([f"effects_path: {file}: transform returned {law!r}, {needed}"], hangs_on_values=False)

    def stage(*arguments: Any) -> Any:
        found = told(file, law, *(_shut(one) for one in arguments))
        if problem := told(file, wrong, arrow, found, arguments, before):
            raise OwnLawFails([f"effects_path: {file}: {arrow} returned {problem}"])
        return _opened(found)

    return stage


def _raise(failure: OwnLawFails, *arguments: Any) -> Any:
    raise failure


def _shut(value: Any) -> Any:
    """Return a value whose arrays cannot be written into."""
    return _mapped(value, lambda array: array.flags.writeable, _read_only)


def _opened(value: Any) -> Any:
    """Return a value whose arrays can be written into, as the chain's own can."""
    return _mapped(value, lambda array: not array.flags.writeable, lambda array: array.copy(order="K"))


def _read_only(array: Any) -> Any:
    view = array.view()
    view.flags.writeable = False
    return view


def _mapped(value: Any, concerned: Callable[[Any], bool], change: Callable[[Any], Any]) -> Any:
    """Return a value with some of its arrays changed, the value itself where none is."""
    if isinstance(value, np.ndarray):
        return change(value) if concerned(value) else value
    if isinstance(value, tuple):
        parts = tuple(_mapped_part(part, concerned, change) for part in value)
        return value if all(one is other for one, other in zip(parts, value, strict=True)) else parts
    if not is_dataclass(value) or isinstance(value, type):
        return value
    old = {field.name: getattr(value, field.name) for field in fields(value)}
    new = {name: _mapped_part(part, concerned, change) for name, part in old.items()}
    changed = {name: part for name, part in new.items() if part is not old[name]}
    return replace(value, **changed) if changed else value


def _mapped_part(part: Any, concerned: Callable[[Any], bool], change: Callable[[Any], Any]) -> Any:
    """Return a part as ``_mapped`` does; gains of the cut stay what they are, for compiled loops take their arrays."""
    return part if callable(part) else _mapped(part, concerned, change)
