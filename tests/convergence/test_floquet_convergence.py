"""Observed orders of the methods of Floquet analysis."""

import numpy as np
import pytest

from chatter_core.floquet import MethodSettings, analyse
from tests.conftest import COLLOCATION, milling_benchmark


def radius(equation, method, refinement=1.0):
    return np.abs(analyse(equation, method, refinement).multiplier)


def test_semi_discretization_converges_with_order_one():
    equation = milling_benchmark(direction="down", immersion=0.5, rpm=[5000.0], depth_mm=[1.0], axes=(0, 1))
    exact = radius(equation, COLLOCATION, 3.0)[0]
    errors = [
        abs(radius(equation, MethodSettings(name="semi_discretization", intervals=n))[0] - exact)
        for n in (320, 640, 1280)
    ]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    # Order zero of the coefficients gives order one of the error; observed orders come
    # down to it from 1.4 at n = 80, to 1.1 here.
    assert orders == pytest.approx(np.ones(2), abs=0.15)


def test_collocation_converges_far_faster_than_its_number_of_nodes():
    equation = milling_benchmark(direction="slot", immersion=1.0, rpm=[3000.0], depth_mm=[0.6], axes=(0,))
    exact = radius(equation, COLLOCATION, 8.0)[0]
    errors = np.array([abs(radius(equation, COLLOCATION, r)[0] - exact) for r in (0.5, 1.0, 2.0)])
    orders = np.log2(errors[:-1] / errors[1:])
    # Six Gauss nodes: the state at the end of an element is of order 12, what the delay sees at the
    # nodes between is of order 7 at least; halving must gain more than 2^6 each time.
    assert np.all(orders > 6.0)


def test_both_methods_have_one_limit(reference_machine):
    from chatter_core.chain import milling_equation, structure

    speed = np.array([6000.0, 16000.0]) * 2.0 * np.pi / 60.0
    built = structure(reference_machine, speed, mode_count=4)
    equation = milling_equation(reference_machine, built, np.array([0, 1]), np.array([1.2e-3, 1.2e-3]))
    fine = radius(equation, COLLOCATION, 2.0)
    coarse, finer = (radius(equation, MethodSettings(name="semi_discretization", intervals=n)) for n in (320, 640))
    # Richardson's extrapolation of a first-order method leaves an error of second order:
    # at n = 640 the error is 1e-2, its square about 1e-4, with a constant of a few.
    assert 2.0 * finer - coarse == pytest.approx(fine, abs=1e-3)
