"""The delayed Mathieu equation without its parametric term, and with damping by a determinant.

x'' + c x' + d x = b x(t - 2 pi), looked at with the period 2 pi. Undamped, its stability boundaries are
the straight lines b = (-1)^k (d - k^2 / 4): C. S. Hsu, S. J. Bhatt, J. Appl. Mech. 33 (1966) 119-124;
T. Insperger, G. Stepan, Proc. R. Soc. A 458 (2002) 2989-2998. Between two neighbouring lines,
k^2/4 < d < (k + 1)^2/4, it is stable in a triangle on one side of the axis b = 0.
"""

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

from chatter_core.floquet import DelayedFeedback, DelayEquation, LinearSystem, MethodSettings, analyse
from tests.conftest import COLLOCATION

METHODS = pytest.mark.parametrize(
    ("method", "accuracy"),
    # Collocation at twice its default resolution; second order with a step of 2 pi / 300.
    [(COLLOCATION, 1e-7), (MethodSettings(name="semi_discretization", intervals=300, order=2), 1e-4)],
    ids=lambda value: getattr(value, "name", ""),
)


def multiplier(damping, detuning, feedback, method) -> complex:
    """Return the critical multiplier; the restoring force d x is split as (d - b) x + b (x - x_delayed)."""
    system = LinearSystem(
        state_matrix=np.array([[[0.0, 1.0], [feedback - detuning, -damping]]]),
        input_matrix=np.array([[[0.0], [1.0]]]),
        output_matrix=np.array([[[1.0, 0.0]]]),
    )
    term = DelayedFeedback(gain=lambda time: np.full((*time.shape, 1, 1), -feedback), delay=np.array([2.0 * math.pi]))
    problem = DelayEquation(
        system=system,
        system_index=np.zeros(1, dtype=int),
        feedback=(term,),
        period=np.array([2.0 * math.pi]),
        breakpoints=np.zeros((1, 1)),
    )
    return complex(analyse(problem, method, 2.0).multiplier[0])


@METHODS
@pytest.mark.parametrize("triangle", [0, 1, 2, 3])
@pytest.mark.parametrize("place", [0.3, 0.5, 0.8])
def test_stable_triangles_end_at_straight_lines(triangle, place, method, accuracy):
    low, high = triangle**2 / 4.0, (triangle + 1) ** 2 / 4.0
    detuning = low + place * (high - low)
    side = (-1.0) ** triangle
    width = min(detuning - low, high - detuning)
    # A hair beside the line: on it, for k = 0, a free mass is left, whose two poles coincide.
    shares = (0.95, 1.0 - 1e-9, 1.05)
    inside, at, outside = (multiplier(0.0, detuning, side * share * width, method) for share in shares)
    assert abs(inside) < 1.0
    assert abs(at) == pytest.approx(1.0, abs=accuracy)
    assert abs(outside) > 1.0 + accuracy
    # On the lines of even k the multiplier is +1, on those of odd k it is -1.
    nearest = triangle if detuning - low < high - detuning else triangle + 1
    if place != 0.5:
        assert at == pytest.approx((-1.0) ** nearest, abs=max(accuracy, 1e-5))
    wrong_side = multiplier(0.0, detuning, -side * 0.5 * width, method)
    assert abs(wrong_side) > 1.0


@METHODS
def test_damped_multipliers_solve_the_characteristic_equation(method, accuracy):
    """The critical exponent s of s^2 + c s + d = b exp(-2 pi s), found by Newton's method from many starts."""
    damping, detuning, feedback = 0.2, 3.0, 0.7

    def characteristic(parts):
        s = complex(*parts)
        value = s**2 + damping * s + detuning - feedback * np.exp(-2.0 * math.pi * s)
        return [value.real, value.imag]

    roots = []
    for imaginary in np.linspace(0.0, 6.0, 40):
        found, _, flag, _ = fsolve(characteristic, [-0.1, imaginary], full_output=True, xtol=1e-13)
        if flag == 1:
            roots.append(found[0])
    expected = math.exp(2.0 * math.pi * max(roots))
    assert abs(multiplier(damping, detuning, feedback, method)) == pytest.approx(expected, rel=10.0 * accuracy)
