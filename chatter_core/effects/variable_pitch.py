"""Teeth that are not equally spaced, as cutters against chatter have them."""

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


@dataclass(frozen=True, kw_only=True)
class VariablePitch(Effect):
    """psi_i = (2 pi/Z) (1 + v p_i), p_i from -1/2 to 1/2: v is the widest pitch less the narrowest, over the mean.

    ``linear`` pitches grow by equal steps from tooth to tooth, ``alternating`` ones are wide and narrow by turns. Each
    tooth has its own delay psi_i/Omega, and takes the feed that belongs to it. Valid for one helix angle.

    Source: Y. Altintas, S. Engin, E. Budak, "Analytical stability prediction and design of variable pitch cutters",
    J. Manuf. Sci. Eng. 121 (1999) 173-178.

    See docs/physics.md#variable-pitch.
    """

    pattern: str

    stage: ClassVar[str] = "teeth"
    scan: ClassVar[Scan | None] = Scan(parameter="variation", values=LOOKED_AT, waves=WAVES)
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    settings: ClassVar[tuple[Setting, ...]] = (
        Setting(name="pattern", doc="how the pitches vary", choices=("linear", "alternating")),
    )
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="variation", unit="", doc="widest pitch less the narrowest over the mean pitch",
            prior_width=0.15, lower=0.0, upper=1.0, touches="cut",
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

    def repeats(self, machine: Machine) -> bool:
        """Return whether the pattern is that of the other choice: of two teeth either one is the nearer."""
        return self.pattern == "alternating" and machine.tool.teeth == 2

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the teeth with other pitches."""
        (variation,) = values

        def teeth(tool: Tool) -> Teeth:
            found: Teeth = before(tool)
            return replace(found, pitch=found.pitch + variation * self._shares(tool.teeth))

        return teeth

    def _shares(self, count: int) -> Array:
        """Return the pattern p_i (tooth,), of mean zero."""
        if self.pattern == "alternating":
            return np.resize([-0.5, 0.5], count)
        return np.linspace(-0.5, 0.5, count)
