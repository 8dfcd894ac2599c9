"""Teeth that are not equally spaced, as cutters against chatter have them."""

import math
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from chatter_core.effects._base import Effect, Scan, Setting
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Tool
from chatter_core.parameters import Array, Parameter
from chatter_core.teeth import Teeth

#: Variations that are looked at one by one with so many waves between two teeth: 0.02 moves one by a fifth of its
#: length.
WAVES, LOOKED_AT = 10.0, (*(0.01 * np.arange(1, 12)), *(0.02 * np.arange(6, 23)))
#: Phases that each is looked at with: one of three teeth that is wide, and one that is narrow, are farthest apart.
PHASES = (0.0, 60.0)


@dataclass(frozen=True, kw_only=True)
class VariablePitch(Effect):
    """psi_i = (2 pi/Z) (1 + v p_i), p_i from -1/2 to 1/2: v is the widest pitch less the narrowest, over the mean.

    ``linear`` pitches grow by equal steps from tooth to tooth, ``alternating`` ones are wide and narrow by turns.
    ``sinusoidal`` ones are p_i = cos(2 pi i/Z + phase)/2, as where an index turned off centre when the teeth were cut:
    v is then that of the cosine, of which three teeth show 0.75 to 0.87, and these have any pitches with some phase.
    Each tooth has its own delay psi_i/Omega, and takes the feed that belongs to it. Valid for one helix angle.

    Source: Y. Altintas, S. Engin, E. Budak, "Analytical stability prediction and design of variable pitch cutters",
    J. Manuf. Sci. Eng. 121 (1999) 173-178.

    See docs/physics.md#variable-pitch.
    """

    pattern: str

    stage: ClassVar[str] = "teeth"
    scan: ClassVar[Scan | None] = Scan(parameter="variation", values=LOOKED_AT, waves=WAVES, shapes=PHASES)
    shapes: ClassVar[tuple[str, ...]] = ("phase_deg",)
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(
            name="pattern",
            doc="how the pitches vary",
            choices=("linear", "alternating", "sinusoidal"),
            unused={"linear": ("phase_deg",), "alternating": ("phase_deg",)},
        ),
    )
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="variation", unit="", doc="widest pitch less narrowest, or the cosine's, over the mean",
            prior_width=0.15, lower=0.0, upper=1.0, touches="cut",
        ),
        Parameter(
            name="phase_deg", unit="degree", doc="of sinusoidal pitches: angle of the first one ahead of the widest",
            prior_width=60.0, lower=-180.0, upper=180.0, touches="cut",
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput for a cutter whose teeth cannot be spaced so."""
        teeth = machine.tool.teeth
        if teeth == 1:
            raise InvalidInput([f"effects.{self.name()}: tool.teeth is 1, and pitches need two teeth at least"])
        if self.pattern == "alternating" and teeth % 2:
            raise InvalidInput(
                [f"effects.{self.name()}.pattern: alternating needs an even number of teeth, not {teeth}"]
            )

    def is_superfluous(self, machine: Machine) -> bool:
        """Return whether other patterns say as much: of two teeth all are one, and of three one is any.

        Of more teeth a cosine is one pattern of many.
        """
        teeth = machine.tool.teeth
        return (self.pattern == "alternating" and teeth == 2) or (self.pattern == "sinusoidal" and teeth != 3)

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the teeth with other pitches."""
        variation, *phase = values
        shares = self._shares(machine.tool.teeth, *phase)

        def teeth(tool: Tool) -> Teeth:
            found: Teeth = before(tool)
            return replace(found, pitch=found.pitch + variation * shares)

        return teeth

    def _shares(self, count: int, phase: float = 0.0) -> Array:
        """Return the pattern p_i (tooth,), of mean zero."""
        if self.pattern == "alternating":
            return np.resize([-0.5, 0.5], count)
        if self.pattern == "sinusoidal":
            return np.asarray(0.5 * np.cos(2.0 * math.pi / count * np.arange(count) + phase))
        return np.linspace(-0.5, 0.5, count)
