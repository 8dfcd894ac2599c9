"""Verdicts: five answers, each for its own reasons; rankings that are tempered and count variants fairly."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.stats import norm

from chatter_core.effects import effect_names
from chatter_core.evidence.failures import Failure
from chatter_core.evidence.power import ENOUGH, USUAL
from chatter_core.evidence.ranking import NOTHING, NOTHING_MISSING, TEMPER, Ranked, rank
from chatter_core.evidence.verdict import NAMED, PAIR_GAIN, decide, leading_pair, led


@dataclass(frozen=True)
class Named:
    """Stands for a candidate, a hypothesis or a fit as far as a verdict looks at them."""

    name: str = ""
    names: tuple[str, ...] = ()
    log_evidence: float = 0.0
    fit: "Named | None" = None


@dataclass(frozen=True)
class Seen:
    """Stands for the power of a candidate."""

    candidate: Named
    nats: float


def ranked(name, probability, gain):
    return Ranked(name=name, probability=probability, gain=gain, best=Named(names=tuple(name.split(" + "))))


def failure(chance):
    return Failure(quantity="outcome", band={}, excess=0.3, chance=chance, text="It fails there.")


POWERFUL = [Seen(Named(name), 50.0) for name in "abcd"]
BLIND = [Seen(Named(name), 50.0 if name == "a" else 0.5 * ENOUGH) for name in "abcd"]
NOTHING_LEFT: dict[str, list[Failure]] = {
    name: [] for name in (NOTHING, "a", "b", "c", "a + b", "a + c", "b + c", "b + d")
}


def decided(ranking, *pairs, powers=POWERFUL, **left):
    everything = {**NOTHING_LEFT, **left}
    return decide(ranking, led(pairs, everything), powers, everything)


def test_nothing_is_missing_where_it_would_have_been_seen():
    found = decided([ranked(NOTHING, 0.9, 0.0), ranked("a", 0.1, -1.0)])
    assert (found.kind, found.missing) == ("none", ())


def test_nothing_seen_by_measurements_that_are_blind_is_no_answer():
    assert decided([ranked(NOTHING, 0.9, 0.0), ranked("a", 0.1, -1.0)], powers=BLIND).kind == "underpowered"


def test_what_would_not_have_been_seen_is_told_by_its_variant_where_another_would_have_been():
    class Variant(Named):
        def __str__(self):
            return f"{self.name} ({self.names[0]})"

    powers = [Seen(Variant(name, (axis,)), nats) for name, axis, nats in (("a", "x", 50.0), ("a", "y", 1.0))]
    powers += [Seen(Variant("b", ("x",)), 1.0), Seen(Variant("b", ("y",)), 2.0)]
    found = decided([ranked(NOTHING, 0.9, 0.0), ranked("a", 0.1, -1.0)], powers=powers)
    assert found.text.endswith("Not seen at their usual size would be a (y), b.")


def test_what_fails_without_any_candidate_that_helps_is_unexplained():
    found = decided([ranked(NOTHING, 0.9, 0.0), ranked("a", 0.1, -1.0)], **{NOTHING: [failure(0.001)]})
    assert found.kind == "unexplained"
    assert "It fails there." in found.text
    # What chance explains once in a hundred is no failed check.
    assert decided([ranked(NOTHING, 0.9, 0.0), ranked("a", 0.1, -1.0)], **{NOTHING: [failure(0.01)]}).kind == "none"


def test_an_effect_is_named_when_it_is_probable_and_suffices():
    found = decided([ranked("a", 0.95, 20.0), ranked("b", 0.05, 14.0), ranked(NOTHING, 0.0, 0.0)])
    assert (found.kind, found.missing) == ("effect", ("a",))
    assert decided([ranked("a", 0.95, 20.0), ranked(NOTHING, 0.05, 0.0)], a=[failure(0.001)]).kind == "unexplained"


def test_effects_that_data_cannot_part_are_tied():
    found = decided([ranked("b", 0.5, 20.0), ranked("a", 0.45, 19.8), ranked(NOTHING, 0.05, 0.0)])
    assert (found.kind, found.missing) == ("ambiguous", ("b", "a"))


def test_too_many_or_nothing_among_them_is_no_tie():
    many = [ranked(name, 0.25, 9.0) for name in "abcd"]
    assert decided([*many, ranked(NOTHING, 0.0, 0.0)]).kind == "underpowered"
    assert decided([ranked("a", 0.6, 3.5), ranked(NOTHING, 0.4, 0.0)]).kind == "underpowered"


def test_two_effects_are_named_when_the_first_fails_and_both_gain():
    ranking, left = [ranked("a", 0.99, 20.0), ranked(NOTHING, 0.01, 0.0)], {"a": [failure(0.001)]}
    found = decided(ranking, ranked("a + b", 1.0, 40.0), **left)
    assert (found.kind, found.missing) == ("effect", ("a", "b"))
    # A second one that gains little does not mend what fails.
    assert decided(ranking, ranked("a + b", 1.0, 27.0), **left).kind == "unexplained"
    still = {**left, "a + b": [failure(0.001)]}
    assert decided(ranking, ranked("a + b", 1.0, 40.0), **still).kind == "unexplained"


def test_a_second_effect_needs_about_what_one_needs_beside_nothing():
    others = [hypothesis(name, 0.0) for name in effect_names() if name != "higher_modes"]
    named = [
        gain
        for gain in np.arange(0.0, 20.0, 0.1)
        if rank(hypothesis("", 0.0), [hypothesis("a", gain), *others[1:]])[0].probability >= NAMED
    ]
    # Those that gain nothing have the null's evidence here, and mostly less: by a few tenths of a nat.
    assert min(named) == pytest.approx(PAIR_GAIN, abs=0.5)


def test_of_two_pairs_that_gain_alike_neither_is_named():
    ranking, left = [ranked("a", 0.99, 20.0), ranked(NOTHING, 0.01, 0.0)], {"a": [failure(0.001)]}
    found = decided(ranking, ranked("a + b", 1.0, 40.0), ranked("a + c", 1.0, 39.0), **left)
    assert (found.kind, found.missing) == ("ambiguous", ("a", "b", "c"))
    found = decided(ranking, ranked("a + b", 1.0, 40.0), ranked("a + c", 1.0, 30.0), **left)
    assert (found.kind, found.missing) == ("effect", ("a", "b"))


def test_a_pair_is_held_against_its_better_half_and_against_pairs_without_the_first():
    left = {"a": [failure(0.001)], NOTHING: [failure(0.001)]}
    # Where two effects are as good as tied, so are the pairs with a third.
    close = [ranked("a", 0.5, 20.0), ranked("b", 0.49, 19.97), ranked(NOTHING, 0.01, 0.0)]
    found = decided(close, ranked("a + c", 1.0, 29.0), ranked("b + c", 1.0, 28.0), **left)
    assert (found.kind, found.missing) == ("ambiguous", ("a", "b", "c"))
    assert found.text.startswith("c is missing, and with it one of a, b")
    found = decided(close, ranked("a + c", 1.0, 29.0), ranked("b + d", 1.0, 28.0), **left)
    assert found.missing == ("a", "b", "c", "d")
    assert found.text.startswith("Two effects are missing, a and c, or b and d, which")
    found = decided(close, ranked("a + c", 1.0, 29.0), ranked("b + c", 1.0, 21.0), **left)
    assert (found.kind, found.missing) == ("effect", ("a", "c"))
    # Over nothing missing a pair may gain what its better half gains alone.
    nothing = [ranked(NOTHING, 0.5, 0.0), ranked("a", 0.45, 3.5)]
    assert decided(nothing, ranked("a + c", 1.0, 10.0), **left).kind == "unexplained"
    assert decided(nothing, ranked("a + c", 1.0, 12.0), **left).missing == ("a", "c")


def test_a_pair_that_leaves_checks_failed_is_not_tied_with_one_that_leaves_none():
    ranking = [ranked("a", 0.99, 20.0), ranked(NOTHING, 0.01, 0.0)]
    pairs = [ranked("a + b", 1.0, 40.0), ranked("a + c", 1.0, 39.0)]
    failed = [failure(0.001)]
    # With checks that the first leaves failed, and as a second beside one that suffices.
    for left in ({"a": failed, "a + c": failed}, {"a + c": failed}):
        found = decided(ranking, *pairs, **left)
        assert (found.kind, found.missing) == ("effect", ("a", "b"))
    assert decided(ranking, *pairs, a=failed).kind == "ambiguous"


def test_of_pairs_that_gain_alike_one_that_leaves_no_check_failed_leads():
    ranking, failed = [ranked("a", 0.99, 20.0), ranked(NOTHING, 0.01, 0.0)], [failure(0.001)]
    pairs = [ranked("a + b", 1.0, 40.0), ranked("a + c", 1.0, 39.0), ranked("b + c", 1.0, 30.0)]
    left = {"a": failed, "a + b": failed}
    found = decided(ranking, *pairs, **left)
    assert (found.kind, found.missing) == ("effect", ("a", "c"))
    assert "39 nats" in found.text
    # What gains about as much as the one that leads is tied with it, though it gains less than the best.
    found = decided(ranking, *pairs[:2], ranked("b + c", 1.0, 37.0), **left)
    assert (found.kind, found.missing) == ("ambiguous", ("a", "b", "c"))
    # One that gains far less does not lead, whatever it leaves.
    assert decided(ranking, *pairs, **left, **{"a + c": failed}).kind == "unexplained"


def test_what_stands_out_is_named_although_it_leaves_something_open():
    ranking, left = [ranked("a", 0.99, 40.0), ranked("b", 0.01, 10.0), ranked(NOTHING, 0.0, 0.0)], [failure(0.001)]
    found = decided(ranking, a=left)
    assert (found.kind, found.missing) == ("effect", ("a",))
    assert found.text.endswith("It does not explain everything, a check still fails: It fails there.")
    # Not where another comes near, nor where what fails says that the law is another.
    assert decided([ranking[0], ranked("b", 0.01, 16.0), ranking[2]], a=left).kind == "unexplained"
    assert decided(ranking, a=[failure(0.001), failure(1e-7)]).kind == "unexplained"
    assert decided([ranked(NOTHING, 0.99, 0.0), ranked("a", 0.01, -30.0)], **{NOTHING: left}).kind == "unexplained"


def test_of_a_pair_that_stands_out_nothing_without_either_half_comes_near():
    ranking = [ranked("a", 0.99, 40.0), ranked("b", 0.01, 10.0), ranked(NOTHING, 0.0, 0.0)]
    left = {"a": [failure(0.001)], "a + b": [failure(0.001), failure(0.002)]}
    found = decided(ranking, ranked("a + b", 1.0, 70.0), ranked("a + c", 1.0, 44.0), **left)
    assert (found.kind, found.missing) == ("effect", ("a", "b"))
    assert "2 checks still fail" in found.text
    # However much a second one gains, it does not take the first back.
    for pairs in ([ranked("a + b", 1.0, 70.0), ranked("a + c", 1.0, 46.0)], [ranked("a + b", 1.0, 64.0)]):
        found = decided(ranking, *pairs, **left)
        assert (found.kind, found.missing) == ("effect", ("a",))
        assert "a check still fails" in found.text
        # Whoever asks which answer leads is told the same.
        assert leading_pair(ranking, pairs, {**NOTHING_LEFT, **left}) is None
    near = [ranked("a", 0.99, 40.0), ranked("b", 0.01, 16.0), ranked(NOTHING, 0.0, 0.0)]
    assert decided(near, ranked("a + b", 1.0, 64.0), **left).kind == "unexplained"


def test_a_second_effect_is_named_beside_one_that_suffices_only_where_it_is_seen():
    ranking = [ranked("a", 0.99, 40.0), ranked("b", 0.01, 5.0), ranked(NOTHING, 0.0, 0.0)]
    assert decided(ranking, ranked("a + b", 1.0, 49.0), ranked("a + c", 1.0, 44.0)).missing == ("a", "b")
    for pairs, left in (
        ([ranked("a + b", 1.0, 47.0)], {}),
        ([ranked("a + b", 1.0, 60.0), ranked("a + c", 1.0, 58.0)], {}),
        ([ranked("a + b", 1.0, 60.0)], {"a + b": [failure(0.001)]}),
        # Without the first it is no second.
        ([ranked("b + c", 1.0, 60.0)], {"b + c": []}),
    ):
        found = decided(ranking, *pairs, **left)
        assert (found.kind, found.missing) == ("effect", ("a",))


def test_what_is_ruled_out_does_not_keep_anything_from_being_unexplained():
    ranking = [ranked("a", 0.79, 20.0), ranked("b", 0.2099, 18.0), ranked(NOTHING, 1e-4, 0.0)]
    left = {"a": [failure(0.001)], "b": [failure(0.001)]}
    assert decided(ranking, **left).kind == "unexplained"
    assert decided(ranking, a=[failure(0.001)]).kind == "ambiguous"


def test_unexplained_is_not_said_where_one_that_is_not_ruled_out_passes():
    left = {"a": [failure(0.001)]}
    tied = [ranked("a", 0.5, 20.0), ranked("b", 0.48, 20.0), ranked(NOTHING, 0.02, 0.0)]
    found = decided(tied, **left)
    # What leaves no check failed stands for both.
    assert (found.kind, found.missing) == ("ambiguous", ("b", "a"))
    assert found.text.endswith("A check still fails with a, and none with b: It fails there.")
    ruled_out = [ranked("a", 0.9, 20.0), ranked("b", 0.1, 15.0)]
    assert decided(ruled_out, **left).kind == "unexplained"
    for probability in (0.5, 0.85):
        nothing = [ranked(NOTHING, probability, 0.0), ranked("a", 0.98 - probability, 4.0)]
        found = decided(nothing, **{NOTHING: [failure(0.001)]})
        assert found.kind == "underpowered"
        assert found.text.endswith("A check still fails with the base model, and none with a: It fails there.")


def test_nothing_is_not_said_where_effects_together_are_more_probable():
    found = decided([ranked(NOTHING, 0.36, 0.0), ranked("a", 0.32, 2.0), ranked("b", 0.32, 2.0)])
    assert found.kind == "underpowered"
    assert found.text == "a or b may be missing, or nothing: 0.32 and 0.32 against 0.36."
    found = decided([ranked("a", 0.41, 4.0), ranked(NOTHING, 0.5, 0.0), ranked("b", 0.09, 1.0)])
    assert found.text == "a may be missing, or nothing: 0.41 against 0.50."


def test_where_no_effect_stands_out_that_is_said():
    even = [ranked(NOTHING, 0.46, 0.0), *(ranked(name, 0.09, 0.0) for name in "abcdef")]
    found = decided(even)
    assert found.kind == "underpowered"
    assert found.text == (
        "An effect may be missing, 0.54 against 0.46 for nothing, but none stands out: the most probable, a, has 0.09."
    )
    # Where hardly any would have been seen that is why.
    assert decided(even, powers=BLIND).text == (
        f"{found.text} These measurements cannot tell: of 4 effects, 1 would have been seen at their usual size."
    )


def test_effects_that_are_improbable_one_by_one_are_told_together():
    ranking = [ranked(NOTHING, 0.43, 0.0), ranked("a", 0.12, 2.0), *(ranked(name, 0.09, 0.0) for name in "bcdef")]
    assert decided(ranking).text == "a may be missing, or nothing: 0.12 against 0.43, and 0.45 for all other effects."


def test_variants_that_were_not_fitted_count():
    found = rank(hypothesis("", 0.0), [hypothesis("a + b", 15.0)], {"a + b": 6})
    assert found[0].gain == pytest.approx(15.0 - np.log(6.0))


def hypothesis(name, evidence):
    return Named(name=name, fit=Named(log_evidence=evidence))


def test_ranking_tempers_evidence_and_prefers_nothing():
    found = rank(hypothesis("", 10.0), [hypothesis("a", 18.0), hypothesis("b", 12.0)])
    weights = np.exp([TEMPER * 8.0, TEMPER * 2.0, NOTHING_MISSING])
    assert [one.name for one in found] == ["a", NOTHING, "b"]
    assert [one.probability for one in found] == pytest.approx(weights[[0, 2, 1]] / weights.sum())


def test_variants_share_the_prior_of_their_effect():
    one = rank(hypothesis("", 0.0), [hypothesis("a", 15.0)])
    two = rank(hypothesis("", 0.0), [hypothesis("a", 15.0), hypothesis("a", -50.0)])
    assert one[0].gain == pytest.approx(15.0)
    # Of two variants one explains nothing: half the prior is lost.
    assert two[0].gain == pytest.approx(15.0 - np.log(2.0))
    assert two[0].best.fit.log_evidence == 15.0


def named_in(nats: float) -> float:
    """Return how often an effect of usual size that leaves so much is named, alone against nothing missing.

    One datum of unit noise, g times a strength whose prior is half-normal with unit width; its evidence is exact.
    """
    slope = math.sqrt(2.0 * nats) / USUAL
    datum = np.linspace(0.0, 4.0 * math.sqrt(2.0 * nats), 100001)
    scaled = slope * datum / math.sqrt(1.0 + slope**2)
    gain = math.log(2.0) - 0.5 * math.log1p(slope**2) + 0.5 * scaled**2 + norm.logcdf(scaled)
    named = TEMPER * gain - NOTHING_MISSING >= math.log(NAMED / (1.0 - NAMED))
    return float(norm.sf(datum[np.argmax(named)] - math.sqrt(2.0 * nats)))


def test_what_counts_as_seen_is_mostly_named():
    assert named_in(ENOUGH) == pytest.approx(2.0 / 3.0, abs=0.05)
    assert named_in(0.5 * ENOUGH) < 0.3
