"""Several delays: where in the period each node's delayed outputs lie, and how they are interpolated.

With teeth that differ, one after the other, the period is a revolution and each tooth has its own delay.
A delayed output w(t - tau_l) is the polynomial through the nodes of the element that t - tau_l lies in:
one already passed in this period, or one of the period before. Where a breakpoint comes back after a
delay the period is broken too, so that no element looks back across a jump of a gain.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import UnsupportedEquation
from chatter_core.floquet import collocation
from chatter_core.floquet.collocation import NODES, Elements
from chatter_core.floquet.equation import Array, DelayEquation
from chatter_core.jit import compiled

#: A delay may exceed the period by this share: by rounding.
DELAY_TOLERANCE = 1e-12
#: Breakpoints nearer to each other than this share of the period are one: by rounding, or too near to be seen.
BREAK_TOLERANCE = 1e-10


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


def lay_out(equation: DelayEquation, refinement: Array | float) -> tuple[Elements, LookBack]:
    """Return the elements of every point and where their nodes look back to.

    Raises UnsupportedEquation when a delay is not positive or longer than the period, and as
    ``collocation.break_up`` does.

    See docs/physics.md#collocation.
    """
    delays = np.stack([feedback.delay for feedback in equation.feedback], axis=-1)
    period = equation.period[:, None]
    if not np.all((delays > 0.0) & (delays <= (1.0 + DELAY_TOLERANCE) * period)):
        raise UnsupportedEquation("delays must be positive and at most the period")
    breakpoints = _distinct(
        np.concatenate([equation.breakpoints, *_returning(equation)], axis=1), BREAK_TOLERANCE * period, period
    )
    holds = _pieces_with_nodes(equation, breakpoints, delays)
    longest = collocation.LONGEST_ELEMENT * delays.min(axis=1, keepdims=True)
    layout = collocation.break_up(equation, refinement, breakpoints, holds, longest)
    return layout, _look_back(equation, layout, delays)


def _returning(equation: DelayEquation) -> Iterator[Array]:
    """Yield where breakpoints come back after each delay (point, breakpoint), as far as its gain acts there.

    Elsewhere they need not be broken at, and the first breakpoint stands for them.
    """
    period = equation.period[:, None]
    beside = BREAK_TOLERANCE * period[..., None] * np.array([-2.0, 2.0])
    for feedback in equation.feedback:
        returning = np.mod(equation.breakpoints + feedback.delay[:, None], period)
        acts = np.any(feedback.gain(returning[..., None] + beside) != 0.0, axis=(2, 3, 4))
        yield np.where(acts, returning, equation.breakpoints[:, :1])


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


def _pieces_with_nodes(equation: DelayEquation, breakpoints: Array, delays: Array) -> NDArray[np.bool_]:
    """Return the pieces (point, piece) in which a gain acts or that an acting one looks back into."""
    length = collocation.piece_lengths(breakpoints, equation.period)
    period = equation.period[:, None]
    begin = breakpoints - breakpoints[:, :1]
    holds = np.zeros(breakpoints.shape, dtype=bool)
    for gain in equation.velocity_gain:
        holds |= collocation.acting_pieces(gain, breakpoints, equation.period)
    for term, feedback in enumerate(equation.feedback):
        acts = collocation.acting_pieces(feedback.gain, breakpoints, equation.period)
        holds |= acts
        origin = np.mod(begin - delays[:, term, None], period)
        for turn in (0.0, 1.0):  # what an origin overlaps before and after the period's end
            first, last = begin + turn * period, begin + turn * period + length
            overlaps = (origin[:, :, None] < last[:, None, :]) & ((origin + length)[:, :, None] > first[:, None, :])
            holds |= (acts[:, :, None] & overlaps & (length > 0.0)[:, None, :]).any(axis=1)
    return holds


def _look_back(equation: DelayEquation, layout: Elements, delays: Array) -> LookBack:
    time = layout.node_time
    gain = np.stack([feedback.gain(time) for feedback in equation.feedback], axis=2)
    gain[~layout.acts] = 0.0
    # Of many teeth few cut at once: the terms that act in an element come first, and what acts nowhere is left out.
    acts = np.any(gain != 0.0, axis=(3, 4, 5))
    order = np.argsort(~acts, axis=2, kind="stable")[:, :, : max(1, acts.sum(axis=2).max())]
    gain = np.take_along_axis(gain, order[..., None, None, None], axis=2)
    earlier = time[:, :, None, :] - delays[np.arange(len(time))[:, None, None], order][..., None]
    past = earlier < layout.start[:, :1, None, None]
    earlier = np.where(past, earlier + equation.period[:, None, None, None], earlier)
    element, weight = np.empty(earlier.shape, dtype=np.intp), np.empty((*earlier.shape, NODES))
    _interpolate(layout.start, layout.length, earlier, collocation.lagrange_powers(), element, weight)
    return LookBack(element=element, past=past, weight=weight, gain=gain)


@compiled
def _interpolate(start, length, time, powers, element, weight):  # type: ignore[no-untyped-def]
    """Fill which element (point, ...) holds each time, and the weights (.., node) of its nodes there.

    That is the last that has begun, the first where none has; elements of no length, which share their start with
    others, hold nothing. powers: (node, power), of the polynomial that is one at a node.
    """
    nodes = len(powers)
    for p in range(len(time)):
        times, held, weights = time[p].reshape(-1), element[p].reshape(-1), weight[p].reshape(-1, nodes)
        first = 0
        while length[p, first] == 0.0:
            first += 1
        found = first
        for i in range(len(times)):
            # Times ascend from node to node, so the search mostly goes on from where it was.
            found = found if start[p, found] <= times[i] else first
            for e in range(found + 1, start.shape[1]):
                if length[p, e] > 0.0:
                    if start[p, e] > times[i]:
                        break
                    found = e
            held[i] = found
            place = (times[i] - start[p, found]) / length[p, found]
            for n in range(nodes):
                value = 0.0
                for power in range(nodes - 1, -1, -1):
                    value = value * place + powers[n, power]
                weights[i, n] = value
