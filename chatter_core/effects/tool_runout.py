"""Teeth that are not equally long, since the cutter turns about another axis than its own."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import Effect
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Tool
from chatter_core.parameters import Parameter
from chatter_core.teeth import Teeth


@dataclass(frozen=True, kw_only=True)
class ToolRunout(Effect):
    """R_i = R + r cos(phi_i + phase), r half the indicator reading, phi_i = 2 pi i/Z, ahead of tooth 0.

    A linear equation knows of the radii where chips end: a tooth that is shorter than the one ahead by more than
    the feed misses, at some angles or at all, and the next one then cuts what was left two pitches ago or more. The
    motion that uneven chips force takes part in that (``chatter_core.contact``). Where every tooth cuts everywhere,
    runout changes nothing here. Valid for an offset of the axis; its tilt would change along the edge.
    Teeth of unlike pitch are given the radii of equal ones.

    Source: W. A. Kline, R. E. DeVor, Int. J. Mach. Tool Des. Res. 23 (1983) 123-140; T. Insperger et al., Int. J.
    Mach. Tools Manuf. 48 (2008) 1081-1089.

    See docs/physics.md#tool-runout.
    """

    stage: ClassVar[str] = "teeth"
    shapes: ClassVar[tuple[str, ...]] = ("phase_deg",)
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="runout_um", unit="um", doc="indicator reading: the longest radius less the shortest, all around",
            prior_width=50.0, lower=0.0, upper=500.0, touches="cut",
        ),
        Parameter(
            name="phase_deg", unit="degree", doc="angle of the first tooth ahead of the offset",
            prior_width=60.0, lower=-180.0, upper=180.0, touches="cut",
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput for a cutter of one tooth, which has no other to differ from."""
        if machine.tool.teeth == 1:
            raise InvalidInput([f"effects.{self.name()}: tool.teeth is 1, and runout needs two teeth at least"])

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the teeth with other radii."""
        runout, phase = values

        def teeth(tool: Tool) -> Teeth:
            found: Teeth = before(tool)
            place = 2.0 * math.pi / tool.teeth * np.arange(tool.teeth)
            return replace(found, radius=found.radius + 0.5 * runout * np.cos(place + phase))

        return teeth
