"""Effects with values: from plain data, as a yaml says it, to the stages of a machine."""

import itertools
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chatter_core.effects._base import Effect
from chatter_core.effects._finding import effect_class
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.reading import nearest, shown
from chatter_core.stages import Stages, stages_of


@dataclass(frozen=True, kw_only=True)
class ActiveEffect:
    """An effect with the values of its parameters, in the units of their names."""

    effect: Effect
    values: tuple[float, ...]

    def apply(self, stages: Stages) -> Stages:
        """Return the stages as the effect makes them; raises InvalidInput where it cannot act on the machine."""
        self.effect.require(stages.machine)
        return self.effect.apply(stages, np.array(self.values))


def activate(name: str, data: Mapping[str, Any], own: Path | None = None) -> ActiveEffect:
    """Return an effect with the parameters and settings that ``data`` says, all of them and no others.

    A parameter that says nothing with what is chosen may be left out, or stand there at its null.

    own: a user's folder in which it may be found.

    Raises InvalidInput with every finding, each naming ``effects.NAME.KEY``.

    See docs/physics.md#effects.
    """
    kind = effect_class(name, own)
    keys = [*(parameter.name for parameter in kind.declared), *(setting.name for setting in kind.settings)]
    problems = [f"effects.{name}.{key}: unknown key; {nearest(str(key), keys)}" for key in data if key not in keys]
    chosen, wrong = _chosen(kind, data)
    # Of choices that are wrong nobody knows what they would leave unused.
    perhaps = {name for setting in kind.settings for names in setting.unused.values() for name in names}
    unused = perhaps if chosen is None else chosen.unused
    for parameter in kind.declared:
        key = f"effects.{name}.{parameter.name}"
        if parameter.name in data:
            found = data[parameter.name]
            problems += _problems(key, parameter, found) or _idle(key, parameter, found, chosen)
        elif parameter.name not in unused:
            problems.append(f"{key}: missing; needed: {parameter.doc}")
    problems += wrong
    if chosen is None or problems:
        raise InvalidInput(problems)
    return ActiveEffect(effect=chosen, values=tuple(float(data[parameter.name]) for parameter in chosen.used))


def _chosen(kind: type[Effect], data: Mapping[str, Any]) -> tuple[Effect | None, list[str]]:
    """Return an effect with the settings that ``data`` says, and what is wrong with them."""
    missing = [setting for setting in kind.settings if setting.name not in data]
    if missing:
        return None, [f"effects.{kind.name()}.{one.name}: missing; needed: {one.doc}" for one in missing]
    try:
        return kind(**{setting.name: data[setting.name] for setting in kind.settings}), []
    except InvalidInput as error:
        return None, error.problems


def _idle(key: str, parameter: Parameter, value: float, chosen: Effect | None) -> list[str]:
    """Return what is wrong with a value of a parameter that says nothing with what is chosen."""
    if chosen is None or parameter.name not in chosen.unused or value == parameter.null:
        return []
    found = f"{value:g}, which says nothing with {chosen.what_is_chosen}"
    return [f"{key}: found {found}; allowed: {parameter.null:g}, or none"]


def _problems(key: str, parameter: Parameter, value: Any) -> list[str]:
    """Return what is wrong with a parameter's value."""
    unit = f" {parameter.unit}" if parameter.unit else ""
    allowed = f"{parameter.lower:g} to {parameter.upper:g}{unit}"
    # A whole number may be too large for a float, and is compared all the same.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) <= sys.float_info.max:
        return [f"{key}: found {shown(value)}, allowed: a number, {allowed}"]
    if not parameter.lower <= value <= parameter.upper:
        return [f"{key}: found {value:g}{unit}, allowed: {allowed}"]
    return []


def apply_effects(model: Machine | Stages, effects: Iterable[ActiveEffect]) -> Stages:
    """Return the stages of a model with effects, along the chain and by name, however they are listed.

    On an arrow users' own act after the program's, which know what they find there.

    Raises InvalidInput when an effect stands twice, or when the machine lacks what one acts on.

    See docs/physics.md#effects.
    """
    stages, ordered = stages_of(model), sorted(effects, key=lambda active: active.effect.place())
    for one, other in itertools.pairwise(ordered):
        if one.effect.name() == other.effect.name():
            raise InvalidInput([f"effects: {one.effect.name()} stands twice"])
    for active in ordered:
        stages = active.apply(stages)
    return stages


def variants(name: str, own: Path | None = None) -> tuple[Effect, ...]:
    """Return an effect once for every combination of what its settings allow, for whoever tries them all.

    own: a user's folder in which it may be found.

    See docs/physics.md#effects.
    """
    kind = effect_class(name, own)
    choices = itertools.product(*(setting.choices for setting in kind.settings))
    names = [setting.name for setting in kind.settings]
    return tuple(kind(**dict(zip(names, chosen, strict=True))) for chosen in choices)


def null_values(effect: Effect) -> Array:
    """Return the values (parameter,) at which the model is as it was.

    See docs/physics.md#effects.
    """
    return np.array([parameter.null for parameter in effect.used])
