"""The fit of a model with one effect more: looked at from many places, pursued from the best."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.candidates import Candidate, Hypothesis, at_nulls, carried, extended, slope_of
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.fit import Fit, free_parameters, maximise, result
from chatter_core.evidence.newton import Climb, Maximum, Place
from chatter_core.evidence.parameters import Array, log_prior
from chatter_core.evidence.starts import (
    AMPLITUDES,
    SMALLEST_PROMISE,
    Worth,
    chosen,
    is_silent,
    missed_frequencies,
    promises,
    scanned_widely,
    smooth_height,
    smooth_rows,
)
from chatter_core.evidence.unbent import at_rest, has_bent, height_at_rest, unbent, unseen_starts

#: A climb goes on from where smooth data have led where those, or all data, gain more than this by the effect [nats].
LEAST_GAIN = 1.0
#: What is ranked need not be known better than this [nats].
LEFT_GAIN = 0.01


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A fitted hypothesis from which further effects are looked for.

    slope: as ``slope_of`` has it; smooth_gain: what a climb by its smooth data alone still gains in those, and
    whole_gain what all data have gained where it ends, mostly a loss [nats]; bent: whether it may imitate an effect;
    unsure: whether nothing was measured that would say where its modes lie but cuts, and it has bent or misses chatter
    frequencies; height_at_rest: to which it can climb by what was measured without cutting alone [nats], None where it
    has not bent.
    """

    hypothesis: Hypothesis
    slope: Array
    smooth_gain: float
    whole_gain: float
    bent: bool
    unsure: bool
    height_at_rest: float | None


def ground(hypothesis: Hypothesis) -> Ground:
    """Return a fitted hypothesis with what is to be known of it before effects are added.

    See docs/physics.md#diagnosis.
    """
    fit, slope, comparison = hypothesis.fit, slope_of(hypothesis), hypothesis.comparison
    climb, bent = Climb(comparison, ~fit.fixed), has_bent(hypothesis)
    smooth = _smooth(climb)
    end = smooth.approach(fit.estimate, START_GAIN, slope[smooth_rows(fit.evaluation)])
    return Ground(
        hypothesis=hypothesis,
        slope=slope,
        smooth_gain=end.log_posterior - smooth_height(fit.log_posterior, fit.evaluation),
        whole_gain=climb.posterior(end.values)[0] - fit.log_posterior,
        bent=bent,
        unsure=comparison.structural is None and (bent or missed_frequencies(comparison, fit.evaluation).size > 0),
        height_at_rest=height_at_rest(hypothesis) if bent else None,
    )


@dataclass(frozen=True, kw_only=True)
class Prospect:
    """What a model has to gain from one effect more, before it is fitted.

    candidates: the last of them is new; nested: the model without it; climb; known: its Jacobian (coordinate,
    parameter); added: (parameter,) which are the new effect's own; at_null: the model with the effect at its null;
    starts: promises over the null [nats], and places (parameter,); still: as ``Promises`` has it.
    """

    candidates: tuple[Candidate, ...]
    nested: Ground
    climb: Climb
    known: Array
    added: NDArray[np.bool_]
    at_null: Maximum
    starts: list[tuple[float, Array]]
    still: list[tuple[float, Array]]

    @property
    def promise(self) -> float:
        """The most that any start promises [nats]."""
        return max(promise for promise, _ in self.starts)

    @property
    def hope(self) -> float:
        """The most that is promised with the motion that unlike teeth force or as if none were [nats].

        Whether the effect is worth a climb hangs on it; whether another is, on what this one promises as it is.
        """
        return max([self.promise, *(promise for promise, _ in self.still)])

    @property
    def is_of_cut(self) -> bool:
        """Whether all parameters of the new effect are of the cut alone: then starts promise about what a climb gains.

        A model whose modes have bent to imitate an effect of the structure hides most of what that gains.
        """
        return all(parameter.touches == "cut" for parameter in self.candidates[-1].term.parameters)


def stay(base: Comparison, candidates: Sequence[Candidate], nested: Ground) -> Hypothesis:
    """Return a model with effects of which the last stays at its null, where the nested model has arrived.

    See docs/physics.md#diagnosis.
    """
    climb, at_null, _, _ = _at_null(base, candidates, nested)
    comparison = climb.problem
    assert isinstance(comparison, Comparison)
    fit = result(comparison, at_null, climb.evaluations, -np.inf)
    return Hypothesis(candidates=tuple(candidates), comparison=comparison, fit=fit)


def _at_null(
    base: Comparison, candidates: Sequence[Candidate], nested: Ground
) -> tuple[Climb, Maximum, Array, NDArray[np.bool_]]:
    """Return the climb of a model with an effect more, where it stands at its null, and what of its slope is known."""
    comparison, new = extended(base, candidates), candidates[-1]
    fit, known = nested.hypothesis.fit, _in_order(comparison, nested)
    own, evaluation = at_nulls(comparison, fit)
    added = np.array([parameter in new.term.parameters for parameter in comparison.parameters])
    climb = Climb(comparison, free_parameters(comparison, (), own))
    return climb, climb.stay(climb.known_place(own, evaluation), known, added), known, added


def look(
    base: Comparison, candidates: Sequence[Candidate], nested: Ground, amplitudes: Sequence[float] = AMPLITUDES
) -> Prospect:
    """Return what a model with effects has to gain over one that is nested in it.

    The last of the candidates is new: it is looked at with several strengths, ``amplitudes`` in widths of their
    priors, and shapes, since a displaced resonance has no slope that would lead to it, and with everything else where
    the slope says that it would go.

    See docs/physics.md#diagnosis.
    """
    climb, at_null, known, added = _at_null(base, candidates, nested)
    comparison, new, own = climb.problem, candidates[-1], at_null.values
    assert isinstance(comparison, Comparison)
    worth, plain = Worth(climb, at_null, known, added), unbent(comparison, own)
    promised = partial(promises, worth, comparison, new=new, at_null=at_null.evaluation, amplitudes=amplitudes)
    looked = [promised(own=own, scanned=True)]
    if nested.bent or (new.scan is not None and is_silent(comparison)):
        looked.append(promised(own=plain, scanned=scanned_widely(new, comparison)))
    return Prospect(
        candidates=tuple(candidates),
        nested=nested,
        climb=climb,
        known=known,
        added=added,
        at_null=at_null,
        starts=[(climb.promise_of(at_null), own), *(one for part in looked for one in part.starts)],
        still=[one for part in looked for one in part.still],
    )


def pursue(prospect: Prospect) -> Hypothesis:
    """Fit a model with one effect more from its best starts, to near its maximum.

    Where neither a step from its null nor any start promises anything, that is where it stays: the score test of the
    effect. What comes near the truth is worth a ``refit``.

    See docs/physics.md#diagnosis.
    """
    climb, known, added, found = prospect.climb, prospect.known, prospect.added, prospect.at_null
    comparison = climb.problem
    assert isinstance(comparison, Comparison)
    smooth, rows = _smooth(climb), smooth_rows(found.evaluation)
    still = smooth_height(found.log_posterior, found.evaluation)
    for promise, start in chosen(comparison, prospect.candidates[-1], prospect.starts, prospect.still):
        ahead = smooth.approach(start, START_GAIN, known[rows], added, still)
        there = climb.place(ahead.values)
        if _leads_on(prospect, ahead, there, still):
            found = _higher(found, climb.approach_from(there, START_GAIN, known, added, found.log_posterior))
        elif promise > LEAST_GAIN:
            # What chatter frequencies alone promise, smooth data know nothing of.
            found = _higher(found, climb.approach(start, START_GAIN, known, added, found.log_posterior))
    if prospect.nested.unsure:
        for there in unseen_starts(climb, prospect.at_null.values, prospect.candidates[-1]):
            found = _higher(found, climb.approach_from(there, START_GAIN, None, None, found.log_posterior))
    if (reached := _reached_at_rest(prospect)) is not None:
        found = _higher(found, climb.approach(reached, START_GAIN, None, None, found.log_posterior))
    fit = result(comparison, found, climb.evaluations, -np.inf)
    return Hypothesis(candidates=prospect.candidates, comparison=comparison, fit=fit)


def _reached_at_rest(prospect: Prospect) -> Array | None:
    """Return where an effect leads beside the machine as described, where that meets more than a bent model can."""
    before, comparison = prospect.nested.height_at_rest, prospect.climb.problem
    if before is None:
        return None
    assert isinstance(comparison, Comparison)
    fit, still = prospect.nested.hypothesis.fit, prospect.at_null.values
    # The effect at its null has a prior's density, too, which no height without it knows.
    before += log_prior(comparison.parameters, still) - log_prior(fit.parameters, fit.estimate)
    end = at_rest(comparison, still, prospect.candidates[-1])
    return end.values if end is not None and end.log_posterior > before + LEAST_GAIN else None


def _higher(found: Maximum, end: Maximum) -> Maximum:
    return end if end.log_posterior > found.log_posterior + SMALLEST_PROMISE else found


def _smooth(climb: Climb) -> Climb:
    """Return the climb of the smooth data alone, of all where none jump."""
    comparison = climb.problem
    assert isinstance(comparison, Comparison)
    return Climb(comparison.smooth or comparison, climb.free)


def _leads_on(prospect: Prospect, ahead: Maximum, there: Place, still: float) -> bool:
    """Return whether an effect has gained anything where a climb by the smooth data alone has ended.

    Of those, or of all, and more than they gain by such a climb without it; there: the same place by all data; still:
    the height of the smooth data with the effect at its null.
    """
    nested = prospect.nested
    smooth = ahead.log_posterior - still - nested.smooth_gain
    whole = there.height - prospect.at_null.log_posterior - nested.whole_gain
    return max(smooth, whole) > LEAST_GAIN


def fit_hypothesis(base: Comparison, candidates: Sequence[Candidate], nested: Ground) -> Hypothesis:
    """Fit a model with effects, starting from one that is nested in it: ``look`` and ``pursue``.

    See docs/physics.md#diagnosis.
    """
    return pursue(look(base, candidates, nested))


def _in_order(comparison: Comparison, nested: Ground) -> Array:
    """Return the slope of a nested model with the columns of another; what it does not know has none."""
    parameters = nested.hypothesis.comparison.parameters
    place = {parameter.name: index for index, parameter in enumerate(parameters)}
    columns = [place.get(parameter.name, -1) for parameter in comparison.parameters]
    return np.where(np.array(columns) >= 0, nested.slope[:, columns], 0.0)


def refit(hypothesis: Hypothesis, start: Fit) -> Hypothesis:
    """Fit a hypothesis again from the common parameters of another fit; the better one is returned.

    An evidence against a fit that had not arrived is none.

    See docs/physics.md#diagnosis.
    """
    return refit_from(hypothesis, carried(hypothesis.comparison, start))


def refit_from(hypothesis: Hypothesis, start: Array) -> Hypothesis:
    """Fit a hypothesis again from values (parameter,); the better one is returned.

    Where the climb is stuck at an edge it ends, as for profiles: of three that went on beyond with teeth that run out
    none led higher, and that took a third of their time.

    See docs/physics.md#diagnosis.
    """
    comparison = hypothesis.comparison
    free = free_parameters(comparison, (), start)
    found = result(comparison, maximise(comparison, [start], free, 1, LEFT_GAIN, leaps=False), 0, -np.inf)
    return hypothesis if found.log_posterior < hypothesis.fit.log_posterior else replace(hypothesis, fit=found)
