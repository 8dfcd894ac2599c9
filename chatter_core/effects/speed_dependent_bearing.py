"""The balls' centrifugal force and gyroscopic moment, on a model that left its bearings at standstill."""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class SpeedDependentBearing(Effect):
    """The balls' inertia acts at the speed s n, in Jones's balance: s = 1 is the spindle's speed, s = 0 standstill.

    On a model whose bearings turn already (``modal_parameters`` dynamic) it changes nothing.
    Valid while every ball touches both races and rolls without gross sliding, as Jones's balance takes it.

    Source: A. B. Jones, J. Basic Eng. 82 (1960) 309-320; docs/physics.md, [P].

    See docs/physics.md#speed-dependent-bearing.
    """

    stage: ClassVar[str] = "bearing_speed"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    changes: ClassVar[tuple[str, ...]] = ("bearing", "modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="share", unit="", doc="speed of the balls' inertia over the spindle's",
            prior_width=1.0, lower=0.0, upper=1.0,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the speed of the balls' inertia, up to the share of the spindle's."""
        (share,) = values

        def bearing_speed(spindle_speed: Array, modal_parameters: str) -> Array:
            turning: Array = np.maximum(before(spindle_speed, modal_parameters), share * spindle_speed)
            return turning

        return bearing_speed
