"""x and y not alike: a machine whose column, rails or housing are stiffer one way than the other."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.bearing import BearingState
from chatter_core.effects._base import Effect, Scan, Setting
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Spindle
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import KnownModes
from chatter_core.tip import TipModes

#: Ratios that are looked at one by one, to both sides: modes that part far enough leave the peaks they were fitted to.
LOOKED_AT = (0.2, 0.45, 0.75, 1.05, 1.4)


@dataclass(frozen=True, kw_only=True)
class DirectionalAsymmetry(Effect):
    """k_y / k_x = exp(a), of the modes at the tip, or of the bearing seats.

    Modes: k_y -> k_y exp(a) for all of them, masses and damping ratios unchanged, so w_y -> w_y exp(a/2). Seats: what
    holds them gives one way, y for a < 0 and x for a > 0, as one and the same spring in series with the bearings of
    each, 1/k -> 1/k + (exp|a| - 1) / k_0, where k_0 is the front seat's stiffness at the lowest speed, and a is met
    there. Modes that move the shaft then differ, and those that bend the tool hardly do. Valid while the principal
    directions are x and y.

    Source: none for the modes, the plainest law that tells the axes apart; Y. Altintas, Manufacturing Automation, 2nd
    ed. (2012), chapter 3 (springs in series). Rotors and their bearings alone are alike in both.

    See docs/physics.md#directional-asymmetry.
    """

    where: str

    stage: ClassVar[str] = "tip_modes"
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    scan: ClassVar[Scan | None] = Scan(
        parameter="stiffness_ratio", values=(*(-ratio for ratio in LOOKED_AT), *LOOKED_AT)
    )
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(name="where", doc="what has another stiffness in y than in x", choices=("modes", "seats")),
    )
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="stiffness_ratio", unit="ln", doc="logarithm of the stiffness in y over that in x",
            prior_width=0.3, lower=-2.0, upper=2.0,
        ),
    )  # fmt: skip

    @property
    def acts_on(self) -> str:
        """The tip's modes, or the seats."""
        return "seat_stiffness" if self.where == "seats" else self.stage

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput where seats are asked for that a machine of measured modes lacks."""
        if self.where == "seats" and machine.spindle is None:
            raise InvalidInput(
                [f"effects.{self.name()}.where: found 'seats', but this machine has measured tip modes; allowed: modes"]
            )

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the tip's modes or the seats' stiffness, unlike in x and y."""
        (ratio,) = values

        def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
            modes: TipModes = before(known, spindle_speed, mode_count)
            factor = np.where(modes.axis == 1, np.exp(0.5 * ratio), 1.0)
            return replace(modes, natural_frequency=modes.natural_frequency * factor)

        def seat_stiffness(spindle: Spindle, state: BearingState) -> Array:
            stiffness = np.array(before(spindle, state))
            softer = 1 if ratio < 0.0 else 0
            compliance = np.expm1(abs(ratio)) / _front_at_rest(spindle, state, stiffness[softer])
            stiffness[softer] /= 1.0 + compliance * stiffness[softer]
            return stiffness

        return seat_stiffness if self.where == "seats" else tip_modes


def _front_at_rest(spindle: Spindle, state: BearingState, stiffness: Array) -> float:
    """Return the front seat's stiffness at the lowest speed at which the bearings have an equilibrium [N/m]."""
    front = int(np.argmin([seat.position for seat in spindle.bearings]))
    lowest = int(np.argmax(state.solved))
    return float(stiffness[lowest, front])
