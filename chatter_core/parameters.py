"""A number that a model may be fitted by: unit, meaning, null, bounds and prior, declared once."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import InvalidInput

Array = NDArray[np.float64]

#: What has to be computed again when a parameter changes: everything; the cut alone, since bearings, modes and
#: receptances stay; or nothing of the model, since only what the sensors make of it changes.
Touches = Literal["structure", "cut", "measurement"]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number that is fitted. Its prior is normal, cut off at its bounds.

    unit: as texts write it, "" for pure numbers, "ln" for the logarithm of a factor; null: value at which the
    model is as described; prior_mean, prior_width, lower, upper: in that unit. A half-normal prior of an
    amplitude has its mean, its null and a bound in one place, mostly the lower one. search_width: what strengths at
    which a search begins are multiples of, and by how much a stated one may be off, where the prior spans more than a
    decade; the prior's width otherwise. source: where its law or its usual size comes from, where that is not the
    docstring's.
    """

    name: str
    unit: str
    doc: str
    prior_width: float
    null: float = 0.0
    prior_mean: float = 0.0
    lower: float = -np.inf
    upper: float = np.inf
    touches: Touches = "structure"
    search_width: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.prior_width) and self.prior_width > 0.0):
            raise InvalidInput([f"parameter {self.name}: prior_width: found {self.prior_width:g}, allowed: above 0"])
        if not (np.isfinite(self.searched_by) and self.searched_by > 0.0):
            raise InvalidInput([f"parameter {self.name}: search_width: found {self.search_width:g}, allowed: above 0"])
        if not self.lower <= self.null <= self.upper or self.lower >= self.upper:
            raise InvalidInput(
                [
                    f"parameter {self.name}: its null {self.null:g} {self.unit} must lie within its bounds, "
                    f"{self.lower:g} to {self.upper:g}"
                ]
            )

    @property
    def searched_by(self) -> float:
        """What strengths at which a search begins are multiples of, and a stated one may be off by, in its unit."""
        return self.prior_width if self.search_width is None else self.search_width

    def aside(self, widths: float) -> float:
        """Return the value so many prior widths above the null, below where it cannot go up; within the bounds."""
        return self._aside(widths * self.prior_width)

    def searched_at(self, strength: float) -> float:
        """Return the value at a strength, in the widths that it is searched by, to the side that ``aside`` goes to."""
        return self._aside(strength * self.searched_by)

    def _aside(self, distance: float) -> float:
        moved = self.null + (distance if self.upper > self.null else -distance)
        return min(max(moved, self.lower), self.upper)
