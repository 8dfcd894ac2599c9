"""Scores: what they are by hand, and intervals that cover as stated."""

import numpy as np
import pytest
from scipy import stats

from chatter_core.evidence import Comparison, base_model, scores
from chatter_core.evidence.likelihood import facts, outcome, outcome_probabilities
from chatter_core.evidence.margin import LIMIT_REACH, REACH
from chatter_core.evidence.measured import OUTCOMES, BearingStiffness, Limits, NaturalFrequencies
from chatter_core.evidence.scores import COVERAGE, Told, cut_scores, misplaced, structure_scores
from tests.synthetic import RPM, campaign, receptance, tip_machine, trials

STABLE, MARGINAL, CHATTER = (OUTCOMES.index(name) for name in ("stable", "marginal", "chatter"))
SETS = 400
#: Shares of covered truths, binomial: outside of these once in a thousand series.
LEAST, MOST = stats.binom.ppf([5e-4, 0.9995], SETS, COVERAGE) / SETS


def judged(labels, margin, frequency=None, said=None):
    count = len(labels)
    nothing = np.full(count, np.nan)
    cuts = trials(
        np.full(count, 4000.0 * RPM),
        np.full(count, 1e-3),
        outcome=np.array(labels, dtype=np.int8),
        chatter_frequency=nothing if frequency is None else frequency,
    )
    told = Told(
        margin=np.array(margin),
        probability=np.tile([0.7, 0.3], (count, 1)),
        chatter_frequency=nothing if said is None else said,
        limit_margin=np.empty(0),
    )
    return cut_scores(campaign(tip_machine(), trials=cuts), told)


def test_outcome_error_is_the_mean_of_both_classes_and_margins_are_those_on_the_wrong_side():
    found = judged(
        [STABLE, STABLE, STABLE, STABLE, CHATTER, CHATTER, MARGINAL], [-0.2, -0.1, -0.3, 0.08, 0.2, -0.04, 0.4]
    )
    assert found["outcome"].value == pytest.approx(0.5 * (1 / 4 + 1 / 2))
    assert found["outcome"].count == 6
    assert found["depth_margin"].value == pytest.approx((0.08 + 0.04) / 6)
    # Two categories: marginal counts with what did not chatter.
    assert found["log_loss"].value == pytest.approx(-(5 * np.log(0.7) + 2 * np.log(0.3)) / 7)


def test_an_outcome_error_of_zero_has_an_interval_that_ends_above_it():
    found = judged([STABLE] * 10 + [CHATTER] * 10, [-0.2] * 10 + [0.2] * 10)["outcome"]
    wilson = stats.binomtest(0, 10).proportion_ci(COVERAGE, method="wilson").high
    assert (found.value, found.low) == (0.0, 0.0)
    assert found.high == pytest.approx(wilson / np.sqrt(2.0))


def test_the_outcome_error_of_one_class_has_wilsons_interval():
    found = judged([CHATTER] * 12, [0.1] * 8 + [-0.1] * 4)["outcome"]
    wilson = stats.binomtest(4, 12).proportion_ci(COVERAGE, method="wilson")
    assert (found.low, found.value, found.high) == pytest.approx((wilson.low, 4 / 12, wilson.high))


def test_chatter_frequencies_are_off_to_the_nearest_line():
    # Two teeth at 4000 rpm: lines lie 133.3 Hz apart.
    hertz = 2.0 * np.pi
    spacing = 4000.0 / 30.0
    measured = np.array([600.0, 700.0, 640.0]) * hertz
    predicted = np.array([604.0, 700.0 - spacing + 9.0, 640.0]) * hertz
    found = judged([CHATTER] * 3, [0.1] * 3, measured, predicted)["chatter_frequency"]
    assert found.value == pytest.approx(4.0)


def judged_limits(margin, uncertainty=0.02):
    """Scores of limit depths of one that have such margins."""
    one = np.ones(len(margin))
    table = Limits(spindle_speed=one, limit_depth=one, uncertainty=uncertainty * one)
    told = Told(
        margin=np.empty(0),
        probability=np.empty((0, 2)),
        chatter_frequency=np.empty(0),
        limit_margin=np.array(margin),
    )
    return cut_scores(campaign(tip_machine(), limits=table), told)


def test_limit_depths_are_off_by_their_root_mean_square():
    found = judged_limits([0.1, -0.1, 0.2])
    assert found["limit_depth"].value == pytest.approx(np.sqrt(0.06 / 3))
    assert list(found) == ["limit_depth"]
    assert not found["limit_depth"].at_least


def test_an_error_with_a_limit_that_the_model_has_not_is_a_least_one():
    found = judged_limits([0.1, -LIMIT_REACH])["limit_depth"]
    assert (found.value, found.at_least) == (pytest.approx(np.sqrt((0.01 + LIMIT_REACH**2) / 2)), True)
    assert np.isnan([found.low, found.high]).all()


@pytest.mark.parametrize(
    ("score", "draw", "truth"),
    [
        ("_median", lambda rng: (np.exp(rng.standard_normal(25)),), 1.0),
        ("_of_residuals", lambda rng: (0.3 * rng.standard_normal(20), 0.3), 0.3),
        # Student's law with four degrees of freedom has twice the variance of its scale.
        ("_of_limits", lambda rng: (0.1 * rng.standard_t(4.0, 12), 0.1), 0.1 * np.sqrt(2.0)),
    ],
)
def test_intervals_cover_as_stated(score, draw, truth):
    inside = 0
    for seed in range(SETS):
        found = getattr(scores, score)(*draw(np.random.default_rng(seed)))
        inside += found.low <= truth <= found.high
    # Order statistics are discrete: the median's interval covers what is stated, or more.
    assert inside / SETS >= LEAST
    assert score == "_median" or inside / SETS <= MOST


def test_the_interval_of_a_mean_of_zeros_and_ones_is_that_of_clopper_and_pearson():
    for wrong in (0, 3, 20):
        found = scores._mean(np.repeat([1.0, 0.0], [wrong, 20 - wrong]), 1.0)
        exact = stats.binomtest(wrong, 20).proportion_ci(COVERAGE, method="exact")
        # Two thousand draws know a quantile of twenty data to two thousandths.
        assert (found.low, found.high) == pytest.approx((exact.low, exact.high), abs=0.006)


@pytest.mark.parametrize("count", [12, 60])
def test_intervals_of_loss_and_depth_margin_cover_at_least_what_is_stated(count):
    def judged_cuts(rng, size):
        margin = np.clip(0.3 * rng.standard_normal(size), -REACH, REACH)
        probability = outcome_probabilities(margin, mislabelled=0.04, width=0.06)
        labels = np.where(rng.random(size) < probability[:, 1], CHATTER, STABLE).astype(np.int8)
        loss = -outcome(labels, probability).log_density
        return (loss, -np.log(0.04)), (misplaced(labels, margin), REACH)

    truth = [data.mean() for data, _ in judged_cuts(np.random.default_rng(0), 300_000)]
    inside = np.zeros(2)
    for seed in range(SETS):
        found = [scores._mean(*one) for one in judged_cuts(np.random.default_rng(1 + seed), count)]
        inside += [one.low <= true <= one.high for one, true in zip(found, truth, strict=True)]
    # Rare wrong labels make both skew: Student's interval covers 64 to 88 % here.
    assert (inside / SETS >= LEAST).all()


def test_a_cut_without_an_answer_is_as_far_off_as_any():
    found = judged([STABLE, CHATTER, CHATTER, STABLE], [-0.2, np.nan, 0.1, np.nan])
    assert found["outcome"].value == 0.5
    assert found["depth_margin"].value == pytest.approx(2 * REACH / 4)
    assert found["depth_margin"].count == 4


def test_a_limit_without_an_answer_is_as_far_off_as_any_and_counted():
    found = judged_limits([0.1, np.nan], uncertainty=0.03)["limit_depth"]
    assert (found.count, found.unanswered, found.at_least) == (2, 1, False)
    assert found.value == pytest.approx(np.sqrt((0.1**2 + LIMIT_REACH**2) / 2))
    of_cuts = judged([STABLE, CHATTER, MARGINAL], [np.nan, 0.1, np.nan])
    assert {name: one.unanswered for name, one in of_cuts.items()} == {"outcome": 1, "depth_margin": 1, "log_loss": 2}


def test_modes_and_stiffnesses_that_the_model_has_not_are_off_and_what_was_not_measured_is_not():
    two, unknown = np.ones(2), np.array([np.nan, np.nan])
    modes = NaturalFrequencies(
        spindle_speed=two,
        mode=np.array([1, 5]),
        natural_frequency=600.0 * 2.0 * np.pi * two,
        damping_ratio=np.array([np.nan, 0.03]),
    )
    # Measured tip modes know nothing of bearings, and there are fewer than five.
    bearing = BearingStiffness(
        spindle_speed=two, preload=100.0 * two, radial_stiffness=5e7 * two, axial_stiffness=unknown
    )
    made = campaign(tip_machine(), natural_frequencies=modes, stiffness=bearing)
    comparison = Comparison(model=base_model(made))
    found = structure_scores(made, comparison.compare(comparison.model.nulls))
    told = {name: (one.value, one.count, one.unanswered) for name, one in found.items()}
    # Ten deviations of 0.005, 0.2 and 0.05 of the logarithm; the first frequency is as predicted.
    assert told["natural_frequency"] == (pytest.approx(0.05 / np.sqrt(2.0)), 2, 1)
    assert told["damping_ratio"] == (pytest.approx(2.0), 1, 1)
    assert told["bearing_stiffness"] == (pytest.approx(0.5), 2, 2)


def test_the_interval_of_the_receptance_error_knows_the_numbers_in_a_response():
    lines = np.linspace(300.0, 900.0, 121) * 2.0 * np.pi
    comparison = Comparison(model=base_model(campaign(tip_machine(), receptances=(receptance(lines),))))
    (predicted,) = comparison.compare(comparison.model.nulls).prediction.receptances
    made = campaign(tip_machine(), receptances=(receptance(lines, 1.1 * predicted),))
    other = Comparison(model=base_model(made))
    found = structure_scores(made, other.compare(other.model.nulls))["receptance"]
    assert found.value == pytest.approx(0.1 / 1.1)
    # One response is not one number: the chi-square law of that would end sixteen times higher.
    numbers = facts(made.receptances[0].value, np.abs(made.receptances[0].value).max())
    assert found.high == pytest.approx(found.value * np.sqrt(numbers / stats.chi2.ppf(0.05, numbers)))
    assert found.high < 2.5 * found.value


def test_the_interval_of_the_outcome_error_covers_as_stated():
    rates, inside = np.array([0.1, 0.25]), 0
    for seed in range(SETS):
        rng = np.random.default_rng(seed)
        wrong = [rng.random(40) < rates[0], rng.random(25) < rates[1]]
        margin = np.concatenate([np.where(wrong[0], 0.1, -0.1), np.where(wrong[1], -0.1, 0.1)])
        found = judged([STABLE] * 40 + [CHATTER] * 25, margin)["outcome"]
        inside += found.low <= rates.mean() <= found.high
    # Wilson's intervals are approximate: two hundredths more to either side.
    assert LEAST - 0.02 <= inside / SETS <= MOST + 0.02
