"""Candidates for what a model lacks: terms that are fitted together with everything that it has."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from chatter_core.evidence.comparison import Compared, Comparison
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.parameters import Array, Evaluation, Parameter
from chatter_core.stages import Term


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """An effect in one variant.

    name: of the effect; settings: what was chosen of it; term: with its parameters; shapes: names of those that say
    how it looks and not how strong it is; heard: the one of them that is a frequency at which it makes cuts chatter
    [Hz]; scan: a parameter and its values that are looked at one by one; scanned_shapes: values of the first shape that
    each of them is looked at with; place: what terms are sorted by.
    """

    name: str
    settings: dict[str, str | int]
    term: Term
    shapes: tuple[str, ...]
    place: tuple[int, bool, str]
    heard: str | None = None
    scan: tuple[str, tuple[float, ...]] | None = None
    scanned_shapes: tuple[float, ...] = ()

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
    """Return a comparison whose model has some effects more, all in the order in which they act along the chain.

    See docs/physics.md#diagnosis.
    """
    placed = [(_place(term), term) for term in base.model.terms]
    placed += [(candidate.place, candidate.term) for candidate in candidates]
    terms = tuple(term for _, term in sorted(placed, key=lambda one: one[0]))
    return replace(base, model=replace(base.model, terms=terms))


def _place(term: Term) -> tuple[int, bool, str]:
    """Return the place of a term along the chain: an effect knows its own, what is none acts before all effects."""
    place: Callable[[], tuple[int, bool, str]] | None = getattr(term, "place", None)
    return (-1, False, "") if place is None else place()


def slope_of(hypothesis: Hypothesis) -> Array:
    """Return the derivatives of a fit's information coordinates (coordinate, parameter), in widths of the priors.

    See docs/physics.md#diagnosis.
    """
    fit = hypothesis.fit
    climb = Climb(hypothesis.comparison, ~fit.fixed)
    return climb.derivatives(fit.estimate, fit.evaluation, np.asarray(fit.standard_deviation))[0]


def carried(comparison: Comparison, fit: Fit) -> Array:
    """Return the values (parameter,) of another model's fit by name; what it does not know is at its null.

    See docs/physics.md#diagnosis.
    """
    known = {parameter.name: value for parameter, value in zip(fit.parameters, fit.estimate, strict=True)}
    return np.array([known.get(parameter.name, parameter.null) for parameter in comparison.parameters])


def at_nulls(comparison: Comparison, fit: Fit) -> tuple[Array, Evaluation]:
    """Return the values (parameter,) of another model's fit, and its evaluation, with effects more at their nulls.

    None changes anything there, so nothing is evaluated, and what is noted in one evaluation is noted in the other.

    See docs/physics.md#diagnosis.
    """
    state, values = fit.evaluation.state, carried(comparison, fit)
    assert isinstance(state, Compared)
    prediction = replace(state.prediction, values=values)
    return values, replace(fit.evaluation, state=replace(state, prediction=prediction))
