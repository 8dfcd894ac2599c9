"""Modes above those that a model kept."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import Effect, Setting
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import KnownModes
from chatter_core.tip import TipModes, most_modes


@dataclass(frozen=True, kw_only=True)
class HigherModes(Effect):
    """H = sum over the kept modes + s sum over those up to ``modes`` on each axis: s = 1 restores them.

    Between 0 and 1 the share s multiplies their compliance, at the same frequency and damping; it is there so
    that the step from none to all has an amplitude. A model that kept so many modes already stays as it is.

    Source: the findings P8 of the paper on speed-dependent bearings and multiple modes (docs/physics.md, [P]).

    See docs/physics.md#higher-modes.
    """

    modes: int

    stage: ClassVar[str] = "tip_modes"
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(name="modes", doc="number of modes on each axis, with those restored", choices=(2, 3, 4, 6, 8)),
    )
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="share", unit="", doc="share of the higher modes' compliance that is there",
            prior_width=1.0, lower=0.0, upper=1.0,
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput where fewer modes were measured."""
        most = self.modes if machine.tip is None else most_modes(machine.tip)
        if self.modes > most:
            found = f"modes is {self.modes}, allowed: up to {most}, as many as were measured of an axis"
            raise InvalidInput([f"effects.{self.name()}: {found}"])

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the tip's modes with higher ones."""
        (share,) = values

        def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
            modes: TipModes = before(known, spindle_speed, max(mode_count, self.modes))
            factor = np.where(modes.label > mode_count, 1.0 / share, 1.0)
            return modes.heavier(factor)

        return tip_modes
