"""Hertz point contact against potential theory, closed forms and its own limits.

K. L. Johnson, Contact Mechanics (1985), sections 3.5 and 4.2: curvatures and approach of an elliptic
contact as integrals of its potential, which need no elliptic function; and the ball on a plane.
"""

import itertools
import math
from typing import Any

import pytest
from scipy.integrate import quad

from chatter_core.hertz import Curvature, elliptic_contact, load_deflection_factor, race_curvature
from chatter_core.machine import Material

STEEL = Material.model_validate({"youngs_modulus_gpa": 206.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0})
CERAMIC = Material.model_validate({"youngs_modulus_gpa": 310.0, "poisson_ratio": 0.27, "density_kg_m3": 3200.0})


def potential(ratio: float, major_power: float, minor_power: float) -> float:
    """Integrate dw / ((1 + w)^major (1/ratio^2 + w)^minor w^0.5) from 0 to infinity, with w = t^2."""

    def integrand(t: float) -> float:
        return 2.0 * math.pow(1.0 + t * t, -major_power) * math.pow(ratio**-2 + t * t, -minor_power)

    # The integrand bends at t = 1 / ratio and at 1: cut there, so that every part is smooth.
    cuts = (0.0, 1.0 / ratio, 1.0, math.inf)
    parts = itertools.pairwise(cuts)
    return math.fsum(quad(integrand, *part, epsabs=0.0, epsrel=1e-12, limit=200)[0] for part in parts)


@pytest.mark.parametrize("ratio", [1.05, 2.0, 5.0, 9.0, 40.0])
def test_contact_solves_the_equations_of_its_potential(ratio: float) -> None:
    along, across = potential(ratio, 1.5, 0.5), potential(ratio, 0.5, 1.5)
    found = elliptic_contact((across - along) / (across + along))
    # The integrals are asked for 1e-12; the axes' ratio, found from 1 - F, loses up to two digits at 40.
    assert found.major / found.minor == pytest.approx(ratio, rel=1e-10)
    assert found.major == pytest.approx(((along + across) / math.pi) ** (1.0 / 3.0), rel=1e-10)
    assert found.approach == pytest.approx(potential(ratio, 0.5, 0.5) / math.pi / found.major, rel=1e-10)


def test_contact_becomes_a_circle() -> None:
    difference = 1e-3
    found = elliptic_contact(difference)
    # To first order a*, b* = 1 +- 2/3 F and delta* = 1; what is left out is F^2 = 1e-6.
    assert found.major == pytest.approx(1.0 + 2.0 / 3.0 * difference, abs=1e-6)
    assert found.minor == pytest.approx(1.0 - 2.0 / 3.0 * difference, abs=1e-6)
    assert found.approach == pytest.approx(1.0, abs=1e-6)


def test_factor_of_a_ball_on_a_plane() -> None:
    radius, modulus = 4e-3, 206e9 / (1.0 - 0.3**2) / 2.0
    found = load_deflection_factor(Curvature(sum=2.0 / radius, difference=1e-3), STEEL, STEEL)
    # Q = 4/3 E* R^0.5 delta^1.5 for a circle; the little ellipticity that is left is worth F^2 = 1e-6.
    assert found == pytest.approx(4.0 / 3.0 * modulus * math.sqrt(radius), rel=1e-6)


def test_compliances_of_two_materials_add() -> None:
    curvature = race_curvature(8.731e-3, 0.54, 0.3)

    def compliance(*pair: Any) -> float:
        return 1.0 / load_deflection_factor(curvature, *pair)

    # The same sum in another order: rounding alone.
    hybrid = compliance(CERAMIC, STEEL)
    assert hybrid == pytest.approx(0.5 * (compliance(STEEL, STEEL) + compliance(CERAMIC, CERAMIC)), rel=1e-14)
    assert hybrid == pytest.approx(compliance(STEEL, CERAMIC), rel=1e-14)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_curvatures_are_those_of_the_radii(side: float) -> None:
    """Principal radii: the ball's, the groove's (concave) and the race's, convex inside, concave outside."""
    ball, pitch, conformity, angle = 8.731e-3, 60e-3, 0.54, math.radians(15.0)
    ratio = ball * math.cos(angle) / pitch
    race = (pitch / math.cos(angle) - side * ball) / 2.0
    rolling, transverse = 2.0 / ball + side / race, 2.0 / ball - 1.0 / (conformity * ball)
    found = race_curvature(ball, conformity, side * 2.0 * ratio / (1.0 - side * ratio))
    # Two ways to add the same four fractions: rounding alone, on differences ten times smaller than the terms.
    assert found.sum == pytest.approx(rolling + transverse, rel=1e-13)
    assert found.difference == pytest.approx((rolling - transverse) / (rolling + transverse), rel=1e-13)
