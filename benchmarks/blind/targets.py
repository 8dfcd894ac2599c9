"""The targets of the hidden-effect test, each with what was measured."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.blind.judgement import (
    CONFIDENCE,
    MODELS,
    WORTH,
    Case,
    Share,
    calibration_error,
    is_sure_and_wrong,
    reliability,
    share,
    share_of,
    stated_probability,
    stating,
    word_of,
)

#: Draws of cases from which intervals of means are read, and their seed.
DRAWS, SEED = 2000, 1
#: Share of cuts that end otherwise because of an effect that shows, whatever a program makes of it.
SHOWS = 0.05
#: A diagnosis takes no more than this: evaluations of the cuts, and processor time [s], two cores for two minutes.
MOST_EVALUATIONS, MOST_PROCESSOR_S = 400, 240.0


@dataclass(frozen=True, kw_only=True)
class Target:
    """A number that is wanted between two, what was measured, its interval and of how many; in percent if share."""

    name: str
    at_least: float | None
    at_most: float | None
    value: float
    low: float
    high: float
    count: int
    percent: bool = True

    @property
    def met(self) -> bool | None:
        """Whether the measured number is as wanted; None where nothing was measured, or nothing is wanted."""
        if not np.isfinite(self.value) or (self.at_least is None and self.at_most is None):
            return None
        above = self.at_least is None or self.value >= self.at_least
        return bool(above and (self.at_most is None or self.value <= self.at_most))


def _of_share(name: str, found: Share, *, at_least: float | None = None, at_most: float | None = None) -> Target:
    return Target(
        name=name, at_least=at_least, at_most=at_most,
        value=found.value, low=found.low, high=found.high, count=found.count,
    )  # fmt: skip


def mean_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Return the mean of values and its interval, by drawing cases anew (percentile bootstrap); NaN of none.

    Source: B. Efron, R. J. Tibshirani, An Introduction to the Bootstrap (1993), chapter 13.
    """
    data = np.asarray(values, dtype=float)
    if not data.size:
        return np.nan, np.nan, np.nan
    drawn = np.random.default_rng(SEED).choice(data, (DRAWS, data.size)).mean(axis=1)
    low, high = np.quantile(drawn, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return float(data.mean()), float(low), float(high)


def targets(cases: Sequence[Case]) -> list[Target]:
    """Return all targets. A case that failed counts as not right, and is out where a number was not computed."""
    return [*_naming(cases), *_warning(cases), *_stating(cases), *_predicting(cases), *_spending(cases)]


def _naming(cases: Sequence[Case]) -> list[Target]:
    one = [case for case in cases if case.kind == "one"]
    worth = [case for case in one if case.gain_of_truth >= WORTH]
    shows = [case for case in one if case.flips >= SHOWS]
    plain = [case for case in cases if case.kind in ("none", "one")]
    named = [case for case in cases if case.kind in ("one", "two")]
    return [
        _of_share("most probable is right, one effect", share_of(one, lambda c: c.first_is_right), at_least=0.85),
        _of_share(
            "the same where its hypothesis gains 5 nats", share_of(worth, lambda c: c.first_is_right), at_least=0.95
        ),
        _of_share("the same where it flips 5 % of the labels", share_of(shows, lambda c: c.first_is_right)),
        _of_share("most probable is right, one effect or none", share_of(plain, lambda c: c.first_is_right)),
        _of_share("confident wrong name, one or two effects", share_of(named, is_sure_and_wrong), at_most=0.02),
    ]


def _warning(cases: Sequence[Case]) -> list[Target]:
    none = [case for case in cases if case.kind == "none"]
    foreign = [case for case in cases if case.kind == "foreign"]
    return [
        _of_share("confident effect where there is none", share_of(none, is_sure_and_wrong), at_most=0.03),
        _of_share("what has no name named without a warning", share_of(foreign, is_sure_and_wrong), at_most=0.15),
        _of_share("the same, near names too", share_of(foreign, lambda c: c.verdict == "effect")),
        _of_share("near name for what has no name", share_of(foreign, lambda c: word_of(c) == "near")),
    ]


def _stating(cases: Sequence[Case]) -> list[Target]:
    said = stating(cases)
    stated, right = [stated_probability(case) for case in said], [case.first_is_right for case in said]
    error, low, high = _calibration_interval(stated, right)
    held = [hit for case in cases if case.kind == "one" and case.first_is_right for hit in case.covered.values()]
    return [
        Target(
            name="calibration error of stated probabilities", at_least=None, at_most=0.05,
            value=error, low=low, high=high, count=len(said),
        ),
        _by_chance(stated),
        _of_share(
            "90 % intervals that hold the true amplitude", share(sum(held), len(held)), at_least=0.85, at_most=0.95
        ),
    ]  # fmt: skip


def _by_chance(stated: Sequence[float]) -> Target:
    """Return what a program whose stated probabilities are true would show, simulated: few answers scatter."""
    value = low = high = np.nan
    probability = np.asarray(stated)
    if len(probability):
        hits = np.random.default_rng(SEED).random((DRAWS // 10, len(probability))) < probability
        drawn = [calibration_error(reliability(probability, hit)) for hit in hits]
        value, (low, high) = np.mean(drawn), np.quantile(drawn, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return Target(
        name="the same of one whose probabilities are true", at_least=None, at_most=None,
        value=float(value), low=float(low), high=float(high), count=len(probability),
    )  # fmt: skip


def _calibration_interval(stated: Sequence[float], right: Sequence[bool]) -> tuple[float, float, float]:
    """Return the calibration error and its interval, by drawing answers anew."""
    probability, hit = np.asarray(stated), np.asarray(right, dtype=bool)
    if not len(probability):
        return np.nan, np.nan, np.nan
    chosen = np.random.default_rng(SEED).integers(len(probability), size=(DRAWS // 10, len(probability)))
    drawn = [calibration_error(reliability(probability[some], hit[some])) for some in chosen]
    low, high = np.quantile(drawn, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return calibration_error(reliability(stated, right)), float(low), float(high)


def _predicting(cases: Sequence[Case]) -> list[Target]:
    known = [case for case in cases if {*MODELS} <= case.errors.keys()]
    right = [case for case in known if case.kind == "one" and word_of(case) == "right"]
    missed = [case for case in known if case.kind == "one" and word_of(case) == "missed"]
    none = [case for case in known if case.kind == "none"]
    found = []
    groups = ("one effect, rightly named", right), ("one effect, told that none is", missed), ("nothing hidden", none)
    for name, of in groups:
        for model, wanted in (("nominal", None), ("refitted", None), ("answered", 0.09 if of is right else None)):
            value, low, high = mean_interval([case.errors[model] for case in of])
            found.append(
                Target(
                    name=f"held-out outcome error, {name}: {model}", at_least=None, at_most=wanted,
                    value=value, low=low, high=high, count=len(of),
                )
            )  # fmt: skip
    return [*found, _fall(right), _rise(none)]


def _fall(cases: Sequence[Case]) -> Target:
    """Return by how much the effect lowers the mean error of the refitted base; cases are drawn anew as pairs."""
    refitted, answered = (np.array([case.errors[model] for case in cases]) for model in ("refitted", "answered"))
    value = low = high = np.nan
    if refitted.size and refitted.sum() > 0.0:
        value = 1.0 - answered.sum() / refitted.sum()
        chosen = np.random.default_rng(SEED).integers(refitted.size, size=(DRAWS, refitted.size))
        before = refitted[chosen].sum(axis=1)
        drawn = 1.0 - answered[chosen].sum(axis=1)[before > 0.0] / before[before > 0.0]
        low, high = np.quantile(drawn, [0.5 * (1.0 - CONFIDENCE), 0.5 * (1.0 + CONFIDENCE)])
    return Target(
        name="fall of that error from refitted to answered", at_least=0.35, at_most=None,
        value=float(value), low=float(low), high=float(high), count=len(cases),
    )  # fmt: skip


def _rise(cases: Sequence[Case]) -> Target:
    value, low, high = mean_interval([case.errors["answered"] - case.errors["refitted"] for case in cases])
    return Target(
        name="rise of that error where nothing is hidden", at_least=None, at_most=0.01,
        value=value, low=low, high=high, count=len(cases),
    )  # fmt: skip


def _spending(cases: Sequence[Case]) -> list[Target]:
    found = []
    for name, most, values in (
        (
            "evaluations of the cuts, mean",
            MOST_EVALUATIONS,
            [c.evaluations for c in cases if c.evaluations is not None],
        ),
        ("processor time, mean [s]", MOST_PROCESSOR_S, [c.processor_s for c in cases if c.processor_s is not None]),
    ):
        value, low, high = mean_interval(values)
        found.append(
            Target(
                name=name, at_least=None, at_most=float(most), value=value, low=low, high=high,
                count=len(values), percent=False,
            )
        )  # fmt: skip
    return [*found, _of_share("diagnoses that failed", share_of(cases, lambda case: case.failed))]
