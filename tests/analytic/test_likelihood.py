"""Likelihoods against closed forms and scipy.stats."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import integrate, stats

from chatter_core.evidence import likelihood
from chatter_core.evidence.measured import OUTCOMES, Receptance, measuring_ranges

STABLE, MARGINAL, CHATTER = range(3)
HZ = 2.0 * np.pi


def test_the_outcome_curve_is_a_logistic_with_wrong_labels_at_both_ends():
    margin = np.array([-50.0, -0.1, 0.0, 0.03, 50.0])
    found = likelihood.outcome_probabilities(margin, mislabelled=0.04, width=0.06)
    expected = 0.04 + 0.92 * stats.logistic.cdf(margin, scale=0.06)
    # Rounding.
    assert found[:, 1] == pytest.approx(expected, rel=1e-14)
    assert found.sum(axis=1) == pytest.approx(np.ones(5), rel=1e-14)


def test_marginal_cuts_make_an_ordered_logit():
    margin = np.linspace(-1.0, 1.0, 41)
    found = likelihood.outcome_probabilities(margin, mislabelled=0.04, width=0.06, marginal_width=0.05)
    louder = stats.logistic.cdf(margin[:, None] - [0.0, 0.05], scale=0.06)
    plain = np.stack([1.0 - louder[:, 0], louder[:, 0] - louder[:, 1], louder[:, 1]], axis=1)
    # Differences of probabilities near one lose digits in the plain form.
    assert found == pytest.approx(0.02 + 0.94 * plain, abs=1e-14)
    assert found.sum(axis=1) == pytest.approx(np.ones(41), rel=1e-13)
    # Most likely halfway between the limit and the end of what is marginal: alike at both.
    assert found[20, MARGINAL] == pytest.approx(found[21, MARGINAL], rel=1e-12)
    assert found[:, MARGINAL].max() == pytest.approx(found[20, MARGINAL], rel=1e-12)


def test_without_a_band_no_cut_is_marginal():
    margin = np.linspace(-0.3, 0.3, 7)
    three = likelihood.outcome_probabilities(margin, mislabelled=0.0, width=0.06, marginal_width=0.0)
    two = likelihood.outcome_probabilities(margin, mislabelled=0.0, width=0.06)
    assert three[:, [STABLE, CHATTER]] == pytest.approx(two, abs=1e-15)


def test_what_the_model_cannot_answer_is_a_wrong_label_whatever_it_is():
    found = likelihood.outcome_probabilities(np.array([np.nan]), mislabelled=0.05, width=0.06)
    assert found.tolist() == [[0.05, 0.05]]


def test_labels_say_the_log_of_their_probability():
    probability = np.array([[0.7, 0.1, 0.2], [0.2, 0.3, 0.5]])
    outcome = np.array([MARGINAL, CHATTER], dtype=np.int8)
    found = likelihood.outcome(outcome, probability)
    assert found.log_density == pytest.approx(np.log([0.1, 0.5]), rel=1e-15)
    two = likelihood.outcome(np.array([STABLE, CHATTER], dtype=np.int8), np.array([[0.9, 0.1], [0.3, 0.7]]))
    assert two.log_density == pytest.approx(np.log([0.9, 0.7]), rel=1e-15)
    assert OUTCOMES == ("stable", "marginal", "chatter")


def gram(coordinates, step):
    """Return the information of central differences of coordinates."""
    return float((((coordinates(step) - coordinates(-step)) / (2.0 * step)) ** 2).sum())


@pytest.mark.parametrize("marginal", [None, 0.05])
def test_coordinates_of_labels_carry_the_expected_information_of_the_margin(marginal):
    def probability(shift):
        return likelihood.outcome_probabilities(
            np.array([0.02 + shift]), mislabelled=0.04, width=0.06, marginal_width=marginal
        )

    slope = (probability(1e-6) - probability(-1e-6))[0] / 2e-6
    expected = (slope**2 / probability(0.0)[0]).sum()
    label = np.array([CHATTER], dtype=np.int8)
    # Central differences over 1e-5: their square.
    assert gram(lambda h: likelihood.outcome(label, probability(h)).coordinates, 1e-5) == pytest.approx(
        expected, rel=1e-6
    )


def test_chatter_frequencies_are_compared_with_the_nearest_line_of_the_motion():
    passing = np.full(6, 100.0)
    predicted = np.full(6, 730.0)
    # On the line, three tooth passings off, a mirrored line (-730 + 800), and beside each.
    measured = np.array([730.0, 430.0, 70.0, 735.0, 68.0, 20.0])
    found = likelihood.frequency_residual(measured, predicted, passing)
    assert found == pytest.approx([0.0, 0.0, 0.0, 5.0, -2.0, -10.0], abs=1e-12)
    assert likelihood.frequency_residual(np.array([1.0]), np.array([np.nan]), np.array([100.0])) == 50.0
    each = likelihood.to_lines(measured, predicted, passing)
    assert each[:, 0] == pytest.approx([0.0, 0.0, 40.0, 5.0, 38.0, -10.0], abs=1e-12)
    assert each[:, 1] == pytest.approx([-40.0, -40.0, 0.0, -35.0, -2.0, -50.0], abs=1e-12)


def heard_alone(measured, residual, passing):
    """What frequencies say where one motion alone grows, whose lines are residuals below what was heard."""
    scale = likelihood.frequency_scale(measured, np.zeros(len(measured)))
    lines = likelihood.to_lines(measured[:, None], (measured - residual)[:, None], passing[:, None])
    return likelihood.chatter_frequency(lines, np.ones((len(measured), 1)), scale, passing)


def wrapped(measured, predicted, scale, spacing):
    """Density of what was heard where each line of a motion is as likely as any other, by summing over many."""
    lines = spacing * np.arange(-400, 401)
    apart = [measured - sign * predicted + lines for sign in (1.0, -1.0)]
    return 0.5 * sum(stats.t.pdf(one, 4.0, scale=scale).sum() for one in apart)


def test_any_motion_that_grows_may_be_the_loudest_by_its_share_of_the_growth():
    measured, spacing = np.full(3, 900.0) * HZ, np.full(3, 800.0) * HZ
    # Both off, the second near, and the second near but not growing.
    frequency = np.array([[650.0, 1100.0], [650.0, 898.0], [650.0, 898.0]]) * HZ
    share = np.array([[0.7, 0.3], [0.7, 0.3], [1.0, 0.0]])
    scale = np.hypot(0.005 * measured, 3.0 * HZ)
    residual = likelihood.to_lines(measured[:, None], frequency, spacing[:, None])
    found = likelihood.chatter_frequency(residual, share, scale, spacing)
    together = [
        sum(weight * wrapped(heard, one, width, apart) for weight, one in zip(weights, motions, strict=True))
        for heard, motions, width, weights, apart in zip(measured, frequency, scale, share, spacing, strict=True)
    ]
    # What lies beyond seven lines counts as spread evenly.
    assert found.log_density == pytest.approx(np.log(0.9 * np.array(together) + 0.1 / spacing), rel=1e-4)
    heard, _, _ = likelihood.heard_motion(residual, share, scale, spacing)
    # 1600 - 650 is a line of the mirrored motion.
    assert heard / HZ == pytest.approx([-50.0, 2.0, -50.0])


@pytest.mark.parametrize("spacing", [60.0, 130.0, 400.0, 1200.0])
@pytest.mark.parametrize("motions", [1, 3])
def test_a_frequency_is_as_often_far_off_as_is_said(spacing, motions):
    """Frequencies are drawn as they are said to be heard: of any motion and sign, one in ten anywhere."""
    rng, count = np.random.default_rng(motions), 20_000
    frequency = rng.uniform(0.1, 0.4, motions) * spacing
    scale = np.hypot(0.005 * 900.0, 3.0)
    line = rng.choice(frequency, count) * rng.choice([-1.0, 1.0], count)
    heard = np.where(
        rng.random(count) < 0.1, rng.uniform(0.0, spacing, count), line + scale * rng.standard_t(4.0, count)
    )
    one = np.ones(count)
    residual = likelihood.to_lines(heard[:, None], frequency * one[:, None], spacing * one[:, None])
    share, far = np.full((count, motions), 1.0 / motions), 2.8 * scale
    apart = np.abs(likelihood.heard_motion(residual, share, scale * one, spacing * one)[0])
    of_one = [each[:5] for each in (far * one, residual, share, scale * one, spacing * one)]
    said = likelihood.chance_beyond(*of_one)
    # Wherever it was heard the same is said, but for where its lattice of places lies: a part of a place at each edge.
    edges = 4 * motions / likelihood.MOVED * (0.1 + 0.9 * spacing * stats.t.pdf(2.8, 4.0) / scale)
    assert said == pytest.approx(np.full(5, said[0]), abs=edges)
    expected = (apart > far).mean()
    # Four deviations of a share of so many.
    assert said[0] == pytest.approx(expected, abs=edges + 4.0 * np.sqrt(max(expected, 1e-3) / count))


def test_chatter_frequencies_drift_as_chatter_grows():
    measured = np.full(4, 1200.0) * HZ
    found = likelihood.frequency_scale(measured, np.array([-0.4, 0.0, 0.45, np.nan])) / HZ
    at_limit, deep = np.hypot(6.0, 3.0), np.sqrt(6.0**2 + 3.0**2 + (0.025 * 0.45 * 1200.0) ** 2)
    assert found == pytest.approx([at_limit, at_limit, deep, at_limit])


def test_chatter_frequencies_are_student_t_around_each_line_and_one_in_ten_is_anywhere():
    measured, residual = np.array([600.0, 2400.0]) * HZ, np.array([4.0, -150.0]) * HZ
    scale, passing = np.hypot(0.005 * measured, 3.0 * HZ), np.full(2, 800.0) * HZ
    found = heard_alone(measured, residual, passing)
    nearby = [wrapped(*one) for one in zip(measured, measured - residual, scale, passing, strict=True)]
    # What lies beyond seven lines counts as spread evenly.
    assert found.log_density == pytest.approx(np.log(0.9 * np.array(nearby) + 0.1 / passing), rel=1e-6)


@pytest.mark.parametrize(
    ("frequency", "spacing", "scale"), [(950.0, 800.0, 6.0), (400.0, 800.0, 6.0), (1500.0, 27.0, 18.0)]
)
def test_what_is_heard_between_two_teeth_has_a_density(frequency, spacing, scale):
    """Hopf and flip, and lines that lie closer than they scatter: no motion is favoured before anything is heard."""
    measured = frequency + spacing * (np.arange(4000) + 0.5) / 4000
    apart = np.full(4000, spacing)
    residual = likelihood.to_lines(measured[:, None], np.full((4000, 1), frequency), apart[:, None])
    found = likelihood.chatter_frequency(residual, np.ones((4000, 1)), np.full(4000, scale), apart)
    # A smooth periodic function: the midpoint rule is as good as exact.
    assert np.exp(found.log_density).mean() * spacing == pytest.approx(1.0, rel=1e-9)


def test_coordinates_of_frequencies_carry_nearly_the_expected_information():
    measured, passing = np.array([600.0]) * HZ, np.array([800.0]) * HZ

    def density(r):
        return np.exp(heard_alone(measured, np.array([r]), passing).log_density[0])

    def information(r):
        return ((density(r + 0.01) - density(r - 0.01)) / 0.02) ** 2 / density(r)

    exact = 2.0 * integrate.quad(information, 0.0, 400.0 * HZ, points=[20.0, 200.0], limit=200)[0]
    stated = gram(lambda h: heard_alone(measured, 4.0 * HZ + np.array([h]), passing).coordinates, 1e-3)
    # Tails in which both explanations are as likely hold a little less than is stated: seven in a hundred.
    assert exact < stated < 1.1 * exact


def test_coordinates_of_limit_depths_carry_the_expected_information():
    error = np.array([0.05])
    stated = gram(lambda h: likelihood.limit_depth(np.array([h]), error, 2.0).coordinates, 1e-3)
    # (freedom + 1) / (freedom + 3) over the scale squared, of a location.
    assert stated == pytest.approx(5.0 / 7.0 / 0.05**2, rel=1e-9)


def numbers_of(contribution):
    """Log density, first coordinate and its score of a single datum."""
    return contribution.log_density[0], contribution.coordinates[0], contribution.score[0]


@pytest.mark.parametrize("residual", [-180.0, -9.0, 0.4, 30.0])
def test_the_score_is_the_slope_of_the_log_density_along_the_coordinates(residual):
    measured, passing = np.array([600.0]) * HZ, np.array([800.0]) * HZ
    of_label = [
        lambda shift, label=label: likelihood.outcome(
            np.array([label], dtype=np.int8),
            likelihood.outcome_probabilities(
                np.array([0.01 + shift]), mislabelled=0.04, width=0.06, marginal_width=0.05
            ),
        )
        for label in (STABLE, MARGINAL, CHATTER)
    ]
    kinds = [
        *of_label,
        lambda shift: heard_alone(measured, np.array([(residual + shift) * HZ]), passing),
        lambda shift: likelihood.gaussian(np.array([residual + shift]), 3.0),
        lambda shift: likelihood.limit_depth(np.array([residual + shift]), np.array([3.0]), 200.0),
        lambda shift: likelihood.receptance(np.array([1.0 + 2.0j]), np.array([(0.4 + 0.1j) * (1.0 + shift)]), 0.7, 2.0),
    ]
    for kind in kinds:
        (before, low, _), (_, _, score), (after, high, _) = (numbers_of(kind(h)) for h in (-1e-5, 0.0, 1e-5))
        # Central differences over 1e-5: their square, and the rounding of a log density of some units.
        assert score @ (high - low) == pytest.approx(after - before, rel=1e-6, abs=1e-13)


def facts(value):
    """Facts of a direct response, which is its own measuring range."""
    return likelihood.facts(value, np.abs(value).max())


def lorentzian(frequency, natural, damping):
    return 1.0 / (1.0 - (frequency / natural) ** 2 + 2j * damping * frequency / natural)


@pytest.mark.parametrize("lines", [400, 800, 1600])
def test_facts_do_not_grow_with_the_number_of_lines(lines):
    frequency = np.linspace(100.0, 1100.0, lines)
    one = facts(lorentzian(frequency, 600.0, 0.03))
    two = facts(lorentzian(frequency, 400.0, 0.02) + lorentzian(frequency, 800.0, 0.02))
    reference = facts(lorentzian(np.linspace(100.0, 1100.0, 6400), 600.0, 0.03))
    assert one == pytest.approx(reference, rel=0.02)
    # A resonance is four numbers, somewhat more where the error follows its flanks.
    assert 4.0 <= one <= 8.0
    assert 1.3 * one <= two <= 2.2 * one


def test_facts_are_never_more_than_what_was_measured():
    assert facts(np.array([1.0 + 1.0j])) == 2.0
    assert facts(np.array([1.0j, 0.5])) == 4.0
    assert facts(np.zeros(3, dtype=complex)) == likelihood.FACTS_OF_A_PEAK


@pytest.mark.parametrize("highest", [1200.0, 2000.0, 4500.0, 9000.0])
@pytest.mark.parametrize("spacing", [2.5, 5.0])
def test_what_a_peak_weighs_does_not_hang_on_how_far_and_how_closely_was_measured(highest, spacing):
    """A peak that is displaced by a hundredth costs as much."""
    frequency = np.arange(600.0, highest, spacing)
    measured = lorentzian(frequency, 1000.0, 0.02)
    largest = np.abs(measured).max()
    weight = likelihood.line_weight(measured, largest)
    displaced = likelihood.receptance(measured, lorentzian(frequency, 1010.0, 0.02), weight, largest)
    right = likelihood.receptance(measured, measured, weight, largest)
    cost = right.log_density.sum() - displaced.log_density.sum()
    reference = np.arange(600.0, 9000.0, 1.0)
    exact = lorentzian(reference, 1000.0, 0.02)
    top = np.abs(exact).max()
    apart = (exact - lorentzian(reference, 1010.0, 0.02)) / likelihood.line_errors(exact, top)
    # How loud a line must be to stand out rises with their number, and lengths count whole lines: some hundredths.
    # Without either the same peak would weigh nine times as much in the narrowest band as in the widest.
    assert cost == pytest.approx(0.5 * likelihood.line_weight(exact, top) * (np.abs(apart) ** 2).sum(), rel=0.1)


def test_silent_responses_are_as_wide_as_the_widest_peaks():
    frequency = np.linspace(100.0, 1100.0, 881)
    wide, narrow = lorentzian(frequency, 600.0, 0.05), lorentzian(frequency, 600.0, 0.02)
    silent = np.full(881, 1e-3 + 0.0j)
    ranges = [np.abs(wide).max(), np.abs(narrow).max(), np.abs(wide).max()]
    weights = likelihood.line_weights([wide, narrow, silent], ranges)
    assert weights[0] < weights[1]
    assert weights[2] == weights[0]
    # With nothing to go by they hold one peak.
    assert likelihood.line_weights([silent], [1.0]) == [0.5 * likelihood.FACTS_OF_A_PEAK / 881]


def test_noise_across_the_axes_holds_no_more_facts_than_one_peak():
    frequency = np.linspace(100.0, 1100.0, 881)
    direct = [Receptance(
        source="", spindle_speed=0.0, output_axis=axis, input_axis=axis, frequency=frequency,
        value=size * lorentzian(frequency, 600.0, 0.03),
    ) for axis, size in ((0, 1.0), (1, 4.0))]  # fmt: skip
    rng = np.random.default_rng(5)
    largest = 2.0 * np.abs(direct[0].value).max()
    noise = likelihood.FLOOR_ERROR * largest * (rng.standard_normal(881) + 1j * rng.standard_normal(881))
    across = replace(direct[0], output_axis=1, value=noise)
    ranges = measuring_ranges([*direct, across])
    assert ranges == pytest.approx([0.5 * largest, 2.0 * largest, largest])
    assert likelihood.facts(noise, ranges[2]) <= 2.0 * likelihood.FACTS_OF_A_PEAK
    # A model that has nothing there is right: no line is off by more than noise. Two deviations of a chi-square mean.
    nothing = likelihood.receptance(noise, np.zeros_like(noise), 1.0, ranges[2])
    assert (nothing.coordinates**2).mean() == pytest.approx(1.0, abs=2.0 * np.sqrt(2.0 / 1762.0))
    # Of one direct response alone it has the range, and without any it has no other measure than itself.
    for one in direct:
        assert measuring_ranges([across, one])[0] == np.abs(one.value).max()
    assert measuring_ranges([across]) == (np.abs(noise).max(),)


def test_noise_alone_is_silent_but_once_in_as_many_responses_as_there_are_lines():
    lines, responses = 100, 4000
    rng = np.random.default_rng(8)
    noise = likelihood.FLOOR_ERROR * (
        rng.standard_normal((responses, lines)) + 1j * rng.standard_normal((responses, lines))
    )
    loud = sum(likelihood.stands_out(one, 1.0).any() for one in noise)
    # Two neighbours, of 99 pairs, are each as loud as one in a hundred is; four deviations of a Poisson count.
    expected = responses * (lines - 1) / lines**2
    assert loud == pytest.approx(expected, abs=4.0 * np.sqrt(expected))
    # One line of hum is no resonance either.
    hum = np.where(np.arange(lines) == 50, 1.0, 0.0) + 0j
    assert not likelihood.stands_out(hum, 1.0).any()
    assert likelihood.stands_out(np.where(np.arange(lines) // 2 == 25, 1.0, 0.0) + 0j, 1.0).sum() == 2


def test_lines_of_a_response_are_normal_in_both_parts():
    measured = np.array([1.0 - 2.0j, 0.1 + 0.2j]) * 1e-6
    predicted = np.array([1.1 - 1.9j, 0.1 + 0.25j]) * 1e-6
    error = np.hypot(0.04 * np.abs(measured), 0.02 * np.abs(measured).max())
    apart = measured - predicted
    expected = stats.norm.logpdf(apart.real, scale=error) + stats.norm.logpdf(apart.imag, scale=error)
    found = likelihood.receptance(measured, predicted, weight=1.0, largest=np.abs(measured).max())
    assert found.log_density == pytest.approx(expected, rel=1e-13)
    half = likelihood.receptance(measured, predicted, weight=0.5, largest=np.abs(measured).max())
    assert half.log_density == pytest.approx(0.5 * expected, rel=1e-13)
    assert (half.coordinates**2).sum() == pytest.approx(0.5 * (np.abs(apart / error) ** 2).sum(), rel=1e-13)
    unknown = likelihood.receptance(measured, np.full(2, np.nan + 0j), weight=1.0, largest=np.abs(measured).max())
    still = likelihood.receptance(measured, np.zeros(2, dtype=complex), weight=1.0, largest=np.abs(measured).max())
    assert unknown.log_density == pytest.approx(still.log_density)


def test_other_numbers_are_normal_and_ten_deviations_off_when_unanswered():
    # The logarithm of a measured damping ratio over a predicted one of zero is infinite.
    found = likelihood.gaussian(np.array([0.01, np.nan, np.inf]), 0.02)
    far = stats.norm.logpdf(0.2, scale=0.02)
    expected = [stats.norm.logpdf(0.01, scale=0.02), far, far]
    assert found.log_density == pytest.approx(expected, rel=1e-13)


def test_limit_depths_are_student_t_and_none_is_worse_than_one_without_an_answer():
    error, farthest = np.array([0.02, 0.1, 0.1, 0.5]), np.log(10.0)
    found = likelihood.limit_depth(np.array([0.03, farthest, np.nan, np.nan]), error, farthest)
    # Where ten deviations are farther than the farthest answer, they count.
    off = np.array([0.03, farthest, farthest, 5.0])
    assert found.log_density == pytest.approx(stats.t.logpdf(off / error, 4.0) - np.log(error), rel=1e-12)


def test_the_balanced_error_weighs_both_classes_alike():
    outcome = np.array([STABLE, STABLE, STABLE, STABLE, CHATTER, CHATTER, MARGINAL], dtype=np.int8)
    margin = np.array([-0.1, -0.1, -0.1, 0.1, 0.1, np.nan, 0.1])
    assert likelihood.balanced_error(outcome, margin) == pytest.approx(0.5 * (0.25 + 0.5))
    assert likelihood.balanced_error(outcome[:4], margin[:4]) == pytest.approx(0.25)
    assert np.isnan(likelihood.balanced_error(outcome[6:], margin[6:]))
