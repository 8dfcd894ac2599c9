"""Linear equations by few directions, against what they were made from."""

import numpy as np
import pytest

from chatter_core.linear_equations import arrived, begun, combined

RNG = np.random.default_rng(5)


def solved(matrix, right):
    """Return the solution, and how many directions hold it."""
    found = begun(right)
    for number in range(len(right)):
        if arrived(found, number, matrix @ found.basis[number]):
            break
    return combined(found, number), number + 1


def identity_with(unknowns: int, strong: int):
    """A matrix that is the identity but for some strong directions: as many, and one more, hold the solution."""
    left, right = RNG.standard_normal((2, unknowns, strong))
    return np.eye(unknowns) + left @ right.T / unknowns


#: Equations, and how many directions hold the solution at most.
CASES = {
    "one": (identity_with(1, 1), 1),
    "few": (identity_with(120, 2), 3),
    "some": (identity_with(200, 12), 13),
    # Every direction but the last is at right angles to what is left: none brings the answer nearer.
    "a ring": (np.roll(np.eye(180), 1, axis=0), 180),
    "no order": (np.eye(200) + 0.06 * RNG.standard_normal((200, 200)), 200),
}


@pytest.mark.parametrize(("matrix", "most"), CASES.values(), ids=CASES)
def test_few_directions_hold_the_solution_or_as_many_as_it_takes(matrix, most):
    wanted = np.zeros(len(matrix))
    wanted[0] = 1.0
    found, asked = solved(matrix, matrix @ wanted)
    assert asked <= most
    # What is left of the right side, 1e-8 of it, is enlarged by the condition number at most.
    assert np.linalg.cond(matrix) < 1e3
    assert np.allclose(found, wanted, rtol=0.0, atol=1e-5 * np.linalg.norm(matrix @ wanted))


def test_equations_without_a_solution_end_at_what_is_not_a_number():
    found, asked = solved(np.zeros((3, 3)), np.ones(3))
    assert asked == 1
    assert np.isnan(found).all()
