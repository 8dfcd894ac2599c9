"""Inner rings that grow by their own centrifugal load."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import REFERENCE_SPEED, Effect
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class RingExpansion(Effect):
    """u(n) = u_ref (n/n_ref)^2, n_ref = 10 000 rpm: the inner groove's centre moves outwards by u in Jones's balance.

    A free ring grows by u = rho w^2 r^3/E, which is 0.7 um for a steel ring of 52 mm at 10 000 rpm; on its shaft
    it grows with the shaft, by less. Elastic, no loss of fit. Valid as long as every ball touches both races.

    Source: T. A. Harris, M. N. Kotzalas, Advanced Concepts of Bearing Technology, 5th ed. (2007), chapter 3;
    S. P. Timoshenko, J. N. Goodier, Theory of Elasticity, 3rd ed. (1970), section 32 (rotating discs).

    See docs/physics.md#ring-expansion.
    """

    stage: ClassVar[str] = "ring_growth"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    changes: ClassVar[tuple[str, ...]] = ("bearing", "modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="growth_um", unit="um", doc="growth of the inner groove's radius at 10000 rpm",
            prior_width=1.5, lower=0.0, upper=20.0,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the rings' growth over speed, with what speed adds."""
        (growth,) = values

        def ring_growth(spindle: Spindle, spindle_speed: Array) -> Array:
            grown: Array = before(spindle, spindle_speed) + growth * (spindle_speed / REFERENCE_SPEED) ** 2
            return grown

        return ring_growth
