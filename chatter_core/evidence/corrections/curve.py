"""A smooth function of one variable whose shape nobody has to know, as a few independent normal numbers.

ln f(x) is the natural cubic spline through its values v at knots. Before the data v is normal around zero, alike
where knots are close: a Gaussian process with Matern's covariance of order 5/2, seen at the knots,

    cov(v_i, v_j) = s^2 (1 + r + r^2/3) exp(-r),  r = sqrt(5) |x_i - x_j| / length,

and v = L z with L L^T that covariance, so that all z are independent and of unit width.

Source: C. E. Rasmussen, C. K. I. Williams, Gaussian Processes for Machine Learning (2006), equation 4.17;
M. C. Kennedy, A. O'Hagan, J. R. Stat. Soc. B 63 (2001) 425-464 (what a model lacks as a Gaussian process that is
fitted beside its calibration).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from chatter_core.parameters import Array

#: Distance over which f may change, as a share of the range: a trend, or one bump. What is shorter than the distance of
#: neighbouring lobes would follow each lobe by itself and be no property of the machine.
LENGTH = 1.0 / 3.0
#: Knots, at most: two to a length, where a cubic follows the process to a tenth of its width, by the covariance.
MOST_KNOTS = 7
#: Directions of the covariance with less than this share of the largest variance are none: rounding.
SMALLEST_SHARE = 1e-9


@dataclass(frozen=True, kw_only=True)
class Curve:
    """ln f over x, between the first and the last of its knots (knot,), ascending; beyond them as at the ends.

    amplitude: s, the width of ln f before the data; level: whether f may differ from 1 as a whole; without, the
    values at the knots have mean zero.
    """

    knots: tuple[float, ...]
    amplitude: float
    level: bool

    @property
    def count(self) -> int:
        """How many numbers z it takes."""
        return int(self.root.shape[1])

    @cached_property
    def root(self) -> Array:
        """L of v = L z (knot, number): the principal directions of the covariance, the widest first."""
        knots = np.array(self.knots)
        covariance = matern(knots, LENGTH * (knots[-1] - knots[0]), self.amplitude)
        if not self.level:
            centre = np.eye(len(knots)) - 1.0 / len(knots)
            covariance = centre @ covariance @ centre
        variance, direction = np.linalg.eigh(covariance)
        kept = np.flatnonzero(variance > SMALLEST_SHARE * variance[-1])[::-1]
        return np.asarray(direction[:, kept] * np.sqrt(variance[kept]))

    def slope(self, x: Array) -> Array:
        """Return the derivatives of ln f at places (place,) by the numbers z, (place, number)."""
        spline = CubicSpline(self.knots, np.eye(len(self.knots)), bc_type="natural")
        return np.asarray(spline(np.clip(x, self.knots[0], self.knots[-1])) @ self.root)

    def log_factor(self, x: Array, values: Array) -> Array:
        """Return ln f (place,) at places (place,) for numbers z, ``values`` (number,)."""
        return np.asarray(self.slope(x) @ values)


def matern(x: Array, length: float, amplitude: float) -> Array:
    """Return the covariance (place, place) of ln f between places (place,): alike over a length, of a certain width.

    See docs/physics.md#corrections.
    """
    r = np.sqrt(5.0) * np.abs(x[:, None] - x) / length
    return np.asarray(amplitude**2 * (1.0 + r + r**2 / 3.0) * np.exp(-r))


def curve_over(places: Array, *, amplitude: float, level: bool) -> Curve:
    """Return a curve over the range of measured places (any,), with evenly spaced knots, as many as differ at most.

    places: two of them differ at least.

    See docs/physics.md#corrections.
    """
    distinct = np.unique(places)
    knots = np.linspace(distinct[0], distinct[-1], min(len(distinct), MOST_KNOTS))
    return Curve(knots=tuple(knots.tolist()), amplitude=amplitude, level=level)
