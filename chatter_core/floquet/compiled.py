"""Collocation of the feedback force, compiled: the same mathematics as ``collocation``, point by point.

``collocation`` holds the equations and is the plain twin of this module; tests hold the two to each
other. Here every point goes through alone, in poles instead of states, and no matrix larger than one
element's is formed:

    z(h) = exp(lambda h) z + drive f          f = K d at the nodes of an element
    (1 - respond K) d = observe z - w_delayed,   w = w_delayed + d

With several delays f = K w - g, where g is the delayed outputs' part, so there

    (1 - respond K) w = observe z - respond g.

A gain on velocities has no delay: it is treated as several delays are, with the velocities over the fastest pole,
so that all are of like size, as further outputs that nothing delayed looks back to.

z holds one pole of each conjugate pair, its real and imaginary part side by side. The discretised
state is z at the start of the period, and w at the nodes of every element in the cut a period ago.

Layout: values at the nodes are (output, node), forces (input, node), parts of z (pole, real and
imaginary). Products are sums along rows, which is what the compiler makes fast; a slice of a row it
knows to be contiguous, a row of a slice it does not. What cannot couple is skipped: ``sees`` and
``pushes`` hold the range of poles that each output sees and of inputs that push each pole. Pieces of
equal length share their integrals, and so do equal poles, for x and y are often alike.
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import collocation, delays
from chatter_core.floquet.collocation import NODES, Elements
from chatter_core.floquet.delays import LookBack
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.multipliers import EXHAUSTED, WARM_UP, Krylov, grown
from chatter_core.jit import compiled
from chatter_core.linear_equations import add, dot

#: Below this |z| the integrals are a power series of so many terms, above they are integrated by
#: parts: either errs by less than 3e-12 here.
SMALL, SMALL_TERMS = 1.5, 18
#: Pieces whose lengths differ by less than this share are equal.
LENGTH_TOLERANCE = 1e-12
#: Squares of norms that lost nothing lie between this and its inverse.
SAFE_SQUARE = 1e-200
#: Share of a vector's norm that one step of orthogonalisation must leave, or it is done again.
LEFT = 0.03


@dataclass(frozen=True, kw_only=True)
class CompiledMonodromy:
    """Map of (z, w at the nodes of the elements in the cut) over one period, as what it is computed from.

    Of each system: alive (system, part), which parts of z it has; sees (output, 2) and pushes (pole,
    2), what couples. Of each point: system_index; piece (point, element), the piece that an element
    belongs to, count of elements; cuts (point, piece) and table (point, piece), whose integrals a piece
    takes; advance (point, piece, pole), observe (point, piece, value, part), drive (point, piece, part,
    force), respond (point, piece, value, force); solve (point, element, value, value); gain (point,
    element, input, output, node); node_time and node_weight (point, element, node). Of several delays
    (no term for a single one): origin (point, element, term, node), the element in the cut, counted
    alone, that holds the delayed output; past, whether a period ago; share (.., node), how it is
    interpolated; term_gain (point, element, term, input, output, node). pushed: the equation's inputs
    that push any mode.
    """

    alive: Array
    sees: NDArray[np.intp]
    pushes: NDArray[np.intp]
    system_index: NDArray[np.intp]
    piece: NDArray[np.intp]
    count: NDArray[np.intp]
    cuts: NDArray[np.bool_]
    table: NDArray[np.intp]
    advance: ComplexArray
    observe: Array
    drive: Array
    respond: Array
    solve: Array
    gain: Array
    origin: NDArray[np.intp]
    past: NDArray[np.bool_]
    share: Array
    term_gain: Array
    node_time: Array
    node_weight: Array
    pushed: NDArray[np.intp]
    inputs: int

    @property
    def states(self) -> int:
        """Parts of z."""
        return int(self.alive.shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and size of the discretised state."""
        points, elements, values, _ = self.solve.shape
        return points, self.states + elements * values

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the operator of some of the points."""
        shared = ("alive", "sees", "pushes", "pushed", "inputs")
        return replace(self, **{name: array[points] for name, array in vars(self).items() if name not in shared})

    @property
    def several_delays(self) -> bool:
        """Whether the period holds several delays."""
        return bool(self.origin.shape[2])

    def krylov(self, start: Array, steps: int, known: Krylov | None = None) -> Krylov:
        """Return basis and Hessenberg matrix of Arnoldi's method, see ``multipliers.arnoldi``."""
        points, size = self.shape
        basis, hessenberg, done = grown(points, steps, size, known)
        _krylov(*self._map(), self.alive, self.system_index, start, done, basis, hessenberg)
        return basis, hessenberg

    def force(self, vectors: ComplexArray) -> tuple[Array, Array, ComplexArray]:
        """Return times (point, sample), weights (point, sample) and feedback force (point, sample, input)."""
        points, elements, nodes = self.node_time.shape
        parts = np.zeros((2, points, elements, len(self.pushed), nodes))
        _forces(*self._map(), np.stack([vectors.real, vectors.imag]), parts)
        force = np.zeros((points, elements, nodes, self.inputs), dtype=complex)
        force[..., self.pushed] = (parts[0] + 1j * parts[1]).swapaxes(-1, -2)
        flat = (points, elements * nodes)
        return self.node_time.reshape(flat), self.node_weight.reshape(flat), force.reshape(*flat, -1)

    def _map(self) -> tuple[NDArray, ...]:  # type: ignore[type-arg]
        return (
            self.sees,
            self.pushes,
            self.piece,
            self.count,
            self.cuts,
            self.table,
            self.advance,
            self.observe,
            self.drive,
            self.respond,
            self.solve,
            self.gain,
            self.origin,
            self.past,
            self.share,
            self.term_gain,
        )


def build(equation: DelayEquation, refinement: Array | float = 1.0) -> CompiledMonodromy:
    """Build the operator; ``refinement`` (point,) multiplies the number of elements.

    Raises UnsupportedEquation when a delay is not positive or longer than the period, when the state
    matrix cannot be diagonalised, or when the refinement is below collocation.LEAST_REFINEMENT.

    See docs/physics.md#collocation.
    """
    half, which = equation.system.half_spectrum, equation.system_index
    layout, gain, look_back, outputs = _lay_out(equation, refinement)
    # A real pole has no imaginary part, and filling has neither: they start at zero and stay there.
    weight = np.where(half.poles.imag > 0.0, 2.0, half.poles.imag == 0.0)
    alive = np.stack([weight > 0.0, weight > 1.0], axis=-1).reshape(len(weight), -1)
    # A direction in which no mode moves takes no part.
    shown, pushed = _taking_part(outputs.swapaxes(1, 2)), _taking_part(half.driven)
    seen = np.ascontiguousarray(outputs[:, shown])
    driven = np.ascontiguousarray((half.driven * (weight > 0.0)[..., None])[..., pushed])
    gain, term_gain = (
        np.ascontiguousarray(np.moveaxis(array[..., pushed[:, None], shown], -3, -1))
        for array in (gain, look_back.gain)
    )
    in_cut = np.cumsum(layout.acts, axis=1) - 1
    # Pieces of no length may lie between others; what is behind the last element is filling.
    count = layout.length.shape[1] - (layout.length[:, ::-1] > 0.0).argmax(axis=1)
    (points, elements), pieces = layout.piece.shape, layout.cuts.shape[1]
    values, forces, parts = NODES * len(shown), NODES * len(pushed), alive.shape[1]
    table = np.empty((points, pieces), dtype=np.intp)
    advance = np.empty((points, pieces, parts // 2), dtype=complex)
    observe, drive = np.empty((points, pieces, values, parts)), np.empty((points, pieces, parts, forces))
    respond = np.empty((points, pieces, values, forces))
    solve = np.empty((points, elements, values, values))
    _prepare(
        *_tables(), half.poles, seen, driven, which, layout.piece, count, layout.cuts, layout.piece_length, gain,
        table, advance, observe, drive, respond, solve,
    )  # fmt: skip
    return CompiledMonodromy(
        alive=alive.astype(float),
        sees=_ranges(np.any(seen != 0.0, axis=0)),
        pushes=_ranges(np.any(driven != 0.0, axis=0)),
        system_index=which,
        piece=layout.piece,
        count=count,
        cuts=layout.cuts,
        table=table,
        advance=advance,
        observe=observe,
        drive=drive,
        respond=respond,
        solve=solve,
        gain=gain,
        origin=in_cut[np.arange(points)[:, None, None, None], look_back.element],
        past=look_back.past,
        share=look_back.weight,
        term_gain=term_gain,
        node_time=layout.node_time,
        node_weight=layout.length[..., None] * collocation.gauss(NODES)[1],
        pushed=pushed,
        inputs=half.driven.shape[-1],
    )


def _lay_out(equation: DelayEquation, refinement: Array | float) -> tuple[Elements, Array, LookBack, ComplexArray]:
    """Return elements, the sum of all gains at their nodes, where they look back to, and what outputs see.

    They look back nowhere with one delay alone.
    """
    seen = equation.system.half_spectrum.seen
    if equation.velocity_gain:
        layout, look_back, velocity = delays.lay_out(equation, refinement)
        velocity = velocity * equation.system.fastest_pole[equation.system_index][:, None, None, None, None]
        gain = np.concatenate([look_back.gain.sum(axis=2), velocity], axis=-1)
        wide = np.concatenate([look_back.gain, np.zeros_like(look_back.gain)], axis=-1)
        return layout, gain, replace(look_back, gain=wide), equation.system.seen_with_velocities
    if not delays.is_one_period(equation):
        layout, look_back, _ = delays.lay_out(equation, refinement)
        return layout, look_back.gain.sum(axis=2), look_back, seen
    layout, _, gain = collocation.lay_out(equation, refinement)
    none = (*layout.piece.shape, 0, NODES)
    return (
        layout,
        gain,
        LookBack(
            element=np.zeros(none, dtype=np.intp),
            past=np.zeros(none, dtype=bool),
            weight=np.zeros((*none, NODES)),
            gain=np.zeros((*none, *gain.shape[-2:])),
        ),
        seen,
    )


def _taking_part(coupling: ComplexArray) -> NDArray[np.intp]:
    """Return the last axis' indices where anything couples, one at least."""
    found = np.flatnonzero(np.any(coupling != 0.0, axis=(0, 1)))
    return found if len(found) else np.array([0])


def _ranges(couples: NDArray[Any]) -> NDArray[np.intp]:
    """Return first and one past the last true entry of every row, (row, 2); zeros for a row without."""
    first, last = couples.argmax(axis=1), couples.shape[1] - couples[:, ::-1].argmax(axis=1)
    return np.asarray(np.stack([first, last], axis=-1) * couples.any(axis=1, keepdims=True))


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
                        add(through.real, re[i * NODES : (i + 1) * NODES], row[c * NODES : (c + 1) * NODES])
                        add(-through.imag, im[i * NODES : (i + 1) * NODES], row[c * NODES : (c + 1) * NODES])


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
    nodes, series, at_end, at_start, poles, seen, driven, system, piece, count, cuts, length, gain,
    table, advance, observe, drive, respond, solve,
):  # fmt: skip
    """Fill the integrals of every piece and the inverse of every element, point by point."""
    swapped = np.empty(solve.shape[2], np.int64)
    for p in range(len(piece)):
        own = poles[system[p]]
        for q in range(cuts.shape[1]):
            table[p, q] = q
            if not cuts[p, q]:
                for k in range(len(own)):
                    advance[p, q, k] = np.exp(own[k] * length[p, q])
                continue
            for other in range(q):
                if cuts[p, other] and abs(length[p, q] - length[p, other]) <= LENGTH_TOLERANCE * length[p, q]:
                    table[p, q] = table[p, other]
            if table[p, q] == q:
                _integrate(
                    nodes, series, at_end, at_start, own, seen[system[p]], driven[system[p]], length[p, q],
                    advance[p, q], observe[p, q], drive[p, q], respond[p, q],
                )  # fmt: skip
        for e in range(count[p]):
            if cuts[p, piece[p, e]]:
                _fill_implicit(respond[p, table[p, piece[p, e]]], gain[p, e], solve[p, e])
                _invert(solve[p, e], swapped)


@compiled
def _fill_implicit(respond, gain, matrix):  # type: ignore[no-untyped-def]
    """Fill 1 - respond K."""
    inputs, outputs = gain.shape[0], gain.shape[1]
    matrix[:] = 0.0
    for i in range(len(matrix)):
        for b in range(outputs):
            for c in range(inputs):
                for m in range(NODES):
                    matrix[i, b * NODES + m] -= respond[i, c * NODES + m] * gain[c, b, m]
        matrix[i, i] += 1.0


@compiled
def _apply(  # type: ignore[no-untyped-def]
    start, end, force, work, sees, pushes, piece, count, cuts, table, advance, observe, drive, respond, solve, gain,
    origin, past, share, term_gain,
):  # fmt: skip
    """Map one vector over a period; the forces (element, input and node) are left in ``force``."""
    parts, values = drive.shape[1], observe.shape[1]
    inputs, outputs = gain.shape[1], gain.shape[2]
    z, mismatch, difference, delayed = end[:parts], work[0, :values], work[1, :values], work[2]
    z[:] = start[:parts]
    several = origin.shape[1] > 0
    offset = parts
    for e in range(count):
        p, acts = table[piece[e]], cuts[piece[e]]
        if acts:
            before, after = start[offset : offset + values], end[offset : offset + values]
            for o in range(outputs):
                seen = slice(2 * sees[o, 0], 2 * sees[o, 1])
                visible = z[seen]
                for j in range(o * NODES, (o + 1) * NODES):
                    row = observe[p, j]
                    mismatch[j] = dot(row[seen], visible)
            if several:
                _look_back(
                    start[parts:], end[parts:], origin[e], past[e], share[e], term_gain[e], delayed[: inputs * NODES]
                )
            for j in range(values):
                mismatch[j] -= dot(respond[p, j], delayed[: inputs * NODES]) if several else before[j]
            for j in range(values):
                difference[j] = dot(solve[e, j], mismatch)
                after[j] = difference[j] if several else before[j] + difference[j]
            acting = force[e]
            for s in range(inputs * NODES):
                acting[s] = -delayed[s] if several else 0.0
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
                z[2 * k] += dot(real[pushing], acting[pushing])
                z[2 * k + 1] += dot(imaginary[pushing], acting[pushing])


@compiled
def _look_back(start, end, origin, past, share, term_gain, delayed):  # type: ignore[no-untyped-def]
    """Add up what delayed outputs, of this period or the one before, do to the forces at an element's nodes."""
    inputs, outputs = term_gain.shape[1], term_gain.shape[2]
    delayed[:] = 0.0
    for term in range(len(origin)):
        for m in range(NODES):
            for b in range(outputs):
                acts = False
                for c in range(inputs):
                    acts = acts or term_gain[term, c, b, m] != 0.0
                # What does not act may look back to where nothing was ever written.
                if not acts:
                    continue
                first, value = (origin[term, m] * outputs + b) * NODES, 0.0
                for i in range(NODES):
                    value += share[term, m, i] * (start[first + i] if past[term, m] else end[first + i])
                for c in range(inputs):
                    delayed[c * NODES + m] += term_gain[term, c, b, m] * value


@compiled
def _norm(vector, size):  # type: ignore[no-untyped-def]
    """Return a norm that overflows only where an entry does."""
    square = dot(vector[:size], vector[:size])
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
            overlap = dot(known[:size], new[:size])
            hessenberg[a, j] += overlap
            add(-overlap, known[:size], new[:size])
        after = _norm(new, size)
        if after > LEFT * before:
            return after
        # What is left of an exhausted space is rounding: it is exact already.
        if after <= EXHAUSTED * before:
            return 0.0
        before = after
    return after


@compiled
def _krylov(  # type: ignore[no-untyped-def]
    sees, pushes, piece, count, cuts, table, advance, observe, drive, respond, solve, gain, origin, past, share,
    term_gain, alive, system, start, done, basis, hessenberg,
):  # fmt: skip
    """Build the Krylov space of every point by Arnoldi's method, from where ``done`` steps of it have come to."""
    parts, values, steps = alive.shape[1], observe.shape[2], hessenberg.shape[2]
    # What nobody has written is not a number: whoever read it would be seen.
    new, work = np.full(len(start), np.nan), np.empty((3, max(values, drive.shape[3])))
    force = np.empty((piece.shape[1], drive.shape[3]))
    for p in range(len(piece)):
        size = parts
        for e in range(count[p]):
            size += values * cuts[p, piece[p, e]]
        maps = (
            sees, pushes, piece[p], count[p], cuts[p], table[p], advance[p], observe[p], drive[p], respond[p], solve[p],
            gain[p], origin[p], past[p], share[p], term_gain[p],
        )  # fmt: skip
        if done > 0:
            new[:] = basis[p, done]
            norm = 1.0 if hessenberg[p, done, done - 1] != 0.0 else 0.0
        else:
            for i in range(size):
                new[i] = start[i] * alive[system[p], i] if i < parts else start[i]
            norm = _norm(new, size)
        for j in range(done if done > 0 else -WARM_UP, min(steps, size) + 1):
            if norm == 0.0 or not np.isfinite(norm):
                break
            vector = basis[p, max(j, 0)]
            for i in range(size):
                vector[i] = new[i] / norm
            if j < min(steps, size):
                _apply(vector, new, force, work, *maps)
                norm = _norm(new, size) if j < 0 else _orthogonalise(new, basis[p], hessenberg[p], j, size)
                if j >= 0:
                    hessenberg[p, j + 1, j] = norm
        if not np.isfinite(norm):
            hessenberg[p] = 0.0


@compiled
def _forces(  # type: ignore[no-untyped-def]
    sees, pushes, piece, count, cuts, table, advance, observe, drive, respond, solve, gain, origin, past, share,
    term_gain, vectors, result,
):  # fmt: skip
    """Find the feedback force (part, point, element, input, node) of vectors (part, point, size), part by part."""
    inputs, end = gain.shape[2], np.full(vectors.shape[2], np.nan)
    work = np.empty((3, max(observe.shape[2], drive.shape[3])))
    force = np.empty((piece.shape[1], drive.shape[3]))
    for p in range(len(piece)):
        for part in range(len(vectors)):
            _apply(
                vectors[part, p], end, force, work, sees, pushes, piece[p], count[p], cuts[p], table[p], advance[p],
                observe[p], drive[p], respond[p], solve[p], gain[p], origin[p], past[p], share[p], term_gain[p],
            )  # fmt: skip
            for e in range(count[p]):
                for s in range(inputs * NODES if cuts[p, piece[p, e]] else 0):
                    result[part, p, e, s // NODES, s % NODES] = force[e, s]
