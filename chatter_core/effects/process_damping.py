"""Process damping: the flank ploughs through the wave that it cuts, and resists the more the slower it cuts."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.cutting import CuttingGain, ForceCoefficients
from chatter_core.effects._base import Effect
from chatter_core.machine import Machine
from chatter_core.parameters import Parameter
from chatter_core.stages import Regeneration

#: Friction of the flank on the workpiece: tangential over radial ploughing force.
FLANK_FRICTION = 0.3


@dataclass(frozen=True, kw_only=True)
class ProcessDamping(Effect):
    """F_r = (C/v) b h', F_t = 0.3 F_r along the engaged edge, which penetrates at the rate h' and cuts at the speed v.

    h' = x' sin(theta) + y' cos(theta), so the force on the tip's velocity has the form of the cutting force, with C/v
    in the place of its coefficients. Linear: valid while waves are long and shallow against the flank's
    clearance, that is below amplitudes of some micrometres.

    Source: Y. Altintas, M. Eynian, H. Onozuka, CIRP Ann. 57 (2008) 371-374, with 0.3 as the flank's friction.

    See docs/physics.md#process-damping.
    """

    stage: ClassVar[str] = "regeneration"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="coefficient_n_m", unit="N/m", doc="ploughing coefficient C",
            prior_width=3e5, lower=0.0, upper=1e7, touches="cut",
        ),
    )  # fmt: skip

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the feedback of the cut with a gain on velocities."""
        (coefficient,) = values

        def regeneration(gain: CuttingGain) -> Regeneration:
            cut: Regeneration = before(gain)
            radial = coefficient / (0.5 * gain.tool.diameter * np.asarray(gain.spindle_speed))
            ploughing = replace(gain, coefficients=ForceCoefficients(tangential=FLANK_FRICTION * radial, radial=radial))
            return replace(cut, velocity_gain=(*cut.velocity_gain, ploughing))

        return regeneration
