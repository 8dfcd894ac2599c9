"""Beam elements against frequencies that textbooks give in closed form.

Euler-Bernoulli: R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), table 8-1.
Timoshenko, pinned: the closed form of S. Timoshenko, Phil. Mag. 41 (1921) 744-746, from the
quadratic in the squared frequency.
"""

import math

import numpy as np
import pytest
import scipy.linalg

from chatter_core.machine import Section, Spindle
from chatter_core.spindle import assemble, reduce_rotor, shear_coefficient, supported_modes

E, RHO, NU, LENGTH, DIAMETER = 206e9, 7800.0, 0.3, 0.5, 0.04


def uniform(beam: str, elements: int = 60, diameter: float = DIAMETER):
    section = {
        "part": "shaft", "length_mm": LENGTH * 1e3, "outer_diameter_mm": diameter * 1e3,
        "youngs_modulus_gpa": E * 1e-9, "poisson_ratio": NU, "density_kg_m3": RHO,
    }  # fmt: skip
    spindle = Spindle.model_validate(
        {
            "sections": [section],
            "bearings": [{"position_mm": 0.0}, {"position_mm": LENGTH * 1e3}],
            "preload_n": 1.0,
            "preload_type": "constant",
            "damping": {"kind": "modal", "ratio": 0.01},
            "beam": beam,
        }
    )
    return assemble(spindle, elements)


def frequencies(rotor, fixed: list[int], count: int) -> np.ndarray:
    free = np.delete(np.arange(len(rotor.mass)), fixed)
    squared = scipy.linalg.eigh(rotor.stiffness[np.ix_(free, free)], rotor.mass[np.ix_(free, free)], eigvals_only=True)
    return np.sqrt(np.abs(squared))[:count]


@pytest.mark.parametrize(
    ("fixed", "skipped", "roots"),
    [
        pytest.param([], 2, [4.73004074, 7.85320462, 10.9956078], id="free"),
        pytest.param([-2, -1], 0, [1.87510407, 4.69409113, 7.85475744], id="clamped at one end"),
        pytest.param([0, -2], 0, [math.pi, 2.0 * math.pi, 3.0 * math.pi], id="pinned"),
    ],
)
def test_thin_beam(fixed, skipped, roots):
    rotor = uniform("euler_bernoulli")
    size = len(rotor.mass)
    found = frequencies(rotor, [f % size for f in fixed], skipped + 3)[skipped:]
    area, inertia = math.pi * DIAMETER**2 / 4.0, math.pi * DIAMETER**4 / 64.0
    exact = np.array(roots) ** 2 * math.sqrt(E * inertia / (RHO * area)) / LENGTH**2
    # Cubic elements err by (root / elements)^4 / 720, 1e-6 for the third root and 60 elements.
    assert found == pytest.approx(exact, rel=2e-6)


def test_thick_pinned_beam():
    rotor = uniform("timoshenko", elements=400)
    area, inertia = math.pi * DIAMETER**2 / 4.0, math.pi * DIAMETER**4 / 64.0
    kappa = 6.0 * (1.0 + NU) / (7.0 + 6.0 * NU)
    shear = kappa * E / (2.0 * (1.0 + NU)) * area
    found = frequencies(rotor, [0, len(rotor.mass) - 2], 3)
    for number, value in enumerate(found, start=1):
        wave = number * math.pi / LENGTH
        # rho^2 I A/(kGA) w^4 - (rho A + rho I k^2 + rho A E I k^2 / kGA) w^2 + E I k^4 = 0
        quartic = [
            RHO * inertia * RHO * area / shear,
            -(RHO * area + RHO * inertia * wave**2 + RHO * area * E * inertia * wave**2 / shear),
            E * inertia * wave**4,
        ]
        exact = math.sqrt(min(np.roots(quartic)))
        # Second order in the element length: 400 elements leave less than 1e-5 at the third mode.
        assert value == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize(("beam", "order"), [("euler_bernoulli", 4.0), ("timoshenko", 2.0)])
def test_observed_order_of_the_elements(beam, order):
    fixed = [0]
    # The reference has 8 times the finest mesh, so its own error stays below 2 % of the finest one's.
    reference = frequencies(uniform(beam, 160), [0, len(uniform(beam, 160).mass) - 2], 4)[3]
    errors = []
    for elements in (5, 10, 20):
        rotor = uniform(beam, elements)
        errors.append(abs(frequencies(rotor, [*fixed, len(rotor.mass) - 2], 4)[3] / reference - 1.0))
    observed = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    # On the fourth mode the coarsest mesh is not yet in the asymptote: a quarter of an order is allowed.
    assert observed[-1] == pytest.approx(order, abs=0.25)


def test_cowper_coefficient():
    solid = Section.model_validate(
        {
            "part": "s",
            "length_mm": 1,
            "outer_diameter_mm": 10,
            "youngs_modulus_gpa": 200,
            "poisson_ratio": 0.3,
            "density_kg_m3": 7800,
        }
    )
    thin = solid.model_copy(update={"inner_diameter": 0.9999 * solid.outer_diameter})
    # Cowper (1966), table 1: circle 6 (1 + nu) / (7 + 6 nu), thin tube 2 (1 + nu) / (4 + 3 nu).
    assert shear_coefficient(solid) == pytest.approx(6.0 * 1.3 / 8.8, rel=1e-12)
    assert shear_coefficient(thin) == pytest.approx(2.0 * 1.3 / 4.9, rel=1e-4)


@pytest.mark.parametrize("stiffness", [1e5, 1e7, 1e8, 1e9, 1e10])
def test_reduced_rotor_has_the_frequencies_of_the_full_one(stiffness, reference_machine):
    rotor = assemble(reference_machine.spindle)
    seats = stiffness * np.array([1.0, 2.0])
    supported = rotor.stiffness.copy()
    supported[rotor.seats, rotor.seats] += seats
    squared, shapes = scipy.linalg.eigh(supported, rotor.mass, subset_by_index=(0, 5))
    modes = supported_modes(reduce_rotor(rotor), seats[None, :])
    # Static attachment shapes leave errors of the fourth power of (mode / first mode left out):
    # most for rigid seats, 1e5 times as stiff as the softest.
    assert modes.natural_frequency[0, :6] == pytest.approx(np.sqrt(squared), rel=3e-5)
    assert np.abs(modes.tip_deflection[0, :4]) == pytest.approx(np.abs(shapes[0, :4]), rel=3e-5)
