"""How probable each hypothesis is, given the campaign: evidences, priors, and a temper against overconfidence."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from chatter_core.evidence.candidates import Hypothesis

#: Prior odds of nothing missing against any one effect [nats].
NOTHING_MISSING = 2.5
#: Evidences count by this share: fits of models that are never quite right are surer than they are right.
TEMPER = 0.6
NOTHING = "none"


@dataclass(frozen=True, kw_only=True)
class Ranked:
    """An effect, or nothing, with its probability.

    name; probability, tempered; gain: log evidence over that of the base model [nats]; best: its most probable
    variant.
    """

    name: str
    probability: float
    gain: float
    best: Hypothesis

    @property
    def told_gain(self) -> str:
        """The gain as it is shown, with its sign; what rounds to nothing is no loss."""
        return f"{round(self.gain, 1) + 0.0:+.1f}"


def rank(
    base: Hypothesis, hypotheses: Sequence[Hypothesis], variants_of: Mapping[str, int] | None = None
) -> list[Ranked]:
    """Return nothing missing and every effect, the most probable first.

    The evidence of an effect is the mean of its variants'; variants_of: how many there are by name, where not all were
    fitted and the others count for nothing. A hypothesis that ended below the base model,
    which is nested in it, has failed; its evidence is what its fit has, and that is never above the base's by
    mistake.

    See docs/physics.md#diagnosis.
    """
    by_name: dict[str, list[Hypothesis]] = {}
    for hypothesis in hypotheses:
        by_name.setdefault(hypothesis.name, []).append(hypothesis)
    entries = [(NOTHING, 0.0, NOTHING_MISSING, base)]
    for name, variants in by_name.items():
        evidence = np.array([variant.fit.log_evidence for variant in variants])
        count = len(variants) if variants_of is None else variants_of[name]
        gain = float(logsumexp(evidence) - np.log(count) - base.fit.log_evidence)
        entries.append((name, gain, 0.0, variants[int(evidence.argmax())]))
    weights = np.array([TEMPER * gain + prior for _, gain, prior, _ in entries])
    probability = np.exp(weights - logsumexp(weights))
    ranked = [
        Ranked(name=name, probability=float(share), gain=gain, best=best)
        for (name, gain, _, best), share in zip(entries, probability, strict=True)
    ]
    return sorted(ranked, key=lambda one: -one.probability)
