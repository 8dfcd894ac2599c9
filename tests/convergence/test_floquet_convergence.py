"""Observed orders of the methods of Floquet analysis."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.floquet import MethodSettings, analyse
from tests.conftest import COLLOCATION, milling_benchmark, oscillator


def radius(equation, method, refinement=1.0):
    return np.abs(analyse(equation, method, refinement).multiplier)


def semi_discretization(intervals, order):
    return MethodSettings(name="semi_discretization", intervals=intervals, order=order)


def observed_orders(equation, exact, order, numbers):
    errors = [abs(radius(equation, semi_discretization(n, order))[0] - exact) for n in numbers]
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


@pytest.mark.parametrize(("order", "expected", "allowed"), [(0, 1.0, 0.15), (1, 2.0, 0.05)])
def test_semi_discretization_of_milling_converges_with_its_order(order, expected, allowed):
    equation = milling_benchmark(direction="down", immersion=0.5, rpm=[5000.0], depth_mm=[1.0], axes=(0, 1))
    exact = radius(equation, COLLOCATION, 3.0)[0]
    # Order zero comes down to one from 1.4 at n = 80 and has 1.1 here; order one is settled.
    assert observed_orders(equation, exact, order, (320, 640, 1280)) == pytest.approx(expected, abs=allowed)


@pytest.mark.parametrize(("order", "expected"), [(0, 1.0), (1, 2.0), (2, 3.0)])
@pytest.mark.parametrize("delay_share", [1.0, 0.7113])
def test_semi_discretization_with_a_steady_gain_converges_with_the_order_of_its_polynomial(
    order, expected, delay_share
):
    """Without a periodic gain nothing else is approximated; also for a delay of no whole number of intervals."""
    period, frequency, damping, gain = 1.0, 9.0, 0.05, 12.0
    equation = oscillator(frequency=frequency, damping=damping, mass=1.0, gain=gain, period=period)
    delay = delay_share * period
    equation = replace(equation, feedback=(replace(equation.feedback[0], delay=np.array([delay])),))

    def characteristic(s):
        return s**2 + 2.0 * damping * frequency * s + frequency**2 + gain * (1.0 - np.exp(-s * delay))

    # The finest result starts the search for the exact exponent, which is then known to rounding.
    start = np.log(analyse(equation, semi_discretization(1280, 2)).multiplier[0]) / period
    candidates = start + 2j * np.pi * np.arange(-4, 5) / period
    exponent = candidates[np.abs(characteristic(candidates)).argmin()]
    for _ in range(20):
        slope = (characteristic(exponent + 1e-6) - characteristic(exponent - 1e-6)) / 2e-6
        exponent -= characteristic(exponent) / slope
    numbers = np.unique(np.geomspace(60, 240, 24).astype(int))
    errors = [abs(radius(equation, semi_discretization(n, order))[0] - np.exp(exponent.real * period)) for n in numbers]
    # Where the delay falls between the samples changes with their number, and the error with it: over
    # 24 numbers the slope of what it is at most is seen to a quarter of an order.
    highest = np.maximum.accumulate(np.array(errors)[::-1])[::-1]
    assert -np.polyfit(np.log(numbers), np.log(highest), 1)[0] == pytest.approx(expected, abs=0.25)


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
    coarse, finer = (radius(equation, semi_discretization(n, 0)) for n in (320, 640))
    # Richardson's extrapolation of a first-order method leaves an error of second order:
    # at n = 640 the error is 1e-2, its square about 1e-4, with a constant of a few.
    assert 2.0 * finer - coarse == pytest.approx(fine, abs=1e-3)
