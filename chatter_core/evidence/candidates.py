"""Candidates for what a model lacks: terms that are fitted together with everything that it has."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.comparison import Compared, Comparison
from chatter_core.evidence.fit import Fit, free_parameters, maximise, result
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.parameters import Array, Evaluation, Parameter
from chatter_core.stages import Term

#: Amplitudes at which a fit is started, in widths of their priors; to both sides where they can go there.
AMPLITUDES = (0.3, 1.0, 3.0)
#: Shapes at which it is, in widths of theirs.
SHAPES = (-1.2, -0.6, 0.0, 0.6, 1.2)
#: An effect of which a step from its null promises less stays there [nats].
SMALLEST_PROMISE = 0.3
#: Of all starts so many of the best are climbed from.
CLIMBED = 2
#: What is ranked need not be known better than this [nats].
LEFT_GAIN = 0.1


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """An effect in one variant.

    name: of the effect; settings: what was chosen of it; term: with its parameters; shapes: names of those that say
    how it looks and not how strong it is; place: what terms are sorted by.
    """

    name: str
    settings: dict[str, str | int]
    term: Term
    shapes: tuple[str, ...]
    place: tuple[int, str]

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
    here = hypothesis.comparison.evaluate(fit.estimate)
    climb = Climb(hypothesis.comparison, ~fit.fixed)
    return climb.derivatives(fit.estimate, here, np.asarray(fit.standard_deviation))[0]


def fit_hypothesis(base: Comparison, candidates: Sequence[Candidate], nested: Hypothesis, slope: Array) -> Hypothesis:
    """Fit a model with effects, starting from one that is nested in it.

    slope: ``slope_of(nested)``. The last of the candidates is new: it is looked at with several strengths and shapes,
    since a displaced resonance has no slope that would lead to it, and with everything else where the slope says that
    it would go. Where neither a step from its null nor any of these promises anything, that is where it stays: the
    score test of the effect.

    See docs/physics.md#diagnosis.
    """
    comparison, new = extended(base, candidates), candidates[-1]
    own, known = carried(comparison, nested.fit), _in_order(comparison, nested.comparison, slope)
    added = np.array([parameter in new.term.parameters for parameter in comparison.parameters])
    climb = Climb(comparison, free_parameters(comparison, (), own))
    height, at_null = climb.posterior(own)
    jacobian = known + climb.derivatives(own, at_null, climb.width, added)[0]
    starts = _starts(comparison, own, new)
    promised = [climb.promise(own, at_null, jacobian), *_promises(climb, own, starts, known)]
    likely = [index for index in np.argsort(promised)[::-1][:CLIMBED] if promised[index] >= SMALLEST_PROMISE]
    ends = [climb.approach([own, *starts][index], START_GAIN, known, added) for index in likely]
    if all(climb.posterior(end)[0] < height + SMALLEST_PROMISE for end in ends):
        fit = result(comparison, climb.stay(own, jacobian), climb.evaluations, -np.inf)
    else:
        fit = result(comparison, maximise(comparison, ends, climb.free, 1, LEFT_GAIN), climb.evaluations, height)
    return Hypothesis(candidates=tuple(candidates), comparison=comparison, fit=fit)


def _promises(climb: Climb, own: Array, starts: Sequence[Array], known: Array) -> list[float]:
    """Return what each start promises over the null, by itself or once everything else has followed it [nats].

    Where chatter frequencies go then is not foreseen: they jump. So either all data count, and nothing follows, or
    the smooth ones, and everything does.
    """
    height, at_null = climb.posterior(own)
    smooth = _smooth_rows(at_null)
    slope = np.where(smooth[:, None], known, 0.0)

    def followed(values: Array, evaluation: Evaluation, reached: float) -> float:
        unforeseen = evaluation.log_density[evaluation.datum[~smooth]].sum()
        return reached - float(unforeseen) + climb.promise(values, evaluation, slope)

    rest, found = followed(own, at_null, height), []
    for start in starts:
        reached, there = climb.posterior(start)
        found.append(max(reached - height, followed(start, there, reached) - rest))
    return found


def _smooth_rows(evaluation: Evaluation) -> NDArray[np.bool_]:
    """Return which coordinates (coordinate,) do not jump when parameters move: all but chatter frequencies."""
    assert isinstance(evaluation.state, Compared)
    rows = np.ones(len(evaluation.coordinates), dtype=bool)
    rows[evaluation.state.coordinates_of.get("chatter_frequency", slice(0))] = False
    return rows


def _in_order(comparison: Comparison, nested: Comparison, slope: Array) -> Array:
    """Return the slope of a nested model with the columns of another; what it does not know has none."""
    place = {parameter.name: index for index, parameter in enumerate(nested.parameters)}
    columns = [place.get(parameter.name, -1) for parameter in comparison.parameters]
    return np.where(np.array(columns) >= 0, slope[:, columns], 0.0)


def refit(hypothesis: Hypothesis, start: Fit) -> Hypothesis:
    """Fit a hypothesis again from the common parameters of another fit; the better one is returned.

    An evidence against a fit that had not arrived is none.

    See docs/physics.md#diagnosis.
    """
    comparison = hypothesis.comparison
    own = carried(comparison, start)
    free = free_parameters(comparison, (), own)
    found = result(comparison, maximise(comparison, [own], free, 1), 0, -np.inf)
    return hypothesis if found.log_posterior <= hypothesis.fit.log_posterior else replace(hypothesis, fit=found)


def carried(comparison: Comparison, fit: Fit) -> Array:
    """Return the values (parameter,) of another model's fit by name; what it does not know is at its null.

    See docs/physics.md#diagnosis.
    """
    known = {parameter.name: value for parameter, value in zip(fit.parameters, fit.estimate, strict=True)}
    return np.array([known.get(parameter.name, parameter.null) for parameter in comparison.parameters])


def _starts(comparison: Comparison, own: Array, new: Candidate) -> list[Array]:
    """Return starts (parameter,) at several strengths and shapes of a candidate."""
    place = {parameter.name: index for index, parameter in enumerate(comparison.parameters)}
    strengths = [sign * size for size in AMPLITUDES for sign in (1.0, -1.0)]
    shapes = [p for p in new.term.parameters if p.name in new.shapes]
    starts: list[Array] = []
    for strength, shape in itertools.product(strengths, SHAPES if shapes else (0.0,)):
        start = own.copy()
        for parameter in new.amplitudes:
            start[place[parameter.name]] = _within(parameter, parameter.null + strength * parameter.prior_width)
        # Of several shapes the first is the one that displaces: a frequency, an exponent.
        for parameter in shapes[:1]:
            start[place[parameter.name]] = _within(parameter, parameter.prior_mean + shape * parameter.prior_width)
        if not any(np.array_equal(start, other) for other in [own, *starts]):
            starts.append(start)
    # An amplitude that cannot go to one side stays at its null there, and so does the model.
    return [start for start in starts if any(start[place[p.name]] != p.null for p in new.amplitudes)]


def _within(parameter: Parameter, value: float) -> float:
    return float(np.clip(value, parameter.lower, parameter.upper))
