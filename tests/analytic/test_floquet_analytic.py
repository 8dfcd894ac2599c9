"""Floquet analysis against cases that can be solved on paper."""

import math
from dataclasses import replace

import numpy as np
import pytest

from chatter_core.errors import UnsupportedEquation
from chatter_core.floquet import (
    DelayedFeedback,
    DelayEquation,
    LinearSystem,
    MethodSettings,
    analyse,
    analyse_leading,
    collocation,
)
from chatter_core.floquet.collocation import NODES, SERIES_TERMS, gauss, integral_series
from tests.conftest import COLLOCATION, milling_benchmark, oscillator

METHODS = (COLLOCATION, MethodSettings(name="semi_discretization", intervals=400, order=0))


@pytest.mark.parametrize("lobe", [1, 3, 8])
def test_turning_least_limit_is_two_k_zeta_one_plus_zeta(lobe):
    """At the bottom of each lobe K = 2 k zeta (1 + zeta) is neutral at w = w_n sqrt(1 + 2 zeta).

    J. Tlusty, M. Polacek (1963): the least limit is -1 / (2 min Re H).
    """
    natural, zeta, mass = 2.0 * math.pi * 300.0, 0.03, 1.3
    stiffness = mass * natural**2
    gain = 2.0 * stiffness * zeta * (1.0 + zeta)
    chatter = natural * math.sqrt(1.0 + 2.0 * zeta)
    response = 1.0 / (stiffness - mass * chatter**2 + 2j * zeta * mass * natural * chatter)
    phase = np.angle(1.0 + 1.0 / (gain * response))  # exp(-i w tau) = 1 + 1 / (K H)
    period = (2.0 * math.pi * lobe - phase) / chatter
    solution = analyse(
        oscillator(frequency=natural, damping=zeta, mass=mass, gain=gain, period=period), COLLOCATION, 2.0
    )
    # Twice the default resolution, which errs by 6e-6 here.
    assert abs(solution.multiplier[0]) == pytest.approx(1.0, abs=1e-6)
    strongest = np.abs(solution.output[0, :, 0]).argmax()
    assert abs(solution.exponent[0, strongest].imag) == pytest.approx(chatter, rel=1e-6)


def test_motions_of_turning_are_roots_of_its_characteristic_equation_whatever_the_period_is_taken_for():
    """Of each motion one line is a root of m s^2 + c s + k + K (1 - exp(-s tau)), and it is the only one there is.

    Over four turns multipliers leave four lines to choose from in each of them.
    """
    natural, zeta, mass, delay = 2.0 * math.pi * 300.0, 0.03, 1.3, 0.013
    gain = 0.6 * mass * natural**2
    equation = oscillator(frequency=natural, damping=zeta, mass=mass, gain=gain, period=delay)
    found = []
    for period in (delay, 4.0 * delay):
        motions = analyse_leading(replace(equation, period=np.array([period])), COLLOCATION, 3)
        assert all(motion.converged[0] for motion in motions)
        root = np.array([motion.exponent[0, np.abs(motion.output[0, :, 0]).argmax()] for motion in motions])
        left = root**2 + 2.0 * zeta * natural * root + natural**2 + gain / mass * (1.0 - np.exp(-root * delay))
        # Multipliers beside the critical one have a residual of at most 1e-3, and s that over the period.
        assert np.abs(left) / natural**2 == pytest.approx(np.zeros(3), abs=2e-3)
        found.append(root.real + 1j * np.abs(root.imag))
    assert (found[0].real > 0.0).all()
    assert found[1] == pytest.approx(found[0], abs=1e-3 / delay)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_hayes_equation(method):
    """X' = -c (x - x(t - 1)) - a x: every multiplier exp(s) solves s + a + c = c exp(-s)."""
    a, c = 0.7, 1.9
    system = LinearSystem(
        state_matrix=np.array([[[-a]]]), input_matrix=np.array([[[1.0]]]), output_matrix=np.array([[[1.0]]])
    )
    feedback = DelayedFeedback(gain=lambda time: np.full((*time.shape, 1, 1), -c), delay=np.array([1.0]))
    equation = DelayEquation(
        system=system,
        system_index=np.zeros(1, dtype=int),
        feedback=(feedback,),
        period=np.array([1.0]),
        breakpoints=np.zeros((1, 1)),
    )
    s = np.log(analyse(equation, method).multiplier[0])
    # 1e-9: converged collocation; 2e-2: order zero with a step of 1/400 and |s| below 1.
    assert abs(s + a + c - c * np.exp(-s)) < (1e-9 if method.name == "collocation" else 2e-2)


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_without_cutting_the_multipliers_are_those_of_the_structure(method):
    equation = milling_benchmark(direction="up", immersion=0.3, rpm=[7000.0], depth_mm=[1e-9], axes=(0, 1))
    free = math.exp(-0.011 * 922.0 * 2.0 * math.pi * float(equation.period[0]))
    # A depth of 1e-9 mm moves the radius by about 1e-9.
    assert abs(analyse(equation, method).multiplier[0]) == pytest.approx(free, rel=1e-7)


@pytest.mark.parametrize("method", [COLLOCATION, MethodSettings(name="semi_discretization", intervals=50, order=0)])
def test_a_force_written_as_two_halves_is_the_same_force(method):
    one = oscillator(frequency=1.0, damping=0.1, mass=1.0, gain=0.3, period=2.0)
    half = DelayedFeedback(gain=lambda time: 0.5 * one.feedback[0].gain(time), delay=one.period)
    split = DelayEquation(
        system=one.system,
        system_index=one.system_index,
        feedback=(half, half),
        period=one.period,
        breakpoints=one.breakpoints,
    )
    # Rounding alone, and the residual of eigenvalues, 1e-7.
    assert analyse(split, method).multiplier == pytest.approx(analyse(one, method).multiplier, rel=1e-7)


def test_the_plain_twin_refuses_several_delays():
    one = oscillator(frequency=1.0, damping=0.1, mass=1.0, gain=0.3, period=2.0)
    with pytest.raises(UnsupportedEquation, match="one delay equal to the period"):
        collocation.build(replace(one, feedback=(*one.feedback, *one.feedback)))


def test_a_defective_structure_is_refused():
    equation = oscillator(frequency=1.0, damping=1.0, mass=1.0, gain=0.3, period=2.0)
    with pytest.raises(UnsupportedEquation, match="cannot be diagonalised"):
        analyse(equation, COLLOCATION)


def test_too_coarse_a_mesh_is_refused():
    equation = oscillator(frequency=1.0, damping=0.1, mass=1.0, gain=0.3, period=2.0)
    with pytest.raises(UnsupportedEquation, match=r"refinement: found 0.1, allowed: at least 0.5"):
        analyse(equation, COLLOCATION, 0.1)


def test_integrals_over_an_element_are_those_of_a_fine_quadrature():
    """Sixty Gauss nodes integrate exp(z (e - s)) l_j(s) to rounding for |z| up to 10."""
    nodes, _ = gauss(NODES)
    fine, weights = gauss(60)
    z = np.array([10j, -3.0 + 9.5j, 5.03j, -5.03, 0.01j])
    found = np.einsum("enm,km->ken", integral_series(), z[:, None] ** np.arange(SERIES_TERMS))
    for index, end in enumerate([*nodes, 1.0]):
        place = end * fine
        basis = np.array(
            [
                np.prod([(place - nodes[k]) / (nodes[j] - nodes[k]) for k in range(NODES) if k != j], axis=0)
                for j in range(NODES)
            ]
        )
        grown = np.exp(z[:, None] * (end - place)) * weights * end
        # Terms of up to e^10 cancel in the series: 2e4 times the rounding of one.
        assert found[:, index] == pytest.approx(grown @ basis.T, abs=2e-11)
