"""What a campaign could have shown: the evidence that an effect of usual size would leave in it."""

from dataclasses import dataclass

import numpy as np

from chatter_core.evidence.candidates import Candidate, Hypothesis, carried, extended
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.parameters import Array, column

#: An effect that would leave less than this could not be told [nats].
ENOUGH = 5.0


@dataclass(frozen=True, kw_only=True)
class Power:
    """What an effect of usual size would leave: log-likelihood [nats] that no other parameter could make up for.

    by_quantity: the share of each quantity in it.
    """

    candidate: Candidate
    nats: float
    by_quantity: dict[str, float]


def nuisance_slope(base: Hypothesis) -> Array:
    """Return the derivatives of the base model's information coordinates (coordinate, parameter), in prior widths.

    See docs/physics.md#diagnosis.
    """
    climb = Climb(base.comparison, ~base.fit.fixed)
    deviation = np.asarray(base.fit.standard_deviation)
    return climb.derivatives(base.fit.estimate, base.comparison.evaluate(base.fit.estimate), deviation)[0]


def power(base: Hypothesis, candidate: Candidate, slope: Array) -> Power:
    """Return what an effect with amplitudes of one prior width would leave in the campaign.

    Half the squared distance that it moves the information coordinates by, as far as the base model's parameters
    cannot follow, their priors counting as data; slope: their derivatives, as ``nuisance_slope`` has them.

    See docs/physics.md#diagnosis.
    """
    comparison = extended(base.comparison, [candidate])
    own = carried(comparison, base.fit)
    before, strong = comparison.evaluate(own), own.copy()
    names = [parameter.name for parameter in comparison.parameters]
    for parameter in candidate.amplitudes:
        raised = min(parameter.null + parameter.prior_width, parameter.upper)
        strong[names.index(parameter.name)] = raised
    moved = comparison.evaluate(strong).coordinates - before.coordinates
    width = np.eye(slope.shape[1])
    followed = slope @ np.linalg.solve(slope.T @ slope + width, slope.T @ moved)
    left = moved - followed
    by_datum = 0.5 * left * moved
    shares: dict[str, float] = {}
    first = 0
    compared = before.state
    for name, part in compared.contributions.items():  # type: ignore[attr-defined]
        last = first + part.coordinates.size
        shares[name] = float(by_datum[first:last].sum())
        first = last
    return Power(candidate=candidate, nats=float(by_datum.sum()), by_quantity=shares)


def sizes(hypothesis: Hypothesis) -> Array:
    """Return the amplitudes of a hypothesis (amplitude,) in widths of their priors.

    See docs/physics.md#diagnosis.
    """
    comparison, names = hypothesis.comparison, [p.name for c in hypothesis.candidates for p in c.amplitudes]
    place = [[p.name for p in comparison.parameters].index(name) for name in names]
    null, width = column(comparison.parameters, "null"), column(comparison.parameters, "prior_width")
    return np.asarray(((hypothesis.fit.estimate - null) / width)[place])
