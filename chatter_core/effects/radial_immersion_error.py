"""Radial depth that is not the nominal one, since the tool bends away or its path is offset."""

from dataclasses import dataclass
from typing import Any, ClassVar

from chatter_core.effects._base import Effect
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Process
from chatter_core.parameters import Parameter
from chatter_core.teeth import Engagement


@dataclass(frozen=True, kw_only=True)
class RadialImmersionError(Effect):
    """a -> a (1 + e), at most 1: the radial depth over the diameter, and with it where teeth enter or leave.

    A deflection grows with the force, and the force with the immersion: hence an error in proportion. Slots are
    left as they are: their immersion cannot err. Valid while the error is the same over the axial depth.

    Source: geometry; T. L. Schmitz, K. S. Smith, Machining Dynamics (2009), chapter 5 (surface location error).

    See docs/physics.md#radial-immersion-error.
    """

    stage: ClassVar[str] = "engagement"
    changes: ClassVar[tuple[str, ...]] = ("cut",)
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            name="error", unit="", doc="error of the radial immersion over the nominal one",
            prior_width=0.1, lower=-0.5, upper=0.5, touches="cut",
        ),
    )  # fmt: skip

    def _check(self, machine: Machine) -> None:
        """Raise InvalidInput for a slot."""
        if machine.process.direction == "slot":
            raise InvalidInput([f"effects.{self.name()}: process.direction is slot, whose radial immersion cannot err"])

    def transform(self, before: Any, machine: Machine, values: tuple[float, ...]) -> Any:
        """Return the engagement at another immersion."""
        (error,) = values

        def engagement(process: Process) -> Engagement:
            immersion = process.radial_immersion
            if process.direction != "slot":
                immersion = min(1.0, immersion * (1.0 + error))
            found: Engagement = before(process.model_copy(update={"radial_immersion": immersion}))
            return found

        return engagement
