"""Monodromy operator by collocation of the feedback force, exact in the linear system.

The period is broken where a gain is not smooth. Where every gain vanishes the state moves freely
and exactly. Elsewhere each piece is cut into elements of equal length; in an element the feedback
force is the polynomial through its values at Gauss nodes, and the linear system is integrated
exactly against it:

    x(t) = exp(A t) x_a + sum_j int_0^t exp(A (t - s)) B l_j(s) ds  f_j,   f_j = K(t_j) (w_j - w_j(delayed))

so the unknowns of an element are its few w_j, and the error falls with twice the number of nodes.
The discretised state is x at the start of the period and the w_j of the period before: neighbouring
elements exchange nothing but x.

Sources: E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I (1993),
section II.7 (Gauss collocation, superconvergence); M. Hochbruck, A. Ostermann, "Exponential
integrators", Acta Numerica 19 (2010) 209-286 (exact integration of the linear part).
"""

import math
from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import UnsupportedEquation
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation, Gain
from chatter_core.floquet.multipliers import Krylov, arnoldi

#: Gauss nodes an element.
NODES = 6
#: Waves of the fastest mode an element may hold at refinement 1.
WAVES_PER_ELEMENT = 0.75
#: An element is at most this share of the period at refinement 1, for the gain's own shape.
LONGEST_ELEMENT = 0.34
#: Terms of the power series of an element's integrals: exact to rounding for the waves it may hold
#: at the least refinement.
SERIES_TERMS = 48
LEAST_REFINEMENT = 0.5
#: Delay and period may differ by this share.
DELAY_TOLERANCE = 1e-12


@dataclass(frozen=True, kw_only=True)
class CollocationMonodromy:
    """Map of (x, w at the nodes of each element) over one period, element by element.

    element_map: (point, element, state + node values, the same); free flight and padding have zero
    rows for their node values. force_map: (point, element, node values, state + node values) gives
    the feedback force at the nodes; node_time, node_weight: (point, element, node).
    """

    element_map: Array
    force_map: Array
    node_time: Array
    node_weight: Array
    states: int

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and size of the discretised state."""
        points, elements, height, _ = self.element_map.shape
        return points, self.states + elements * (height - self.states)

    def apply(self, vectors: Array) -> Array:
        """Map vectors (point, size) over one period."""
        state, delayed = self._split(vectors)
        after = np.empty_like(delayed)
        for element in range(delayed.shape[1]):
            moved = (self.element_map[:, element] @ np.concatenate([state, delayed[:, element]], axis=1)[..., None])[
                ..., 0
            ]
            state, after[:, element] = moved[:, : self.states], moved[:, self.states :]
        return np.concatenate([state, after.reshape(len(vectors), -1)], axis=1)

    @property
    def several_delays(self) -> bool:
        """Whether the period holds several delays: here it is the only one."""
        return False

    def krylov(self, start: Array, steps: int, known: Krylov | None = None) -> Krylov:
        """Return basis and Hessenberg matrix of Arnoldi's method, see ``multipliers.arnoldi``."""
        return arnoldi(self.apply, np.broadcast_to(start, self.shape), steps, known)

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the operator of some of the points."""
        return replace(
            self,
            element_map=self.element_map[points],
            force_map=self.force_map[points],
            node_time=self.node_time[points],
            node_weight=self.node_weight[points],
        )

    def force(self, vectors: ComplexArray) -> tuple[Array, Array, ComplexArray]:
        """Return times (point, sample), weights (point, sample) and feedback force (point, sample, input)."""
        state, delayed = self._split(vectors)
        points, elements, samples = self.node_time.shape
        force = np.empty((points, elements, self.force_map.shape[2]), dtype=complex)
        for element in range(elements):
            both = np.concatenate([state, delayed[:, element]], axis=1)[..., None]
            force[:, element] = (self.force_map[:, element] @ both)[..., 0]
            state = (self.element_map[:, element, : self.states] @ both)[..., 0]
        flat = (points, elements * samples)
        return self.node_time.reshape(flat), self.node_weight.reshape(flat), force.reshape(*flat, -1)

    def _split(self, vectors: NDArray) -> tuple[NDArray, NDArray]:  # type: ignore[type-arg]
        points, elements, height, _ = self.element_map.shape
        return vectors[:, : self.states], vectors[:, self.states :].reshape(points, elements, height - self.states)


@dataclass(frozen=True, kw_only=True)
class Elements:
    """Layout of the elements.

    Piece, start and length are (point, element); the length of an element in each piece, and whether
    a gain acts there, are (point, piece).
    """

    piece: NDArray[np.intp]
    start: Array
    length: Array
    piece_length: Array
    cuts: NDArray[np.bool_]

    @property
    def acts(self) -> NDArray[np.bool_]:
        """Whether a gain acts in an element (point, element)."""
        return np.take_along_axis(self.cuts, self.piece, axis=1) & (self.length > 0.0)

    @property
    def node_time(self) -> Array:
        """Times of the nodes (point, element, node) [s]."""
        return np.asarray(self.start[..., None] + self.length[..., None] * gauss(NODES)[0])


@dataclass(frozen=True, kw_only=True)
class _Tables:
    """Exact integrals over one element of each piece (point, piece, ...).

    advance: exp(A h) (state, state); drive: x(h) per force at a node (state, node x input);
    observe: w at the nodes per x_a (node x output, state); respond: w at the nodes per force at the
    nodes (node, output, node, input).
    """

    advance: Array
    drive: Array
    observe: Array
    respond: Array


def build(equation: DelayEquation, refinement: Array | float = 1.0) -> CollocationMonodromy:
    """Build the operator; ``refinement`` (point,) multiplies the number of elements.

    Raises UnsupportedEquation when there is not exactly one delay, equal to the period, when there is a gain on
    velocities, when the state matrix cannot be diagonalised, or when the refinement is below LEAST_REFINEMENT.

    See docs/physics.md#collocation.
    """
    layout, time, gain = lay_out(equation, refinement)
    tables = _integrate(equation, layout.piece_length, layout.cuts)
    _, weights = gauss(NODES)
    element_map, force_map = _element_maps(tables, layout, gain)
    return CollocationMonodromy(
        element_map=element_map,
        force_map=force_map,
        node_time=time,
        node_weight=layout.length[..., None] * weights,
        states=equation.system.state_matrix.shape[-1],
    )


def lay_out(equation: DelayEquation, refinement: Array | float) -> tuple[Elements, Array, Array]:
    """Return the elements of every point, the times of their nodes and the gain there.

    Times are (point, element, node), gains (point, element, node, input, output), zero where none acts.

    Raises UnsupportedEquation as ``build`` says.

    See docs/physics.md#collocation.
    """
    delays = [feedback.delay for feedback in equation.feedback]
    if equation.velocity_gain:
        raise UnsupportedEquation("the plain collocation has no gain on velocities; the compiled one has")
    if len(delays) != 1 or np.any(np.abs(delays[0] - equation.period) > DELAY_TOLERANCE * equation.period):
        raise UnsupportedEquation(
            "the plain collocation solves one delay equal to the period; the compiled one takes any delays up to it"
        )
    breakpoints = np.sort(equation.breakpoints, axis=1)
    cuts = acting_pieces(equation.feedback[0].gain, breakpoints, equation.period)
    layout = break_up(equation, refinement, breakpoints, cuts)
    time = layout.node_time
    gain = equation.feedback[0].gain(time)
    gain[~layout.acts] = 0.0
    return layout, time, gain


def acting_pieces(gain: Gain, breakpoints: Array, period: Array) -> NDArray[np.bool_]:
    """Return whether a gain acts between breakpoints (point, breakpoint), ascending, and the next (point, piece).

    See docs/physics.md#collocation.
    """
    length = piece_lengths(breakpoints, period)
    probes = breakpoints[..., None] + length[..., None] * np.array([0.21, 0.5, 0.83])
    return np.asarray(np.any(gain(probes) != 0.0, axis=(2, 3, 4)) & (length > 0.0))


def piece_lengths(breakpoints: Array, period: Array) -> Array:
    """Return the lengths (point, piece) [s] between ascending breakpoints, the last one's around the period's end.

    See docs/physics.md#collocation.
    """
    return np.diff(breakpoints, axis=1, append=breakpoints[:, :1] + period[:, None])


def break_up(
    equation: DelayEquation,
    refinement: Array | float,
    breakpoints: Array,
    cuts: NDArray[np.bool_],
    longest: Array | float = np.inf,
) -> Elements:
    """Cut the pieces that ``cuts`` names (point, piece) into elements; the others are one element each.

    breakpoints: (point, breakpoint), ascending [s]; longest: allowed element (point, 1) [s].

    Raises UnsupportedEquation when the refinement is below LEAST_REFINEMENT.

    See docs/physics.md#collocation.
    """
    if not np.all(np.asarray(refinement) >= LEAST_REFINEMENT):
        raise UnsupportedEquation(f"refinement: found {np.min(refinement):g}, allowed: at least {LEAST_REFINEMENT:g}")
    begin, length = breakpoints, piece_lengths(breakpoints, equation.period)
    fastest = np.abs(equation.system.spectrum.poles).max(axis=1)[equation.system_index]
    waves = length * fastest[:, None] / (2.0 * np.pi)
    share = length / equation.period[:, None]
    wanted = np.maximum(waves / WAVES_PER_ELEMENT, share / LONGEST_ELEMENT)
    # Rounded up before the refinement too: a finer mesh has more elements in every piece.
    wanted = np.maximum(1.0, np.ceil(wanted - 1e-9)) * np.broadcast_to(refinement, (len(equation),))[:, None]
    wanted = np.maximum(wanted, length / longest)
    count = np.where(cuts, np.maximum(1, np.ceil(wanted - 1e-9)), 1).astype(int)
    last = np.cumsum(count, axis=1)
    index = np.arange(last[:, -1].max())
    piece = (index[None, :, None] >= last[:, None, :]).sum(axis=-1)
    padding = piece == begin.shape[1]
    piece = np.where(padding, begin.shape[1] - 1, piece)
    rows = np.arange(len(begin))[:, None]
    step = length / count
    order = index - (last - count)[rows, piece]
    return Elements(
        piece=piece,
        start=np.where(padding, 0.0, begin[rows, piece] + order * step[rows, piece]),
        length=np.where(padding, 0.0, step[rows, piece]),
        piece_length=step,
        cuts=cuts,
    )


@cache
def gauss(count: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss's rule on [0, 1].

    See docs/physics.md#collocation.
    """
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return 0.5 * (nodes + 1.0), 0.5 * weights


@cache
def lagrange_powers() -> Array:
    """Return the Lagrange polynomials of the nodes (node, power), powers ascending.

    See docs/physics.md#collocation.
    """
    nodes, _ = gauss(NODES)
    others = [np.delete(nodes, j) for j in range(NODES)]
    return np.array(
        [np.polynomial.polynomial.polyfromroots(rest) / np.prod(nodes[j] - rest) for j, rest in enumerate(others)]
    )


@cache
def integral_series() -> Array:
    """Return the power series in z of int_0^e exp(z (e - s)) l_j(s) ds for e at each node and at 1.

    See docs/physics.md#collocation.

    l_j are the Lagrange polynomials of the nodes; the result is (end, node, term). From
    int_0^e exp(z (e - s)) s^p ds = sum_m z^m p! e^(m + p + 1) / (m + p + 1)!.
    """
    powers = lagrange_powers()
    ends = np.append(gauss(NODES)[0], 1.0)
    series = np.zeros((NODES + 1, NODES, SERIES_TERMS))
    for term in range(SERIES_TERMS):
        for power in range(NODES):
            factor = math.factorial(power) / math.factorial(term + power + 1)
            series[:, :, term] += factor * ends[:, None] ** (term + power + 1) * powers[:, power]
    return series


def _integrate(equation: DelayEquation, length: Array, cuts: NDArray[np.bool_]) -> _Tables:
    """Integrate the linear system exactly against the Lagrange polynomials of the nodes.

    length: (point, piece), the length of an element in each piece [s]; the integrals are found where
    a gain acts, ``cuts`` (point, piece), and are zero elsewhere.
    """
    nodes, _ = gauss(NODES)
    half, which = equation.system.half_spectrum, equation.system_index
    modes, inverse, seen, driven = (array[which, None] for array in (half.modes, half.inverse, half.seen, half.driven))
    exponent = half.poles[which, None, :] * length[..., None]  # (point, piece, pole)
    advance = _real_product(modes * np.exp(exponent)[..., None, :], inverse)

    # A free flight may be long, and the series is for elements.
    exponent *= cuts[..., None]
    length = np.where(cuts, length, 0.0)
    grown = np.exp(exponent[..., None, :] * nodes[:, None])  # (point, piece, node, pole)
    shown = seen[..., None, :, :] * grown[..., None, :]  # (point, piece, node, output, pole)
    observe = _real_product(shown.reshape(*length.shape, -1, exponent.shape[-1]), inverse)

    factors = np.repeat(exponent[..., None], SERIES_TERMS, axis=-1)
    factors[..., 0] = length[..., None]
    terms = np.cumprod(factors, axis=-1)
    series = integral_series().reshape(-1, SERIES_TERMS).T
    integrals = (terms.real @ series + 1j * (terms.imag @ series)).reshape(*exponent.shape, NODES + 1, NODES)
    # Both end in (node, input): which node's force, in which direction.
    whole = integrals[..., -1, :, None] * driven[..., :, None, :]
    drive = _real_product(modes, whole.reshape(*exponent.shape, -1))
    outputs, inputs = seen.shape[-2], driven.shape[-1]
    kernel = (seen[..., :, None, :] * driven.swapaxes(-1, -2)[..., None, :, :]).reshape(
        len(length), 1, -1, len(half.poles[0])
    )
    partial = integrals[..., :-1, :].reshape(*exponent.shape, -1)
    respond = _real_product(kernel, partial).reshape(*length.shape, outputs, inputs, NODES, NODES)
    respond = respond.transpose(0, 1, 4, 2, 5, 3)  # (point, piece, node, output, node, input)
    return _Tables(advance=advance, drive=drive, observe=observe, respond=respond)


def _real_product(left: ComplexArray, right: ComplexArray) -> Array:
    """Return the real part of a matrix product, at half its cost."""
    wide = np.concatenate([left.real, -left.imag], axis=-1)
    tall = np.concatenate([right.real, right.imag], axis=-2)
    return np.asarray(wide @ tall)


def _element_maps(tables: _Tables, layout: Elements, gain: Array) -> tuple[Array, Array]:
    """Solve every element for its node values and write it as a map of (x_a, delayed w)."""
    points, elements = layout.piece.shape
    rows = np.arange(points)[:, None]
    states = tables.advance.shape[-1]
    inputs, outputs = gain.shape[-2:]
    values = NODES * outputs
    # (delayed - present) w is the unknown d: d = observe x_a - delayed + respond gain d.
    respond = tables.respond[rows, layout.piece].reshape(points, elements, values, NODES, inputs)
    driven = sum(respond[..., b, None] * gain[:, :, None, :, b] for b in range(inputs))
    implicit = np.eye(values) - np.reshape(driven, (points, elements, values, values))
    right = np.zeros((points, elements, values, states + values))
    right[..., :states] = tables.observe[rows, layout.piece]
    right[..., states:] = -np.eye(values)
    difference = np.linalg.solve(implicit, right)
    split = difference.reshape(points, elements, NODES, outputs, -1)
    weighted = sum(gain[..., b, None] * split[..., None, b, :] for b in range(outputs))
    force_map = np.reshape(weighted, (points, elements, NODES * inputs, states + values))
    drive = tables.drive[rows, layout.piece]
    element_map = np.empty((points, elements, states + values, states + values))
    element_map[..., :states, :] = drive @ force_map
    element_map[..., :states, :states] += tables.advance[rows, layout.piece]
    element_map[..., states:, :] = difference
    element_map[..., states:, states:] += np.eye(values)
    # Where no gain acts nobody will ask for w; and padding has no length.
    element_map[..., states:, :][~layout.acts] = 0.0
    idle = layout.length == 0.0
    element_map[..., :states, :][idle] = np.eye(states, states + values)
    return element_map, force_map
