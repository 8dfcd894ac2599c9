"""A holder that loosens as speed grows: the taper widens, and the drawbar holds it no longer as tight."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import REFERENCE_SPEED, Effect, Setting
from chatter_core.effects.holder_joint import border_position
from chatter_core.joint import Joint
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Array, Parameter


@dataclass(frozen=True, kw_only=True)
class DrawbarStiffness(Effect):
    """phi = c_r (n/n_ref)^2 M between the two faces of a border, n_ref = 10 000 rpm: closed at rest, open at speed.

    Bores widen with speed squared, and contact is lost with them. It acts in series with a holder joint at the same
    border. Linear in M: valid while the faces do not part altogether.

    Source: none for the size; the growth is that of a ring, S. P. Timoshenko, J. N. Goodier, Theory of Elasticity,
    3rd ed. (1970), section 32.

    See docs/physics.md#drawbar-stiffness.
    """

    joint: str

    stage: ClassVar[str] = "joints"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(name="joint", doc="parts at whose border the joint lies", choices=("holder/shaft", "tool/holder")),
    )
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="rotational_compliance_urad_n_m", unit="urad/(N m)", doc="tilt of the faces over moment at 10000 rpm",
            prior_width=5.0, lower=0.0, upper=1000.0,
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput where the rotor has no such border."""
        assert machine.spindle is not None
        border_position(machine.spindle, self.joint, self.name())

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the rotor's joints with this one."""
        (rotational,) = values

        def joints(spindle: Spindle) -> tuple[Joint, ...]:
            own = Joint(
                position=border_position(spindle, self.joint, self.name()),
                lateral_compliance=0.0,
                rotational_compliance=rotational,
                loosening=_with_speed_squared,
            )
            return (*before(spindle), own)

        return joints


def _with_speed_squared(spindle_speed: Array) -> Array:
    return (spindle_speed / REFERENCE_SPEED) ** 2
