"""The rotor's gyroscopic moments: what tilts in one plane is turned into the other."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import Effect
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class GyroscopicCoupling(Effect):
    """M q_x'' + s Omega G q_y' + ... = F_x, M q_y'' - s Omega G q_x' + ... = F_y, G the rotor's polar inertia.

    G is taken in the kept modes of the rotor at rest. Each pair of alike modes in x and y parts into a forward and a
    backward whirl, and the tip gets cross receptances. Teeth and rotor turn from +y towards +x, so Omega is negative
    here. s = 1 is the rotor as described. Valid while higher modes feel no gyroscopic moment that matters.

    Source: H. D. Nelson, J. Mech. Design 102 (1980) 793-803.

    See docs/physics.md#gyroscopic-coupling.
    """

    stage: ClassVar[str] = "gyroscopic_speed"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="share", unit="", doc="gyroscopic moment over that of the rotor's polar inertia",
            prior_width=1.0, lower=0.0, upper=3.0,
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput for a rotor that is modelled without polar inertia."""
        spindle = machine.spindle
        if spindle is not None and spindle.beam == "euler_bernoulli" and not spindle.discs:
            raise InvalidInput(
                [f"effects.{self.name()}: beam euler_bernoulli has no rotary inertia, and there is no disc to have any"]
            )

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the speed at which gyroscopic moments act."""
        (share,) = values

        def gyroscopic_speed(spindle_speed: Array) -> Array:
            acting: Array = before(spindle_speed) - share * spindle_speed
            return acting

        return gyroscopic_speed
