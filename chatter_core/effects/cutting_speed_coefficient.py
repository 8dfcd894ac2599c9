"""Cutting coefficients that change with cutting speed."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.cutting import ForceCoefficients
from chatter_core.effects._base import REFERENCE_SPEED, Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class CuttingSpeedCoefficient(Effect):
    """K(v) = K (v/v_ref)^-m for both coefficients, v_ref the cutting speed at 10 000 rpm, where K is as stated.

    Softening by heat makes m positive, usually 0.05 to 0.3; a built-up edge at low speed makes it negative. Valid
    over a decade of speed around the reference.

    Source: empirical; M. C. Shaw, Metal Cutting Principles, 2nd ed. (2005) (specific energy over cutting speed).

    See docs/physics.md#cutting-speed-coefficient.
    """

    stage: ClassVar[str] = "force_coefficients"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="exponent", unit="", doc="exponent m of the fall with cutting speed",
            prior_width=0.3, lower=-1.0, upper=1.0, touches="cut",
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the coefficients over speed."""
        (exponent,) = values

        def force_coefficients(machine: Machine, spindle_speed: Array) -> ForceCoefficients:
            found: ForceCoefficients = before(machine, spindle_speed)
            factor = (spindle_speed / REFERENCE_SPEED) ** -exponent
            return ForceCoefficients(tangential=found.tangential * factor, radial=found.radial * factor)

        return force_coefficients
