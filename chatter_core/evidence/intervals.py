"""Intervals of single parameters by profiling: how far one can be moved while all others make up for it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from chatter_core.errors import InvalidInput, NotConverged
from chatter_core.evidence.fit import Fit, maximise
from chatter_core.evidence.parameters import Array, Problem, column, position

#: A drop this near to what is wanted, in standard deviations, gives the end by a straight line: the root of the
#: drop is nearly one, and a tenth of it that is not leaves a hundredth of a deviation.
NEAR_END = 0.15
#: A refit that ends this much above the fit found another maximum [nats]. Where chatter frequencies jump a posterior
#: has edges of about a nat, and no climb finds the highest of them: what rises less counts as flat. Refits lie where
#: the posterior has dropped already, so a fit may lack a nat more than that and its ends, by its own height, be too far
#: by two thirds; where it lacks 0.3 nats they are by a tenth.
HIGHER = 1.0
#: Where the drop leaps over what is wanted the end is known to this share of its distance from the estimate, or to a
#: quarter of it in standard deviations of the parameter.
EDGE_TOLERANCE = 0.06
#: A secant goes no nearer to either end of what it divides than this share of it.
LEAST_SHARE = 0.1
#: A refit ends where its next step promises less than this [nats]: the drop is then off by three hundredths at most,
#: but for what an edge hides at which it ends.
REFIT_GAIN = 0.05
#: A step beyond all values inside is this much longer than a straight line has it, to come to lie outside.
LENGTHENED = 1.1
#: Refits that each end may take.
MOST_REFITS = 10
#: The lower end and the upper one.
SIDES = (-1, 1)


class HigherPlace(NotConverged):
    """A refit ended above the fit, which was no maximum: values (parameter,), and by how much [nats]."""

    def __init__(self, name: str, values: Array, rise: float) -> None:
        self.name, self.values, self.rise = name, values, rise
        super().__init__(name, values, rise)

    def __str__(self) -> str:
        return f"a refit for {self.name} ends {self.rise:.2g} nats above the fit, which was no maximum"


@dataclass(frozen=True, kw_only=True)
class Interval:
    """Profile interval of a parameter, in its unit; an end is open where a bound comes before the drop."""

    low: float
    high: float
    low_is_open: bool
    high_is_open: bool
    refits: int


@dataclass(frozen=True, kw_only=True)
class End:
    """One end of an interval, in the parameter's unit, open where a bound comes before the drop; refits it took."""

    value: float
    is_open: bool
    refits: int


def profile_interval(problem: Problem, fit: Fit, name: str, coverage: float = 0.9) -> Interval:
    """Return between which values of a parameter the best log posterior drops by less than z^2 / 2.

    z is the normal quantile that belongs to ``coverage``; at each value all other free parameters are fitted
    again. Unlike estimate and standard deviation it knows that a posterior is skew.

    Source: W. A. Rolke, A. M. Lopez, J. Conrad, Nucl. Instrum. Methods A 551 (2005) 493-503.

    Raises InvalidInput for an unknown or fixed parameter or a coverage outside of (0, 1), HigherPlace where a refit
    ends higher than the fit, which was no maximum then, and NotConverged where an end is not found.

    See docs/physics.md#fit.
    """
    return joined(*(profile_end(problem, fit, name, side, coverage) for side in SIDES))


def profile_end(problem: Problem, fit: Fit, name: str, side: int, coverage: float = 0.9) -> End:
    """Return one end of ``profile_interval``, the lower one for side -1 and the upper for +1; raises as that does.

    See docs/physics.md#fit.
    """
    index = position(problem.parameters, name)
    if fit.fixed[index]:
        raise InvalidInput([f"parameter {name}: it was fixed in the fit and has no interval"])
    if not 0.0 < coverage < 1.0:
        raise InvalidInput([f"coverage: found {coverage:g}, allowed: between 0 and 1"])
    return _end(problem, fit, index, side, float(ndtri(0.5 * (1.0 + coverage))))


def joined(low: End, high: End) -> Interval:
    """Return the interval between two ends.

    See docs/physics.md#fit.
    """
    return Interval(
        low=low.value,
        high=high.value,
        low_is_open=low.is_open,
        high_is_open=high.is_open,
        refits=low.refits + high.refits,
    )


def _end(problem: Problem, fit: Fit, index: int, side: int, wanted: float) -> End:
    """Return the end to one side where the root of twice the drop is ``wanted``, by its distance from the estimate."""
    parameter, deviation = problem.parameters[index], float(fit.standard_deviation[index])
    estimate, bound = float(fit.estimate[index]), parameter.upper if side > 0 else parameter.lower
    room = abs(bound - estimate)

    def value(distance: float) -> float:
        return bound if distance >= room else estimate + side * distance

    distance, drops, places = [0.0], [0.0], [fit.estimate]
    following = wanted * deviation
    for refit in range(1, MOST_REFITS + 1):
        following = min(following, room)
        starts = [places[one] for one in _beside(distance, following)]
        drop, place = _drop(problem, fit, index, value(following), starts)
        distance.append(following)
        drops.append(drop)
        places.append(place)
        if following == room and drop < wanted:
            return End(value=bound, is_open=True, refits=refit)
        low, high = _bracket(distance, drops, wanted)
        expected = _where_wanted(distance, drops, wanted, low, high)
        if abs(drop - wanted) < NEAR_END:
            return End(value=value(expected), is_open=False, refits=refit)
        following = expected
        if high is not None:
            inside, outside = distance[low], distance[high]
            apart = outside - inside
            # A posterior with an edge drops there all at once.
            if apart < max(2.0 * EDGE_TOLERANCE * outside, 0.5 * EDGE_TOLERANCE * deviation):
                return End(value=value(0.5 * (inside + outside)), is_open=False, refits=refit)
            share = 0.5 if refit % 2 == 0 else (expected - inside) / apart
            following = inside + float(np.clip(share, LEAST_SHARE, 1.0 - LEAST_SHARE)) * apart
    raise NotConverged(f"the interval of {parameter.name} has no end within {MOST_REFITS} refits")


def _bracket(distance: list[float], drops: list[float], wanted: float) -> tuple[int, int | None]:
    """Return which refit with a drop below what is wanted lies farthest out, and the next one beyond, None if none is.

    Refits on a rough posterior need not drop more the farther out they lie: what lies beyond one that is inside bounds
    the end.
    """
    out, inside = np.array(distance), np.array(drops) < wanted
    low = int(np.where(inside, out, -np.inf).argmax())
    beyond = np.where(~inside & (out > out[low]), out, np.inf)
    return low, int(beyond.argmin()) if np.isfinite(beyond).any() else None


def _where_wanted(distance: list[float], drops: list[float], wanted: float, low: int, high: int | None) -> float:
    """Return at which distance the drop is as wanted by a straight line: through a bracket, or from the estimate."""
    if high is not None:
        share = (wanted - drops[low]) / (drops[high] - drops[low])
        return distance[low] + share * (distance[high] - distance[low])
    # Where a step made no difference to the posterior, a longer one has to.
    reached = max(drops[low], 1e-3)
    longer = 1.0 if abs(drops[low] - wanted) < NEAR_END else LENGTHENED
    return distance[low] * min(2.0, longer * wanted / reached)


def _beside(distance: list[float], following: float) -> list[int]:
    """Return the refits next to a distance, the one nearer to the estimate first."""
    out = np.array(distance)
    inside, outside = np.flatnonzero(out <= following), np.flatnonzero(out > following)
    return [int(inside[out[inside].argmax()]), *(outside[out[outside].argsort()][:1].tolist())]


def _drop(problem: Problem, fit: Fit, index: int, value: float, near: Sequence[Array]) -> tuple[float, Array]:
    """Return the root of twice the drop of the best log posterior at a value, and the values that reach it.

    near: values (parameter,) that refits nearby have reached. The climb begins from the highest of the places where the
    others have followed from one of them or have stayed. Where it is stuck at an edge it ends: going on beyond took a
    third of the time, and led higher in one of three places, by half a nat.
    """
    free = ~fit.fixed
    free[index] = False
    starts = [_moved(one, index, value) for one in near]
    starts += [_followed(problem, fit, index, value, one) for one in near]
    found = maximise(problem, starts, free, most=1, smallest_gain=REFIT_GAIN, leaps=False)
    rise = found.log_posterior - fit.log_posterior
    if not np.isfinite(rise):
        # No model has an answer there: it lies outside, by however much.
        return np.inf, near[0]
    if rise > HIGHER:
        raise HigherPlace(problem.parameters[index].name, found.values, rise)
    return float(np.sqrt(2.0 * max(-rise, 0.0))), found.values


def _followed(problem: Problem, fit: Fit, index: int, value: float, start: Array) -> Array:
    """Return where the others follow to (parameter,) from a start when one takes a value, were it all normal."""
    lower, upper = column(problem.parameters, "lower"), column(problem.parameters, "upper")
    along = fit.correlation[index] * fit.standard_deviation / fit.standard_deviation[index]
    following = np.clip(start + along * (value - start[index]), lower, upper)
    return np.where(fit.fixed, fit.estimate, _moved(following, index, value))


def _moved(start: Array, index: int, value: float) -> Array:
    """Return values (parameter,) of which one is another."""
    moved = start.copy()
    moved[index] = value
    return moved
