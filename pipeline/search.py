"""The search for what is missing: single effects and pairs are fitted, spread over workers, and ranked."""

from collections import Counter
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from math import prod
from typing import Any

import numpy as np

from chatter_core.evidence.assessment import Limits
from chatter_core.evidence.candidates import Candidate, Hypothesis
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.pursuit import (
    Ground,
    Prospect,
    ground,
    look,
    pursue,
    refit,
    refit_from,
    stay,
)
from chatter_core.evidence.ranking import NOTHING, Ranked, rank
from chatter_core.evidence.starts import AMPLITUDES, SLIGHT_AMPLITUDES, other_shapes
from chatter_core.evidence.verdict import not_ruled_out
from pipeline.cluster import Workers
from pipeline.jobs import Job, spread
from pipeline.profiling import profiled

#: Hypotheses whose evidence comes so near to the best are fitted to their end [nats]: of others none could be named.
CLOSE = 12.0
#: Where the base model rises by more than this from the best effect's place [nats], all is looked at again, once.
RISEN, GROUNDS = 1.0, 2
#: But for what stays so far behind the best all the same [nats]. What is of the cut alone and promises so much less
#: than another has gained is not climbed from there either: of 41 such effects, on d01 to d06, climbs gained 23 nats at
#: most beyond what was promised, and by 25 a verdict may hang on what is second.
OUT_OF_REACH = 48.0
#: Effects of which pairs are tried, the most probable, and second effects that are fitted beside each, those that
#: promise most; beside one that suffices, of those that promise so much [nats].
FIRSTS, SECONDS, SEEN = 2, 4, 2.0


@dataclass(frozen=True, kw_only=True)
class Singles:
    """The base model and every single effect, fitted; ranking: of nothing missing and the effects.

    intervals: of the parameters of the most probable effect, by profiles, where those were asked for.
    """

    base: Hypothesis
    fitted: list[Hypothesis]
    intervals: dict[str, Limits] = field(default_factory=dict)

    @property
    def ranking(self) -> list[Ranked]:
        """Nothing missing and every effect, the most probable first."""
        return rank(self.base, self.fitted)


def singles(workers: Workers | None, base: Hypothesis, candidates: Sequence[Candidate]) -> Singles:
    """Return the base model and every candidate fitted beside it; the base model may have risen meanwhile.

    Where it has, all is looked at again that may still come near the best; what lies farther behind stays where it
    was, or at its null beside the better base model.
    """
    found: list[Hypothesis] = []
    again = [True] * len(candidates)
    for _ in range(GROUNDS):
        near, promised = _beside(workers, base, candidates, again)
        found = _higher(found, _climbed(workers, near))
        first, before = rank(base, found)[0], base.fit.log_evidence
        if first.name != NOTHING:
            # The base model gets the same chance to arrive as what is held against it.
            base = refit(base, first.best.fit)
        risen = base.fit.log_evidence - before
        if risen < RISEN:
            # What stood where the base model was has not been held against a better one.
            break
        best = max(one.fit.log_evidence for one in found)
        heights = [max(one.fit.log_evidence, height) for one, height in zip(found, promised, strict=True)]
        again = [height + risen > best - OUT_OF_REACH for height in heights]
    return Singles(base=base, fitted=found)


def _beside(
    workers: Workers | None, base: Hypothesis, candidates: Sequence[Candidate], wanted: Sequence[bool]
) -> tuple[list[Hypothesis], list[float]]:
    """Return every candidate beside a base model, near its maximum, and the log evidence that it may come to.

    Those that are not wanted stay at their nulls, and promise nothing. All others are looked at before any is climbed.
    One of the cut alone that promises less than another waits until that is climbed, and where it is out of reach then
    it stays at its null, too.
    """
    nested, numbers = ground(base), range(len(candidates))

    def beside(step: Callable[..., Any], number: int) -> Callable[[], Any]:
        return partial(step, base.comparison, [candidates[number]], nested)

    def answers(doing: str, calls: Mapping[int, Callable[[], Any]]) -> dict[int, Any]:
        jobs = [Job(name=f"{candidates[number]}, {doing}", call=call) for number, call in calls.items()]
        return dict(zip(calls, spread(workers, jobs), strict=True))

    prospects: dict[int, Prospect] = answers("looked at", {i: beside(look, i) for i in numbers if wanted[i]})
    most = max((one.promise for one in prospects.values()), default=0.0)
    later = {i for i, one in prospects.items() if one.is_of_cut and one.hope + CLOSE < most}

    def calls(which: Iterable[int], climbed: Container[int]) -> dict[int, Callable[[], Any]]:
        return {i: partial(pursue, prospects[i]) if i in climbed else beside(stay, i) for i in which}

    found = answers("fitted", calls((i for i in numbers if i not in later), prospects))
    best = max((one.fit.log_evidence for one in found.values()), default=-np.inf) - base.fit.log_evidence
    within_reach = {i for i in later if prospects[i].hope > best - OUT_OF_REACH}
    found |= answers("fitted", calls(later, within_reach))
    promised = [base.fit.log_evidence + prospects[i].hope if i in prospects else -np.inf for i in numbers]
    return [found[i] for i in numbers], promised


def arrived(workers: Workers | None, found: Singles) -> Singles:
    """Return the single effects where no other shape leads above those that are not ruled out, nor a profile the first.

    What is tied with the most probable gets the same chance to arrive as that, and the base model the same as what is
    held against it.
    """
    likely = [one.best for one in not_ruled_out(found.ranking) if one.name != NOTHING]
    again = dict(zip(map(id, likely), _best_shapes(workers, likely), strict=True))
    shaped = replace(found, fitted=[again.get(id(one), one) for one in found.fitted])
    first = shaped.ranking[0].best
    named, limits = profiled(workers, first)
    fitted = [named if one is first else one for one in shaped.fitted]
    settled = all(now is before for now, before in zip(fitted, found.fitted, strict=True))
    base = found.base if settled else refit(found.base, named.fit)
    return Singles(base=base, fitted=fitted, intervals=limits)


def pairs_of(
    workers: Workers | None,
    base: Hypothesis,
    candidates: Sequence[Candidate],
    ranking: Sequence[Ranked],
    *,
    suffices: bool = False,
) -> tuple[list[Ranked], list[Hypothesis]]:
    """Return pairs with the effects that are not ruled out, the best first, and all that were fitted for them.

    None where all effects are ruled out. Seconds are those that promise most beside the first: what a model with
    neither says of them may be nothing. Where the first suffices it is the only one, and they are slight, and have to
    promise anything at all. Of a pair that was met from both of its halves the better fit counts.
    """
    many, amplitudes, least = (1, SLIGHT_AMPLITUDES, SEEN) if suffices else (FIRSTS, AMPLITUDES, -np.inf)
    firsts = [one.best for one in not_ruled_out(ranking) if one.name != NOTHING][:many]
    known = [ground(one) for one in firsts]
    looks = [
        [
            Job(
                name=f"{first.name} and {one}",
                call=partial(look, base.comparison, [*first.candidates, one], beside, amplitudes),
            )
            for one in candidates
            if one.name != first.name
        ]
        for first, beside in zip(firsts, known, strict=True)
    ]
    seen = iter(spread(workers, [job for jobs in looks for job in jobs]))
    prospects = [_worth_fitting([next(seen) for _ in jobs], least) for jobs in looks]
    jobs = [
        Job(name=f"{' and '.join(map(str, one.candidates))}, fitted", call=partial(pursue, one))
        for of_first in prospects
        for one in of_first
    ]
    paired = _once(_climbed(workers, spread(workers, jobs)))
    variants_of = Counter(one.name for one in candidates)
    counts = {pair.name: prod(variants_of[name] for name in pair.names) for pair in paired}
    pairs = [one for one in rank(base, paired, counts) if one.name != NOTHING]
    return sorted(pairs, key=lambda one: -one.gain), paired


def _worth_fitting(prospects: Sequence[Prospect], least: float) -> list[Prospect]:
    """Return those that promise most, in variants of so many effects as SECONDS says, and no less than ``least``."""
    found: list[Prospect] = []
    for one in sorted(prospects, key=lambda prospect: -prospect.hope):
        names = {known.candidates[-1].name for known in found} | {one.candidates[-1].name}
        if len(names) > SECONDS or one.hope < least:
            break
        found.append(one)
    return found


def with_halves_refitted(workers: Workers | None, found: Singles, pair: Ranked) -> Singles:
    """Return the single effects, both halves of a pair that leads fitted again from the pair's place.

    A pair that is held against a half that had not arrived gains what the half has missed. What promised little where
    the base model has come to was not climbed, and may be all that is missing: the other half has led there.
    """
    which = {str(candidate) for candidate in pair.best.candidates}
    halves = [one for one in found.fitted if str(one.candidates[-1]) in which]
    jobs = [Job(name=f"{one.name}, from the pair", call=partial(refit, one, pair.best.fit)) for one in halves]
    again = dict(zip(map(id, halves), spread(workers, jobs), strict=True))
    return replace(found, fitted=[again.get(id(one), one) for one in found.fitted])


def taken_over(
    workers: Workers | None, base: Hypothesis, candidates: Sequence[Candidate], pairs: Sequence[Hypothesis]
) -> Singles:
    """Return the single effects beside a base model that has gained one, from the pairs that were fitted with it.

    What promised too little beside it to be fitted stays at its null, and so does what was fitted and came to stand
    there: what such a pair has gained is the base model's, which gets the same chance to arrive as what is held against
    it.
    """
    for alike in ([one for one in pairs if one.moved], [one for one in pairs if not one.moved]):
        if alike:
            base = refit(base, max(alike, key=lambda pair: pair.fit.log_evidence).fit)
    known, paired = ground(base), {str(one): pair for pair in pairs if pair.moved for one in pair.candidates}
    jobs = [
        Job(name=str(one), call=partial(_taken_over, base.comparison, one, known, paired.get(str(one))))
        for one in candidates
    ]
    return Singles(base=base, fitted=spread(workers, jobs))


def _taken_over(base: Comparison, candidate: Candidate, nested: Ground, pair: Hypothesis | None) -> Hypothesis:
    """Return an effect beside a model, fitted again from where a pair was, or at its null."""
    at_null = stay(base, [candidate], nested)
    return at_null if pair is None else refit(at_null, pair.fit)


def _best_shapes(workers: Workers | None, likely: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return hypotheses of one effect, each fitted again from all other shapes of it where one of them leads higher.

    All are climbed from, and at once to the end: where the posterior is rough neither what a place promises nor how far
    one Jacobian leads from it says where a climb ends.
    """
    others = [other_shapes(one.comparison, one.fit.estimate, one.candidates[-1]) for one in likely]
    jobs = [
        Job(name=f"{one.name}, from another shape", call=partial(refit_from, one, start))
        for one, starts in zip(likely, others, strict=True)
        for start in starts
    ]
    again = iter(spread(workers, jobs))
    found = [[one, *(next(again) for _ in starts)] for one, starts in zip(likely, others, strict=True)]
    return [max(of_one, key=lambda one: one.fit.log_posterior) for of_one in found]


def _higher(before: Sequence[Hypothesis], now: list[Hypothesis]) -> list[Hypothesis]:
    """Return of every candidate the better of two fits; none may have been fitted before.

    A second look, beside a better base model, need not come upon what the first one did.
    """
    if not before:
        return now
    return [max(pair, key=lambda one: one.fit.log_posterior) for pair in zip(before, now, strict=True)]


def _once(pairs: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return every pair of effects in its variants once, as it was fitted best."""
    best: dict[tuple[str, ...], Hypothesis] = {}
    for one in sorted(pairs, key=lambda pair: pair.fit.log_evidence):
        best[tuple(sorted(str(candidate) for candidate in one.candidates))] = one
    return list(best.values())


def _climbed(workers: Workers | None, near: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return hypotheses, fitted to their end where an effect has left its null and they come near the best."""
    found, ended = list(near), {index for index, one in enumerate(near) if not one.moved}
    while True:
        best = max((one.fit.log_evidence for one in found), default=0.0)
        close = [i for i, one in enumerate(found) if i not in ended and one.fit.log_evidence > best - CLOSE]
        if not close:
            return found
        jobs = [Job(name=f"{found[i].name}, to its end", call=partial(refit, found[i], found[i].fit)) for i in close]
        for index, one in zip(close, spread(workers, jobs), strict=True):
            found[index] = one
            ended.add(index)
