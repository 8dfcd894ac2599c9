"""Collocation of the feedback force, compiled: the same mathematics as ``collocation``, point by point.

``collocation`` holds the equations and is the plain twin of this module; tests hold the two to each
other. Here every point goes through alone, in poles instead of states, and no matrix larger than one
element's is formed:

    z(h) = exp(lambda h) z + drive f          f = K d at the nodes of an element
    (1 - respond K) d = observe z - w_delayed,   w = w_delayed + d

z holds one pole of each conjugate pair, its real and imaginary part side by side. The discretised
state is z at the start of the period, and w at the nodes of every element a period ago.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import numba
import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import collocation
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.multipliers import EXHAUSTED, WARM_UP

#: Freedoms of the compiler that keep infinities and not-a-numbers what they are.
FAST = {"contract", "reassoc", "nsz", "arcp"}


def _compiled(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, and keep the result on disk where there is a place for it."""
    try:
        return numba.njit(cache=True, nogil=True, fastmath=FAST)(function)
    except RuntimeError:  # neither the code's folder nor the user's cache folder can be written
        return numba.njit(nogil=True, fastmath=FAST)(function)


@dataclass(frozen=True, kw_only=True)
class CompiledMonodromy:
    """Map of (z, w at the nodes of each element) over one period, as what it is computed from.

    poles, seen, driven: of each system, see HalfSpectrum; alive: which parts of z a system has
    (system, part); system_index, piece (point, element), cuts and piece_length (point, piece), count
    of elements (point,), gain (point, element, node, input, output), node_time and node_weight
    (point, element, node).
    """

    poles: ComplexArray
    seen: ComplexArray
    driven: ComplexArray
    alive: Array
    system_index: NDArray[np.intp]
    piece: NDArray[np.intp]
    cuts: NDArray[np.bool_]
    piece_length: Array
    count: NDArray[np.intp]
    gain: Array
    node_time: Array
    node_weight: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and size of the discretised state."""
        points, elements, nodes = self.node_time.shape
        return points, 2 * self.poles.shape[1] + elements * nodes * self.gain.shape[-1]

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the operator of some of the points."""
        per_point = ("system_index", "piece", "cuts", "piece_length", "count", "gain", "node_time", "node_weight")
        return replace(self, **{name: getattr(self, name)[points] for name in per_point})

    def krylov(self, start: Array, steps: int) -> tuple[Array, Array]:
        """Return basis (point, steps + 1, size) and Hessenberg matrix (point, steps + 1, steps) of Arnoldi's method."""
        points, size = self.shape
        basis, hessenberg = np.zeros((points, steps + 1, size)), np.zeros((points, steps + 1, steps))
        _krylov(*self._arrays(), self.alive, start, basis, hessenberg)
        return basis, hessenberg

    def force(self, vectors: ComplexArray) -> tuple[Array, Array, ComplexArray]:
        """Return times (point, sample), weights (point, sample) and feedback force (point, sample, input)."""
        points, elements, nodes = self.node_time.shape
        parts = np.zeros((2, points, elements, nodes, self.gain.shape[-2]))
        _forces(*self._arrays(), np.stack([vectors.real, vectors.imag]), parts)
        flat = (points, elements * nodes)
        force = (parts[0] + 1j * parts[1]).reshape(*flat, -1)
        return self.node_time.reshape(flat), self.node_weight.reshape(flat), force

    def _arrays(self) -> tuple[NDArray, ...]:  # type: ignore[type-arg]
        nodes, _ = collocation.gauss(collocation.NODES)
        series = np.ascontiguousarray(collocation.integral_series().reshape(-1, collocation.SERIES_TERMS).T)
        return (
            nodes,
            series,
            self.poles,
            self.seen,
            self.driven,
            self.system_index,
            self.piece,
            self.cuts,
            self.piece_length,
            self.count,
            self.gain,
        )


def build(equation: DelayEquation, refinement: Array | float = 1.0) -> CompiledMonodromy:
    """Build the operator; ``refinement`` (point,) multiplies the number of elements.

    Raises UnsupportedEquation as ``collocation.build`` does.

    See docs/physics.md#collocation.
    """
    layout, time, gain = collocation.lay_out(equation, refinement)
    half = equation.system.half_spectrum
    _, weights = collocation.gauss(collocation.NODES)
    # A real pole has no imaginary part, and filling has neither: they start at zero and stay there.
    weight = np.where(half.poles.imag > 0.0, 2.0, half.poles.imag == 0.0)
    alive = np.stack([weight > 0.0, weight > 1.0], axis=-1).reshape(len(weight), -1)
    return CompiledMonodromy(
        poles=half.poles,
        seen=half.seen,
        driven=half.driven * (weight > 0.0)[..., None],
        alive=alive.astype(float),
        system_index=equation.system_index,
        piece=layout.piece,
        cuts=layout.cuts,
        piece_length=layout.piece_length,
        # Pieces of no length may lie between others; what is behind the last element is filling.
        count=layout.length.shape[1] - (layout.length[:, ::-1] > 0.0).argmax(axis=1),
        gain=gain,
        node_time=time,
        node_weight=layout.length[..., None] * weights,
    )


@_compiled
def _integrate(nodes, series, poles, seen, driven, h, advance, observe, drive, respond):  # type: ignore[no-untyped-def]
    """Fill the exact integrals over an element of length h; observe and drive are transposed."""
    count, outputs, inputs = len(nodes), seen.shape[0], driven.shape[1]
    real, imaginary = np.empty(series.shape[1]), np.empty(series.shape[1])
    respond[:] = 0.0
    for k in range(len(poles)):
        z = poles[k] * h
        advance[k] = np.exp(z)
        for i in range(count):
            grown = np.exp(z * nodes[i])
            for o in range(outputs):
                shown = grown * seen[o, k]
                observe[2 * k, i * outputs + o] = shown.real
                observe[2 * k + 1, i * outputs + o] = -shown.imag
        real[:] = 0.0
        imaginary[:] = 0.0
        power = h + 0j
        for term in range(len(series)):
            for q in range(series.shape[1]):
                real[q] += power.real * series[term, q]
                imaginary[q] += power.imag * series[term, q]
            power *= z
        for m in range(count):
            whole = complex(real[count * count + m], imaginary[count * count + m])
            for c in range(inputs):
                moved = whole * driven[k, c]
                drive[m * inputs + c, 2 * k] = moved.real
                drive[m * inputs + c, 2 * k + 1] = moved.imag
        for o in range(outputs):
            for c in range(inputs):
                through = seen[o, k] * driven[k, c]
                if through != 0.0:
                    for i in range(count):
                        for m in range(count):
                            respond[i * outputs + o, m * inputs + c] += (
                                through.real * real[i * count + m] - through.imag * imaginary[i * count + m]
                            )


@_compiled
def _invert(matrix, inverse):  # type: ignore[no-untyped-def]
    """Invert a small matrix by Gauss-Jordan elimination with row pivoting; ``matrix`` is used up."""
    size = len(matrix)
    inverse[:] = 0.0
    for c in range(size):
        inverse[c, c] = 1.0
    for c in range(size):
        pivot = c
        for r in range(c + 1, size):
            if abs(matrix[r, c]) > abs(matrix[pivot, c]):
                pivot = r
        for j in range(size):
            matrix[c, j], matrix[pivot, j] = matrix[pivot, j], matrix[c, j]
            inverse[c, j], inverse[pivot, j] = inverse[pivot, j], inverse[c, j]
        scale = 1.0 / matrix[c, c]
        for j in range(size):
            matrix[c, j] *= scale
            inverse[c, j] *= scale
        for r in range(size):
            if r != c:
                factor = matrix[r, c]
                for j in range(size):
                    matrix[r, j] -= factor * matrix[c, j]
                    inverse[r, j] -= factor * inverse[c, j]


@_compiled
def _prepare(nodes, series, poles, seen, driven, piece, cuts, length, count, gain):  # type: ignore[no-untyped-def]
    """Return the integrals of every piece (advance, observe, drive) and the transposed inverses of one point."""
    outputs, inputs = seen.shape[0], driven.shape[1]
    values, forces, parts = len(nodes) * outputs, len(nodes) * inputs, 2 * len(poles)
    advance = np.empty((len(cuts), len(poles)), np.complex128)
    observe, drive = np.empty((len(cuts), parts, values)), np.empty((len(cuts), forces, parts))
    solve = np.empty((count, values, values))
    respond = np.empty((len(cuts), values, forces))
    implicit, inverse = np.empty((values, values)), np.empty((values, values))
    for p in range(len(cuts)):
        if cuts[p]:
            _integrate(nodes, series, poles, seen, driven, length[p], advance[p], observe[p], drive[p], respond[p])
        else:
            for k in range(len(poles)):
                advance[p, k] = np.exp(poles[k] * length[p])
    for e in range(count):
        if not cuts[piece[e]]:
            continue
        for i in range(values):
            for m in range(len(nodes)):
                for b in range(outputs):
                    total = 0.0
                    for c in range(inputs):
                        total += respond[piece[e], i, m * inputs + c] * gain[e, m, c, b]
                    implicit[i, m * outputs + b] = -total
            implicit[i, i] += 1.0
        _invert(implicit, inverse)
        for i in range(values):
            for j in range(values):
                solve[e, j, i] = inverse[i, j]
    return advance, observe, drive, solve


@_compiled
def _apply(start, end, force, piece, cuts, count, gain, advance, observe, drive, solve):  # type: ignore[no-untyped-def]
    """Map one vector over a period; the forces at the nodes (element, node x input) are left in ``force``."""
    parts, values = observe.shape[1], observe.shape[2]
    nodes, inputs, outputs = gain.shape[1], gain.shape[2], gain.shape[3]
    z, following = start[:parts].copy(), np.empty(parts)
    mismatch, difference = np.empty(values), np.empty(values)
    for e in range(count):
        p, offset = piece[e], parts + e * values
        for k in range(parts // 2):
            moved = advance[p, k] * complex(z[2 * k], z[2 * k + 1])
            following[2 * k], following[2 * k + 1] = moved.real, moved.imag
        if cuts[p]:
            for j in range(values):
                mismatch[j] = -start[offset + j]
                difference[j] = 0.0
            for s in range(parts):
                for j in range(values):
                    mismatch[j] += z[s] * observe[p, s, j]
            for s in range(values):
                for j in range(values):
                    difference[j] += mismatch[s] * solve[e, s, j]
            for m in range(nodes):
                for c in range(inputs):
                    total = 0.0
                    for b in range(outputs):
                        total += gain[e, m, c, b] * difference[m * outputs + b]
                    force[e, m * inputs + c] = total
            for s in range(nodes * inputs):
                for j in range(parts):
                    following[j] += force[e, s] * drive[p, s, j]
            for j in range(values):
                end[offset + j] = start[offset + j] + difference[j]
        else:
            for j in range(values):
                end[offset + j] = 0.0
        for j in range(parts):
            z[j] = following[j]
    for j in range(parts):
        end[j] = z[j]


@_compiled
def _norm(vector, size):  # type: ignore[no-untyped-def]
    """Return a norm that overflows only where an entry does."""
    largest = 0.0
    for i in range(size):
        largest = max(largest, abs(vector[i]))
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    total = 0.0
    for i in range(size):
        total += (vector[i] / largest) ** 2
    return largest * math.sqrt(total)


@_compiled
def _scaled(vector, result, size, factor):  # type: ignore[no-untyped-def]
    for i in range(size):
        result[i] = vector[i] * factor


@_compiled
def _krylov(  # type: ignore[no-untyped-def]
    nodes, series, poles, seen, driven, system, piece, cuts, length, count, gain, alive, start, basis, hessenberg
):
    """Build the Krylov space of every point by Arnoldi's method with Gram and Schmidt's step done twice."""
    parts, values, forces = alive.shape[1], len(nodes) * seen.shape[1], len(nodes) * driven.shape[2]
    elements, steps = piece.shape[1], hessenberg.shape[2]
    force = np.empty((elements, forces))
    new = np.empty(parts + elements * values)
    for p in range(len(system)):
        s, size = system[p], parts + count[p] * values
        advance, observe, drive, solve = _prepare(
            nodes, series, poles[s], seen[s], driven[s], piece[p], cuts[p], length[p], count[p], gain[p]
        )
        first = basis[p, 0]
        _scaled(start, first, size, 1.0)
        for i in range(parts):
            first[i] *= alive[s, i]
        for _ in range(WARM_UP):
            _apply(first, new, force, piece[p], cuts[p], count[p], gain[p], advance, observe, drive, solve)
            norm = _norm(new, size)
            if norm == 0.0 or not np.isfinite(norm):
                break
            _scaled(new, first, size, 1.0 / norm)
        else:
            for j in range(min(steps, size)):
                _apply(basis[p, j], new, force, piece[p], cuts[p], count[p], gain[p], advance, observe, drive, solve)
                before = _norm(new, size)
                if not np.isfinite(before):
                    hessenberg[p, :, :] = 0.0
                    break
                for _ in range(2):
                    for a in range(j + 1):
                        overlap = 0.0
                        for i in range(size):
                            overlap += basis[p, a, i] * new[i]
                        hessenberg[p, a, j] += overlap
                        for i in range(size):
                            new[i] -= overlap * basis[p, a, i]
                norm = _norm(new, size)
                # What is left of an exhausted space is rounding: it is exact already.
                if norm > EXHAUSTED * before:
                    hessenberg[p, j + 1, j] = norm
                    _scaled(new, basis[p, j + 1], size, 1.0 / norm)


@_compiled
def _forces(  # type: ignore[no-untyped-def]
    nodes, series, poles, seen, driven, system, piece, cuts, length, count, gain, vectors, result
):
    """Find the feedback force at the nodes for the vectors (real and imaginary part, point, size)."""
    parts, values, forces = 2 * poles.shape[1], len(nodes) * seen.shape[1], len(nodes) * driven.shape[2]
    elements, inputs = piece.shape[1], driven.shape[2]
    force = np.empty((elements, forces))
    end = np.empty(parts + elements * values)
    for p in range(len(system)):
        s = system[p]
        advance, observe, drive, solve = _prepare(
            nodes, series, poles[s], seen[s], driven[s], piece[p], cuts[p], length[p], count[p], gain[p]
        )
        for part in range(len(vectors)):
            force[:] = 0.0
            _apply(vectors[part, p], end, force, piece[p], cuts[p], count[p], gain[p], advance, observe, drive, solve)
            for e in range(count[p]):
                for m in range(len(nodes)):
                    for c in range(inputs):
                        result[part, p, e, m, c] = force[e, m * inputs + c]
