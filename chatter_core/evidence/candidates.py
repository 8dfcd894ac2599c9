"""Candidates for what a model lacks: terms that are fitted together with everything that it has."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.comparison import Compared, Comparison
from chatter_core.evidence.fit import Fit, free_parameters, maximise, result
from chatter_core.evidence.newton import Climb, Maximum
from chatter_core.evidence.parameters import Array, Evaluation, Parameter
from chatter_core.stages import Term

#: Amplitudes at which a fit is started, in widths of their priors; to both sides where they can go there. The first
#: is looked at with every shape.
AMPLITUDES = (1.0, 0.3, 2.0, 3.0)
#: Shapes at which it is, in widths of theirs.
SHAPES = (-1.2, -0.6, 0.0, 0.6, 1.2)
#: An effect that is heard is looked at where chatter was and the model is off by so many deviations; frequencies nearer
#: to each other than this share are one, and so many of those that were heard most often count. The natural frequency
#: lies beside, by some such share.
MISSED_BY, SAME_FREQUENCY, MOST_FREQUENCIES, BESIDE = 3.0, 0.05, 3, 0.02
#: An effect of which a step from its null promises less stays there [nats].
SMALLEST_PROMISE = 0.3
#: Of all starts so many of the best are climbed from.
CLIMBED = 2
#: Of a strength that may go to both sides the best start to each that is no smaller than the first amplitude is climbed
#: from too, unless it promises less than this [nats]: where all else has bent to imitate an effect, a small one beside
#: its null promises most.
HOPELESS = -15.0
#: A climb goes on from where smooth data have led where those, or all data, gain more than this by the effect [nats].
LEAST_GAIN = 1.0
#: What is ranked need not be known better than this [nats].
LEFT_GAIN = 0.01


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """An effect in one variant.

    name: of the effect; settings: what was chosen of it; term: with its parameters; shapes: names of those that say
    how it looks and not how strong it is; heard: the one of them that is a frequency at which it makes cuts chatter
    [Hz]; place: what terms are sorted by.
    """

    name: str
    settings: dict[str, str | int]
    term: Term
    shapes: tuple[str, ...]
    place: tuple[int, str]
    heard: str | None = None

    @property
    def amplitudes(self) -> tuple[Parameter, ...]:
        """The parameters that say how strong the effect is."""
        return tuple(p for p in self.term.parameters if p.name not in self.shapes)

    def __str__(self) -> str:
        chosen = ", ".join(f"{key} {value}" for key, value in self.settings.items())
        return f"{self.name} ({chosen})" if chosen else self.name


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """A model with some effects, fitted: the base model when there are none."""

    candidates: tuple[Candidate, ...]
    comparison: Comparison
    fit: Fit

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return tuple(candidate.name for candidate in self.candidates)

    @property
    def name(self) -> str:
        """Names of the effects in one, however they are listed; empty for the base model."""
        return " + ".join(sorted(self.names))

    @property
    def moved(self) -> bool:
        """Whether the last of its effects has left its null."""
        known = dict(zip((p.name for p in self.fit.parameters), self.fit.estimate, strict=True))
        return bool(self.candidates) and any(known[p.name] != p.null for p in self.candidates[-1].amplitudes)


def extended(base: Comparison, candidates: Sequence[Candidate]) -> Comparison:
    """Return a comparison whose model has some effects more, in the order in which they act along the chain.

    See docs/physics.md#diagnosis.
    """
    ordered = sorted(candidates, key=lambda candidate: candidate.place)
    terms = (*base.model.terms, *(candidate.term for candidate in ordered))
    return replace(base, model=replace(base.model, terms=terms))


def slope_of(hypothesis: Hypothesis) -> Array:
    """Return the derivatives of a fit's information coordinates (coordinate, parameter), in widths of the priors.

    See docs/physics.md#diagnosis.
    """
    fit = hypothesis.fit
    climb = Climb(hypothesis.comparison, ~fit.fixed)
    here = hypothesis.comparison.evaluate(fit.estimate)
    return climb.derivatives(fit.estimate, here, np.asarray(fit.standard_deviation))[0]


@dataclass(frozen=True, kw_only=True)
class Ground:
    """A fitted hypothesis from which further effects are looked for.

    slope: as ``slope_of`` has it; smooth_gain: what a climb by its smooth data alone still gains in those, and
    whole_gain what all data have gained where it ends, mostly a loss [nats].
    """

    hypothesis: Hypothesis
    slope: Array
    smooth_gain: float
    whole_gain: float


def ground(hypothesis: Hypothesis) -> Ground:
    """Return a fitted hypothesis with what is to be known of it before effects are added.

    See docs/physics.md#diagnosis.
    """
    fit, slope = hypothesis.fit, slope_of(hypothesis)
    climb = Climb(hypothesis.comparison, ~fit.fixed)
    height, here = climb.posterior(fit.estimate)
    smooth = _smooth(climb)
    end = smooth.approach(fit.estimate, START_GAIN, slope[_smooth_rows(here)])
    return Ground(
        hypothesis=hypothesis,
        slope=slope,
        smooth_gain=end.log_posterior - smooth.posterior(fit.estimate)[0],
        whole_gain=climb.posterior(end.values)[0] - height,
    )


@dataclass(frozen=True, kw_only=True)
class Prospect:
    """What a model has to gain from one effect more, before it is fitted.

    candidates: the last of them is new; nested: the model without it; climb; known: its Jacobian (coordinate,
    parameter); added: (parameter,) which are the new effect's own; at_null: the model with the effect at its null;
    starts: promises over the null [nats], and places (parameter,).
    """

    candidates: tuple[Candidate, ...]
    nested: Ground
    climb: Climb
    known: Array
    added: NDArray[np.bool_]
    at_null: Maximum
    starts: list[tuple[float, Array]]

    @property
    def promise(self) -> float:
        """The most that any start promises [nats]."""
        return max(promise for promise, _ in self.starts)


def look(base: Comparison, candidates: Sequence[Candidate], nested: Ground) -> Prospect:
    """Return what a model with effects has to gain over one that is nested in it.

    The last of the candidates is new: it is looked at with several strengths and shapes, since a displaced resonance
    has no slope that would lead to it, and with everything else where the slope says that it would go.

    See docs/physics.md#diagnosis.
    """
    comparison, new = extended(base, candidates), candidates[-1]
    own, known = carried(comparison, nested.hypothesis.fit), _in_order(comparison, nested)
    added = np.array([parameter in new.term.parameters for parameter in comparison.parameters])
    climb = Climb(comparison, free_parameters(comparison, (), own))
    at_null = climb.stay(own, known, added)
    starts = [
        (climb.promise_of(at_null), own),
        *_promises(_Worth(climb, at_null, known, added), comparison, own, new, at_null.evaluation),
    ]
    return Prospect(
        candidates=tuple(candidates),
        nested=nested,
        climb=climb,
        known=known,
        added=added,
        at_null=at_null,
        starts=starts,
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
    smooth, rows = _smooth(climb), _smooth_rows(found.evaluation)
    still = smooth.posterior(found.values)[0]
    for start in _chosen(comparison, prospect.candidates[-1], prospect.starts):
        ahead = smooth.approach(start, START_GAIN, known[rows], added, still)
        if not _leads_on(prospect, ahead, still):
            continue
        end = climb.approach(ahead.values, START_GAIN, known, added, found.log_posterior)
        found = end if end.log_posterior > found.log_posterior + SMALLEST_PROMISE else found
    fit = result(comparison, found, climb.evaluations, -np.inf)
    return Hypothesis(candidates=prospect.candidates, comparison=comparison, fit=fit)


def _smooth(climb: Climb) -> Climb:
    """Return the climb of the smooth data alone, of all where none jump."""
    comparison = climb.problem
    assert isinstance(comparison, Comparison)
    return Climb(comparison.smooth or comparison, climb.free)


def _leads_on(prospect: Prospect, ahead: Maximum, still: float) -> bool:
    """Return whether an effect has gained anything where a climb by the smooth data alone has ended.

    Of those, or of all, and more than they gain by such a climb without it; still: the height of the smooth data with
    the effect at its null.
    """
    nested, there = prospect.nested, prospect.climb.posterior(ahead.values)[0]
    smooth = ahead.log_posterior - still - nested.smooth_gain
    whole = there - prospect.at_null.log_posterior - nested.whole_gain
    return max(smooth, whole) > LEAST_GAIN


def fit_hypothesis(base: Comparison, candidates: Sequence[Candidate], nested: Ground) -> Hypothesis:
    """Fit a model with effects, starting from one that is nested in it: ``look`` and ``pursue``.

    See docs/physics.md#diagnosis.
    """
    return pursue(look(base, candidates, nested))


def _promises(
    worth: "_Worth", comparison: Comparison, own: Array, new: Candidate, at_null: Evaluation
) -> list[tuple[float, Array]]:
    """Return starts of an effect, and what each promises over its null [nats].

    Each shape is looked at with the first strength, the best of them with the others too.
    """
    shapes = _shapes(new, comparison, at_null)
    found = [(worth.of(start), start) for start in _starts(comparison, own, new, AMPLITUDES[:1], shapes)]
    best = sorted(found, key=lambda one: -one[0])[:CLIMBED]
    others = [start for _, shaped in best for start in _starts(comparison, shaped, new, AMPLITUDES[1:], ())]
    for start in others:
        if not any(np.array_equal(start, known_start) for _, known_start in found):
            found.append((worth.of(start), start))
    return found


def _shapes(new: Candidate, comparison: Comparison, at_null: Evaluation) -> list[float]:
    """Return values of the shape that displaces, a frequency or an exponent; none where an effect has no shape."""
    displacing = _displacing(new)
    if displacing is None:
        return []
    shapes = [displacing.prior_mean + share * displacing.prior_width for share in SHAPES]
    if new.heard != displacing.name:
        return shapes
    missed = _missed_frequencies(comparison, at_null) / (2.0 * np.pi)
    return [*shapes, *missed, *(1.0 - BESIDE) * missed, *(1.0 + BESIDE) * missed]


def _missed_frequencies(comparison: Comparison, evaluation: Evaluation) -> Array:
    """Return the frequencies (frequency,) [rad/s] at which chatter was heard most often that a model does not know."""
    assert isinstance(evaluation.state, Compared)
    trials = comparison.model.campaign.trials
    said = evaluation.state.contributions.get("chatter_frequency")
    if trials is None or said is None:
        return np.empty(0)
    heard = trials.chatter_frequency[np.isfinite(trials.chatter_frequency)]
    missed = np.sort(heard[np.abs(said.coordinates[:, 0]) > MISSED_BY])
    places = np.split(missed, np.flatnonzero(np.diff(np.log(missed)) > SAME_FREQUENCY) + 1) if len(missed) else []
    return np.array([np.median(place) for place in sorted(places, key=len, reverse=True)[:MOST_FREQUENCIES]])


def _displacing(new: Candidate) -> Parameter | None:
    """Return the first shape of an effect, the one that displaces it; None where it has none."""
    return next((p for p in new.term.parameters if p.name in new.shapes), None)


def _chosen(comparison: Comparison, new: Candidate, promised: Sequence[tuple[float, Array]]) -> list[Array]:
    """Return the starts that are climbed from: those that promise most, and the best large one to each of two sides."""
    ordered = sorted(promised, key=lambda one: -one[0])
    chosen = [start for promise, start in ordered[:CLIMBED] if promise >= SMALLEST_PROMISE]
    names = [parameter.name for parameter in comparison.parameters]
    first = new.amplitudes[0]
    place, large = names.index(first.name), 0.999 * AMPLITUDES[0] * first.prior_width
    for side in (1.0, -1.0) if first.lower < first.null < first.upper else ():
        of_side = [one for one in ordered if side * (one[1][place] - first.null) >= large and one[0] >= HOPELESS]
        if of_side and not any(np.array_equal(of_side[0][1], start) for start in chosen):
            chosen.append(of_side[0][1])
    return chosen


class _Worth:
    """What places promise over the null of an effect, by themselves or once everything else has followed [nats].

    Where chatter frequencies go then is not foreseen: they jump. So either all data count, and nothing follows, or
    the smooth ones, and everything does.
    """

    def __init__(self, climb: Climb, at_null: Maximum, known: Array, added: NDArray[np.bool_]) -> None:
        # The effect itself stays where it is put.
        self.climb = Climb(climb.problem, climb.free & ~added)
        self.height = at_null.log_posterior
        self.smooth = _smooth_rows(at_null.evaluation)
        self.slope = np.where(self.smooth[:, None], known, 0.0)
        self.rest = self._followed(at_null.values, at_null.evaluation, self.height)

    def of(self, values: Array) -> float:
        """Return what values (parameter,) promise."""
        reached, there = self.climb.posterior(values)
        return max(reached - self.height, self._followed(values, there, reached) - self.rest)

    def _followed(self, values: Array, evaluation: Evaluation, reached: float) -> float:
        unforeseen = evaluation.log_density[evaluation.datum[~self.smooth]].sum()
        return reached - float(unforeseen) + self.climb.promise(values, evaluation, self.slope)


def _smooth_rows(evaluation: Evaluation) -> NDArray[np.bool_]:
    """Return which coordinates (coordinate,) do not jump when parameters move: all but chatter frequencies."""
    assert isinstance(evaluation.state, Compared)
    rows = np.ones(len(evaluation.coordinates), dtype=bool)
    rows[evaluation.state.coordinates_of.get("chatter_frequency", slice(0))] = False
    return rows


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
    comparison = hypothesis.comparison
    own = carried(comparison, start)
    free = free_parameters(comparison, (), own)
    found = result(comparison, maximise(comparison, [own], free, 1, LEFT_GAIN), 0, -np.inf)
    return hypothesis if found.log_posterior < hypothesis.fit.log_posterior else replace(hypothesis, fit=found)


def carried(comparison: Comparison, fit: Fit) -> Array:
    """Return the values (parameter,) of another model's fit by name; what it does not know is at its null.

    See docs/physics.md#diagnosis.
    """
    known = {parameter.name: value for parameter, value in zip(fit.parameters, fit.estimate, strict=True)}
    return np.array([known.get(parameter.name, parameter.null) for parameter in comparison.parameters])


def _starts(
    comparison: Comparison, own: Array, new: Candidate, amplitudes: Sequence[float], shapes: Sequence[float]
) -> list[Array]:
    """Return starts (parameter,) at strengths of a candidate, in widths of their priors, and values of its shape.

    To both sides where its strength can go there; without shapes ``own`` has them.
    """
    place = {parameter.name: index for index, parameter in enumerate(comparison.parameters)}
    strengths = [sign * size for size in amplitudes for sign in (1.0, -1.0)]
    displacing, starts = _displacing(new), list[Array]()
    for strength, shape in itertools.product(strengths, shapes or (None,)):
        start = own.copy()
        for parameter in new.amplitudes:
            start[place[parameter.name]] = _within(parameter, parameter.null + strength * parameter.prior_width)
        if displacing is not None and shape is not None:
            start[place[displacing.name]] = _within(displacing, shape)
        # An amplitude that cannot go to one side stays at its null there, and so does the model.
        moved = any(start[place[p.name]] != p.null for p in new.amplitudes)
        if moved and not any(np.array_equal(start, other) for other in starts):
            starts.append(start)
    return starts


def _within(parameter: Parameter, value: float) -> float:
    return float(np.clip(value, parameter.lower, parameter.upper))
