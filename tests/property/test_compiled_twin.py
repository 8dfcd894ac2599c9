"""The compiled collocation and its plain twin: the same mathematics, so the same numbers but for rounding."""

import numpy as np
import pytest
from hypothesis import given, settings

from chatter_core.floquet import (
    MethodSettings,
    analyse,
    analyse_leading,
    collocation,
    compiled,
)
from chatter_core.floquet import (
    leading_multipliers as leading_of,
)
from chatter_core.floquet.multipliers import critical_motion, leading_multipliers
from tests.conftest import milling_benchmark, oscillator
from tests.property.test_stability_invariances import CUTS, MODES, equation, tip_modes


def agree(problem) -> None:
    plain, fast = critical_motion(collocation.build(problem)), critical_motion(compiled.build(problem))
    assert np.array_equal(plain.converged, fast.converged)
    # Both iterate to a residual of 1e-9; multipliers near a double one magnify it.
    assert np.abs(fast.multiplier) == pytest.approx(np.abs(plain.multiplier), rel=1e-7)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(cut=CUTS, x=MODES, y=MODES)
def test_multipliers_are_the_same(cut, x, y):
    agree(equation(tip_modes(x, y), cut, "down"))


def test_a_batch_of_the_benchmark_is_the_same_and_each_point_alone_too():
    depths = np.linspace(0.2, 2.0, 9)
    together = milling_benchmark(
        direction="slot", immersion=1.0, rpm=[5000.0] * 9, depth_mm=depths.tolist(), axes=(0, 1)
    )
    agree(together)
    found = critical_motion(compiled.build(together)).multiplier
    for depth, value in zip(depths, found, strict=True):
        alone = milling_benchmark(direction="slot", immersion=1.0, rpm=[5000.0], depth_mm=[depth], axes=(0, 1))
        assert critical_motion(compiled.build(alone)).multiplier[0] == value


def test_one_input_an_overdamped_pair_of_poles_and_a_steady_gain():
    """Two real poles: their half of the spectrum is real, and nothing imaginary may enter."""
    agree(oscillator(frequency=3.0, damping=1.4, mass=1.0, gain=2.0, period=1.7))


@pytest.mark.parametrize("twin", [collocation, compiled])
def test_a_krylov_space_that_is_gone_on_from_is_the_one_that_is_built_at_once(twin):
    operator = twin.build(
        milling_benchmark(direction="slot", immersion=1.0, rpm=[5000.0] * 3, depth_mm=[0.2, 0.6, 2.0], axes=(0, 1))
    )
    start = np.random.default_rng(3).standard_normal(operator.shape[1])
    at_once, begun = operator.krylov(start, 12), operator.krylov(start, 5)
    kept = np.array([0, 2])
    gone_on = operator.select(kept).krylov(start, 12, tuple(part[kept] for part in begun))
    for part, other in zip(at_once, gone_on, strict=True):
        assert np.array_equal(part[kept], other)


def test_leading_multipliers_are_the_eigenvalues_of_the_map():
    """Of a deep cut, against the dense matrix that the plain twin maps the unit vectors to."""
    problem = milling_benchmark(direction="down", immersion=0.5, rpm=[6000.0], depth_mm=[4.0], axes=(0, 1))
    plain = collocation.build(problem)
    matrix = np.stack([plain.apply(unit[None])[0] for unit in np.eye(plain.shape[1])], axis=1)
    exact = np.linalg.eigvals(matrix)
    exact = exact[exact.imag >= 0.0]
    found = leading_multipliers(compiled.build(problem), 2, 1e-6)[0]
    # A residual of 1e-6, times the condition of multipliers that are far from normal.
    assert np.abs(found) == pytest.approx(np.sort(np.abs(exact))[::-1][:2], rel=1e-4)


def test_one_space_tells_the_critical_motion_and_those_beside_it():
    """Of cuts from idle to deep, what either finds by itself."""
    method = MethodSettings(name="collocation", tolerance=1e-4)
    problem = milling_benchmark(
        direction="down", immersion=0.5, rpm=[6000.0] * 3, depth_mm=[0.05, 0.8, 4.0], axes=(0, 1)
    )
    alone, (together, *beside) = analyse(problem, method), analyse_leading(problem, method, 3)
    leading = leading_of(problem, method, 3)
    # The same space is read for those beside it.
    for which, motion in enumerate(beside, start=1):
        known = np.where(motion.converged, motion.multiplier, np.nan)
        assert np.array_equal(known, leading[:, which], equal_nan=True)
    assert together.converged.all()
    # Each pair has a residual of at most 1e-7, and lines are as exact as their multiplier.
    assert together.multiplier == pytest.approx(alone.multiplier, rel=1e-5)
    assert np.abs(together.multiplier) == pytest.approx(np.abs(leading[:, 0]), rel=1e-5)
    strongest = np.abs(alone.output).sum(axis=-1).argmax(axis=-1)
    assert np.array_equal(strongest, np.abs(together.output).sum(axis=-1).argmax(axis=-1))


def test_forces_belong_to_the_same_motion():
    problem = milling_benchmark(direction="down", immersion=0.4, rpm=[7000.0], depth_mm=[0.8], axes=(0, 1))
    found = []
    for motion in (critical_motion(collocation.build(problem)), critical_motion(compiled.build(problem))):
        found.append((motion.time, motion.weight, motion.force / motion.force.ravel()[np.abs(motion.force).argmax()]))
    for plain, fast in zip(*found, strict=True):
        assert fast == pytest.approx(plain, rel=1e-6, abs=1e-6)
