"""What is known of a model's parameters: by a fit, by a file, or by nothing but what data sheets leave open."""

from dataclasses import dataclass, replace

import numpy as np

from chatter_core.evidence.fit import Fit
from chatter_core.evidence.parameters import Array, column
from chatter_core.evidence.prediction import CampaignModel


@dataclass(frozen=True, kw_only=True)
class Belief:
    """What is known of a model's parameters by their names: estimates, deviations and how they correlate.

    names: (parameter,); estimate, deviation: (parameter,) in the parameters' units; correlation: (parameter,
    parameter).
    """

    names: tuple[str, ...]
    estimate: Array
    deviation: Array
    correlation: Array

    def about(self, model: CampaignModel) -> "Belief":
        """Return the same of all parameters of a model, in its order; those unknown are as their priors have them."""
        known = {name: place for place, name in enumerate(self.names)}
        names = tuple(parameter.name for parameter in model.parameters)
        estimate, deviation = model.nulls, column(model.parameters, "prior_width")
        correlation = np.eye(len(names))
        here = [place for place, name in enumerate(names) if name in known]
        there = [known[names[place]] for place in here]
        estimate[here], deviation[here] = self.estimate[there], self.deviation[there]
        correlation[np.ix_(here, here)] = self.correlation[np.ix_(there, there)]
        return Belief(names=names, estimate=estimate, deviation=deviation, correlation=correlation)

    def sure(self) -> "Belief":
        """Return the same estimates without any doubt about them."""
        return replace(self, deviation=np.zeros_like(self.deviation))


#: Nothing but the priors.
PRIORS = Belief(names=(), estimate=np.empty(0), deviation=np.empty(0), correlation=np.empty((0, 0)))


def fitted(fit: Fit) -> Belief:
    """Return what a fit knows of its parameters.

    See docs/physics.md#fit.
    """
    return Belief(
        names=tuple(parameter.name for parameter in fit.parameters),
        estimate=fit.estimate,
        deviation=fit.standard_deviation,
        correlation=fit.correlation,
    )
