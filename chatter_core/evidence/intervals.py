"""Intervals of single parameters by profiling: how far one can be moved while all others make up for it."""

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
#: has edges of about a nat, and no climb finds the highest of them: what rises less counts as flat, and the ends, by
#: the fit's height, are too far by a tenth where it lacks 0.3 nats and by a third where it lacks one.
HIGHER = 1.0
#: An end is known to this where the drop leaps over what is wanted, in standard deviations of the parameter: the end of
#: a normal posterior would be off by a sixteenth.
EDGE_TOLERANCE = 0.1
#: A refit ends where its next step promises less than this [nats]: the drop is then off by three hundredths at most.
REFIT_GAIN = 0.05
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
    return _end(problem, fit, index, side * float(ndtri(0.5 * (1.0 + coverage))))


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


def _end(problem: Problem, fit: Fit, index: int, wanted: float) -> End:
    """Return the end where the root of twice the drop is ``wanted``."""
    parameter = problem.parameters[index]
    bound = parameter.upper if wanted > 0.0 else parameter.lower
    values, drops = [float(fit.estimate[index])], [0.0]
    following, start = values[0] + wanted * float(fit.standard_deviation[index]), fit.estimate
    for refit in range(1, MOST_REFITS + 1):
        place = min(following, bound) if wanted > 0.0 else max(following, bound)
        drop, start = _drop(problem, fit, index, place, start)
        values.append(place)
        drops.append(np.copysign(drop, wanted))
        if abs(drops[-1] - wanted) < NEAR_END:
            return End(value=_straight(values, drops, wanted, bound), is_open=False, refits=refit)
        if place == bound and drop < abs(wanted):
            return End(value=place, is_open=True, refits=refit)
        following = _following(values, drops, wanted, halve=refit % 2 == 0)
        # A posterior with an edge drops there all at once.
        if abs(following - place) < EDGE_TOLERANCE * float(fit.standard_deviation[index]):
            return End(value=following, is_open=False, refits=refit)
    raise NotConverged(f"the interval of {parameter.name} has no end within {MOST_REFITS} refits")


def _straight(values: list[float], drops: list[float], wanted: float, bound: float) -> float:
    """Return where the drop is as wanted, by a straight line through the two values that are nearest to it."""
    near, next_to = np.argsort(np.abs(np.array(drops) - wanted))[:2]
    slope = (values[near] - values[next_to]) / (drops[near] - drops[next_to])
    end = values[near] + slope * (wanted - drops[near])
    return float(min(end, bound) if wanted > 0.0 else max(end, bound))


def _following(values: list[float], drops: list[float], wanted: float, *, halve: bool) -> float:
    """Return where the drop should be as wanted: beyond all values inside, by secant or halfway, or farther out.

    Refits on a rough posterior need not rise with the distance: what lies beyond one that is inside bounds the end.
    """
    known, size = np.array(values), np.abs(drops)
    distance, inside = np.abs(known - known[0]), size < abs(wanted)
    low = np.where(inside, distance, -np.inf).argmax()
    beyond = np.where(~inside & (distance > distance[low]), distance, np.inf)
    if np.isfinite(beyond).any():
        high = beyond.argmin()
        share = 0.5 if halve else (abs(wanted) - size[low]) / (size[high] - size[low])
        return float(known[low] + share * (known[high] - known[low]))
    # Where a step made no difference to the posterior, a longer one has to.
    return float(known[0] + (known[low] - known[0]) * min(2.0, 1.1 * abs(wanted) / max(size[low], 1e-3)))


def _drop(problem: Problem, fit: Fit, index: int, value: float, start: Array) -> tuple[float, Array]:
    """Return the root of twice the drop of the best log posterior at a value, and the values that reach it."""
    free = ~fit.fixed
    free[index] = False
    found = maximise(problem, [_expected(problem, fit, index, value, start)], free, most=1, smallest_gain=REFIT_GAIN)
    rise = found.log_posterior - fit.log_posterior
    if rise > HIGHER:
        raise HigherPlace(problem.parameters[index].name, found.values, rise)
    return float(np.sqrt(2.0 * max(-rise, 0.0))), found.values


def _expected(problem: Problem, fit: Fit, index: int, value: float, start: Array) -> Array:
    """Return where the others follow to (parameter,) from a start when one takes a value, were it all normal."""
    lower, upper = column(problem.parameters, "lower"), column(problem.parameters, "upper")
    along = fit.correlation[index] * fit.standard_deviation / fit.standard_deviation[index]
    following = np.clip(start + along * (value - start[index]), lower, upper)
    following[index] = value
    return np.where(fit.fixed, fit.estimate, following)
