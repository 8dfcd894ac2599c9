"""Linear equations by few directions, against what they were made from."""

import numpy as np
import pytest

from chatter_core.linear_equations import DIRECTIONS, solve

RNG = np.random.default_rng(5)


def identity_with(unknowns: int, strong: int):
    """A matrix that is the identity but for some strong directions: as many, and one more, hold the solution."""
    left, right = RNG.standard_normal((2, unknowns, strong))
    return np.eye(unknowns) + left @ right.T / unknowns


CASES = {
    "one": (identity_with(1, 1), False),
    "few": (identity_with(120, 2), False),
    "some": (identity_with(200, 12), False),
    # Every direction but the last is at right angles to what is left: none brings the answer nearer.
    "a ring": (np.roll(np.eye(3 * DIRECTIONS), 1, axis=0), True),
    "no order": (np.eye(200) + 0.06 * RNG.standard_normal((200, 200)), True),
}


@pytest.mark.parametrize(("matrix", "eliminates"), CASES.values(), ids=CASES)
def test_the_solution_is_found_by_few_directions_or_by_elimination(matrix, eliminates, monkeypatch):
    wanted = np.zeros(len(matrix))
    wanted[0] = 1.0
    calls, eliminate = [], np.linalg.solve
    with monkeypatch.context() as watched:
        watched.setattr(np.linalg, "solve", lambda *equations: calls.append(1) or eliminate(*equations))
        plain = solve.py_func(matrix, matrix @ wanted)
    assert bool(calls) == eliminates
    # What is left of the right side, 1e-12 of it, is enlarged by the condition number at most.
    assert np.linalg.cond(matrix) < 1e3
    for found in (plain, solve(matrix, matrix @ wanted)):
        assert np.allclose(found, wanted, rtol=0.0, atol=1e-9 * np.linalg.norm(matrix @ wanted))


def test_nothing_solves_equations_without_a_right_side():
    assert np.array_equal(solve(np.eye(3) + 0.1, np.zeros(3)), np.zeros(3))
