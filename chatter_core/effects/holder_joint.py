"""A border of the rotor that gives: between tool and holder, or between holder and shaft."""

import itertools
from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import Effect, Setting
from chatter_core.errors import InvalidInput
from chatter_core.joint import Joint
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Parameter


@dataclass(frozen=True, kw_only=True)
class HolderJoint(Effect):
    """F = d/c_l and M = phi/c_r between the two faces of a border, without mass, damped as the rotor is.

    Bearings and discs that sit on the border sit behind the joint. Linear: valid while the faces do not part.

    Source: T. L. Schmitz, K. S. Smith, Machining Dynamics (2009), chapter 9 (joints by springs between parts).

    See docs/physics.md#holder-joint.
    """

    joint: str

    stage: ClassVar[str] = "joints"
    needs: ClassVar[tuple[str, ...]] = ("spindle", "bearing")
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(name="joint", doc="parts at whose border the joint lies", choices=("tool/holder", "holder/shaft")),
    )
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="lateral_compliance_um_n", unit="um/N", doc="shift of the two faces over the force between them",
            prior_width=0.01, lower=0.0, upper=1.0,
        ),
        Parameter(
            name="rotational_compliance_urad_n_m", unit="urad/(N m)", doc="tilt of the two faces over the moment",
            prior_width=10.0, lower=0.0, upper=1000.0,
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput where the rotor has no such border."""
        assert machine.spindle is not None
        border_position(machine.spindle, self.joint, self.name())

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the rotor's joints with this one."""
        lateral, rotational = values

        def joints(spindle: Spindle) -> tuple[Joint, ...]:
            own = Joint(
                position=border_position(spindle, self.joint, self.name()),
                lateral_compliance=lateral,
                rotational_compliance=rotational,
            )
            return (*before(spindle), own)

        return joints


def border_position(spindle: Spindle, border: str, effect: str) -> float:
    """Return where two parts meet, ``front/rear``, from the tool tip [m].

    Raises InvalidInput when the sections do not name two such parts side by side.

    See docs/physics.md#holder-joint.
    """
    position = 0.0
    for one, other in itertools.pairwise(spindle.sections):
        position += one.length
        if f"{one.part}/{other.part}" == border:
            return position
    parts = ", ".join(dict.fromkeys(section.part for section in spindle.sections))
    raise InvalidInput([f"effects.{effect}.joint: found {border!r}, but the rotor's parts are, tip first: {parts}"])
