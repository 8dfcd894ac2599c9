"""Axial preload that rises with speed, since the shaft and the inner rings run warmer than the housing."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import REFERENCE_SPEED, Effect
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class ThermalPreload(Effect):
    """F_a(n) = F_0 (1 + a (n/n_ref)^p), n_ref = 10 000 rpm.

    Friction heats the bearings in proportion to speed times torque, which itself grows with speed, so p lies
    between 1 and 2. Steady state: the time that it takes to warm up is not modelled. With rigid preload F_a is
    the force that the displacement at that speed would cause at standstill. Valid as long as every ball
    touches both races.

    Source: C.-W. Lin, J. F. Tu, J. Kamman, Int. J. Mach. Tools Manuf. 43 (2003) 1035-1050 (thermal preload of
    angular contact bearings in motorised spindles).

    See docs/physics.md#thermal-preload.
    """

    stage: ClassVar[str] = "preload"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    shapes: ClassVar[tuple[str, ...]] = ("exponent",)
    changes: ClassVar[tuple[str, ...]] = ("bearing", "modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="rise", unit="", doc="rise of the preload at 10000 rpm, over the preload as set",
            prior_width=1.0, lower=0.0, upper=10.0,
        ),
        Parameter(
            name="exponent", unit="", doc="exponent of speed in the rise",
            prior_mean=1.5, null=1.5, prior_width=0.4, lower=0.5, upper=3.0,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the preload over speed, raised."""
        rise, exponent = values

        def preload(spindle: Spindle, spindle_speed: Array) -> Array:
            raised: Array = before(spindle, spindle_speed) * (
                1.0 + rise * (spindle_speed / REFERENCE_SPEED) ** exponent
            )
            return raised

        return preload
