"""Stiffness that is not the same in x and y."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.bearing import BearingState, axisymmetric_state
from chatter_core.effects._base import Effect, Scan, Setting
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import KnownModes, Stages
from chatter_core.tip import AXES, TipModes

#: Axial preload on every single bearing at which seats have lost their stated share [N].
REFERENCE_PRELOAD = 100.0


@dataclass(frozen=True, kw_only=True)
class DirectionalAsymmetry(Effect):
    """k -> k exp(-a) along one axis, of the modes at the tip, or of the bearing seats.

    Modes: all of that axis, masses and damping ratios unchanged, so w -> w exp(-a/2). Seats: what holds them gives
    along that axis, as a spring in series with the bearings of each, 1/k -> 1/k + exp(d s) (exp(a) - 1)/k_0, where s is
    the place of a seat, 0 at the front one and 1 at the rearmost: ribs and feet are at one end. k_0 is the stiffness of
    the front seat's bearings at rest under ``REFERENCE_PRELOAD``, so that the spring is the same at every preload.
    Modes that move the shaft then differ, and those that bend the tool hardly do. The direction along which they give
    may be turned, from x towards y, and what is across it with it: the tip then has cross receptances. Valid while all
    seats give along the same direction; of modes, while the principal directions are x and y.

    Source: none for the modes, the plainest law that tells the axes apart; Y. Altintas, Manufacturing Automation, 2nd
    ed. (2012), chapter 3 (springs in series). Rotors and their bearings alone are alike in both.

    See docs/physics.md#directional-asymmetry.
    """

    where: str
    axis: str

    stage: ClassVar[str] = "tip_modes"
    shapes: ClassVar[tuple[str, ...]] = ("rear_difference", "turn_deg")
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    # Soft modes move by some seven per cent from one to the next: farther, and they leave the peaks that they were at.
    scan: ClassVar[Scan | None] = Scan(parameter="stiffness_loss", values=tuple(0.15 * np.arange(1, 13)))
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(
            name="where", doc="what is softer along one axis", choices=("modes", "seats"),
            unused={"modes": ("rear_difference", "turn_deg")},
        ),
        Setting(name="axis", doc="the softer direction", choices=AXES),
    )  # fmt: skip
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="stiffness_loss", unit="ln",
            doc="ln of the stiffness without the effect over that with it; of the front seat at rest under 100 N",
            prior_width=0.3, lower=0.0, upper=2.0,
        ),
        Parameter(
            name="rear_difference", unit="ln", doc="ln of what the rearmost seat gives by over the front one, of seats",
            prior_width=1.0, lower=-3.0, upper=3.0,
        ),
        Parameter(
            name="turn_deg", unit="degree", doc="angle by which the softer direction is turned from its axis, of seats",
            prior_width=20.0, lower=-45.0, upper=45.0,
        ),
    )  # fmt: skip

    @property
    def acts_on(self) -> str:
        """The tip's modes, or the seats."""
        return "seat_stiffness" if self.where == "seats" else self.stage

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput where a machine of measured modes lacks what is asked for: seats, or modes of an axis."""
        if self.where == "seats" and machine.spindle is None:
            raise InvalidInput(
                [f"effects.{self.name()}.where: found 'seats', but this machine has measured tip modes; allowed: modes"]
            )
        if machine.tip is not None and all(mode.axis != self.axis for mode in machine.tip.modes):
            raise InvalidInput([f"effects.{self.name()}.axis: found '{self.axis}', along which no mode was measured"])

    def is_superfluous(self, machine: Machine) -> bool:
        """Return whether it is of modes that a spindle explains: seats say the same of them, and why."""
        return self.where == "modes" and machine.spindle is not None

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages with its own transformed; of seats the axes turn with what softens one of them."""
        softer = super().apply(stages, values)
        if softer is stages or self.where == "modes":
            return softer
        (turn,) = (np.deg2rad(value) for one, value in zip(self.used, values, strict=True) if one.name == "turn_deg")
        return replace(softer, seat_turn=lambda spindle, state: stages.seat_turn(spindle, state) + turn)

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the tip's modes or the seats' stiffness, less along one axis."""
        if self.where == "seats":
            return self._softer_seats(before, machine, *values[:2])
        return self._softer_modes(before, *values)

    def _softer_modes(self, before: Any, loss: float) -> Any:
        def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
            modes: TipModes = before(known, spindle_speed, mode_count)
            factor = np.where(modes.axis == AXES.index(self.axis), np.exp(-0.5 * loss), 1.0)
            return replace(modes, natural_frequency=modes.natural_frequency * factor)

        return tip_modes

    def _softer_seats(self, before: Any, machine: Machine, loss: float, difference: float) -> Any:
        axis, front = AXES.index(self.axis), np.expm1(loss) / _front_at_rest(machine)

        def seat_stiffness(spindle: Spindle, state: BearingState) -> Array:
            stiffness = np.array(before(spindle, state))
            compliance = front * np.exp(difference * np.array(spindle.seat_places))
            stiffness[axis] /= 1.0 + compliance * stiffness[axis]
            return stiffness

        return seat_stiffness


def _front_at_rest(machine: Machine) -> float:
    """Return the stiffness of the front seat's bearings at rest under the reference preload [N/m]."""
    assert machine.bearing is not None
    assert machine.spindle is not None
    front = min(machine.spindle.bearings, key=lambda seat: seat.position)
    at_rest = axisymmetric_state(machine.bearing, REFERENCE_PRELOAD, np.zeros(1), "constant")
    return float(at_rest.radial_stiffness[0] * front.count)
