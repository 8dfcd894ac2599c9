"""What is fitted: parameters with their priors, and what a fit asks of whoever knows the data.

A fit knows nothing of machines. It moves a vector of parameters, in whatever order and number, and asks a
``Problem`` how well it explains the measurements; nuisances, effects and sensors are all alike to it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from chatter_core.errors import InvalidInput
from chatter_core.parameters import Array, Parameter, Touches

__all__ = [
    "Array",
    "Evaluation",
    "Parameter",
    "Problem",
    "Touches",
    "column",
    "log_prior",
    "log_share",
    "position",
]


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """How well parameter values explain the measurements.

    log_density: (datum,); coordinates: (coordinate,), functions of the parameters for which J^T J of their
    Jacobian is the expected Fisher information (residuals over their deviation, 2 sqrt(p) for probabilities);
    score: (coordinate,), the derivatives of the log density by them; datum: (coordinate,), which datum each
    belongs to; state: what the problem wants to find again when it evaluates values nearby.
    """

    log_density: Array
    coordinates: Array
    score: Array
    datum: NDArray[np.intp]
    state: object = None

    @property
    def log_likelihood(self) -> float:
        """Log-likelihood of all data together."""
        return float(self.log_density.sum())


class Problem(Protocol):
    """Data and a model of them, as a fit sees it."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters, in the order of the vector."""

    def evaluate(self, values: Array, near: Evaluation | None = None) -> Evaluation:
        """Evaluate values (parameter,); ``near``, an evaluation of other values, may save work."""


def column(parameters: Sequence[Parameter], attribute: str) -> Array:
    """Return one attribute of all parameters (parameter,).

    See docs/physics.md#fit.
    """
    return np.array([getattr(parameter, attribute) for parameter in parameters], dtype=float)


def position(parameters: Sequence[Parameter], name: str) -> int:
    """Return the place of a parameter in the vector; raise InvalidInput for a name that none has.

    See docs/physics.md#fit.
    """
    names = [parameter.name for parameter in parameters]
    if name not in names:
        raise InvalidInput([f"parameter: found {name!r}, allowed: {', '.join(names)}"])
    return names.index(name)


def log_prior(parameters: Sequence[Parameter], values: Array) -> float:
    """Return the log density of the priors, in units of their widths.

    A normal density in z = (value - mean) / width, divided by its share within the bounds; minus infinity
    outside of them.

    See docs/physics.md#fit.
    """
    mean, width = column(parameters, "prior_mean"), column(parameters, "prior_width")
    lower, upper = column(parameters, "lower"), column(parameters, "upper")
    if np.any((values < lower) | (values > upper)):
        return -np.inf
    density = -0.5 * ((values - mean) / width) ** 2 - 0.5 * np.log(2.0 * np.pi)
    inside = log_share((lower - mean) / width, (upper - mean) / width)
    return float(np.sum(density - inside))


def log_share(low: Array, high: Array) -> Array:
    """Return the log of a standard normal's share between ``low`` and ``high``, whatever tail they lie in.

    See docs/physics.md#fit.
    """
    # In the upper tail shares are differences of numbers near one: mirrored, they are not.
    mirrored = low > 0.0
    lower, upper = np.where(mirrored, -high, low), np.where(mirrored, -low, high)
    large, small = log_ndtr(upper), log_ndtr(lower)
    return np.asarray(large + np.log1p(-np.exp(small - large)))
