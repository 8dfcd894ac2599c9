"""The dominant Ritz pair against all eigenvalues of numpy, filtered or not, with ties and without."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter_core.floquet import ritz

TOLERANCE = 1e-9


def hessenberg(size: int, seed: int, values: list[complex]) -> np.ndarray:
    """A matrix (size + 1, size) whose square part has some eigenvalues of modulus about one and small others."""
    random = np.random.default_rng(seed)
    blocks = np.diag(random.uniform(-0.5, 0.5, size))
    for place, value in enumerate(values):
        at = slice(2 * place, 2 * place + 2)
        blocks[at, at] = [[value.real, value.imag], [-value.imag, value.real]]
    basis = np.linalg.qr(random.normal(size=(size, size)))[0] * random.uniform(0.5, 2.0, size)
    matrix = np.linalg.solve(basis, blocks @ basis)
    # Arnoldi's method turns any matrix into a Hessenberg matrix of the same eigenvalues.
    vectors = [np.ones(size) / np.sqrt(size)]
    result = np.zeros((size + 1, size))
    for j in range(size):
        new = matrix @ vectors[j]
        for _ in range(2):
            for i, known in enumerate(vectors):
                overlap = known @ new
                result[i, j] += overlap
                new = new - overlap * known
        if j + 1 < size:
            result[j + 1, j] = np.linalg.norm(new)
            vectors.append(new / result[j + 1, j])
    return result


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    size=st.integers(8, 30),
    seed=st.integers(0, 10_000),
    moduli=st.lists(st.floats(0.7, 1.3), min_size=1, max_size=4),
    angles=st.lists(st.floats(0.3, 2.8), min_size=4, max_size=4),
    tie=st.booleans(),
)
def test_the_dominant_pair_is_that_of_all_eigenvalues(size, seed, moduli, angles, tie):
    if tie:
        moduli = [moduli[0]] * len(moduli)
    values = [modulus * np.exp(1j * angle) for modulus, angle in zip(moduli, angles, strict=False)]
    matrix = hessenberg(size, seed, values)
    basis = np.eye(size + 1)[None, :, :size]
    value, vector, residual = ritz.dominant_pair(basis, matrix[None], TOLERANCE)
    exact = np.linalg.eigvals(matrix[:size])
    # The filter settles pairs to a tenth of the tolerance; ill-conditioned ones magnify it.
    assert abs(value[0]) == pytest.approx(np.abs(exact).max(), rel=1e-6)
    assert value[0].imag >= 0.0
    assert np.linalg.norm(matrix[:size] @ vector[0] - value[0] * vector[0]) <= 1e-8 * abs(value[0])
    assert residual[0] == pytest.approx(0.0, abs=1e-12)


def test_what_is_not_finite_or_zero_has_no_residual():
    matrices = np.zeros((2, 21, 20))
    matrices[0, 3, 4] = np.inf
    basis = np.repeat(np.eye(21)[None, :, :20], 2, axis=0)
    value, _, residual = ritz.dominant_pair(basis, matrices, TOLERANCE)
    assert np.array_equal(value, [0.0, 0.0])
    assert np.isnan(residual).all()
