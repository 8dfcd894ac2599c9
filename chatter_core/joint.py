"""Joints: borders in the rotor that give, and may give more as it turns faster."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: A joint that opens counts as closed where it is so many times stiffer than stated: more would be lost in rounding.
STIFFEST = 1e3
#: Compliances below these count as closed [m/N, rad/(N m)]: they move frequencies by a ten-thousandth or less, and as
#: much is lost in rounding where a joint is stiffer than all the rest by so many digits.
CLOSED = (1e-13, 5e-10)


@dataclass(frozen=True, kw_only=True)
class Joint:
    """Border in the rotor that gives: two springs without mass between the faces.

    position: from the tool tip [m]; lateral_compliance [m/N] and rotational_compliance [rad/(N m)], at least 0;
    loosening: factor of both (speed,) at spindle speeds (speed,) [rad/s], at least 0.
    """

    position: float
    lateral_compliance: float
    rotational_compliance: float
    loosening: Callable[[Array], Array] = np.ones_like


@dataclass(frozen=True, kw_only=True)
class OpenFreedom:
    """A freedom in which the faces of a border move apart, from ``front`` to ``behind``.

    parts: the joints there, in series: a compliance, SI, and its loosening each.
    """

    front: int
    behind: int
    parts: tuple[tuple[float, Callable[[Array], Array]], ...]

    @property
    def stiffness(self) -> float:
        """Stiffness where every loosening is one."""
        return 1.0 / sum(compliance for compliance, _ in self.parts)

    def change(self, spindle_speed: Array) -> Array:
        """Return how much the stiffness differs from that at speeds (speed,) [rad/s]."""
        compliance = np.sum([part * loosening(spindle_speed) for part, loosening in self.parts], axis=0)
        least = 1.0 / (STIFFEST * self.stiffness)
        return np.asarray(1.0 / np.maximum(compliance, least) - self.stiffness)
