"""What a campaign could have shown: the evidence that an effect of usual size would leave in it."""

from dataclasses import dataclass

import numpy as np

from chatter_core.evidence.candidates import Candidate, Hypothesis, carried, extended
from chatter_core.evidence.comparison import Compared
from chatter_core.evidence.likelihood import LIMIT_FREEDOM, LIMIT_UNIT
from chatter_core.evidence.parameters import Array

#: A chatter frequency tells no more than this, in deviations: it may be that of another branch.
MOST_OF_A_FREQUENCY = 2.0
#: The usual size of a strength, in the widths that it is searched by: half of all are larger by a half-normal law of
#: that width. A prior may be wider, for strengths that differ by decades: that makes no effect easier to see.
USUAL = 0.6745
#: An effect that would leave less than this could not be told [nats]. By the odds and the temper of a ranking one that
#: leaves so much is named two times of three. Of the answers `none` in ``benchmarks/blind/answers`` it takes back four
#: of 59 where something is hidden and none of 86 where nothing is; 5 nats take back one and none, 12 eight and one.
ENOUGH = 10.0


@dataclass(frozen=True, kw_only=True)
class Power:
    """What an effect of usual size would leave: log-likelihood [nats] that no other parameter could make up for.

    by_quantity: the share of each quantity in it.
    """

    candidate: Candidate
    nats: float
    by_quantity: dict[str, float]


def power(base: Hypothesis, candidate: Candidate, slope: Array) -> Power:
    """Return what an effect of usual size would leave in the campaign.

    Half the squared distance that it moves the information coordinates by, as far as the base model's parameters
    cannot follow, their priors counting as data; slope: their derivatives, as ``slope_of`` has them. Shapes of the
    effect are at their nulls.

    See docs/physics.md#diagnosis.
    """
    comparison = extended(base.comparison, [candidate])
    before, strong = base.fit.evaluation, carried(comparison, base.fit)
    names = [parameter.name for parameter in comparison.parameters]
    for parameter in candidate.amplitudes:
        strong[names.index(parameter.name)] = parameter.searched_at(USUAL)
    moved = comparison.evaluate(strong).coordinates - before.coordinates
    assert isinstance(before.state, Compared)
    parts = before.state.coordinates_of
    for name, at_most in (("chatter_frequency", _of_a_frequency), ("limit_depth", _of_a_limit)):
        if name in parts:
            moved[parts[name]] = at_most(moved[parts[name]])
    followed = slope @ np.linalg.solve(slope.T @ slope + np.eye(slope.shape[1]), slope.T @ moved)
    left = 0.5 * (moved - followed) * moved
    return Power(
        candidate=candidate,
        nats=float(left.sum()),
        by_quantity={name: float(left[part].sum()) for name, part in parts.items()},
    )


def _of_a_frequency(moved: Array) -> Array:
    return np.clip(moved, -MOST_OF_A_FREQUENCY, MOST_OF_A_FREQUENCY)


def _of_a_limit(moved: Array) -> Array:
    """Return movements of limit depths (row,), no half square more than Student's law takes off for what is that far.

    One of many that moves far, or out of reach, tells hardly more than that it has moved.
    """
    square = (moved / LIMIT_UNIT) ** 2
    largest = np.sqrt((LIMIT_FREEDOM + 1.0) * np.log1p(square / LIMIT_FREEDOM))
    return np.asarray(np.sign(moved) * np.minimum(np.abs(moved), largest))
