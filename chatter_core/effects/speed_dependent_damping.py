"""Modal damping that changes with speed."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import REFERENCE_SPEED, Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import KnownModes
from chatter_core.tip import TipModes


@dataclass(frozen=True, kw_only=True)
class SpeedDependentDamping(Effect):
    """zeta(n) = zeta exp(a n/n_ref), n_ref = 10 000 rpm, the same for every mode, at most 0.9.

    Lubricant films and preload set the bearings' damping, and both change with speed; the law is the plainest
    that keeps it positive. No theory stands behind it: valid at the speeds that were measured.

    Source: E. Ozturk, U. Kumar, S. Turner, T. Schmitz, CIRP Ann. 61 (2012) 343-346 (damping of a spindle over
    speed and preload).

    See docs/physics.md#speed-dependent-damping.
    """

    stage: ClassVar[str] = "tip_modes"
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="change", unit="ln", doc="logarithm of the damping at 10000 rpm over that at standstill",
            prior_width=0.5, lower=-1.5, upper=1.5,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the tip's modes, damped otherwise."""
        (change,) = values

        def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
            modes: TipModes = before(known, spindle_speed, mode_count)
            return modes.damped(np.exp(change * spindle_speed / REFERENCE_SPEED))

        return tip_modes
