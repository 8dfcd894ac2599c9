"""The dominant Ritz pair of small Krylov spaces, compiled: one Hessenberg matrix per point.

Filtering comes first: powers of the matrix raise the eigenvalues of largest modulus so far above
all others that a tiny Krylov space, begun with what they leave of a vector, holds their eigenvectors.
Where it does not (more of them tie than it can hold), its residual says so and LAPACK finds all
eigenvalues. Source: Y. Saad, Numerical Methods for Large Eigenvalue Problems (2011), chapters 4 and 6.
"""

import math

import numpy as np
from numpy.typing import NDArray

from chatter_core.jit import compiled, scipy_routine

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Size of the tiny Krylov space, and squarings of the matrix before it. Tried on the reference machine:
#: of 768 spaces two had to be left to LAPACK; with 8 squarings a hundred.
FILTERED_SIZE, SQUARINGS = 6, 10
#: Smaller matrices are left to LAPACK at once.
LEAST_FILTERED = 13
#: The filter's residual must be below this share of the tolerance.
FILTER_SHARE = 0.1
#: Of a complex pair the value with positive angle is taken, whatever rounding says of their moduli.
TIE = 1e-12
#: A pivot below this share of the eigenvalue is rounding.
LEAST_PIVOT = 1e-16
#: Letters that BLAS and LAPACK take: eigenvalues only; no vectors, or not transposed.
EIGENVALUES_ONLY, NO = ord("E"), ord("N")
#: Eigenvalues of a Hessenberg matrix: job, compz, n, ilo, ihi, h, ldh, wr, wi, z, ldz, work, lwork, info.
_dhseqr = scipy_routine("lapack", "dhseqr", "cciiididddidii")
#: Matrix product: transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc.
_dgemm = scipy_routine("blas", "dgemm", "cciiiddididdi")


def dominant_pair(basis: Array, hessenberg: Array, tolerance: float) -> tuple[ComplexArray, ComplexArray, Array]:
    """Return the Ritz value of largest modulus (point,), its vector (point, size) and its residual (point,).

    basis: (point, steps + 1, size); hessenberg: (point, steps + 1, steps); tolerance: of the residual,
    relative to the value. Of a complex pair it is the value with positive angle. A matrix that is not
    finite, or that LAPACK cannot solve, gives zero and a residual that is not a number.

    See docs/physics.md#critical-multiplier.
    """
    points, _, size = basis.shape
    value, residual = np.zeros(points, dtype=complex), np.full(points, np.nan)
    vector = np.zeros((points, size), dtype=complex)
    _dominant_pairs(basis, hessenberg, tolerance, value, vector, residual)
    return value, vector, residual


def leading_pairs(hessenberg: Array, count: int, tolerance: float) -> tuple[ComplexArray, ComplexArray]:
    """Return the Ritz values of largest modulus (point, count) and their vectors (point, count, steps) in the space.

    Descending, one of each complex pair. hessenberg: (point, steps + 1, steps); zeros are left out, and those whose
    residual exceeds the tolerance, relative to the modulus; NaN stands where fewer are left.

    See docs/physics.md#critical-multiplier.
    """
    points, _, steps = hessenberg.shape
    found = np.full((points, count), np.nan, dtype=complex)
    vectors = np.full((points, count, steps), np.nan, dtype=complex)
    _leading_pairs(hessenberg, tolerance, found, vectors)
    return found, vectors


@compiled
def _leading_pairs(hessenberg, tolerance, found, vectors):  # type: ignore[no-untyped-def]
    size = hessenberg.shape[2]
    for p in range(len(found)):
        real, imaginary = _eigenvalues(hessenberg[p], size)
        order, taken = np.argsort(-np.hypot(real, imaginary)), 0
        for i in order:
            value = complex(real[i], imaginary[i])
            if taken == found.shape[1] or value == 0.0:
                break
            if imaginary[i] < 0.0:
                continue
            vector = _eigenvector(hessenberg[p], size, value)
            if hessenberg[p, size, size - 1] * abs(vector[size - 1]) <= tolerance * abs(value):
                found[p, taken], vectors[p, taken] = value, vector
                taken += 1


@compiled
def _dominant_pairs(basis, hessenberg, tolerance, value, vector, residual):  # type: ignore[no-untyped-def]
    size = hessenberg.shape[2]
    for p in range(len(value)):
        settled = False
        if size >= LEAST_FILTERED:
            value[p], coordinates, within = _filtered_pair(hessenberg[p], size)
            settled = within <= FILTER_SHARE * tolerance * abs(value[p])
        if not settled:
            value[p] = _largest_eigenvalue(hessenberg[p], size)
            if value[p] == 0.0:
                continue
            coordinates = _eigenvector(hessenberg[p], size, value[p])
        residual[p] = hessenberg[p, size, size - 1] * abs(coordinates[size - 1])
        for j in range(size):
            known, factor = basis[p, j], coordinates[j]
            for i in range(len(known)):
                vector[p, i] += factor * known[i]


@compiled
def _largest_eigenvalue(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return the eigenvalue of largest modulus, zero if there is none."""
    real, imaginary = _eigenvalues(hessenberg, size)
    best, largest = 0.0 + 0.0j, 0.0
    for i in range(size):
        modulus = math.hypot(real[i], imaginary[i]) * (1.0 + TIE * (imaginary[i] >= 0.0))
        if modulus > largest:
            best, largest = complex(real[i], imaginary[i]), modulus
    return best


@compiled
def _eigenvalues(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return real and imaginary parts of all eigenvalues; zeros if LAPACK finds none, or the matrix is not finite."""
    matrix, real, imaginary = np.empty((size, size)), np.zeros(size), np.zeros(size)
    for i in range(size):
        for j in range(size):
            matrix[j, i] = hessenberg[i, j]  # LAPACK counts along columns
            if not np.isfinite(hessenberg[i, j]):
                return real, imaginary
    letters, whole = np.empty(2, np.uint8), np.empty(7, np.int32)
    letters[0], letters[1] = EIGENVALUES_ONLY, NO
    whole[0], whole[1], whole[2], whole[3], whole[4], whole[5] = size, 1, size, size, 1, 11 * size
    work = np.empty(11 * size)
    _dhseqr(
        letters.ctypes, letters[1:].ctypes, whole.ctypes, whole[1:].ctypes, whole[2:].ctypes, matrix.ctypes,
        whole[3:].ctypes, real.ctypes, imaginary.ctypes, work.ctypes, whole[4:].ctypes, work.ctypes,
        whole[5:].ctypes, whole[6:].ctypes,
    )  # fmt: skip
    if whole[6] != 0:
        real[:], imaginary[:] = 0.0, 0.0
    return real, imaginary


@compiled
def _eigenvector(hessenberg, size, value):  # type: ignore[no-untyped-def]
    """Return the unit eigenvector of a Hessenberg matrix to an eigenvalue, by two steps of inverse iteration."""
    matrix = np.zeros((size, size), np.complex128)
    factor, swapped = np.zeros(size, np.complex128), np.zeros(size, np.bool_)
    for i in range(size):
        for j in range(max(0, i - 1), size):
            matrix[i, j] = hessenberg[i, j]
        matrix[i, i] -= value
    for c in range(size):
        below = c + 1
        if below < size:
            swapped[c] = abs(matrix[below, c]) > abs(matrix[c, c])
            for j in range(c, size if swapped[c] else c):
                matrix[c, j], matrix[below, j] = matrix[below, j], matrix[c, j]
        if abs(matrix[c, c]) < LEAST_PIVOT * abs(value):
            matrix[c, c] = LEAST_PIVOT * abs(value)
        if below < size:
            factor[c] = matrix[below, c] / matrix[c, c]
            for j in range(c, size):
                matrix[below, j] -= factor[c] * matrix[c, j]
    vector = np.ones(size, np.complex128)
    for step in range(2):
        for c in range(size - 1 if step else 0):
            if swapped[c]:
                vector[c], vector[c + 1] = vector[c + 1], vector[c]
            vector[c + 1] -= factor[c] * vector[c]
        for i in range(size - 1, -1, -1):
            for j in range(i + 1, size):
                vector[i] -= matrix[i, j] * vector[j]
            vector[i] /= matrix[i, i]
        _make_unit(vector)
    return vector


@compiled
def _make_unit(vector):  # type: ignore[no-untyped-def]
    """Divide a vector by its norm, in two steps, for it may be huge."""
    for power in (1, 2):
        size = 0.0
        for i in range(len(vector)):
            size = max(size, abs(vector[i])) if power == 1 else size + abs(vector[i]) ** 2
        for i in range(len(vector)):
            vector[i] *= 1.0 / (size if power == 1 else math.sqrt(size))


@compiled
def _high_power(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return a high power of the matrix, to any scale."""
    power, square = np.empty((size, size)), np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            power[i, j] = hessenberg[i, j]
    letters, whole, factors = np.empty(1, np.uint8), np.empty(1, np.int32), np.zeros(2)
    letters[0], whole[0] = NO, size
    for _ in range(SQUARINGS):
        largest = 0.0
        for i in range(size):
            for j in range(size):
                largest = max(largest, abs(power[i, j]))
        factors[0] = 1.0 / largest**2
        # Columns for rows: the transposed square of the transposed matrix is the square.
        _dgemm(
            letters.ctypes, letters.ctypes, whole.ctypes, whole.ctypes, whole.ctypes, factors.ctypes, power.ctypes,
            whole.ctypes, power.ctypes, whole.ctypes, factors[1:].ctypes, square.ctypes, whole.ctypes,
        )  # fmt: skip
        power, square = square, power
    return power


@compiled
def _filtered_pair(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return value, vector and residual of the dominant pair in the tiny Krylov space; zero if there is no space."""
    power = _high_power(hessenberg, size)
    basis, small = np.zeros((FILTERED_SIZE, size)), np.zeros((FILTERED_SIZE + 1, FILTERED_SIZE))
    new, vector = np.zeros(size), np.zeros(size, np.complex128)
    for i in range(size):
        for j in range(size):
            new[i] += power[i, j]
    steps, length = 0, math.sqrt(_inner(new, new))
    while steps < FILTERED_SIZE and length > 0.0 and np.isfinite(length):
        for i in range(size):
            basis[steps, i] = new[i] / length
        for i in range(size):
            row, known = hessenberg[i], basis[steps]
            new[i] = _inner(row[max(0, i - 1) :], known[max(0, i - 1) :])
        for _ in range(2):
            for a in range(steps + 1):
                overlap = _inner(basis[a], new)
                small[a, steps] += overlap
                for i in range(size):
                    new[i] -= overlap * basis[a, i]
        length = math.sqrt(_inner(new, new))
        steps += 1
        small[steps, steps - 1] = length
    if steps == 0 or not np.isfinite(length):
        return 0.0 + 0.0j, vector, np.inf
    value = _largest_eigenvalue(small, steps)
    if value == 0.0:
        return value, vector, np.inf
    coordinates = _eigenvector(small, steps, value)
    for j in range(steps):
        for i in range(size):
            vector[i] += coordinates[j] * basis[j, i]
    return value, vector, length * abs(coordinates[steps - 1])


@compiled
def _inner(left, right):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(left)):
        total += left[i] * right[i]
    return total
