"""Where an effect leads beside the machine as described, when a model without it has bent far away to imitate it.

From where such a model stands neither a slope nor a look leads to what the effect and the machine as it is would give
together.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.candidates import Candidate, Hypothesis
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.newton import Climb, Maximum, Place
from chatter_core.evidence.nuisances import Nuisance
from chatter_core.evidence.parameters import Array, column
from chatter_core.evidence.starts import CLIMBED, shapes_of, starts_at

#: A model has bent where a parameter of the machine lies farther than this from what is described [widths of its
#: prior].
BENT = 2.5
#: Strengths from the highest of which all data are climbed, whatever they promise, in the widths that they are searched
#: by; two places are one where no parameter differs by more than so many widths of its prior.
UNSEEN_AMPLITUDES, ONE_PLACE = (0.3, 1.0), 1.0
#: Strengths that are looked at beside the machine as described by what was measured without cutting, in the same
#: widths: springs between the parts of machines differ by decades, and a spring that is far too soft leads astray.
STRENGTHS_AT_REST = (0.03, 0.1, 0.3, 1.0, 3.0)
#: Of all those so many of the best are climbed from by the sizes of responses with one Jacobian, and the best ends of
#: these to their maxima, and then by the responses.
ROUGHLY_CLIMBED = 6


def has_bent(hypothesis: Hypothesis) -> bool:
    """Return whether a fitted model has left the machine as described so far that it may imitate an effect.

    See docs/physics.md#diagnosis.
    """
    bent = _nuisances(hypothesis.comparison)
    pulls = zip(hypothesis.fit.parameters, hypothesis.fit.pull, strict=True)
    return any(abs(pull) > BENT for p, pull in pulls if p.name in bent)


def moves_modes(new: Candidate) -> bool:
    """Return whether an effect changes the structure.

    See docs/physics.md#diagnosis.
    """
    return any(parameter.touches == "structure" for parameter in new.amplitudes)


def unseen_starts(climb: Climb, own: Array, new: Candidate) -> list[Place]:
    """Return starts of an effect beside what a model has come to, and beside the machine as described.

    For models of which cuts alone say where modes lie: the highest of several strengths and shapes. Effects that do not
    move modes have none. own: (parameter,), where the model has come to.

    See docs/physics.md#diagnosis.
    """
    comparison = climb.problem
    assert isinstance(comparison, Comparison)
    if not moves_modes(new):
        return []
    plain, width = unbent(comparison, own), column(comparison.parameters, "prior_width")
    places = [own] if np.abs((own - plain) / width).max() < ONE_PLACE else [own, plain]
    shapes = shapes_of(new, comparison, None)
    starts = [start for place in places for start in starts_at(comparison, place, new, UNSEEN_AMPLITUDES, shapes)]
    return sorted(map(climb.place, starts), key=lambda place: -place.height)[:CLIMBED]


def at_rest(comparison: Comparison, own: Array, new: Candidate) -> Maximum | None:
    """Return where an effect and the machine as described lead together, by what was measured without cutting.

    None for effects that do not move modes, and where nothing was measured without cutting.

    See docs/physics.md#diagnosis.
    """
    if comparison.structural is None or not moves_modes(new):
        return None
    plain, free = unbent(comparison, own), np.ones(len(own), dtype=bool)
    starts = starts_at(comparison, plain, new, STRENGTHS_AT_REST, shapes_of(new, comparison, None))
    return _climbed_at_rest(comparison, starts, free)


def height_at_rest(hypothesis: Hypothesis) -> float | None:
    """Return how high a fitted model can climb by what was measured without cutting alone [nats].

    From where it stands, and from the machine as described. None where nothing was measured without cutting.

    See docs/physics.md#diagnosis.
    """
    comparison, fit = hypothesis.comparison, hypothesis.fit
    if comparison.structural is None:
        return None
    plain = np.where(fit.fixed, fit.estimate, unbent(comparison, fit.estimate))
    there = Climb(comparison.structural, ~fit.fixed).from_start(fit.estimate, START_GAIN)
    return max(there.log_posterior, _climbed_at_rest(comparison, [plain], ~fit.fixed).log_posterior)


def _climbed_at_rest(comparison: Comparison, starts: Sequence[Array], free: NDArray[np.bool_]) -> Maximum:
    """Return the highest place to which starts (parameter,) lead by what was measured without cutting.

    By the sizes of responses first, which see from afar where a resonance lies, then by the responses themselves.
    """
    structural, coarse = comparison.structural, comparison.coarse
    assert structural is not None
    assert coarse is not None
    roughly, closely = Climb(coarse, free), Climb(structural, free)
    places = sorted(map(roughly.place, starts), key=lambda place: -place.height)[:ROUGHLY_CLIMBED]
    near = sorted((roughly.approach_from(place, START_GAIN) for place in places), key=lambda end: -end.log_posterior)
    rough = [roughly.from_start(end.values, START_GAIN) for end in near[:CLIMBED]]
    return max((closely.from_start(end.values, START_GAIN) for end in rough), key=lambda end: end.log_posterior)


def unbent(comparison: Comparison, own: Array) -> Array:
    """Return values (parameter,) with those of the machine as described.

    See docs/physics.md#diagnosis.
    """
    bent = _nuisances(comparison)
    return np.array([p.null if p.name in bent else own[i] for i, p in enumerate(comparison.parameters)])


def _nuisances(comparison: Comparison) -> set[str]:
    return {p.name for term in comparison.model.terms if isinstance(term, Nuisance) for p in term.parameters}
