"""Radial depth that is not the nominal one, since the tool bends away or its path is offset."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import Effect
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Process
from chatter_core.parameters import Parameter
from chatter_core.teeth import Engagement

#: Of a width of cut so much is left at least.
LEAST_LEFT = 0.1


@dataclass(frozen=True, kw_only=True)
class RadialImmersionError(Effect):
    """a -> a + e, at least a/10 and at most 1: the radial depth over the diameter, and where teeth enter or leave.

    A path that is offset, a worn or undersized tool, or a face that an earlier pass left proud is off by the same
    distance whatever the width of cut. Slots are left as they are: their immersion cannot err. Valid while the error is
    the same over the axial depth and in all cuts; a deflection grows with the force, and is this only as their mean.

    Source: geometry; T. L. Schmitz, K. S. Smith, Machining Dynamics (2009), chapter 5 (surface location error).

    See docs/physics.md#radial-immersion-error.
    """

    stage: ClassVar[str] = "engagement"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="offset", unit="", doc="what the radial depth is off by, over the tool's diameter",
            prior_width=0.05, lower=-0.5, upper=0.5, touches="cut",
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput for a slot."""
        if machine.process.direction == "slot":
            raise InvalidInput([f"effects.{self.name()}: process.direction is slot, whose radial immersion cannot err"])

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the engagement at another immersion."""
        (offset,) = values

        def engagement(process: Process) -> Engagement:
            immersion = process.radial_immersion
            if process.direction != "slot":
                immersion = min(1.0, max(immersion + offset, LEAST_LEFT * immersion))
            found: Engagement = before(process.model_copy(update={"radial_immersion": immersion}))
            return found

        return engagement
