"""x and y not alike: a machine whose column, rails or housing are stiffer one way than the other."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.stages import KnownModes
from chatter_core.tip import TipModes


@dataclass(frozen=True, kw_only=True)
class DirectionalAsymmetry(Effect):
    """k_y -> k_y exp(a) for every mode in y, masses and damping ratios unchanged, so w_y -> w_y exp(a/2).

    Valid while the principal directions are x and y, and modes keep their order.

    Source: none; the plainest law that tells the axes apart. Rotors and their bearings alone are alike in both.

    See docs/physics.md#directional-asymmetry.
    """

    stage: ClassVar[str] = "tip_modes"
    changes: ClassVar[tuple[str, ...]] = ("modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="stiffness_ratio", unit="ln", doc="logarithm of the stiffness in y over what it was",
            prior_width=0.2, lower=-1.0, upper=1.0,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the tip's modes, those in y stiffer."""
        (ratio,) = values

        def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
            modes: TipModes = before(known, spindle_speed, mode_count)
            factor = np.where(modes.axis == 1, np.exp(0.5 * ratio), 1.0)
            return replace(modes, natural_frequency=modes.natural_frequency * factor)

        return tip_modes
