"""Collocation of the feedback force, compiled: the same mathematics as ``collocation``, point by point.

``collocation`` holds the equations and is the plain twin of this module; tests hold the two to each
other. Here every point goes through alone, in poles instead of states, and no matrix larger than one
element's is formed:

    z(h) = exp(lambda h) z + drive f          f = K d at the nodes of an element
    (1 - respond K) d = observe z - w_delayed,   w = w_delayed + d

z holds one pole of each conjugate pair, its real and imaginary part side by side. The discretised
state is z at the start of the period, and w at the nodes of every element in the cut a period ago.
The critical multiplier is the largest of the Ritz values of a Krylov space that grows until it has
settled; LAPACK finds them.

Layout: values at the nodes are (output, node), forces (input, node), parts of z (pole, real and
imaginary). Every product is a sum along the last axis, which is what the compiler makes fast. What
cannot couple is skipped: ``sees`` and ``pushes`` hold the range of poles that each output sees and
of inputs that push each pole.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import collocation
from chatter_core.floquet.collocation import NODES
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.multipliers import EXHAUSTED, WARM_UP, CriticalMotion
from chatter_core.jit import compiled, scipy_routine

#: Below this |z| the integrals are a power series of so many terms, above they are integrated by
#: parts: either errs by less than 3e-12 here.
SMALL, SMALL_TERMS = 1.5, 18
#: Sizes of the Krylov space at which the critical Ritz value is tested, beyond 4 and 9/8 of the parts of z.
BEYOND_PARTS = np.array([0, 4, 10, 22, 44, 84])
#: Pieces whose lengths differ by less than this share are equal.
LENGTH_TOLERANCE = 1e-12
#: Squares of norms that lost nothing lie between this and its inverse.
SAFE_SQUARE = 1e-200
#: Above this size the dominant Ritz pair is first looked for by filtering: 2^FILTER_SQUARINGS powers
#: of the Hessenberg matrix leave so few eigenvectors that a Krylov space of this size holds them.
FILTERED_SIZE, FILTER_SQUARINGS = 6, 10
#: Least share of a vector's norm that may be left after one step of orthogonalisation.
LEFT = 0.03


#: Letters that LAPACK takes: eigenvalues only, no vectors; also "not transposed".
EIGENVALUES_ONLY, NO = ord("E"), ord("N")
#: Eigenvalues of a Hessenberg matrix: job, compz, n, ilo, ihi, h, ldh, wr, wi, z, ldz, work, lwork, info.
_dhseqr = scipy_routine("lapack", "dhseqr", "cciiididddidii")
#: Matrix product: transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc.
_dgemm = scipy_routine("blas", "dgemm", "cciiiddididdi")


@dataclass(frozen=True, kw_only=True)
class Discretisation:
    """A batch of points as the compiled functions take it.

    poles, seen, driven: of each system, see HalfSpectrum; alive: which parts of z a system has
    (system, part); sees (output, 2) and pushes (pole, 2): ranges of what couples; system_index
    (point,), piece (point, element), cuts and piece_length (point, piece), count of elements (point,),
    gain (point, element, input, output, node).
    """

    poles: ComplexArray
    seen: ComplexArray
    driven: ComplexArray
    alive: Array
    sees: NDArray[np.intp]
    pushes: NDArray[np.intp]
    system_index: NDArray[np.intp]
    piece: NDArray[np.intp]
    cuts: NDArray[np.bool_]
    piece_length: Array
    count: NDArray[np.intp]
    gain: Array


def critical_motion(
    equation: DelayEquation, refinement: Array | float = 1.0, residual_tolerance: float = 1e-9
) -> CriticalMotion:
    """Find the critical multiplier of every point; ``refinement`` (point,) multiplies the number of elements.

    A multiplier has converged when its residual, relative to its modulus, is below the tolerance.

    Raises UnsupportedEquation as ``collocation.build`` does.

    See docs/physics.md#critical-multiplier.
    """
    layout, time, gain = collocation.lay_out(equation, refinement)
    points, elements = layout.piece.shape
    multiplier, residual = np.zeros(points, dtype=complex), np.full(points, np.inf)
    # A direction in which no mode moves takes no part.
    half = equation.system.half_spectrum
    seen, pushed = _some(half.seen.any(axis=(0, 2))), _some(half.driven.any(axis=(0, 1)))
    discretisation = _discretise(equation, layout, gain, seen, pushed)
    parts = 2 * half.poles.shape[1]
    start = np.random.default_rng(20111).standard_normal(parts + elements * NODES * len(seen))
    acting = np.zeros((points, elements, NODES, len(pushed)), dtype=complex)
    arrays = tuple(vars(discretisation).values())
    sizes = parts + parts // 8 + 4 + BEYOND_PARTS
    _critical(*_tables(), *arrays, start, sizes, residual_tolerance, multiplier, residual, acting)
    force = np.zeros((points, elements, NODES, gain.shape[-2]), dtype=complex)
    force[..., pushed] = acting
    _, weights = collocation.gauss(NODES)
    flat = (points, elements * NODES)
    return CriticalMotion(
        multiplier=multiplier,
        # A value of exactly zero is what is left of vectors that overflowed.
        converged=(residual <= residual_tolerance * np.abs(multiplier)) & (multiplier != 0.0),
        time=time.reshape(flat),
        weight=(layout.length[..., None] * weights).reshape(flat),
        force=force.reshape(*flat, -1),
    )


def _some(taking_part: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return the indices that take part, one at least."""
    return np.flatnonzero(taking_part) if taking_part.any() else np.array([0])


def _discretise(
    equation: DelayEquation,
    layout: collocation.Elements,
    gain: Array,
    outputs: NDArray[np.intp],
    inputs: NDArray[np.intp],
) -> Discretisation:
    half = equation.system.half_spectrum
    # A real pole has no imaginary part, and filling has neither: they start at zero and stay there.
    weight = np.where(half.poles.imag > 0.0, 2.0, half.poles.imag == 0.0)
    alive = np.stack([weight > 0.0, weight > 1.0], axis=-1).reshape(len(weight), -1)
    seen = np.ascontiguousarray(half.seen[:, outputs])
    driven = np.ascontiguousarray((half.driven * (weight > 0.0)[..., None])[..., inputs])
    return Discretisation(
        poles=half.poles,
        seen=seen,
        driven=driven,
        alive=alive.astype(float),
        sees=_ranges(seen.any(axis=0)),
        pushes=_ranges(driven.any(axis=0)),
        system_index=equation.system_index,
        piece=layout.piece,
        cuts=layout.cuts,
        piece_length=layout.piece_length,
        # Pieces of no length may lie between others; what is behind the last element is filling.
        count=layout.length.shape[1] - (layout.length[:, ::-1] > 0.0).argmax(axis=1),
        gain=np.ascontiguousarray(gain[..., inputs[:, None], outputs].transpose(0, 1, 3, 4, 2)),
    )


def _ranges(couples: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Return first and one past the last true entry of every row, (row, 2); zeros for a row without."""
    first, last = couples.argmax(axis=1), couples.shape[1] - couples[:, ::-1].argmax(axis=1)
    return np.stack([first, last], axis=-1) * couples.any(axis=1)[:, None]


@cache
def _tables() -> tuple[Array, Array, Array, Array]:
    """Return nodes, the series of an element's integrals, and what integration by parts takes.

    Both tables are (term, end and node); the last is l_j's derivatives at the start (node, derivative).
    int_0^e exp(z (e - s)) l_j(s) ds = sum_k [exp(z e) l_j^(k)(0) - l_j^(k)(e)] / z^(k+1).
    """
    nodes, _ = collocation.gauss(NODES)
    series = collocation.integral_series()[..., :SMALL_TERMS].reshape(-1, SMALL_TERMS).T
    at_end, at_start = np.zeros((NODES, NODES + 1, NODES)), np.zeros((NODES, NODES))
    for j, powers in enumerate(collocation.lagrange_powers()):
        for order in range(NODES):
            derivative = np.polynomial.Polynomial(powers).deriv(order)
            at_end[order, :, j], at_start[j, order] = -derivative(np.append(nodes, 1.0)), derivative(0.0)
    return nodes, np.ascontiguousarray(series), at_end.reshape(NODES, -1), at_start


@compiled
def _dot(left, right):  # type: ignore[no-untyped-def]
    total = 0.0
    for i in range(len(left)):
        total += left[i] * right[i]
    return total


@compiled
def _add(factor, vector, result):  # type: ignore[no-untyped-def]
    for i in range(len(vector)):
        result[i] += factor * vector[i]


@compiled
def _integrals(z, grown, series, at_end, at_start, real, imaginary):  # type: ignore[no-untyped-def]
    """Fill the integrals of one pole (end and node,); grown: exp(z e) at every end."""
    real[:] = 0.0
    imaginary[:] = 0.0
    near = abs(z) < SMALL
    factor = z if near else 1.0 / z
    power = 1.0 + 0.0j if near else factor
    table = series if near else at_end
    for term in range(len(table)):
        for q in range(len(real)):
            real[q] += power.real * table[term, q]
            imaginary[q] += power.imag * table[term, q]
        power *= factor
    if not near:
        for j in range(NODES):
            constant, power = 0.0 + 0.0j, factor
            for order in range(NODES):
                constant += at_start[j, order] * power
                power *= factor
            for e in range(NODES + 1):
                real[e * NODES + j] += (grown[e] * constant).real
                imaginary[e * NODES + j] += (grown[e] * constant).imag


@compiled
def _integrate(  # type: ignore[no-untyped-def]
    nodes, series, at_end, at_start, poles, seen, driven, h, advance, observe, drive, respond
):
    """Fill the exact integrals over an element of length h."""
    outputs, inputs = seen.shape[0], driven.shape[1]
    ends = series.shape[1]
    real, imaginary = np.empty((len(poles), ends)), np.empty((len(poles), ends))
    grown = np.empty((len(poles), NODES + 1), np.complex128)
    respond[:] = 0.0
    for k in range(len(poles)):
        like = 0  # x and y are often alike
        while poles[like] != poles[k]:
            like += 1
        if like == k:
            for e in range(NODES):
                grown[k, e] = np.exp(poles[k] * h * nodes[e])
            grown[k, NODES] = np.exp(poles[k] * h)
            _integrals(poles[k] * h, grown[k], series, at_end, at_start, real[k], imaginary[k])
        shape, re, im = grown[like], real[like], imaginary[like]
        advance[k] = shape[NODES]
        for o in range(outputs):
            for i in range(NODES):
                shown = shape[i] * seen[o, k]
                observe[o * NODES + i, 2 * k] = shown.real
                observe[o * NODES + i, 2 * k + 1] = -shown.imag
        for c in range(inputs):
            for m in range(NODES):
                moved = h * driven[k, c] * complex(re[NODES * NODES + m], im[NODES * NODES + m])
                drive[2 * k, c * NODES + m] = moved.real
                drive[2 * k + 1, c * NODES + m] = moved.imag
        for o in range(outputs):
            for c in range(inputs):
                through = h * seen[o, k] * driven[k, c]
                if through != 0.0:
                    for i in range(NODES):
                        row = respond[o * NODES + i]
                        _add(through.real, re[i * NODES : (i + 1) * NODES], row[c * NODES : (c + 1) * NODES])
                        _add(-through.imag, im[i * NODES : (i + 1) * NODES], row[c * NODES : (c + 1) * NODES])


@compiled
def _invert(matrix, swapped):  # type: ignore[no-untyped-def]
    """Invert a small matrix in place by Gauss-Jordan elimination with row pivoting."""
    size = len(matrix)
    for c in range(size):
        pivot = c
        for r in range(c + 1, size):
            if abs(matrix[r, c]) > abs(matrix[pivot, c]):
                pivot = r
        swapped[c] = pivot
        if pivot != c:
            for j in range(size):
                matrix[c, j], matrix[pivot, j] = matrix[pivot, j], matrix[c, j]
        scale = 1.0 / matrix[c, c]
        matrix[c, c] = 1.0
        for j in range(size):
            matrix[c, j] *= scale
        for r in range(size):
            if r != c:
                factor = matrix[r, c]
                matrix[r, c] = 0.0
                for j in range(size):
                    matrix[r, j] -= factor * matrix[c, j]
    for c in range(size - 1, -1, -1):
        if swapped[c] != c:
            for r in range(size):
                matrix[r, c], matrix[r, swapped[c]] = matrix[r, swapped[c]], matrix[r, c]


@compiled
def _prepare(  # type: ignore[no-untyped-def]
    nodes, series, at_end, at_start, poles, seen, driven, piece, cuts, length, count, gain
):
    """Return what moves one point through its elements: advance, observe, drive of every piece, inverse of every element.

    Pieces of equal length share their integrals; ``table`` says which a piece takes.
    """
    outputs, inputs = seen.shape[0], driven.shape[1]
    values, forces, parts = NODES * outputs, NODES * inputs, 2 * len(poles)
    advance = np.empty((len(cuts), len(poles)), np.complex128)
    observe, drive = np.empty((len(cuts), values, parts)), np.empty((len(cuts), parts, forces))
    respond = np.empty((len(cuts), values, forces))
    solve, swapped = np.empty((count, values, values)), np.empty(values, np.int64)
    table = np.empty(len(cuts), np.int64)
    for p in range(len(cuts)):
        table[p] = p
        if not cuts[p]:
            for k in range(len(poles)):
                advance[p, k] = np.exp(poles[k] * length[p])
            continue
        for q in range(p):
            if cuts[q] and abs(length[p] - length[q]) <= LENGTH_TOLERANCE * length[p]:
                table[p] = table[q]
        if table[p] == p:
            _integrate(
                nodes, series, at_end, at_start, poles, seen, driven, length[p],
                advance[p], observe[p], drive[p], respond[p],
            )  # fmt: skip
    for e in range(count):
        if cuts[piece[e]]:
            through, inverse = respond[table[piece[e]]], solve[e]
            inverse[:] = 0.0
            for i in range(values):
                for b in range(outputs):
                    for c in range(inputs):
                        for m in range(NODES):
                            inverse[i, b * NODES + m] -= through[i, c * NODES + m] * gain[e, c, b, m]
                inverse[i, i] += 1.0
            _invert(inverse, swapped)
    return table, advance, observe, drive, solve


@compiled
def _apply(  # type: ignore[no-untyped-def]
    start, end, force, work, sees, pushes, piece, cuts, count, gain, table, advance, observe, drive, solve
):
    """Map one vector over a period; the forces (element, input and node) are left in ``force``."""
    parts, values = drive.shape[1], observe.shape[1]
    inputs, outputs = gain.shape[1], gain.shape[2]
    z, mismatch, difference = end[:parts], work[0, :values], work[1, :values]
    z[:] = start[:parts]
    offset = parts
    for e in range(count):
        p, acts = table[piece[e]], cuts[piece[e]]
        if acts:
            before, after = start[offset : offset + values], end[offset : offset + values]
            for o in range(outputs):
                seen = slice(2 * sees[o, 0], 2 * sees[o, 1])
                visible = z[seen]
                for j in range(o * NODES, (o + 1) * NODES):
                    # Two steps: the compiler knows a slice of a row, not a row of a slice, to be contiguous.
                    row = observe[p, j]
                    mismatch[j] = _dot(row[seen], visible) - before[j]
            for j in range(values):
                difference[j] = _dot(solve[e, j], mismatch)
                after[j] = before[j] + difference[j]
            acting = force[e]
            acting[:] = 0.0
            for c in range(inputs):
                for b in range(outputs):
                    for m in range(NODES):
                        acting[c * NODES + m] += gain[e, c, b, m] * difference[b * NODES + m]
            offset += values
        for k in range(parts // 2):
            moved = advance[p, k] * complex(z[2 * k], z[2 * k + 1])
            z[2 * k], z[2 * k + 1] = moved.real, moved.imag
            if acts:
                pushing = slice(pushes[k, 0] * NODES, pushes[k, 1] * NODES)
                real, imaginary, acting = drive[p, 2 * k], drive[p, 2 * k + 1], force[e]
                z[2 * k] += _dot(real[pushing], acting[pushing])
                z[2 * k + 1] += _dot(imaginary[pushing], acting[pushing])


@compiled
def _norm(vector, size):  # type: ignore[no-untyped-def]
    """Return a norm that overflows only where an entry does."""
    square = _dot(vector[:size], vector[:size])
    if SAFE_SQUARE < square < 1.0 / SAFE_SQUARE:
        return math.sqrt(square)
    largest = 0.0
    for i in range(size):
        largest = max(largest, abs(vector[i]))
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    total = 0.0
    for i in range(size):
        total += (vector[i] / largest) ** 2
    return largest * math.sqrt(total)


@compiled
def _orthogonalise(new, basis, hessenberg, j, size):  # type: ignore[no-untyped-def]
    """Take from ``new`` what lies in the first j + 1 vectors of the basis; return what is left of its norm.

    Once is not enough where the vector nearly lies in the space.
    """
    before = _norm(new, size)
    if not np.isfinite(before):
        return before
    for _ in range(3):
        for a in range(j + 1):
            known = basis[a]
            overlap = _dot(known[:size], new[:size])
            hessenberg[a, j] += overlap
            _add(-overlap, known[:size], new[:size])
        after = _norm(new, size)
        if after > LEFT * before:
            return after
        # What is left of an exhausted space is rounding: it is exact already.
        if after <= EXHAUSTED * before:
            return 0.0
        before = after
    return after


@compiled
def _largest_eigenvalue(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return the eigenvalue of largest modulus, of a pair the one with positive angle; zero if there is none."""
    matrix = np.empty((size, size))
    for i in range(size):
        for j in range(size):
            matrix[j, i] = hessenberg[i, j]  # LAPACK counts along columns
    letters, whole = np.empty(2, np.uint8), np.empty(7, np.int32)
    letters[0], letters[1] = EIGENVALUES_ONLY, NO
    whole[0], whole[1], whole[2], whole[3], whole[4], whole[5] = size, 1, size, size, 1, 11 * size
    real, imaginary, work = np.zeros(size), np.zeros(size), np.empty(11 * size)
    _dhseqr(
        letters.ctypes, letters[1:].ctypes, whole.ctypes, whole[1:].ctypes, whole[2:].ctypes, matrix.ctypes,
        whole[3:].ctypes, real.ctypes, imaginary.ctypes, work.ctypes, whole[4:].ctypes, work.ctypes,
        whole[5:].ctypes, whole[6:].ctypes,
    )  # fmt: skip
    best, largest = 0.0 + 0.0j, 0.0
    if whole[6] == 0:
        for i in range(size):
            modulus = math.hypot(real[i], imaginary[i]) * (1.0 + 1e-12 * (imaginary[i] >= 0.0))
            if modulus > largest:
                best, largest = complex(real[i], imaginary[i]), modulus
    return best


@compiled
def _eigenvector(hessenberg, size, value):  # type: ignore[no-untyped-def]
    """Return the unit eigenvector of a Hessenberg matrix to an eigenvalue, by inverse iteration."""
    matrix = np.zeros((size, size), np.complex128)
    factor, swapped = np.zeros(size, np.complex128), np.zeros(size, np.bool_)
    for i in range(size):
        for j in range(max(0, i - 1), size):
            matrix[i, j] = hessenberg[i, j]
        matrix[i, i] -= value
    least = 1e-16 * (abs(value) + 1e-300)
    for c in range(size):
        if c + 1 < size:
            swapped[c] = abs(matrix[c + 1, c]) > abs(matrix[c, c])
            if swapped[c]:
                for j in range(c, size):
                    matrix[c, j], matrix[c + 1, j] = matrix[c + 1, j], matrix[c, j]
        if abs(matrix[c, c]) < least:
            matrix[c, c] = least
        if c + 1 < size:
            factor[c] = matrix[c + 1, c] / matrix[c, c]
            for j in range(c, size):
                matrix[c + 1, j] -= factor[c] * matrix[c, j]
    vector = np.ones(size, np.complex128)
    for iteration in range(2):
        if iteration:
            for c in range(size - 1):
                if swapped[c]:
                    vector[c], vector[c + 1] = vector[c + 1], vector[c]
                vector[c + 1] -= factor[c] * vector[c]
        for i in range(size - 1, -1, -1):
            for j in range(i + 1, size):
                vector[i] -= matrix[i, j] * vector[j]
            vector[i] /= matrix[i, i]
        largest, square = 0.0, 0.0
        for i in range(size):
            largest = max(largest, abs(vector[i]))
        for i in range(size):
            square += abs(vector[i] / largest) ** 2
        for i in range(size):
            vector[i] /= largest * math.sqrt(square)
    return vector


@compiled
def _settled(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return the dominant eigenvalue of a Krylov space, its vector, and its residual."""
    value = _largest_eigenvalue(hessenberg, size)
    vector = _eigenvector(hessenberg, size, value)
    return value, vector, hessenberg[size, size - 1] * abs(vector[size - 1])


@compiled
def _filtered(hessenberg, size):  # type: ignore[no-untyped-def]
    """Return as ``_settled``, but with the residual of the pair within the space, for the price of a few products.

    Powers of the matrix raise the largest eigenvalues so far above all others that a small Krylov space
    begun with what they leave of a vector holds their vectors. Where more of them tie than it can
    hold, the residual says so.
    """
    square, power = np.empty((size, size)), np.zeros((size, size))
    for i in range(size):
        for j in range(size):
            square[i, j] = hessenberg[i, j]
    letters, whole, factors = np.empty(1, np.uint8), np.empty(1, np.int32), np.zeros(2)
    letters[0], whole[0] = NO, size
    for _ in range(FILTER_SQUARINGS):
        largest = 0.0
        for i in range(size):
            for j in range(size):
                largest = max(largest, abs(square[i, j]))
        factors[0] = 1.0 / largest**2
        # Columns for rows: the transposed square of the transposed matrix is the square.
        _dgemm(
            letters.ctypes, letters.ctypes, whole.ctypes, whole.ctypes, whole.ctypes, factors.ctypes, square.ctypes,
            whole.ctypes, square.ctypes, whole.ctypes, factors[1:].ctypes, power.ctypes, whole.ctypes,
        )  # fmt: skip
        square, power = power, square
    basis, small = np.empty((FILTERED_SIZE, size)), np.zeros((FILTERED_SIZE + 1, FILTERED_SIZE))
    new, vector = np.empty(size), np.zeros(size, np.complex128)
    for i in range(size):
        new[i] = 0.0
        for j in range(size):
            new[i] += square[i, j]
    steps, norm = 0, _norm(new, size)
    while steps < FILTERED_SIZE and norm > 0.0 and np.isfinite(norm):
        for i in range(size):
            basis[steps, i] = new[i] / norm
        for i in range(size):
            row = hessenberg[i]
            new[i] = _dot(row[max(0, i - 1) : size], basis[steps][max(0, i - 1) :])
        norm = _orthogonalise(new, basis, small, steps, size)
        steps += 1
        small[steps, steps - 1] = norm
    if steps == 0 or not np.isfinite(norm):
        return 0.0 + 0.0j, vector, np.inf
    value, coordinates, residual = _settled(small, steps)
    for j in range(steps):
        for i in range(size):
            vector[i] += coordinates[j] * basis[j, i]
    return value, vector, residual


@compiled
def _dominant(hessenberg, size, tolerance):  # type: ignore[no-untyped-def]
    """Return the dominant Ritz value, its vector in the basis, and its residual."""
    if size > 2 * FILTERED_SIZE:
        value, vector, error = _filtered(hessenberg, size)
        if error <= 0.1 * tolerance * abs(value):
            return value, vector, hessenberg[size, size - 1] * abs(vector[size - 1])
    return _settled(hessenberg, size)


@compiled
def _critical(  # type: ignore[no-untyped-def]
    nodes, series, at_end, at_start, poles, seen, driven, alive, sees, pushes, system, piece, cuts, length, count,
    gain, start, sizes, tolerance, multiplier, residual, force,
):  # fmt: skip
    """Find every point's critical multiplier, its residual, and the force (point, element, node, input) it goes with."""
    parts, values, inputs = alive.shape[1], NODES * seen.shape[1], driven.shape[2]
    basis, hessenberg = np.empty((sizes[-1] + 1, len(start))), np.zeros((sizes[-1] + 1, sizes[-1]))
    new, real, imaginary = np.empty(len(start)), np.empty(len(start)), np.empty(len(start))
    parts_force, work = np.zeros((2, piece.shape[1], NODES * inputs)), np.empty((2, values))
    for p in range(len(system)):
        s, acting = system[p], 0
        for e in range(count[p]):
            acting += cuts[p, piece[p, e]]
        size = parts + acting * values
        operator = (
            work, sees, pushes, piece[p], cuts[p], count[p], gain[p],
            *_prepare(nodes, series, at_end, at_start, poles[s], seen[s], driven[s],
                      piece[p], cuts[p], length[p], count[p], gain[p]),
        )  # fmt: skip
        first = basis[0]
        for i in range(size):
            first[i] = start[i] * alive[s, i] if i < parts else start[i]
        lost = False
        for _ in range(WARM_UP):
            _apply(first, new, parts_force[0], *operator)
            norm = _norm(new, size)
            lost = norm == 0.0 or not np.isfinite(norm)
            if lost:
                break
            for i in range(size):
                first[i] = new[i] / norm
        steps = 0
        for wanted in sizes:
            while not lost and steps < min(wanted, size):
                hessenberg[: steps + 1, steps] = 0.0
                _apply(basis[steps], new, parts_force[0], *operator)
                norm = _orthogonalise(new, basis, hessenberg, steps, size)
                lost = not np.isfinite(norm)
                steps += 1
                hessenberg[steps, steps - 1] = norm
                if norm == 0.0:
                    break
                for i in range(size):
                    basis[steps, i] = new[i] / norm
            if lost or steps == 0:
                break
            multiplier[p], coordinates, residual[p] = _dominant(hessenberg, steps, tolerance)
            if residual[p] <= tolerance * abs(multiplier[p]) or norm == 0.0 or steps == size:
                break
        if lost or steps == 0:
            multiplier[p], residual[p] = 0.0, np.inf
            continue
        real[:size] = 0.0
        imaginary[:size] = 0.0
        for j in range(steps):
            known = basis[j]
            _add(coordinates[j].real, known[:size], real[:size])
            _add(coordinates[j].imag, known[:size], imaginary[:size])
        _apply(real, new, parts_force[0], *operator)
        _apply(imaginary, new, parts_force[1], *operator)
        for e in range(count[p]):
            if cuts[p, piece[p, e]]:
                for m in range(NODES):
                    for c in range(inputs):
                        force[p, e, m, c] = complex(parts_force[0, e, c * NODES + m], parts_force[1, e, c * NODES + m])
