"""What answers are worth when the truth is known. Plain data alone: nothing here has seen the program.

An answer gets one of these words, ``word_of``:

========== ==========================================================================================
right      the verdict that the truth asks for: ``none``; all hidden effects and no other; ``unexplained`` for
           what has no name
part       of two hidden effects one was named, and no other
tied       ``ambiguous``, with a hidden effect among the names
near       what has no name was called by the name of an effect that lies near it (``NEAR``), and by no other with
           confidence: neither right nor wrong
wrong      an effect was named with confidence that is not hidden
wrong_tie  ``ambiguous`` among effects of which none is hidden
missed     ``none``, though something is hidden
unexplained, underpowered  said where something else is true
failed     no answer
========== ==========================================================================================
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy import stats

WORDS = (
    "right", "part", "tied", "near", "wrong", "wrong_tie", "missed", "unexplained", "underpowered", "failed",
)  # fmt: skip
NOTHING = "none"
#: Hidden things without a name that lie near named ones: two modes of the workpiece near one; a preload that rises
#: with the trials near one that rises with speed.
NEAR = {"workpiece_pair": "workpiece_mode", "warm_up": "thermal_preload"}
#: Models whose errors on cuts kept back are judged: as described, calibrated, and what the answer stands for.
MODELS = ("nominal", "refitted", "answered")
STRENGTHS = ("weak", "middle", "strong")
#: Confidence of intervals of shares.
CONFIDENCE = 0.95
#: An effect is worth it where its own hypothesis gained so much [nats].
WORTH = 5.0
#: Bins of stated probabilities.
BINS = 10


@dataclass(frozen=True, kw_only=True)
class Case:
    """A campaign with its truth and its answer.

    kind: none, one, two or foreign; effects: names of what is hidden, foreign ones too; strength: 0 to 1, the mean of
    two; flips: share of cuts that end otherwise because of it; data: kind of measurement. verdict, missing: the
    answer, "failed" where there is none; probabilities: of nothing and of every effect; gains [nats] of effects;
    covered: of every amplitude that truth and model share, whether its interval holds the truth; errors: of held-out
    outcomes by model; evaluations of the cuts and processor time [s] of the diagnosis.
    """

    seed: int
    kind: str
    effects: tuple[str, ...] = ()
    strength: float | None = None
    flips: float = 0.0
    data: str = ""
    verdict: str = "failed"
    missing: tuple[str, ...] = ()
    probabilities: dict[str, float] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    covered: dict[str, bool] = field(default_factory=dict)
    errors: dict[str, float] = field(default_factory=dict)
    evaluations: int | None = None
    processor_s: float | None = None

    @property
    def failed(self) -> bool:
        """Whether there is no answer."""
        return self.verdict == "failed"

    @property
    def first(self) -> str:
        """The most probable of nothing and all single effects; "" where there is no answer."""
        return max(self.probabilities, key=lambda name: self.probabilities[name], default="")

    @property
    def first_is_right(self) -> bool:
        """Whether the most probable is what is hidden, or one of the two; of what has no name nothing is right."""
        if self.kind == "foreign":
            return False
        return self.first in (self.effects or (NOTHING,))

    @property
    def level(self) -> str:
        """How strong the effect is, in a word; "" where nothing is hidden."""
        return "" if self.strength is None else STRENGTHS[min(int(3.0 * self.strength), 2)]

    @property
    def gain_of_truth(self) -> float:
        """What the hypothesis of the only hidden effect gained [nats]; minus infinity where it was no candidate."""
        return self.gains.get(self.effects[0], -np.inf) if self.effects else -np.inf


@dataclass(frozen=True, kw_only=True)
class Share:
    """A share of cases with its interval."""

    hits: int
    count: int
    low: float
    high: float

    @property
    def value(self) -> float:
        """The share; NaN of no case."""
        return self.hits / self.count if self.count else np.nan


def share(hits: int, count: int) -> Share:
    """Return a share with Wilson's interval.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209-212.
    """
    if not count:
        return Share(hits=0, count=0, low=0.0, high=1.0)
    interval = stats.binomtest(hits, count).proportion_ci(CONFIDENCE, method="wilson")
    return Share(hits=hits, count=count, low=float(interval.low), high=float(interval.high))


def share_of(cases: Sequence[Case], holds: Callable[[Case], bool]) -> Share:
    """Return the share of cases of which something holds."""
    return share(sum(holds(case) for case in cases), len(cases))


def word_of(case: Case) -> str:
    """Return what an answer is worth, one of WORDS."""
    if case.failed:
        return "failed"
    if case.verdict in ("effect", "ambiguous"):
        return _word_of_names(case)
    asked = {"none": "none", "foreign": "unexplained"}.get(case.kind, "effect")
    if case.verdict == asked:
        return "right"
    return "missed" if case.verdict == "none" else case.verdict


def _word_of_names(case: Case) -> str:
    named, sure = set(case.missing), case.verdict == "effect"
    if case.kind == "foreign":
        near = {NEAR.get(effect, "") for effect in case.effects}
        # Who names another effect with it, and is sure of both, is wrong in the other.
        if named <= near if sure else named & near:
            return "near"
        return "wrong" if sure else "wrong_tie"
    hidden = set(case.effects)
    if sure:
        return "wrong" if named - hidden else "right" if named == hidden else "part"
    return "tied" if named & hidden else "wrong_tie"


def is_sure_and_wrong(case: Case) -> bool:
    """Return whether an effect was named with confidence that is not hidden."""
    return word_of(case) == "wrong"


@dataclass(frozen=True, kw_only=True)
class Bin:
    """Answers with a stated probability between two: their mean, the share that was right, and how many."""

    low: float
    high: float
    stated: float
    right: Share


def reliability(stated: Sequence[float], right: Sequence[bool], bins: int = BINS) -> list[Bin]:
    """Return stated probabilities against frequencies, in bins of equal width; empty ones are left out."""
    probability, hit = np.asarray(stated, dtype=float), np.asarray(right, dtype=bool)
    place = np.minimum((probability * bins).astype(int), bins - 1)
    found = []
    for number in np.unique(place):
        inside = place == number
        found.append(
            Bin(
                low=number / bins,
                high=(number + 1) / bins,
                stated=float(probability[inside].mean()),
                right=share(int(hit[inside].sum()), int(inside.sum())),
            )
        )
    return found


def calibration_error(bins: Sequence[Bin]) -> float:
    """Return the expected calibration error: the mean distance of stated probability and frequency over all answers.

    Source: M. P. Naeini, G. F. Cooper, M. Hauskrecht, Proc. AAAI 29 (2015) 2901-2907.
    """
    total = sum(one.right.count for one in bins)
    if not total:
        return np.nan
    return sum(one.right.count * abs(one.stated - one.right.value) for one in bins) / total


def stating(cases: Sequence[Case]) -> list[Case]:
    """Return the cases whose answer states a probability: ``unexplained`` takes back that any candidate is true."""
    return [case for case in cases if not case.failed and case.verdict != "unexplained"]


def stated_probability(case: Case) -> float:
    """Return the probability of the most probable of nothing and all single effects."""
    return case.probabilities[case.first]


def confusion(cases: Sequence[Case]) -> tuple[list[str], list[str], Any]:
    """Return truths, answers and how often they met (truth, answer).

    Of two hidden effects, and of two that are named, each row and column is the pair; answers that name nothing have
    columns of their own.
    """
    truths = [" + ".join(case.effects) if case.kind != "two" else "two effects" for case in cases]
    rows = sorted({truth or NOTHING for truth in truths}, key=lambda name: (name == "two effects", name))
    answers = [_answered(case) for case in cases]
    last = ["two effects", "ambiguous", "none", "unexplained", "underpowered", "failed"]
    columns = sorted(set(answers) - set(last)) + last
    table = np.zeros((len(rows), len(columns)), dtype=int)
    for truth, answered in zip(truths, answers, strict=True):
        table[rows.index(truth or NOTHING), columns.index(answered)] += 1
    return rows, columns, table


def _answered(case: Case) -> str:
    if case.verdict != "effect":
        return case.verdict
    return case.missing[0] if len(case.missing) == 1 else "two effects"


def balanced_error(predicted: Sequence[str], observed: Sequence[str]) -> float:
    """Return the share of cuts told wrongly, the mean of stable cuts and of those with chatter; marginal ones are out.

    A cut without an answer is told wrongly; NaN where there is neither kind.
    """
    shares = []
    for label in ("stable", "chatter"):
        of_label = [said for said, seen in zip(predicted, observed, strict=True) if seen == label]
        if of_label:
            shares.append(sum(said != label for said in of_label) / len(of_label))
    return float(np.mean(shares)) if shares else np.nan
