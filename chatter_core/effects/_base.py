"""What every effect is: parameters, settings, one stage of the chain, and one pure method that transforms it."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

from chatter_core.cards import Card, ShownAsCard
from chatter_core.effects._watching import watched
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.own_laws import told
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import ARROWS, Stages
from chatter_core.units import si_factor

#: Spindle speed at which effects that change with speed have their stated size: 10 000 rpm [rad/s].
REFERENCE_SPEED = 10_000.0 * 2.0 * math.pi / 60.0


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A choice that is not fitted: its name, meaning, and what may be chosen. A diagnosis tries each.

    unused: by choice, names of the parameters that say nothing with it.
    """

    name: str
    doc: str
    choices: tuple[str | int, ...]
    unused: Mapping[str | int, tuple[str, ...]] = field(default_factory=dict, hash=False)


@dataclass(frozen=True, kw_only=True)
class Scan:
    """Values of a parameter, in the unit of its name, that a diagnosis looks at one by one.

    For effects of which one value says nothing about the next: where the data see a mode only beside its frequency, or
    teeth only where their delays come around again. What counts then is by how much of a wave on the surface they
    differ: ``waves`` says for how many between two teeth the values are told, and none that their number is no matter.
    shapes: values of the effect's first shape, each of which each value of a strength is looked at with, and with no
    others; empty where shapes are looked at with a few strengths, as they are of what is not scanned.
    """

    parameter: str
    values: tuple[float, ...]
    waves: float | None = None
    shapes: tuple[float, ...] = ()

    def with_waves(self, waves: float) -> tuple[float, ...]:
        """Return the values for cuts with so many waves between two teeth: where there are fewer, farther apart."""
        apart = 1.0 if self.waves is None else max(self.waves / waves, 1.0)
        found = tuple(apart * value for value in self.values if min(self.values) <= apart * value <= max(self.values))
        return found or (max(self.values, key=abs),)


@dataclass(frozen=True, kw_only=True)
class Effect(ShownAsCard, ABC):
    """An effect: a frozen class of its settings, with a law that transforms one arrow of the chain.

    stage: the field of ``Stages`` that it transforms, see ``acts_on``; declared: its parameters, in the units of their
    names; shapes: names of those that say how the effect looks and not how strong it is; heard: the one of them that is
    a frequency [Hz] at which the effect makes cuts chatter, if any; scan: where it is looked for, if it takes more than
    a few strengths and shapes; settings: its choices, each an attribute of the
    class; needs: what of a machine it acts on; changes: what a strong value changes, of ``bearing``, ``modes`` (at the
    tip), ``cut`` (the multipliers). What is not named stays bit for bit. own_file: the file of a user's own effect.
    """

    stage: ClassVar[str]
    declared: ClassVar[tuple[Parameter, ...]]
    shapes: ClassVar[tuple[str, ...]] = ()
    heard: ClassVar[str | None] = None
    scan: ClassVar[Scan | None] = None
    settings: ClassVar[tuple[Setting, ...]] = ()
    needs: ClassVar[tuple[str, ...]] = ()
    changes: ClassVar[tuple[str, ...]]
    own_file: ClassVar[Path | None] = None

    def __post_init__(self) -> None:
        for setting in self.settings:
            found = getattr(self, setting.name)
            if found not in setting.choices or isinstance(found, bool):
                allowed = ", ".join(str(choice) for choice in setting.choices)
                raise InvalidInput([f"effects.{self.name()}.{setting.name}: found {found!r}, allowed: {allowed}"])

    def card(self) -> Card:
        """Return its stage, what was chosen, and its parameters with their bounds."""
        chosen = f", {self.what_is_chosen}" if self.settings else ""
        rows = tuple((one.name, one.doc, f"{one.lower:g} to {one.upper:g}", f"{one.null:g}") for one in self.used)
        columns = ("parameter", "meaning", "bounds", "without the effect")
        return Card(title=f"{self.name()}, on {self.acts_on}{chosen}", rows=rows, columns=columns)

    @classmethod
    def name(cls) -> str:
        """Return the effect's name: that of its file."""
        return cls.__module__.rpartition(".")[2]

    @property
    def acts_on(self) -> str:
        """The field of ``Stages`` that it transforms: its class's, unless a setting chooses another."""
        return self.stage

    @property
    def what_is_chosen(self) -> str:
        """What was chosen, as a command line says it."""
        return ", ".join(f"{setting.name}={getattr(self, setting.name)}" for setting in self.settings)

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of the parameters that say nothing with what is chosen."""
        return tuple(name for one in self.settings for name in one.unused.get(getattr(self, one.name), ()))

    @property
    def used(self) -> tuple[Parameter, ...]:
        """The declared parameters that say something with what is chosen."""
        unused = self.unused
        return tuple(parameter for parameter in self.declared if parameter.name not in unused)

    def place(self) -> tuple[int, bool, str]:
        """Return what effects are sorted by: the place of their stage, the user's own after the others, their name."""
        return ARROWS.index(self.acts_on), self.own_file is not None, self.name()

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those used, named with the effect's name in front: no two effects share one."""
        return tuple(replace(parameter, name=f"{self.name()}.{parameter.name}") for parameter in self.used)

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages with its own transformed, at values (parameter,) in the units of their names.

        Where nothing but the shape differs from the nulls the stages are returned as they are.

        Raises InvalidInput when the machine lacks what the effect acts on, or where a user's own law fails.
        """
        self._require_parts(stages.machine)
        pairs = list(zip(self.used, values, strict=True))
        if all(value == parameter.null for parameter, value in pairs if parameter.name not in self.shapes):
            return stages
        in_si = tuple(float(value) * si_factor(parameter.name) for parameter, value in pairs)
        before = getattr(stages, self.acts_on)
        if self.own_file is None:
            return replace(stages, **{self.acts_on: self.transform(before, stages.machine, in_si)})
        law, files = watched(self, before, stages.machine, in_si), (*stages.own_files, self.own_file)
        return replace(stages, own_files=files, **{self.acts_on: law})

    def require(self, machine: Machine) -> None:
        """Raise InvalidInput, naming what is missing, where the effect cannot act on a machine as described."""
        self._require_parts(machine)
        if self.own_file is None:
            self._check(machine)
        else:
            told(self.own_file, self._check, machine)

    def _require_parts(self, machine: Machine) -> None:
        missing = [part for part in self.needs if getattr(machine, part) is None]
        if missing:
            what = " and ".join(missing)
            raise InvalidInput([f"effects.{self.name()}: acts on {what}; this machine has measured tip modes instead"])

    def _check(self, machine: Machine) -> None:  # most effects act on any machine with these parts
        """Raise InvalidInput where the effect cannot act on a machine that has all the parts it needs."""

    def is_superfluous(self, machine: Machine) -> bool:  # most settings differ on any machine
        """Return whether a diagnosis can do without it on a machine: another choice of its settings says as much."""
        return False

    @abstractmethod
    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the stage as the effect makes it from what it was; values: of those used, as declared, in SI."""
