"""Linear equations by few directions, against elimination."""

import numpy as np
import pytest

from chatter_core.linear_equations import DIRECTIONS, solve


@pytest.mark.parametrize(("unknowns", "strong"), [(1, 1), (5, 2), (120, 0), (200, 12), (200, 2 * DIRECTIONS)])
def test_the_solution_is_that_of_elimination_whether_few_directions_hold_it_or_not(unknowns, strong):
    """One but for some strong directions: as many of these as are needed, and one more, hold the solution."""
    rng = np.random.default_rng(5)
    left, right = rng.standard_normal((2, unknowns, strong))
    matrix = np.eye(unknowns) + left @ right.T / unknowns
    wanted = rng.standard_normal(unknowns)
    # What is left of the right side, 1e-12, is enlarged by the condition number, about a thousand at most here.
    assert np.linalg.cond(matrix) < 1e4
    assert np.allclose(solve(matrix, matrix @ wanted), wanted, rtol=0.0, atol=1e-8)


def test_nothing_solves_equations_without_a_right_side():
    assert np.array_equal(solve(np.eye(3) + 0.1, np.zeros(3)), np.zeros(3))
