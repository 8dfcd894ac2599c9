"""Spectral radii and limit depths of the two-tooth benchmark.

System: T. Insperger, G. Stepan, "Updated semi-discretization method for periodic delay-differential
equations with discrete delay", Int. J. Numer. Meth. Engng 61 (2004) 117-141; also Y. Ding et al.,
Int. J. Mach. Tools Manuf. 50 (2010) 502-509. The converged values below were computed by two other
methods and are given to the digits printed.
"""

import numpy as np
import pytest

from chatter_core.floquet import MethodSettings, analyse
from tests.conftest import COLLOCATION, milling_benchmark


def test_spectral_radius_of_slotting():
    depths = [0.2, 0.5, 0.7, 1.0]
    equation = milling_benchmark(direction="slot", immersion=1.0, rpm=[5000.0] * 4, depth_mm=depths, axes=(0,))
    radius = np.abs(analyse(equation, COLLOCATION).multiplier)
    # The values have five decimals; the default resolution is held to 1e-4.
    assert radius == pytest.approx([0.81974, 1.07398, 1.22156, 1.40647], rel=1e-4)
    fine = np.abs(analyse(equation, COLLOCATION, 2.0).multiplier)
    assert fine == pytest.approx([0.81974, 1.07398, 1.22156, 1.40647], abs=6e-6)


def test_spectral_radius_of_half_immersion_far_above_the_boundary():
    equation = milling_benchmark(direction="down", immersion=0.5, rpm=[5000.0], depth_mm=[2.0], axes=(0, 1))
    # 7.18876 has six digits.
    assert np.abs(analyse(equation, COLLOCATION, 2.0).multiplier[0]) == pytest.approx(7.18876, abs=5e-6)


@pytest.mark.parametrize(
    ("order", "intervals", "radius", "accuracy"), [(0, 40, 6.41, 5e-3), (0, 640, 7.15, 5e-3), (1, 40, 7.0786, 1e-4)]
)
def test_semi_discretization_has_its_known_error(order, intervals, radius, accuracy):
    # The textbook method is right only if it is wrong by as much as others found, to their digits.
    equation = milling_benchmark(direction="down", immersion=0.5, rpm=[5000.0], depth_mm=[2.0], axes=(0, 1))
    method = MethodSettings(name="semi_discretization", intervals=intervals, order=order)
    assert np.abs(analyse(equation, method).multiplier[0]) == pytest.approx(radius, abs=accuracy)


@pytest.mark.parametrize(
    ("direction", "limits_mm"),
    [("down", [0.84720, 0.79793, 2.10469, 2.59624, 0.71964]), ("up", [0.26028, 0.40604, 0.21353, 0.25887, 1.18530])],
)
def test_limit_depths_of_half_immersion(direction, limits_mm):
    speeds = [5000.0, 8000.0, 10000.0, 15000.0, 20000.0]
    equation = milling_benchmark(direction=direction, immersion=0.5, rpm=speeds, depth_mm=limits_mm, axes=(0,))
    # Depths are given to 5e-6 mm; d(ln radius)/d(ln depth) is at most 3 here, so 3e-5 in the radius
    # at the shallowest limit is what the digits and the resolution of 1e-5 together leave.
    assert np.abs(analyse(equation, COLLOCATION).multiplier) == pytest.approx(np.ones(5), abs=3e-5)


def test_kinds_of_stability_loss_in_down_milling():
    equation = milling_benchmark(
        direction="down", immersion=0.5, rpm=[10000.0, 15000.0], depth_mm=[2.10469, 2.59624], axes=(0,)
    )
    solution = analyse(equation, COLLOCATION)
    # A flip: real, and the strongest line is an odd multiple of half the tooth passing frequency.
    assert np.all(solution.multiplier.imag == 0.0)
    assert np.all(solution.multiplier.real < 0.0)
    strongest = np.linalg.norm(solution.output, axis=-1).argmax(axis=-1)
    line = np.abs(solution.exponent[[0, 1], strongest].imag) * equation.period / np.pi
    # The line is known from the multiplier's angle, which is exact for a real one: rounding alone.
    assert line % 2.0 == pytest.approx([1.0, 1.0], abs=1e-12)
