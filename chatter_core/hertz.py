"""Hertz contact of a ball on a grooved race, by exact elliptic integrals.

Source: T. A. Harris, M. N. Kotzalas, Essential Concepts of Bearing Technology, 5th ed. (2007),
chapter 6: curvature sum and difference, dimensionless semi-axes and approach, and the
load-deflection factor of a point contact.
"""

import math
from dataclasses import dataclass

from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from chatter_core.machine import Material

#: Ratio of the semi-axes that is looked for at most.
LARGEST_AXIS_RATIO = 1e4


@dataclass(frozen=True, kw_only=True)
class EllipticContact:
    """Dimensionless semi-axes a*, b* and approach of the surfaces delta* of a point contact."""

    major: float
    minor: float
    approach: float


@dataclass(frozen=True, kw_only=True)
class Curvature:
    """Sum [1/m] and difference F(rho) [-] of the principal curvatures of two bodies in contact."""

    sum: float
    difference: float


def elliptic_contact(difference: float) -> EllipticContact:
    """Return the dimensionless contact for a curvature difference F(rho).

    Solves F(rho) = ((kappa^2 + 1) E - 2 K) / ((kappa^2 - 1) E) for the ratio kappa of the semi-axes.
    Valid for 0 < F(rho) < 0.9999. Source: Harris and Kotzalas (2007), chapter 6.

    See docs/physics.md#contact.
    """

    def mismatch(log_ratio: float) -> float:
        squared = math.exp(2.0 * log_ratio)
        first, second = ellipk(1.0 - 1.0 / squared), ellipe(1.0 - 1.0 / squared)
        return float(((squared + 1.0) * second - 2.0 * first) / ((squared - 1.0) * second)) - difference

    ratio = math.exp(brentq(mismatch, 1e-4, math.log(LARGEST_AXIS_RATIO), xtol=1e-14, rtol=1e-14))
    first, second = float(ellipk(1.0 - ratio**-2)), float(ellipe(1.0 - ratio**-2))
    return EllipticContact(
        major=(2.0 * ratio**2 * second / math.pi) ** (1.0 / 3.0),
        minor=(2.0 * second / (math.pi * ratio)) ** (1.0 / 3.0),
        approach=2.0 * first / math.pi * (math.pi / (2.0 * ratio**2 * second)) ** (1.0 / 3.0),
    )


def race_curvature(ball_diameter: float, conformity: float, across: float) -> Curvature:
    """Return the curvatures of a ball [m] on a race.

    ``conformity`` is groove radius over ball diameter; ``across`` is the race's own curvature in the
    rolling direction times the ball diameter, 2 g / (1 - g) for the inner and -2 g / (1 + g) for the
    outer race with g = D cos(alpha) / d_m. Source: Harris and Kotzalas (2007), chapter 2.

    See docs/physics.md#contact.
    """
    total = 4.0 - 1.0 / conformity + across
    return Curvature(sum=total / ball_diameter, difference=(1.0 / conformity + across) / total)


def load_deflection_factor(curvature: Curvature, ball: Material, ring: Material) -> float:
    """Return K of Q = K delta^1.5 for one contact [N/m^1.5]; ball and ring may differ in material.

    See docs/physics.md#contact.
    """
    compliance = (1.0 - ball.poisson_ratio**2) / ball.youngs_modulus + (
        1.0 - ring.poisson_ratio**2
    ) / ring.youngs_modulus
    approach = elliptic_contact(curvature.difference).approach
    return float(2.0 * curvature.sum / (3.0 * compliance) * (2.0 / (approach * curvature.sum)) ** 1.5)
