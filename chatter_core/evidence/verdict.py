"""What a campaign says is missing in a model: one of five answers, and none of them is forced.

``none``: what is left is what noise explains. ``effect``: this one, or these two. ``ambiguous``: one of these,
which the data cannot part. ``unexplained``: something is left that no candidate mends. ``underpowered``: these
measurements could not have shown it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from chatter_core.evidence.failures import Failure
from chatter_core.evidence.power import ENOUGH, Power
from chatter_core.evidence.ranking import NOTHING, Ranked

#: An effect is named when it has this probability; several are tied when they have it together.
NAMED, TIED_TOGETHER = 0.8, 0.9
#: An answer that is more probable than this is not ruled out.
POSSIBLE = 0.1
#: That nothing is missing is said when it is more probable than all effects together.
NOTHING_NAMED = 0.5
#: More than this many are not a tie but ignorance.
MOST_TIED = 3
#: A pair is named when it gains so much over its better half, and over the first of the ranking [nats]: about what one
#: effect needs to be named beside nothing, for a second one is one of as many.
PAIR_GAIN = 8.0
#: Pairs that gain less than this over one another are tied [nats].
PAIR_LEAD = 2.5
#: What is left counts as a failed check when it is so improbable by chance.
CHECK_CHANCE = 0.002
#: Where checks fail, what is best is named all the same if every answer that lacks any of it gains so much less [nats]:
#: a law that leaves something open is the right one for most of what is seen. Not where a check fails by such a chance:
#: then the law is another.
OUTSTANDING, GROSS_CHANCE = 25.0, 1e-6
#: Nothing can be said to be missing when fewer candidates than this share would have been seen.
SEEN_SHARE = 0.5


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """The answer.

    kind: one of the five; missing: names, none unless kind is effect or ambiguous, of tied effects the one first that
    is to stand for them; text: why.
    """

    kind: str
    missing: tuple[str, ...]
    text: str


def failed_checks(left: Sequence[Failure]) -> list[Failure]:
    """Return the failures that a right model would hardly show.

    See docs/physics.md#diagnosis.
    """
    return [failure for failure in left if failure.chance <= CHECK_CHANCE]


def not_ruled_out(ranking: Sequence[Ranked]) -> list[Ranked]:
    """Return the answers that are possible, nothing missing perhaps among them: the first, and all that are likely.

    See docs/physics.md#diagnosis.
    """
    return [one for one in ranking if one is ranking[0] or one.probability > POSSIBLE]


def is_sure(ranking: Sequence[Ranked]) -> bool:
    """Return whether one effect is probable enough to be named, whatever else it leaves.

    See docs/physics.md#diagnosis.
    """
    return ranking[0].name != NOTHING and ranking[0].probability >= NAMED


def leading_pair(
    ranking: Sequence[Ranked], pairs: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]
) -> Ranked | None:
    """Return the first of pairs where it gains enough over what is simpler, else None; pairs: as ``led`` has them.

    Where the first suffices, a second effect has to be seen beside it, and not only one of several. Where the first
    stands out, none that leaves checks failed takes it back, unless it stands out itself.

    See docs/physics.md#diagnosis.
    """
    if not pairs:
        return None
    first = pairs[0]
    simpler = [ranking[0], *(one for one in ranking if one.name in first.best.names)]
    if first.gain <= max(one.gain for one in simpler) + PAIR_GAIN:
        return None
    if failed_checks(left[ranking[0].name]):
        return None if _takes_back(first, ranking, pairs, left) else first
    is_second = ranking[0].name in first.best.names and len(_tied(pairs, left)) == 1
    return first if is_second and not failed_checks(left[first.name]) else None


def decide(
    ranking: Sequence[Ranked],
    pairs: Sequence[Ranked],
    powers: Sequence[Power],
    left: Mapping[str, Sequence[Failure]],
) -> Verdict:
    """Return the verdict.

    ranking: nothing missing and single effects, the most probable first; pairs: those that were tried, as ``led`` has
    them; powers: of all candidates; left: where nothing missing, those that are not ruled out and the pairs that come
    close to the best still fail, by name.

    See docs/physics.md#diagnosis.
    """
    first = ranking[0]
    pair = leading_pair(ranking, pairs, left)
    best = pair or first
    checks = failed_checks(left[best.name])
    if checks and (pair is not None or not _another_suffices(ranking, left)):
        if not _stands_out(best, [*ranking, *pairs], checks):
            return _unexplained(best, checks)
        return _with_rest(_named(ranking) if pair is None else _two(pairs, left), checks)
    if pair is not None:
        return _two(pairs, left)
    if not checks:
        return _nothing(ranking, powers) if first.name == NOTHING else _named(ranking)
    return _doubted(_perhaps(ranking) if first.name == NOTHING else _named(ranking), ranking, left)


def _doubted(verdict: Verdict, ranking: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]) -> Verdict:
    """Return a verdict that says with which of the possible answers a check fails, and with which none does."""
    fails = {one.name: failed_checks(left[one.name]) for one in not_ruled_out(ranking)}
    failing, passing = ([name for name in fails if bool(fails[name]) is does] for does in (True, False))
    model = {NOTHING: "the base model"}
    with_which, not_with = (" and ".join(model.get(name, name) for name in names) for names in (failing, passing))
    text = (
        f"{verdict.text} A check still fails with {with_which}, and none with {not_with}: {fails[failing[0]][0].text}"
    )
    missing = tuple(sorted(verdict.missing, key=lambda name: name not in passing))
    return Verdict(kind=verdict.kind, missing=missing, text=text)


def _another_suffices(ranking: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]) -> bool:
    """Return whether one that the first does not rule out passes every check; an effect that is named rules out all."""
    return not is_sure(ranking) and any(not failed_checks(left[one.name]) for one in not_ruled_out(ranking)[1:])


def _takes_back(
    pair: Ranked, ranking: Sequence[Ranked], pairs: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]
) -> bool:
    """Return whether the first stands out, and a pair in its place would be unexplained; both fail checks then."""
    answers, checks = [*ranking, *pairs], failed_checks(left[pair.name])
    return (
        bool(checks)
        and not _stands_out(pair, answers, checks)
        and _stands_out(ranking[0], answers, failed_checks(left[ranking[0].name]))
    )


def _stands_out(one: Ranked, answers: Sequence[Ranked], checks: Sequence[Failure]) -> bool:
    """Return whether no answer that lacks any effect of one comes near it, and no check fails grossly."""
    if one.name == NOTHING or min(check.chance for check in checks) < GROSS_CHANCE:
        return False
    lacking = [other.gain for other in answers if not set(one.best.names) <= set(other.best.names)]
    return one.gain > max(lacking) + OUTSTANDING


def _with_rest(verdict: Verdict, checks: Sequence[Failure]) -> Verdict:
    """Return a verdict that says that checks still fail."""
    text = f"{verdict.text} It does not explain everything, {_still(checks)}: {checks[0].text}"
    return Verdict(kind=verdict.kind, missing=verdict.missing, text=text)


def _unexplained(best: Ranked, checks: Sequence[Failure]) -> Verdict:
    with_what = "" if best.name == NOTHING else f": with {best.name}, the best of them, {_still(checks)}"
    text = f"Something is missing that no candidate explains{with_what}. {checks[0].text}"
    return Verdict(kind="unexplained", missing=(), text=text)


def _still(checks: Sequence[Failure]) -> str:
    """Return in words how many checks still fail."""
    return "a check still fails" if len(checks) == 1 else f"{len(checks)} checks still fail"


def close_pairs(pairs: Sequence[Ranked]) -> list[Ranked]:
    """Return the pairs that gain about as much as the best of them, and as the first; none without any.

    See docs/physics.md#diagnosis.
    """
    least = min(max(one.gain for one in pairs), pairs[0].gain) - PAIR_LEAD if pairs else 0.0
    return [one for one in pairs if one.gain > least]


def led(pairs: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]) -> list[Ranked]:
    """Return pairs with the one first that leads: of those that gain about as much, one that leaves no check failed.

    pairs: the best first, which leads where none of the close ones passes; left: what those still fail, by name.

    See docs/physics.md#diagnosis.
    """
    passing = [one for one in close_pairs(pairs) if not failed_checks(left[one.name])]
    return sorted(pairs, key=lambda one: one is not passing[0]) if passing else list(pairs)


def _tied(pairs: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]) -> list[Ranked]:
    """Return the leading pair and those that neither gains nor checks part from it."""
    first = pairs[0]
    others = [one for one in close_pairs(pairs) if one is not first]
    return [first, *(one for one in others if failed_checks(left[first.name]) or not failed_checks(left[one.name]))]


def _two(pairs: Sequence[Ranked], left: Mapping[str, Sequence[Failure]]) -> Verdict:
    """Return the two effects that are named, or those that are tied."""
    tied = _tied(pairs, left)
    names = tuple(sorted({name for one in tied for name in one.best.names}))
    if len(tied) == 1:
        text = f"Two effects are missing, {' and '.join(names)}: together they gain {pairs[0].gain:.0f} nats."
        return Verdict(kind="effect", missing=names, text=text)
    common = set.intersection(*(set(one.best.names) for one in tied))
    if common:
        seconds = [name for name in names if name not in common]
        what = f"{min(common)} is missing, and with it one of {', '.join(seconds)}"
    else:
        what = f"Two effects are missing, {', or '.join(' and '.join(one.best.names) for one in tied)}"
    text = f"{what}, which these measurements cannot part."
    return Verdict(kind="ambiguous", missing=names, text=text)


def _nothing(ranking: Sequence[Ranked], powers: Sequence[Power]) -> Verdict:
    first, too_few = ranking[0], _too_few_seen(powers)
    if first.probability < NOTHING_NAMED:
        perhaps = _perhaps(ranking)
        return replace(perhaps, text=f"{perhaps.text} {too_few}".rstrip())
    if too_few:
        return Verdict(kind="underpowered", missing=(), text=too_few)
    # Of an effect of which some variants would have been seen the others are told.
    seen, blind = _seen(powers), [power for power in powers if power.nats < ENOUGH]
    told = {power.candidate.name if power.candidate.name not in seen else str(power.candidate) for power in blind}
    unseen = f" Not seen at their usual size would be {', '.join(sorted(told))}." if told else ""
    text = f"Nothing is missing that these measurements show (probability {first.probability:.2f}).{unseen}"
    return Verdict(kind="none", missing=(), text=text)


def _seen(powers: Sequence[Power]) -> set[str]:
    """Return the effects of which a variant would have been seen."""
    return {power.candidate.name for power in powers if power.nats >= ENOUGH}


def _too_few_seen(powers: Sequence[Power]) -> str:
    """Return that too few effects would have been seen to say that nothing is missing, "" where enough would have."""
    seen, all_of_them = len(_seen(powers)), len({power.candidate.name for power in powers})
    if seen >= SEEN_SHARE * all_of_them:
        return ""
    return f"These measurements cannot tell: of {all_of_them} effects, {seen} would have been seen at their usual size."


def _perhaps(ranking: Sequence[Ranked]) -> Verdict:
    """Return that an effect may be missing, one of those that are possible, or nothing."""
    effects = [one for one in ranking if one.name != NOTHING]
    possible = [one for one in effects if one.probability > POSSIBLE]
    nothing = _of_nothing(ranking)
    if possible:
        names = " or ".join(one.name for one in possible)
        shares = " and ".join(f"{one.probability:.2f}" for one in possible)
        rest = 1.0 - nothing - sum(one.probability for one in possible)
        others = f", and {rest:.2f} for all other effects" if rest > POSSIBLE else ""
        text = f"{names} may be missing, or nothing: {shares} against {nothing:.2f}{others}."
    else:
        text = (
            f"An effect may be missing, {1.0 - nothing:.2f} against {nothing:.2f} for nothing, but none stands out: "
            f"the most probable, {effects[0].name}, has {effects[0].probability:.2f}."
        )
    return Verdict(kind="underpowered", missing=(), text=text)


def _named(ranking: Sequence[Ranked]) -> Verdict:
    """Return the effect that is named, or those that are tied."""
    first = ranking[0]
    if first.probability >= NAMED:
        text = (
            f"{first.name} is missing: probability {first.probability:.2f}, {first.gain:.1f} nats over the base model."
        )
        return Verdict(kind="effect", missing=(first.name,), text=text)
    tied, together = [], 0.0
    for one in ranking[:MOST_TIED]:
        tied.append(one.name)
        together += one.probability
        if together >= TIED_TOGETHER:
            break
    if NOTHING in tied:
        return _perhaps(ranking)
    if together < TIED_TOGETHER:
        text = f"Too many effects could be missing to name them: {', '.join(tied)} and others."
        return Verdict(kind="underpowered", missing=(), text=text)
    text = f"One of {', '.join(tied)} is missing; these measurements cannot part them."
    return Verdict(kind="ambiguous", missing=tuple(tied), text=text)


def _of_nothing(ranking: Sequence[Ranked]) -> float:
    return next(one.probability for one in ranking if one.name == NOTHING)
