"""Calibration of a model by a campaign, in three steps.

Receptances are fitted first, from several starts, because they cost little and a sharp peak that is displaced has
no gradient, and by their sizes too, which see from afar where it lies; then all but chatter frequencies, which jump
from branch to branch; then everything.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.fit import CLIMBED_STARTS, Fit, free_parameters, height, maximise, result
from chatter_core.evidence.newton import SMALLEST_GAIN, Climb
from chatter_core.evidence.parameters import Array, Parameter, Problem, column

#: Starts lie so many prior widths to both sides of the null, one parameter at a time.
START_WIDTHS = 2.0
#: What only yields a start for the fit of everything may end where the next step promises this [nats].
START_GAIN = 0.3
#: What sizes of responses lead to is another maximum where it is higher by more than a posterior is rough [nats].
HIGHER = 1.0


def calibrate(
    comparison: Comparison,
    *,
    start: Array | None = None,
    fixed: Sequence[str] = (),
    smallest_gain: float = SMALLEST_GAIN,
) -> Fit:
    """Fit a model to a campaign: by what is cheap and sharp, then by what is smooth, then by everything.

    start: (parameter,), values that the fit must not end below, such as those of a model that is nested in this
    one; without it, the nulls. fixed: names of parameters that stay at their start. The fit ends where its next step
    promises less than ``smallest_gain`` [nats].

    Raises InvalidInput for an unknown name or a start out of bounds.

    See docs/physics.md#fit.
    """
    own = column(comparison.parameters, "null") if start is None else np.asarray(start, dtype=float)
    free = free_parameters(comparison, fixed, own)
    # Labels alone are cheap to look at from many starts too: their lobes lie elsewhere when a frequency does.
    displaced = _displaced(comparison.parameters, own, free)
    starts, climbed, spent = [own, *displaced], CLIMBED_STARTS, 0
    # Where no parameter of the structure is free, sizes would lead the sensors' frequencies astray.
    coarse = comparison.coarse if displaced else None
    for part, from_afar in ((comparison.structural, coarse), (comparison.smooth, None), (comparison, None)):
        if part is not None:
            end, evaluations = _approached(part, starts, free, climbed, from_afar)
            # Where it jumps, data may ask for another place than those that lead there.
            starts, climbed = [own, end, *_displaced(comparison.parameters, end, free)], 2
            spent += evaluations
    found = maximise(comparison, starts, free, 1, smallest_gain)
    return result(comparison, found, spent, height(comparison, own))


def _approached(
    problem: Problem, starts: Sequence[Array], free: NDArray[np.bool_], climbed: int, from_afar: Problem | None
) -> tuple[Array, int]:
    """Return the highest place (parameter,) that approaches from the highest of some starts come to; evaluations.

    from_afar: a problem that sees maxima from afar, by which the first start may lead to another one.
    """
    climb = Climb(problem, free)
    order = np.argsort([climb.posterior(start)[0] for start in starts])[::-1][:climbed]
    best = max((climb.approach(starts[index], START_GAIN) for index in order), key=lambda end: end.log_posterior)
    if from_afar is None:
        return best.values, climb.evaluations
    rough = Climb(from_afar, free).from_start(starts[0], START_GAIN)
    beside = climb.from_start(rough.values, START_GAIN)
    highest = beside if beside.log_posterior > best.log_posterior + HIGHER else best
    return highest.values, climb.evaluations + rough.evaluations


def _displaced(parameters: Sequence[Parameter], start: Array, free: NDArray[np.bool_]) -> list[Array]:
    """Return starts in which one parameter of the structure lies to either side."""
    starts = []
    for index, parameter in enumerate(parameters):
        if free[index] and parameter.touches == "structure":
            for side in (-START_WIDTHS, START_WIDTHS):
                aside = start.copy()
                moved = start[index] + side * parameter.prior_width
                aside[index] = np.clip(moved, parameter.lower, parameter.upper)
                if aside[index] != start[index]:
                    starts.append(aside)
    return starts
