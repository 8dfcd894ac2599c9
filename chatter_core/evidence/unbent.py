"""Where an effect leads beside the machine as described, when a model without it has bent far away to imitate it.

From where such a model stands neither a slope nor a look leads to what the effect and the machine as it is would give
together.
"""

import numpy as np

from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.candidates import Candidate, Hypothesis
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.newton import Climb, Maximum
from chatter_core.evidence.nuisances import Nuisance
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.starts import CLIMBED, shapes_of, starts_at

#: A model has bent where a parameter of the machine lies farther than this from what is described [widths of its
#: prior].
BENT = 2.5
#: Strengths from which all data are climbed at once, without a look, in the widths that they are searched by.
UNSEEN_AMPLITUDES = (0.3, 1.0)
#: Strengths that are looked at beside the machine as described by what was measured without cutting, in the same
#: widths: springs between the parts of machines differ by decades, and a spring that is far too soft leads astray.
STRENGTHS_AT_REST = (0.03, 0.1, 0.3, 1.0, 3.0)
#: Of all those so many of the best are climbed from by the sizes of responses, and of the ends the best by all.
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


def unseen_starts(comparison: Comparison, own: Array, new: Candidate) -> list[Array]:
    """Return starts (parameter,) of an effect beside what a model has come to, and beside the machine as described.

    For models of which cuts alone say where modes lie. Effects that do not move modes have none.

    See docs/physics.md#diagnosis.
    """
    if not moves_modes(new):
        return []
    plain = unbent(comparison, own)
    places = [own] if np.array_equal(own, plain) else [own, plain]
    return [start for place in places for start in starts_at(comparison, place, new, UNSEEN_AMPLITUDES, ())]


def at_rest(comparison: Comparison, own: Array, new: Candidate) -> Maximum | None:
    """Return where an effect and the machine as described lead together, by what was measured without cutting.

    By the sizes of responses first, which see from afar where a resonance lies, then by the responses themselves. None
    for effects that do not move modes, and where nothing was measured without cutting.

    See docs/physics.md#diagnosis.
    """
    structural, coarse = comparison.structural, comparison.coarse
    if structural is None or coarse is None or not moves_modes(new):
        return None
    plain, free = unbent(comparison, own), np.ones(len(own), dtype=bool)
    roughly, closely = Climb(coarse, free), Climb(structural, free)
    starts = starts_at(comparison, plain, new, STRENGTHS_AT_REST, shapes_of(new, comparison, None))
    starts = sorted(starts, key=lambda start: -roughly.posterior(start)[0])[:ROUGHLY_CLIMBED]
    rough = sorted((roughly.from_start(start, START_GAIN) for start in starts), key=lambda end: -end.log_posterior)
    ends = [closely.from_start(end.values, START_GAIN) for end in rough[:CLIMBED]]
    return max(ends, key=lambda end: end.log_posterior, default=None)


def unbent(comparison: Comparison, own: Array) -> Array:
    """Return values (parameter,) with those of the machine as described.

    See docs/physics.md#diagnosis.
    """
    bent = _nuisances(comparison)
    return np.array([p.null if p.name in bent else own[i] for i, p in enumerate(comparison.parameters)])


def _nuisances(comparison: Comparison) -> set[str]:
    return {p.name for term in comparison.model.terms if isinstance(term, Nuisance) for p in term.parameters}
