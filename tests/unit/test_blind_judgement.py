"""The judgement of the hidden-effect test, on made-up answers whose worth is known, and against published intervals."""

import math

import numpy as np
import pytest

from benchmarks.blind.choosing import Numbers, disagreeing, grid, log_score, replay, replayed
from benchmarks.blind.judgement import (
    Case,
    balanced_error,
    calibration_error,
    confusion,
    reliability,
    share,
    stating,
    word_of,
)
from benchmarks.blind.shared_amplitudes import cosine, covered, true_amplitudes
from benchmarks.blind.summary import by_data, by_effect, by_strength, difference, row_of
from benchmarks.blind.targets import mean_interval, targets
from chatter_core.evidence.ranking import NOTHING_MISSING, TEMPER


def case(kind, verdict, *missing, effects=(), **known):
    """A case; what is hidden by its names."""
    return Case(seed=1, kind=kind, effects=tuple(effects), verdict=verdict, missing=missing, **known)


@pytest.mark.parametrize(
    ("hits", "count", "low", "high"),
    # R. G. Newcombe, Stat. Med. 17 (1998) 857-872, table I, method 3: given to four digits.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_shares_have_wilsons_interval(hits, count, low, high):
    found = share(hits, count)
    assert found.value == pytest.approx(hits / count)
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)


def test_a_share_of_nothing_may_be_anything():
    found = share(0, 0)
    assert math.isnan(found.value)
    assert (found.low, found.high) == (0.0, 1.0)


def test_a_difference_of_shares_has_the_published_interval():
    # R. G. Newcombe, Stat. Med. 17 (1998) 873-890, table II, method 10: 56/70 - 48/80.
    value, low, high = difference(share(56, 70), share(48, 80))
    assert value == pytest.approx(0.2)
    assert (low, high) == pytest.approx((0.0524, 0.3339), abs=5e-5)


WORTH = [
    (case("none", "none"), "right"),
    (case("none", "underpowered"), "underpowered"),
    (case("none", "unexplained"), "unexplained"),
    (case("none", "effect", "a"), "wrong"),
    (case("none", "ambiguous", "a", "b"), "wrong_tie"),
    (case("one", "effect", "a", effects="a"), "right"),
    (case("one", "effect", "b", effects="a"), "wrong"),
    (case("one", "effect", "a", "b", effects="a"), "wrong"),
    (case("one", "ambiguous", "a", "b", effects="a"), "tied"),
    (case("one", "ambiguous", "b", "c", effects="a"), "wrong_tie"),
    (case("one", "none", effects="a"), "missed"),
    (case("one", "underpowered", effects="a"), "underpowered"),
    (case("one", "failed", effects="a"), "failed"),
    (case("two", "effect", "a", "b", effects="ba"), "right"),
    (case("two", "effect", "a", effects="ab"), "part"),
    (case("two", "effect", "a", "c", effects="ab"), "wrong"),
    (case("two", "ambiguous", "a", "c", effects="ab"), "tied"),
    (case("foreign", "unexplained", effects=["warm_up"]), "right"),
    (case("foreign", "effect", "thermal_preload", effects=["warm_up"]), "near"),
    (case("foreign", "effect", "ring_expansion", effects=["warm_up"]), "wrong"),
    (case("foreign", "effect", "workpiece_mode", effects=["workpiece_pair"]), "near"),
    # Sure of another effect beside the near one: the other is not there.
    (case("foreign", "effect", "thermal_preload", "tool_runout", effects=["warm_up"]), "wrong"),
    (case("foreign", "effect", "thermal_preload", effects=["tool_wear"]), "wrong"),
    (case("foreign", "none", effects=["tool_wear"]), "missed"),
    (case("foreign", "ambiguous", "a", "b", effects=["tool_wear"]), "wrong_tie"),
]


@pytest.mark.parametrize(("answered", "word"), WORTH)
def test_an_answer_is_worth_a_word(answered, word):
    assert word_of(answered) == word


def test_a_row_counts_every_case_once():
    row = row_of("table", "all", [answered for answered, _ in WORTH])
    counts = {word: sum(one == word for _, one in WORTH) for _, word in WORTH}
    assert row["count"] == len(WORTH)
    assert {word: row[word] for word in counts} == counts


def test_calibration_error_of_a_constructed_set():
    # Four at 0.75 of which three are right, and two at 0.95 of which one is: (4 * 0 + 2 * 0.45) / 6.
    bins = reliability([0.75] * 4 + [0.95] * 2, [True] * 3 + [False] + [True, False])
    assert [(one.low, one.right.hits, one.right.count) for one in bins] == [(0.7, 3, 4), (0.9, 1, 2)]
    assert calibration_error(bins) == pytest.approx(0.15)
    assert reliability([1.0], [True])[0].high == 1.0
    assert math.isnan(calibration_error([]))


def test_calibrated_answers_have_a_calibration_error_of_their_scatter():
    rng = np.random.default_rng(3)
    stated = rng.uniform(size=20_000)
    # The mean of |share - p| of ten bins of 2000 is about 0.4 * 0.0089.
    assert calibration_error(reliability(stated, rng.random(20_000) < stated)) < 0.01


def test_unexplained_states_no_probability():
    said = [case("none", "none"), case("foreign", "unexplained", effects="z"), case("one", "failed", effects="a")]
    assert [one.verdict for one in stating(said)] == ["none"]


def test_confusion_counts_truths_and_answers():
    rows, columns, table = confusion([answered for answered, _ in WORTH])
    assert table.sum() == len(WORTH)
    assert table[rows.index("none")].sum() == 5
    assert table[rows.index("a"), columns.index("a")] == 1
    assert table[rows.index("a"), columns.index("ambiguous")] == 2
    assert table[rows.index("a"), columns.index("failed")] == 1
    assert table[rows.index("two effects"), columns.index("two effects")] == 2
    assert table[rows.index("warm_up"), columns.index("unexplained")] == 1
    assert columns[-6:] == ["two effects", "ambiguous", "none", "unexplained", "underpowered", "failed"]


def test_groups_hold_every_case_that_belongs_to_them():
    cases = [
        case("one", "none", effects="a", strength=0.1, data="cuts alone"),
        case("one", "none", effects="a", strength=0.5, data="cuts alone"),
        case("one", "none", effects="b", strength=1.0, data="cuts, responses at rest"),
        case("none", "none", data="cuts alone"),
        case("foreign", "none", effects=["warm_up"], strength=0.9, data="cuts alone"),
    ]
    assert [(name, len(of)) for name, of in by_effect(cases)] == [
        ("nothing", 1), ("a", 2), ("b", 1), ("warm_up (no name)", 1),
    ]  # fmt: skip
    assert [(name, len(of)) for name, of in by_strength(cases)] == [("weak", 1), ("middle", 1), ("strong", 1)]
    assert [(name, len(of)) for name, of in by_data(cases)] == [("cuts alone", 4), ("cuts, responses at rest", 1)]


def test_a_balanced_error_weighs_both_outcomes_alike():
    observed = ["stable"] * 8 + ["chatter"] * 2 + ["marginal"]
    assert balanced_error(["stable"] * 11, observed) == 0.5
    assert balanced_error([*["stable"] * 6, "chatter", "", "chatter", "stable", ""], observed) == (2 / 8 + 1 / 2) / 2
    assert balanced_error(["stable"], ["stable"]) == 0.0
    assert math.isnan(balanced_error(["stable"], ["marginal"]))


def probable(name):
    return {"probabilities": {"none": 0.1, "a": 0.1, "b": 0.1, name: 0.9}}


def errors(nominal, refitted, answered):
    return {"errors": {"nominal": nominal, "refitted": refitted, "answered": answered}}


def test_targets_are_measured_and_met_or_not():
    right = case("one", "effect", "a", effects="a", gains={"a": 9.0}, flips=0.2, covered={"a": True, "b": False},
                 evaluations=300, processor_s=100.0, **probable("a"), **errors(0.3, 0.12, 0.06))  # fmt: skip
    weak = case("one", "none", effects="a", gains={"a": 1.0}, **probable("none"), **errors(0.2, 0.1, 0.1))
    clean = case("none", "none", evaluations=500, processor_s=100.0, **probable("none"), **errors(0.2, 0.1, 0.1))
    false = case("none", "effect", "b", **probable("b"), **errors(0.2, 0.1, 0.14))
    near = case("foreign", "effect", "thermal_preload", effects=["warm_up"], **probable("thermal_preload"))
    named = case("foreign", "effect", "b", effects=["tool_wear"], **probable("b"))
    lost = case("one", "failed", effects="b")
    found = {one.name: one for one in targets([right] * 9 + [weak, lost, clean, false, near, named])}

    def measured(name):
        one = found[name]
        return pytest.approx(one.value), one.count, one.met

    assert measured("most probable is right, one effect") == (9 / 11, 11, False)
    assert measured("the same where its hypothesis gains 5 nats") == (1.0, 9, True)
    assert measured("most probable is right, one effect or none") == (10 / 13, 13, None)
    assert measured("confident wrong name, one or two effects") == (0.0, 11, True)
    assert measured("confident effect where there is none") == (0.5, 2, False)
    assert measured("what has no name named without a warning") == (0.5, 2, False)
    assert measured("the same, near names too") == (1.0, 2, None)
    assert measured("near name for what has no name") == (0.5, 2, None)
    assert measured("90 % intervals that hold the true amplitude") == (0.5, 18, False)
    assert measured("held-out outcome error, one effect, rightly named: answered") == (0.06, 9, True)
    assert measured("fall of that error from refitted to answered") == (0.5, 9, True)
    assert measured("held-out outcome error, one effect, told that none is: refitted") == (0.1, 1, None)
    assert measured("rise of that error where nothing is hidden") == (0.02, 2, False)
    assert measured("evaluations of the cuts, mean") == (320.0, 10, True)
    assert measured("diagnoses that failed") == (1 / 15, 15, None)
    # Stated 0.9 fourteen times, and right ten times.
    assert measured("calibration error of stated probabilities") == (0.9 - 10 / 14, 14, False)


def test_targets_of_nothing_are_neither_met_nor_missed():
    assert {one.met for one in targets([])} == {None}


def test_a_mean_has_the_interval_of_its_scatter():
    data = np.random.default_rng(5).normal(3.0, 2.0, 400)
    value, low, high = mean_interval(data.tolist())
    half = 1.96 * data.std() / 20.0
    assert value == pytest.approx(data.mean())
    # Ends drawn 2000 times lie within a tenth of the interval's half.
    assert (low, high) == pytest.approx((value - half, value + half), abs=0.1 * half)


def test_shared_amplitudes_are_those_of_the_hidden_law():
    machine = {
        "bearing": {
            "pitch_diameter_m": 0.06, "ball_diameter_m": 0.01,
            "ring": {"density_kg_m3": 7800.0, "modulus_pa": 2.06e11},
        },
        "process": {"radial_immersion": 0.5},
    }  # fmt: skip

    def truth(name, **hidden):
        return {"effect_names": [name], "hidden": hidden, "machine": machine}

    # 7800 * (1047.2 rad/s)^2 * (25 mm)^3 / 206 GPa = 0.6488 um.
    assert true_amplitudes(truth("ring_expansion", ring_growth=2.0), {}) == pytest.approx(
        {"growth_um": 1.2976}, rel=1e-3
    )
    assert true_amplitudes(truth("tool_runout", runout_m=1e-5), {}) == pytest.approx({"runout_um": 20.0})
    # Pitches of 180 + 9 and 180 - 9 degrees.
    pitch = truth("variable_pitch", pitch_errors_deg=[0.0, 9.0])
    assert true_amplitudes(pitch, {"pattern": "linear"}) == pytest.approx({"variation": 0.1})
    # Pitches of 120 + 4, 120 - 8 and 120 + 4 degrees: a cosine with a height of 8 degrees.
    pitch = truth("variable_pitch", pitch_errors_deg=[0.0, 4.0, -4.0])
    assert true_amplitudes(pitch, {"pattern": "linear"}) == {}
    assert true_amplitudes(pitch, {"pattern": "sinusoidal"}) == pytest.approx({"variation": 8.0 / 120.0 * 2.0})
    found = cosine([0.0, 4.0, -4.0])
    angles = 2.0 * np.pi / 3.0 * np.arange(3) + math.radians(found["phase_deg"])
    assert 120.0 * 0.5 * found["variation"] * np.cos(angles) == pytest.approx([4.0, -8.0, 4.0])
    offset = truth("radial_immersion_error", immersion_offset=-0.1)
    assert true_amplitudes(offset, {}) == pytest.approx({"offset": -0.1, "error": -0.2})
    assert true_amplitudes(truth("radial_immersion_error", immersion_per_depth_1_m=9.0), {}) == {}
    mode = {"axis": 1, "frequency_hz": 500.0, "damping_ratio": 0.01, "mass_kg": 1.0}
    found = true_amplitudes(truth("workpiece_mode", foreign_modes=[mode]), {"axis": "y"})
    assert found["compliance_um_n"] == pytest.approx(1e6 / (1000.0 * math.pi) ** 2)
    assert true_amplitudes(truth("workpiece_mode", foreign_modes=[mode]), {"axis": "x"}) == {}
    assert true_amplitudes(truth("thermal_preload", thermal_rise=1.0), {}) == {}
    entry = {"settings": {"tool_runout": {}}, "parameters": {"runout_um": {"low": 15.0, "high": 19.0}}}
    assert covered(truth("tool_runout", runout_m=1e-5), entry) == {"runout_um": False}


def kept_answer(gains, *, chances=None, pair=None):
    """An answer as it is kept, as far as it is answered again."""
    return {
        "document": {
            "ranking": [{"effect": name, "score": gain} for name, gain in gains.items()],
            "power": [{"effect": name, "nats": 50.0} for name in gains],
            "pair": pair,
            "other_pairs": [],
        },
        "chances": {"none": [], **{name: [] for name in gains}, **(chances or {})},
    }


def test_other_tempers_and_priors_give_the_probabilities_of_the_rule():
    answer = kept_answer({"a": 8.0, "b": 2.0})
    found = replay(answer, Numbers(temper=1.0, nothing_missing=5.0))
    weights = np.exp([5.0, 8.0, 2.0])
    assert list(found.probabilities.values()) == pytest.approx(sorted(weights / weights.sum(), reverse=True))
    assert (found.verdict, found.missing) == ("effect", ("a",))
    assert replay(answer, Numbers(temper=0.2)).verdict == "none"
    assert replay(answer, Numbers(temper=1.0, named=0.995)).verdict != "effect"
    # The program's own numbers are in force again.
    own = replay(answer, Numbers()).probabilities
    weights = np.exp([NOTHING_MISSING, 8.0 * TEMPER, 2.0 * TEMPER])
    assert own["a"] == pytest.approx(weights[1] / weights.sum())


def test_thresholds_of_checks_and_pairs_are_asked_again():
    doubted = kept_answer({"a": 30.0, "b": 10.0}, chances={"a": [1e-4]})
    assert replay(doubted, Numbers()).verdict == "unexplained"
    assert replay(doubted, Numbers(check_chance=1e-5)).verdict == "effect"
    assert replay(doubted, Numbers(outstanding=15.0)).verdict == "effect"
    told = {"effect": "a + b", "score": 40.0}
    pair = kept_answer({"a": 30.0, "b": 10.0}, chances={"a": [1e-4], "a + b": []}, pair=told)
    assert replay(pair, Numbers()).missing == ("a", "b")
    assert replay(pair, Numbers(pair_gain=15.0)).verdict == "unexplained"
    beside = kept_answer({"a": 30.0, "b": 10.0}, chances={"a + b": []}, pair=told)
    assert replay(beside, Numbers()).missing == ("a", "b")
    assert replay(beside, Numbers(pair_gain=15.0)).missing == ("a",)


def test_a_grid_measures_what_it_chooses_by():
    hidden, none = kept_answer({"a": 8.0, "b": 0.0}), kept_answer({"a": 6.0, "b": 0.0})
    cases = [(case("one", "effect", "a", effects="a"), hidden), (case("none", "none"), none)]
    rows = grid(cases, {"temper": [0.1, 1.0], "nothing_missing": [0.0]})
    assert [row["temper"] for row in rows] == [0.1, 1.0]
    assert rows[1]["false_positives"] == 1
    assert rows[0]["false_positives"] == 0
    # Hand-made: P(a) = e^8 / (1 + e^8 + 1) and P(none) = 1 / (1 + e^6 + 1), untempered.
    expected = 0.5 * (8.0 - math.log(2.0 + math.exp(8.0)) - math.log(2.0 + math.exp(6.0)))
    assert rows[1]["log_score"] == pytest.approx(expected)
    assert math.isnan(log_score([]))


def test_answers_of_other_numbers_are_found_out():
    answer = kept_answer({"a": 8.0, "b": 2.0})
    own = replayed(case("one", "", effects="a"), answer, Numbers())
    other = replayed(case("one", "", effects="a"), answer, Numbers(temper=0.1))
    assert disagreeing([(own, answer)]) == []
    assert disagreeing([(other, answer)]) == [1]
