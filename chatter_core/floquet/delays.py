"""Several delays: where in the period each node's delayed outputs lie, and how they are interpolated.

With teeth that differ, one after the other, the period is a revolution and each tooth has its own delay.
A delayed output w(t - tau_l) is the polynomial through the nodes of the element that t - tau_l lies in:
one already passed in this period, or one of the period before. Where a breakpoint comes back after a
delay the period is broken too, so that no element looks back across a jump of a gain.

Runout leaves many slivers of contact, and an element each would cost more than they are worth. Pieces that are short
for an element are one with what follows, and at the nodes a gain there is what keeps its integrals against
polynomials: a force K d with a smooth d then does what it should to the end of the element, and is off between by the
square of what is short.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import UnsupportedEquation
from chatter_core.floquet import collocation
from chatter_core.floquet.collocation import NODES, Elements
from chatter_core.floquet.equation import Array, DelayEquation, Gain
from chatter_core.jit import compiled

#: A delay may exceed the period by this share: by rounding.
DELAY_TOLERANCE = 1e-12
#: Breakpoints nearer to each other than this share of the period are one: by rounding, or too near to be seen.
BREAK_TOLERANCE = 1e-10
#: Pieces shorter than this share of the longest element allowed are one with what follows: ln|mu| is off by 1e-4 then.
SHORT = 0.1
#: What is nearer to an end of an element than this share of its length is there: by rounding.
ROUNDING = 1e-12


@dataclass(frozen=True, kw_only=True)
class LookBack:
    """Where delayed outputs come from, arrays (point, element, term, node, ...).

    Terms are those that act in an element, as many as act anywhere at once. element: the element that holds them; past:
    whether a period ago; weight: (.., node) of the values at its nodes. gain: (point, element, term, node, input,
    output).
    """

    element: NDArray[np.intp]
    past: NDArray[np.bool_]
    weight: Array
    gain: Array


def is_one_period(equation: DelayEquation) -> bool:
    """Return whether there is one delay, equal to the period.

    See docs/physics.md#collocation.
    """
    delays = [feedback.delay for feedback in equation.feedback]
    return len(delays) == 1 and bool(np.all(np.abs(delays[0] - equation.period) <= DELAY_TOLERANCE * equation.period))


@dataclass(frozen=True, kw_only=True)
class _Broken:
    """A period with its breakpoints, and those of them that part elements.

    smooth_from: (point, breakpoint), where a gain may not be smooth, and breakpoints: (point, piece), where pieces
    begin, both ascending; piece: (point, breakpoint), in which one that smooth_from names, and what follows, lies.
    """

    smooth_from: Array
    breakpoints: Array
    piece: NDArray[np.intp]

    def acting(self, gain: Gain, period: Array) -> NDArray[np.bool_]:
        """Return the pieces (point, piece) in which a gain acts."""
        result = np.zeros(self.breakpoints.shape, dtype=bool)
        point, within = np.nonzero(collocation.acting_pieces(gain, self.smooth_from, period))
        result[point, self.piece[point, within]] = True
        return result


@dataclass(frozen=True, kw_only=True)
class _Parts:
    """Elements in which a gain acts, parted where it is not smooth: start, length [s] and element (point, part).

    What is filled up has no length.
    """

    start: Array
    length: Array
    element: NDArray[np.intp]


def lay_out(equation: DelayEquation, refinement: Array | float) -> tuple[Elements, LookBack, Array]:
    """Return the elements of every point, where their nodes look back to, and the gain on velocities at the nodes.

    That gain is (point, element, node, input, output).

    Raises UnsupportedEquation when a delay is not positive or longer than the period, and as
    ``collocation.break_up`` does.

    See docs/physics.md#collocation.
    """
    delays = np.stack([feedback.delay for feedback in equation.feedback], axis=-1)
    period = equation.period[:, None]
    if not np.all((delays > 0.0) & (delays <= (1.0 + DELAY_TOLERANCE) * period)):
        raise UnsupportedEquation("delays must be positive and at most the period")
    longest = collocation.LONGEST_ELEMENT * delays.min(axis=1)
    broken = _broken(equation, _short(equation, refinement, longest))
    acts = [broken.acting(feedback.gain, equation.period) for feedback in equation.feedback]
    holds = _pieces_with_nodes(equation, broken, acts, delays)
    layout = collocation.break_up(equation, refinement, broken.breakpoints, holds, longest[:, None])
    parts = _parts(layout, broken.smooth_from, layout.acts)
    velocity = np.zeros((*layout.piece.shape, NODES, *_couples(equation)))
    for gain in equation.velocity_gain:
        _add_at_nodes(gain, layout, parts, velocity)
    return layout, _look_back(equation, layout, broken.smooth_from, acts, delays), velocity


def _couples(equation: DelayEquation) -> tuple[int, int]:
    """Return the numbers of inputs and outputs."""
    return equation.system.input_matrix.shape[-1], equation.system.output_matrix.shape[-2]


def _short(equation: DelayEquation, refinement: Array | float, longest: Array) -> Array:
    """Return below which length (point,) [s] a piece is one with what follows."""
    fastest = equation.system.fastest_pole[equation.system_index]
    allowed = np.minimum(2.0 * np.pi * collocation.WAVES_PER_ELEMENT / fastest, longest)
    return np.asarray(SHORT * allowed / refinement)


def _broken(equation: DelayEquation, short: Array) -> _Broken:
    """Return where the period is broken; short: (point,) [s]."""
    period = equation.period[:, None]
    tolerance = BREAK_TOLERANCE * period
    own = _distinct(equation.breakpoints, tolerance, period)
    smooth_from = _distinct(np.concatenate([own, *_returning(equation, own)], axis=1), tolerance, period)
    piece = np.zeros(smooth_from.shape, dtype=np.intp)
    breakpoints = np.empty_like(smooth_from)
    count = _part(smooth_from, short, breakpoints, piece)
    # The last of the breakpoints, repeated where a point has fewer than others, begins the piece around the end.
    last = piece == piece[:, -1:]
    piece[last] = count - 1
    return _Broken(smooth_from=smooth_from, breakpoints=breakpoints[:, :count], piece=piece)


@compiled
def _part(smooth_from, short, breakpoints, piece):  # type: ignore[no-untyped-def]
    """Fill breakpoints that are not short of each other, the last repeated; return how many a point has at most."""
    most = 0
    for p in range(len(smooth_from)):
        count, latest = 1, smooth_from[p, 0]
        breakpoints[p, 0] = latest
        for q in range(1, smooth_from.shape[1]):
            if smooth_from[p, q] - latest >= short[p]:
                latest = smooth_from[p, q]
                breakpoints[p, count] = latest
                count += 1
            piece[p, q] = count - 1
        breakpoints[p, count:] = latest
        most = max(most, count)
    return most


def _returning(equation: DelayEquation, own: Array) -> Iterator[Array]:
    """Yield where breakpoints ``own`` come back after each delay (point, breakpoint), as far as its gain acts there.

    Elsewhere they need not be broken at, and the first breakpoint stands for them.
    """
    period = equation.period[:, None]
    beside = BREAK_TOLERANCE * period[..., None] * np.array([-2.0, 2.0])
    for feedback in equation.feedback:
        returning = np.mod(own + feedback.delay[:, None], period)
        acts = np.any(feedback.gain(returning[..., None] + beside) != 0.0, axis=(2, 3, 4))
        yield np.where(acts, returning, own[:, :1])


def _distinct(breakpoints: Array, tolerance: Array, period: Array) -> Array:
    """Return breakpoints ascending, each once, the last repeated where a point has fewer than others."""
    # What lies just before the period's end is the beginning, missed by rounding.
    ordered = np.sort(np.mod(breakpoints + tolerance, period) - tolerance, axis=1)
    new = np.diff(ordered, axis=1, prepend=-np.inf) > tolerance
    rank = np.cumsum(new, axis=1) - 1
    latest = np.maximum.accumulate(np.where(new, ordered, -np.inf), axis=1)
    distinct = np.repeat(latest[:, -1:], rank.max() + 1, axis=1)
    distinct[np.arange(len(rank))[:, None], rank] = latest
    return distinct


def _pieces_with_nodes(
    equation: DelayEquation, broken: _Broken, acts: Sequence[NDArray[np.bool_]], delays: Array
) -> NDArray[np.bool_]:
    """Return the pieces (point, piece) in which a gain acts or that an acting one looks back into.

    acts: of every term, the pieces (point, piece) in which it acts.
    """
    length = collocation.piece_lengths(broken.breakpoints, equation.period)
    begin = broken.breakpoints - broken.breakpoints[:, :1]
    holds = np.zeros(begin.shape, dtype=bool)
    for gain in equation.velocity_gain:
        holds |= broken.acting(gain, equation.period)
    for term, acting in enumerate(acts):
        _look_into(acting, begin, length, np.ascontiguousarray(delays[:, term]), equation.period, holds)
    return holds


@compiled
def _look_into(acts, begin, length, delay, period, holds):  # type: ignore[no-untyped-def]
    """Mark the pieces (point, piece) that act, and those that they overlap a delay before."""
    for p, q in np.ndindex(acts.shape):
        if not acts[p, q]:
            continue
        holds[p, q] = True
        first = (begin[p, q] - delay[p]) % period[p]
        last = first + length[p, q]
        for r in range(begin.shape[1]):
            for origin in (begin[p, r], begin[p, r] + period[p]):  # before and after the period's end
                overlaps = first < origin + length[p, r] and origin < last
                holds[p, r] = holds[p, r] or (overlaps and length[p, r] > 0.0)


def _parts(layout: Elements, smooth_from: Array, acts: NDArray[np.bool_]) -> _Parts:
    """Return the elements in which a gain acts (point, element), parted where it is not smooth."""
    points, elements = layout.piece.shape
    start, length = np.zeros((2, points, elements + smooth_from.shape[1]))
    element = np.zeros(start.shape, dtype=np.intp)
    acts = np.ascontiguousarray(acts)
    most = _fill_parts(layout.start, layout.length, acts, smooth_from, start, length, element)
    # One layout in memory for all: each is compiled for itself.
    start, length, element = (np.ascontiguousarray(one[:, :most]) for one in (start, length, element))
    return _Parts(start=start, length=length, element=element)


@compiled
def _fill_parts(  # type: ignore[no-untyped-def]
    element_start, element_length, acts, smooth_from, start, length, element
):
    """Fill the parts of all elements that act, in turn; return how many a point has at most."""
    most = 0
    for p in range(len(acts)):
        count, following = 0, 0
        for e in range(acts.shape[1]):
            if not acts[p, e]:
                continue
            begin, end = element_start[p, e], element_start[p, e] + element_length[p, e]
            # What is nearer to an end than rounding is the end.
            rounding = ROUNDING * element_length[p, e]
            while following < smooth_from.shape[1] and smooth_from[p, following] <= begin + rounding:
                following += 1
            while begin < end:
                stop = end
                if following < smooth_from.shape[1] and smooth_from[p, following] < end - rounding:
                    stop = smooth_from[p, following]
                start[p, count], length[p, count], element[p, count] = begin, stop - begin, e
                count += 1
                begin = stop
                while following < smooth_from.shape[1] and smooth_from[p, following] <= begin:
                    following += 1
        most = max(most, count)
    return most


def _look_back(
    equation: DelayEquation, layout: Elements, smooth_from: Array, acts: Sequence[NDArray[np.bool_]], delays: Array
) -> LookBack:
    time, couples = layout.node_time, _couples(equation)
    of_all = np.zeros((*layout.piece.shape, len(equation.feedback), NODES, *couples))
    acting = np.stack([np.take_along_axis(of_term, layout.piece, axis=1) for of_term in acts], axis=-1)
    for term, feedback in enumerate(equation.feedback):
        # Of many gains few act in an element, and looking at each everywhere would take most of the time.
        own = _parts(layout, smooth_from, acting[:, :, term])
        _add_at_nodes(feedback.gain, layout, own, of_all[:, :, term])
    # Of many teeth few cut at once: the terms that act in an element come first, and what acts nowhere is left out.
    order, count = np.zeros(of_all.shape[:3], dtype=np.intp), np.zeros(of_all.shape[:2], dtype=np.intp)
    order = order[:, :, : _acting_first(of_all, acting, order, count)]
    points, elements = np.ogrid[: order.shape[0], : order.shape[1]]
    gain = of_all[points[..., None], elements[..., None], order]
    earlier = time[:, :, None, :] - delays[np.arange(len(time))[:, None, None], order][..., None]
    past = earlier < layout.start[:, :1, None, None]
    earlier = np.where(past, earlier + equation.period[:, None, None, None], earlier)
    element, weight = np.zeros(earlier.shape, dtype=np.intp), np.zeros((*earlier.shape, NODES))
    _interpolate(layout.start, layout.length, earlier, count, collocation.lagrange_powers(), element, weight)
    return LookBack(element=element, past=past, weight=weight, gain=gain)


@compiled
def _acting_first(gain, acting, order, count):  # type: ignore[no-untyped-def]
    """Fill in the terms (point, element, term), those that act first, and how many act (point, element).

    Return how many act at most, or one. acting: (point, element, term), which may act; none else has a gain.
    """
    most = 1
    for p in range(acting.shape[0]):
        for e in range(acting.shape[1]):
            place = 0
            for first in (True, False):
                for term in range(acting.shape[2]):
                    if (acting[p, e, term] and _acts(gain[p, e, term])) == first:
                        order[p, e, place] = term
                        place += 1
                if first:
                    count[p, e] = place
                    most = max(most, place)
    return most


@compiled
def _acts(gain):  # type: ignore[no-untyped-def]
    """Return whether a gain (node, input, output) acts at any node."""
    acting = False
    for place in np.ndindex(gain.shape):
        acting = acting or gain[place] != 0.0
    return acting


def _add_at_nodes(gain: Gain, layout: Elements, parts: _Parts, result: Array) -> None:
    """Add what stands for a gain at the nodes (point, element, node, input, output), nothing where it does not act.

    Its integrals against the nodes' polynomials, over the nodes' weights: the gain itself where that is smooth.
    """
    if not parts.start.size:
        return
    nodes, weights = collocation.gauss(NODES)
    value = gain(parts.start[..., None] + parts.length[..., None] * nodes)
    _add_integrals(
        parts.start, parts.length, parts.element, layout.start, layout.length, nodes, weights,
        collocation.lagrange_powers(), value, result,
    )  # fmt: skip


@compiled
def _add_integrals(  # type: ignore[no-untyped-def]
    start, length, element, element_start, element_length, nodes, weights, powers, value, result
):
    """Add up integrals of values at the nodes of parts (point, part, node, ..) against the polynomials of elements."""
    count = len(nodes)
    for p in range(len(start)):
        for s in range(start.shape[1]):
            # Of many gains few act in a part, and integrals of nothing would take most of the time.
            if length[p, s] == 0.0 or not _acts(value[p, s]):
                continue
            e = element[p, s]
            share = length[p, s] / element_length[p, e]
            offset = (start[p, s] - element_start[p, e]) / element_length[p, e]
            for q in range(count):
                place = offset + share * nodes[q]
                for n in range(count):
                    factor = 0.0
                    for power in range(count - 1, -1, -1):
                        factor = factor * place + powers[n, power]
                    factor *= share * weights[q] / weights[n]
                    for i in range(value.shape[3]):
                        for o in range(value.shape[4]):
                            result[p, e, n, i, o] += factor * value[p, s, q, i, o]


@compiled
def _interpolate(start, length, time, count, powers, element, weight):  # type: ignore[no-untyped-def]
    """Fill which element holds each time (point, element, term, node), and the weights (.., node) of its nodes there.

    That is the last that has begun, the first where none has; elements of no length, which share their start with
    others, hold nothing. count: (point, element), how many terms act: others look back nowhere. powers: (node, power),
    of the polynomial that is one at a node.
    """
    nodes = len(powers)
    for p in range(len(time)):
        first = 0
        while length[p, first] == 0.0:
            first += 1
        found = first
        for own in range(time.shape[1]):
            for term, node in np.ndindex(count[p, own], nodes):
                # Times ascend from node to node, so the search mostly goes on from where it was.
                at = time[p, own, term, node]
                found = found if start[p, found] <= at else first
                for e in range(found + 1, start.shape[1]):
                    if length[p, e] > 0.0:
                        if start[p, e] > at:
                            break
                        found = e
                element[p, own, term, node] = found
                place = (at - start[p, found]) / length[p, found]
                for n in range(nodes):
                    value = 0.0
                    for power in range(nodes - 1, -1, -1):
                        value = value * place + powers[n, power]
                    weight[p, own, term, node, n] = value
