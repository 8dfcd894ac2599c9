"""A clamp that loosens as the spindle turns faster: the workpiece gives way in the feed direction."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects import REFERENCE_SPEED, Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.tip import TipModes


@dataclass(frozen=True, kw_only=True)
class LooseningClamp(Effect):
    """k_x -> k_x exp(-a n/n_ref) for the modes in the cut, masses and damping ratios unchanged; n_ref = 10 000 rpm.

    Source: none; an example.
    """

    stage: ClassVar[str] = "cut_modes"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="loss", unit="ln", doc="logarithm of the stiffness lost at 10 000 rpm",
            prior_width=0.2, lower=0.0, upper=2.0,
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the modes in the cut, those in x softer."""
        (loss,) = values

        def cut_modes(modes: TipModes, spindle_speed: Array) -> TipModes:
            found: TipModes = before(modes, spindle_speed)
            softer = np.exp(-0.5 * loss * spindle_speed / REFERENCE_SPEED)[:, None]
            factor = np.where(found.axis == 0, softer, 1.0)
            return replace(found, natural_frequency=found.natural_frequency * factor)

        return cut_modes
