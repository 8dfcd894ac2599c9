"""Candidates for what a model lacks: terms that are fitted together with everything that it has."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.fit import Fit, free_parameters, height, maximise, result
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.parameters import Array, Parameter
from chatter_core.stages import Term

#: Amplitudes at which a fit is started, in widths of their priors; to both sides where they can go there.
AMPLITUDES = (0.3, 1.0, 3.0)
#: Shapes at which it is, in widths of theirs.
SHAPES = (-1.2, -0.6, 0.0, 0.6, 1.2)
#: An effect of which a step from its null promises less stays there [nats].
SMALLEST_PROMISE = 0.3
#: Of all starts so many of the best are climbed from.
CLIMBED = 2


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


def fit_hypothesis(base: Comparison, candidates: Sequence[Candidate], nested: Hypothesis) -> Hypothesis:
    """Fit a model with effects, starting from one that is nested in it.

    The last of the candidates is new: it is tried at several strengths and shapes, with everything else as in
    ``nested``, since a displaced resonance has no slope that would lead to it. Where neither the slope at its
    null nor any of these promises anything, that is where it stays: the score test of the effect.

    See docs/physics.md#diagnosis.
    """
    comparison, new = extended(base, candidates), candidates[-1]
    own = carried(comparison, nested.fit)
    free = free_parameters(comparison, (), own)
    starts = [own, *_starts(comparison, own, new)]
    climb = Climb(comparison, free)
    heights = [climb.posterior(start)[0] for start in starts]
    stayed, promised = climb.stay(own, _deviation(comparison, nested.fit))
    if promised < SMALLEST_PROMISE and max(heights) <= heights[0]:
        fit = result(comparison, stayed, climb.evaluations, -np.inf)
        return Hypothesis(candidates=tuple(candidates), comparison=comparison, fit=fit)
    best = [starts[index] for index in np.argsort(heights)[::-1][:CLIMBED]]
    spent = climb.evaluations
    if comparison.smooth is not None:
        first = maximise(comparison.smooth, best, free, CLIMBED, START_GAIN)
        best, spent = [best[0], first.values], spent + first.evaluations
    found = maximise(comparison, best, free, 1)
    fit = result(comparison, found, spent, height(comparison, own))
    return Hypothesis(candidates=tuple(candidates), comparison=comparison, fit=fit)


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


def _deviation(comparison: Comparison, nested: Fit) -> Array:
    """Return the standard deviations (parameter,) of the nested fit, and the priors' widths of what is new."""
    known = {p.name: value for p, value in zip(nested.parameters, nested.standard_deviation, strict=True)}
    return np.array([known.get(parameter.name, parameter.prior_width) for parameter in comparison.parameters])


def _within(parameter: Parameter, value: float) -> float:
    return float(np.clip(value, parameter.lower, parameter.upper))
