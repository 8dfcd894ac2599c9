"""Scores: what they are by hand, and intervals that cover as stated."""

import numpy as np
import pytest
from scipy import stats

from chatter_core.evidence import scores
from chatter_core.evidence.measured import OUTCOMES, Limits
from chatter_core.evidence.scores import COVERAGE, Told, cut_scores
from tests.synthetic import RPM, campaign, tip_machine, trials

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


def test_chatter_frequencies_are_off_to_the_nearest_line():
    # Two teeth at 4000 rpm: lines lie 133.3 Hz apart.
    hertz = 2.0 * np.pi
    spacing = 4000.0 / 30.0
    measured = np.array([600.0, 700.0, 640.0]) * hertz
    predicted = np.array([604.0, 700.0 - spacing + 9.0, 640.0]) * hertz
    found = judged([CHATTER] * 3, [0.1] * 3, measured, predicted)["chatter_frequency"]
    assert found.value == pytest.approx(4.0)


def test_limit_depths_are_off_by_their_root_mean_square():
    table = Limits(spindle_speed=np.ones(3), limit_depth=np.ones(3), uncertainty=np.ones(3))
    told = Told(
        margin=np.empty(0),
        probability=np.empty((0, 2)),
        chatter_frequency=np.empty(0),
        limit_margin=np.array([0.1, -0.1, 0.2]),
    )
    found = cut_scores(campaign(tip_machine(), limits=table), told)
    assert found["limit_depth"].value == pytest.approx(np.sqrt(0.06 / 3))
    assert list(found) == ["limit_depth"]


@pytest.mark.parametrize(
    ("score", "draw", "truth"),
    [
        ("_mean", lambda rng: 2.0 + rng.standard_normal(30), 2.0),
        ("_median", lambda rng: np.exp(rng.standard_normal(25)), 1.0),
        ("_root_mean_square", lambda rng: 0.3 * rng.standard_normal(20), 0.3),
    ],
)
def test_intervals_cover_as_stated(score, draw, truth):
    inside = 0
    for seed in range(SETS):
        found = getattr(scores, score)(draw(np.random.default_rng(seed)))
        inside += found.low <= truth <= found.high
    # Order statistics are discrete: the median's interval covers what is stated, or more.
    assert inside / SETS >= LEAST
    assert score == "_median" or inside / SETS <= MOST


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
