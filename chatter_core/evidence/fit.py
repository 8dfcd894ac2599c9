"""Fit of parameters: estimates, their deviations and pulls, and the evidence for the model.

A fit knows parameters and a problem, and nothing of machines.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.cards import Card, ShownAsCard
from chatter_core.errors import InvalidInput
from chatter_core.evidence.newton import SMALLEST_GAIN, Climb, Maximum
from chatter_core.evidence.parameters import (
    Array,
    Evaluation,
    Parameter,
    Problem,
    column,
    log_prior,
    log_share,
    position,
)

#: Of many starts, so many of the best are climbed from.
CLIMBED_STARTS = 3
#: A fit that ends lower than a start that it was given has failed; less than this is rounding [nats].
WORSE = 0.01


@dataclass(frozen=True, kw_only=True, repr=False)
class Fit(ShownAsCard):
    """Maximum of the posterior, and the normal distribution around it.

    estimate, standard_deviation, pull: (parameter,) in the parameters' own units, a pull in widths of the prior;
    correlation: (parameter, parameter); fixed parameters have deviation 0 and correlate with nothing.
    covariance is that of the curvature: where a parameter is at_bound, the bound cuts it off. log_likelihood,
    log_posterior (priors as densities in units of their widths) and log_evidence (Laplace) in nats.
    evaluation: of the estimate. converged, and the reason in words.
    """

    parameters: tuple[Parameter, ...]
    estimate: Array
    standard_deviation: Array
    correlation: Array
    pull: Array
    at_bound: NDArray[np.bool_]
    fixed: NDArray[np.bool_]
    log_likelihood: float
    log_posterior: float
    log_evidence: float
    evaluation: Evaluation
    evaluations: int
    converged: bool
    reason: str

    def card(self) -> Card:
        """Return every parameter with its estimate, deviation and pull."""
        columns = ("parameter", "estimate", "+-", "unit", "pull", "")
        state = "converged" if self.converged else "not converged"
        title = f"Fit, {state}: {self.reason}; log-likelihood {self.log_likelihood:.4g} nats"
        return Card(title=title, rows=tuple(map(self._row, range(len(self.parameters)))), columns=columns)

    def _row(self, number: int) -> tuple[str, ...]:
        one = self.parameters[number]
        state = "fixed" if self.fixed[number] else "at its bound" if self.at_bound[number] else ""
        numbers = (self.estimate[number], self.standard_deviation[number])
        return one.name, *(f"{value:.4g}" for value in numbers), one.unit, f"{self.pull[number]:+.2f}", state


def fit(
    problem: Problem, *, starts: Sequence[Array] = (), fixed: Sequence[str] = (), most: int = CLIMBED_STARTS
) -> Fit:
    """Fit any problem from the best of some starts (parameter,), the nulls where there are none.

    fixed: names of parameters that stay as they are in each start.

    Raises InvalidInput for an unknown name or a start out of bounds.

    See docs/physics.md#fit.
    """
    starts = list(starts) or [column(problem.parameters, "null")]
    free = free_parameters(problem, fixed, *starts)
    found = maximise(problem, starts, free, most=most)
    return result(problem, found, 0, height(problem, starts[0]))


def maximise(
    problem: Problem,
    starts: Sequence[Array],
    free: NDArray[np.bool_],
    most: int = CLIMBED_STARTS,
    smallest_gain: float = SMALLEST_GAIN,
    *,
    leaps: bool = True,
) -> Maximum:
    """Return the highest maximum that is reached from the ``most`` highest of the starts.

    A climb ends where its next step promises less than ``smallest_gain`` [nats]; leaps: as ``Climb.from_place`` has it.

    See docs/physics.md#fit.
    """
    climb = Climb(problem, free)
    places = [climb.place(start) for start in starts]
    # What is no number is no height.
    order = np.argsort([-np.inf if np.isnan(place.height) else place.height for place in places])[::-1][:most]
    found = [climb.from_place(places[index], smallest_gain, leaps=leaps) for index in order]
    best = max(found, key=lambda maximum: maximum.log_posterior)
    return Maximum(**{**vars(best), "evaluations": climb.evaluations})


def log_evidence(maximum: Maximum, parameters: Sequence[Parameter]) -> float:
    """Return the log of the integral of likelihood times prior over the free parameters, by Laplace's method.

    The log posterior is taken as quadratic around the maximum, which at a bound has a slope; the normal
    integral counts as far as it lies within the bounds, parameter by parameter (exact for a single bounded
    one). The priors of fixed parameters do not count.

    Source: R. E. Kass, A. E. Raftery, J. Am. Stat. Assoc. 90 (1995) 773-795.

    See docs/physics.md#fit.
    """
    free, z = maximum.free, _standard(parameters, maximum.values)
    if not free.any():
        return maximum.evaluation.log_likelihood
    information = maximum.information[np.ix_(free, free)]
    covariance, gradient = np.linalg.inv(information), maximum.gradient[free]
    # Only a bound can hold a gradient, one that leads beyond it: elsewhere what is left of it is what the search left.
    gradient = np.where(_held_at_bound(maximum, parameters)[free], gradient, 0.0)
    peak, deviation = z[free] + covariance @ gradient, np.sqrt(np.diag(covariance))
    low = (_standard(parameters, column(parameters, "lower"))[free] - peak) / deviation
    high = (_standard(parameters, column(parameters, "upper"))[free] - peak) / deviation
    volume = 0.5 * (free.sum() * np.log(2.0 * np.pi) - np.linalg.slogdet(information)[1])
    height = maximum.log_posterior - _fixed_prior(parameters, maximum)
    return float(height + 0.5 * gradient @ covariance @ gradient + volume + log_share(low, high).sum())


def _fixed_prior(parameters: Sequence[Parameter], maximum: Maximum) -> float:
    """Return the log prior of the parameters that are not free."""
    fixed = [parameter for parameter, free in zip(parameters, maximum.free, strict=True) if not free]
    return log_prior(fixed, maximum.values[~maximum.free])


def _standard(parameters: Sequence[Parameter], values: Array) -> Array:
    """Return values in widths of their priors, from the priors' means."""
    return np.asarray((values - column(parameters, "prior_mean")) / column(parameters, "prior_width"))


def _at_bound(maximum: Maximum, parameters: Sequence[Parameter]) -> NDArray[np.bool_]:
    at_lower, at_upper = (maximum.values <= column(parameters, "lower")), maximum.values >= column(parameters, "upper")
    return np.asarray(maximum.free & (at_lower | at_upper))


def _held_at_bound(maximum: Maximum, parameters: Sequence[Parameter]) -> NDArray[np.bool_]:
    """Return which parameters stand at a bound that they would leave (parameter,)."""
    low = (maximum.values <= column(parameters, "lower")) & (maximum.gradient < 0.0)
    high = (maximum.values >= column(parameters, "upper")) & (maximum.gradient > 0.0)
    return np.asarray(maximum.free & (low | high))


def free_parameters(problem: Problem, fixed: Sequence[str], *starts: Array) -> NDArray[np.bool_]:
    """Return which parameters are free (parameter,).

    Raises InvalidInput for an unknown name, or starts (parameter,) of another length or out of bounds.

    See docs/physics.md#fit.
    """
    free = np.ones(len(problem.parameters), dtype=bool)
    for name in fixed:
        free[position(problem.parameters, name)] = False
    problems = []
    for start in starts:
        if start.shape != free.shape:
            raise InvalidInput([f"start: found {start.size} values, needed one for each of {len(free)} parameters"])
        problems += [
            f"start of {p.name}: found {value:g} {p.unit}, allowed {p.lower:g} to {p.upper:g}"
            for p, value in zip(problem.parameters, start, strict=True)
            if not p.lower <= value <= p.upper
        ]
    if problems:
        raise InvalidInput(problems)
    return free


def height(problem: Problem, values: Array) -> float:
    """Return the log posterior at values (parameter,).

    See docs/physics.md#fit.
    """
    return Climb(problem, np.zeros(len(values), dtype=bool)).posterior(values)[0]


def result(problem: Problem, found: Maximum, spent: int, started: float) -> Fit:
    """Return the fit that a maximum is.

    spent: evaluations that led to it; started: the log posterior that it must not end below.

    See docs/physics.md#fit.
    """
    parameters, free = problem.parameters, found.free
    width = column(parameters, "prior_width")
    covariance = np.zeros((len(parameters), len(parameters)))
    if free.any():
        covariance[np.ix_(free, free)] = np.linalg.inv(found.information[np.ix_(free, free)])
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(free, deviation, 1.0)
    failed = found.log_posterior < started - WORSE
    lost = f"ended {started - found.log_posterior:.2g} nats below its start"
    return Fit(
        parameters=parameters,
        estimate=found.values,
        standard_deviation=deviation * width,
        correlation=np.where(np.eye(len(parameters), dtype=bool), 1.0, covariance / np.outer(scale, scale)),
        pull=_standard(parameters, found.values),
        at_bound=_at_bound(found, parameters),
        fixed=~free,
        log_likelihood=found.evaluation.log_likelihood,
        log_posterior=found.log_posterior,
        log_evidence=log_evidence(found, parameters),
        evaluation=found.evaluation,
        evaluations=spent + found.evaluations + 1,
        converged=found.converged and not failed,
        reason=lost if failed else found.reason,
    )
