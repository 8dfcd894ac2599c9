"""Bearing seats that give: the housing's spring in series with the bearings'."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from chatter_core.bearing import BearingState
from chatter_core.effects._base import Effect
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class HousingCompliance(Effect):
    """1/k = 1/k_bearings + c exp(d s): every seat is a spring in series with its bearings, the same at all speeds.

    s is the place of a seat, 0 at the front one and 1 at the rearmost: walls differ along a housing. The housing's
    mass is left out: valid below its own first frequency on these springs.

    Source: Y. Altintas, Manufacturing Automation, 2nd ed. (2012), chapter 3 (springs in series); Y. Cao,
    Y. Altintas, J. Mech. Design 126 (2004) 1089-1104 (spindle housings that give).

    See docs/physics.md#housing-compliance.
    """

    stage: ClassVar[str] = "seat_stiffness"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    shapes: ClassVar[tuple[str, ...]] = ("rear_difference",)
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="compliance_um_n", unit="um/N", doc="radial compliance of the housing at the front seat",
            prior_width=0.01, lower=0.0, upper=1.0,
        ),
        Parameter(
            name="rear_difference", unit="ln", doc="ln of the compliance at the rearmost seat over the front one's",
            prior_width=1.0, lower=-3.0, upper=3.0,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the seats' stiffness, softened."""
        front, difference = values

        def seat_stiffness(spindle: Spindle, state: BearingState) -> Array:
            stiffness: Array = before(spindle, state)
            compliance = front * np.exp(difference * np.array(spindle.seat_places))
            return stiffness / (1.0 + compliance * stiffness)

        return seat_stiffness
