"""Where a model fails: silence for a right model, and words with the right place for a wrong one."""

import math
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import stats

from chatter_core.evidence import Comparison, base_model, likelihood
from chatter_core.evidence.bands import CHANCE
from chatter_core.evidence.failures import failures
from chatter_core.evidence.fit import fit
from chatter_core.evidence.likelihood import line_errors
from chatter_core.evidence.measured import OUTCOMES, BearingStiffness, Limits, NaturalFrequencies, measuring_ranges
from chatter_core.evidence.receptance_bands import misfits
from chatter_core.evidence.verdict import CHECK_CHANCE, failed_checks
from chatter_core.machine import Machine
from tests.synthetic import RPM, campaign, machine_of_modes, measured, receptance, tip_machine, trials

SETS = 25
LINES = np.linspace(300.0, 900.0, 121) * 2.0 * np.pi


def planned(rng, count=60):
    speed = rng.choice(np.linspace(3500.0, 5000.0, 12), count) * RPM
    return campaign(
        tip_machine(), trials=trials(speed, rng.uniform(3e-3, 6.5e-3, count)), receptances=(receptance(LINES),)
    )


def told(made, values=None, modes=None):
    comparison = Comparison(model=base_model(made))
    compared = comparison.compare(comparison.model.nulls if values is None else values)
    count = 0 if made.trials is None else len(made.trials)
    return failures(comparison.model, compared, np.ones(count) if modes is None else modes, None)


def test_a_right_model_is_told_to_fail_no_more_often_than_chance():
    ways, alarms = 0, 0
    for seed in range(SETS):
        rng = np.random.default_rng(seed)
        plan = planned(rng)
        found = told(measured(plan, base_model(plan).nulls, rng))
        # Three kinds of data over speed, depth and order, and the response around its mode.
        ways, alarms = ways + 3 * 3 + 1, alarms + len(found)
    assert alarms <= stats.binom.ppf(0.999, ways, CHANCE)


def test_a_boundary_that_lies_deeper_at_some_speeds_is_told_with_them():
    rng = np.random.default_rng(2)
    plan = planned(rng, 90)
    made = measured(plan, base_model(plan).nulls, rng)
    slow = made.trials.spindle_speed < 4000.0 * RPM
    quiet = np.where(slow, OUTCOMES.index("stable"), made.trials.outcome).astype(np.int8)
    first = told(replace(made, trials=replace(made.trials, outcome=quiet)))[0]
    assert first.quantity == "outcome"
    low, high = first.band["spindle_speed_rpm"]
    # Speeds lie 136 rpm apart: the band ends at the last slow one, or a neighbour.
    assert low < 3640.0
    assert 3700.0 < high < 4150.0
    assert first.excess > 0.5
    assert "cuts that should chatter at" in first.text
    assert "the boundary lies deeper there" in first.text


def test_chatter_frequencies_that_drift_are_told_by_the_order_of_trials():
    rng = np.random.default_rng(3)
    plan = planned(rng, 120)
    made = measured(plan, base_model(plan).nulls, rng)
    late = np.arange(120) > 70
    drifted = made.trials.chatter_frequency + np.where(late, 2.0 * np.pi * 40.0, 0.0)
    found = told(replace(made, trials=replace(made.trials, chatter_frequency=drifted)))
    texts = [f.text for f in found if f.quantity == "chatter_frequency" and "trial" in f.band]
    assert len(texts) == 1
    (band,) = [f.band["trial"] for f in found if f.quantity == "chatter_frequency" and "trial" in f.band]
    # One that fails by chance a few heard ones before, three cuts apart, may be taken along.
    assert 60 <= band[0] <= 80
    assert band[1] >= 110


def test_a_response_that_is_off_is_told_with_its_mode_and_both_peaks():
    rng = np.random.default_rng(4)
    plan = planned(rng)
    model = base_model(plan)
    off = model.nulls
    off[[p.name for p in model.parameters].index("tip_frequency")] = np.log(0.95)
    found = told(replace(measured(plan, off, rng), trials=None))
    (first,) = found
    assert first.quantity == "receptance"
    assert first.band["mode"] == 1
    # 600 Hz less 5 %, on lines of 5 Hz, against 600 Hz.
    assert "measured peak at 570 Hz" in first.text
    assert "predicted at 600 Hz" in first.text
    assert first.excess > 0.3


def test_a_response_along_an_axis_for_which_the_model_has_no_modes_is_judged():
    machine = tip_machine().described()
    machine["tip"]["modes"] = machine["tip"]["modes"][:1]
    rng = np.random.default_rng(4)
    plan = planned(rng)
    both = replace(plan, receptances=(*plan.receptances, receptance(LINES, axis=1)))
    made = replace(measured(both, base_model(both).nulls, rng), machine=Machine.model_validate(machine), trials=None)
    (found,) = told(made)
    assert (found.quantity, found.band["frequency_hz"]) == ("receptance", [300.0, 895.0])
    assert "mode" not in found.band
    assert "the model has no modes along this axis" in found.text
    # It is all of the response that is missing.
    assert found.excess > 0.8
    # Across the axes there is nothing but noise, a third of what the likelihood grants: 0.02 of both ranges' mean.
    noise = 1e-4 * np.abs(made.receptances[0].value).max() * (rng.standard_normal((2, len(LINES))).T @ [1.0, 1j])
    across = replace(made.receptances[0], output_axis=1, value=noise)
    assert told(replace(made, receptances=(made.receptances[0], across))) == []


def test_limits_and_modes_that_are_off_to_one_side_are_told():
    speed = np.linspace(3500.0, 5000.0, 10) * RPM
    made = campaign(
        tip_machine(), limits=Limits(spindle_speed=speed, limit_depth=np.full(10, 5e-3), uncertainty=np.full(10, 1e-4))
    )
    comparison = Comparison(model=base_model(made))
    limit = 5e-3 / np.exp(comparison.compare(comparison.model.nulls).prediction.limit_margin)
    deeper = replace(made, limits=replace(made.limits, limit_depth=1.2 * limit, uncertainty=0.02 * limit))
    (found,) = told(deeper)
    assert "10 are larger than predicted" in found.text
    modes = NaturalFrequencies(
        spindle_speed=speed,
        mode=np.ones(10, dtype=np.int64),
        natural_frequency=np.full(10, 0.96 * 600.0 * 2.0 * np.pi),
        damping_ratio=np.full(10, np.nan),
    )
    (found,) = told(campaign(tip_machine(), natural_frequencies=modes))
    assert found.quantity == "natural_frequency"
    assert "10 are smaller than predicted" in found.text


def test_limits_scatter_as_the_likelihood_has_it():
    """By Student's law with four degrees of freedom one in sixteen is beyond what one in forty is by the normal one."""
    speed = np.linspace(3500.0, 5000.0, 200) * RPM
    usual = Limits(spindle_speed=speed, limit_depth=np.full(200, 5e-3), uncertainty=np.full(200, 1e-4))
    made = campaign(tip_machine(), limits=usual)
    comparison = Comparison(model=base_model(made))
    limit = 5e-3 / np.exp(comparison.compare(comparison.model.nulls).prediction.limit_margin)
    off = np.exp(0.02 * np.random.default_rng(5).standard_t(4.0, 200))
    # The stated uncertainty is that of the measured depth.
    scattered = replace(usual, limit_depth=limit * off, uncertainty=0.02 * limit * off)
    assert told(replace(made, limits=scattered)) == []


def test_limits_that_the_model_has_nowhere_near_are_told():
    table = Limits(spindle_speed=np.array([4000.0 * RPM]), limit_depth=np.array([1e-5]), uncertainty=np.array([1e-6]))
    texts = [one.text for one in told(campaign(tip_machine(), limits=table)) if one.band == {}]
    expected = "From 0.1 to 10 times the measured limiting depth the model has no limit for 1 of 1; they count"
    assert [text[: len(expected)] for text in texts] == [expected]


def test_what_has_no_answer_is_said_to_have_none_and_no_size():
    stiffness = BearingStiffness(
        spindle_speed=np.linspace(0.0, 12000.0, 6) * RPM,
        preload=np.full(6, 100.0),
        radial_stiffness=np.full(6, 5e7),
        axial_stiffness=np.full(6, np.nan),
    )
    # Measured tip modes know nothing of bearings.
    (found,) = told(campaign(tip_machine(), stiffness=stiffness))
    assert found.quantity == "bearing_stiffness"
    assert found.text == "The model has no answer for 6 of 6 measured radial stiffnesses; they count as wrong."
    assert found.excess == 1.0


@pytest.mark.parametrize("modes", [1, 3])
def test_a_response_without_an_answer_is_said_to_have_none(modes):
    asked = campaign(machine_of_modes(modes), receptances=(receptance(LINES), receptance(LINES, axis=1)))
    model = base_model(asked)
    responses = zip(asked.receptances, model.predict(model.nulls).receptances, strict=True)
    made = replace(asked, receptances=tuple(replace(one, value=value) for one, value in responses))
    comparison = Comparison(model=base_model(made))
    compared = comparison.compare(comparison.model.nulls)
    lost = np.full(len(LINES), np.nan + 0j)
    compared = replace(
        compared, prediction=replace(compared.prediction, receptances=(compared.prediction.receptances[0], lost))
    )
    (found,) = failures(comparison.model, compared, np.empty(0), None)
    assert found.text == f"The model has no answer for receptance {made.receptances[1]}; it counts as wrong."
    assert failed_checks([found]) == [found]


@pytest.mark.parametrize("heard", [False, True])
def test_cuts_too_slow_for_any_model_are_told_and_count_for_nothing(heard):
    speed, depth = np.array([4000.0, 5.0, 6.0, 4000.0]) * RPM, np.full(4, 1e-4)
    cut = trials(speed, depth)
    heard_at = np.where(heard & (speed < 10.0 * RPM), 2.0 * np.pi * 600.0, np.nan)
    table = Limits(spindle_speed=np.array([7.0 * RPM]), limit_depth=np.array([5e-3]), uncertainty=np.array([1e-4]))
    made = campaign(tip_machine(), trials=replace(cut, chatter_frequency=heard_at), limits=table)
    found = told(made)
    why = "the spindle is so slow that the waves of its fastest mode in a tooth period cannot be resolved"
    assert [one.text for one in found] == [
        f"2 of 4 cuts say nothing, for none can be computed there, the first at 5 rpm: {why}.",
        f"1 of 1 measured limiting depths say nothing, for none can be computed there, the first at 7 rpm: {why}.",
    ]
    assert [one.band["spindle_speed_rpm"] for one in found] == [pytest.approx([5.0, 6.0]), pytest.approx([7.0, 7.0])]
    assert not any(one.counts for one in found)
    assert failed_checks(found) == []


@pytest.mark.parametrize("lines", [150, 1000])
def test_responses_across_the_axes_that_hold_noise_alone_seldom_fail(lines):
    frequency = np.linspace(300.0, 900.0, lines) * 2.0 * np.pi
    axes = [(0, 0), (1, 1), (0, 1), (1, 0)]
    planned = [replace(receptance(frequency), output_axis=output, input_axis=other) for output, other in axes]
    model = base_model(campaign(tip_machine(), receptances=tuple(planned)))
    exact = model.predict(model.nulls)
    largest = measuring_ranges([replace(one, value=h) for one, h in zip(planned, exact.receptances, strict=True)])
    rng, failed = np.random.default_rng(3), 0
    for _ in range(400):
        noisy = [
            replace(one, value=h + line_errors(h, top) * (rng.standard_normal(lines) + 1j * rng.standard_normal(lines)))
            for one, h, top in zip(planned, exact.receptances, largest, strict=True)
        ]
        made = replace(model.campaign, receptances=tuple(noisy))
        failed += any(one.chance <= CHECK_CHANCE for one in misfits(made, exact))
    # 0.8 are stated; more than four come by chance once in seven hundred.
    assert failed <= 4


@pytest.mark.parametrize(("lost", "fails"), [(1, False), (3, False), (7, True), (39, True)])
def test_what_an_effect_cannot_answer_where_the_base_model_can_counts_as_wrong_labels_would(lost, fails):
    # The last of 40 cuts is too slow for any model.
    speeds = np.append(np.linspace(4000.0, 5000.0, 39), 5.0) * RPM
    comparison = Comparison(model=base_model(campaign(tip_machine(), trials=trials(speeds, np.full(40, 1e-4)))))
    compared = comparison.compare(comparison.model.nulls)
    margin = np.where(np.arange(40) < lost, np.nan, compared.prediction.margin)
    compared = replace(
        compared, prediction=replace(compared.prediction, cuts=replace(compared.prediction.cuts, margin=margin))
    )
    found = failures(comparison.model, compared, np.ones(40), None)
    (told,) = (one for one in found if "no answer" in one.text)
    assert told.text == f"The model has no answer for {lost} of 40 cuts; they count as told wrongly."
    # Of 39 labels 4 % are wrong: more than so many with this chance.
    fewer = sum(math.comb(39, k) * 0.04**k * 0.96 ** (39 - k) for k in range(lost))
    assert told.chance == pytest.approx(1.0 - fewer, rel=1e-6, abs=1e-12)
    assert (told in failed_checks(found)) == fails


def test_damping_that_is_off_to_one_side_is_told():
    modes = NaturalFrequencies(
        spindle_speed=np.linspace(0.0, 12000.0, 6) * RPM,
        mode=np.ones(6, dtype=np.int64),
        natural_frequency=np.full(6, 600.0 * 2.0 * np.pi),
        damping_ratio=np.array([0.06, 0.06, 0.06, 0.06, 0.06, np.nan]),
    )
    (found,) = told(campaign(tip_machine(), natural_frequencies=modes))
    assert found.quantity == "damping_ratio"
    assert found.text.startswith("Of 5 measured damping ratios")
    assert "5 are larger than predicted" in found.text


def test_failures_at_the_only_speed_are_told():
    made = campaign(tip_machine(), trials=trials(np.full(20, 4000.0 * RPM), np.linspace(5.5e-3, 9e-3, 20)))
    (found,) = told(made)
    assert found.band == {"spindle_speed_rpm": [pytest.approx(4000.0), pytest.approx(4000.0)]}
    assert "20 were stable" in found.text


def test_what_a_trial_does_not_state_is_the_machines_own():
    rng = np.random.default_rng(8)
    plan = planned(rng, 90)
    made = measured(plan, base_model(plan).nulls, rng)
    other = np.arange(90) % 2 == 1
    feed = np.where(other, 0.05e-3, np.nan)
    quiet = np.where(other, OUTCOMES.index("stable"), made.trials.outcome).astype(np.int8)
    found = told(replace(made, trials=replace(made.trials, outcome=quiet, feed_per_tooth=feed)))
    # Only one feed is stated: beside the machine's own it is a place all the same.
    assert [f.band["feed_per_tooth_mm"] for f in found if "feed_per_tooth_mm" in f.band] == [
        [pytest.approx(0.05), pytest.approx(0.05)]
    ]


def test_nothing_is_said_of_deeper_where_the_nearest_boundary_is_the_upper_one_of_an_island():
    made = campaign(tip_machine(), trials=trials(np.full(20, 4000.0 * RPM), np.linspace(5.5e-3, 9e-3, 20)))
    comparison = Comparison(model=base_model(made))
    compared = comparison.compare(comparison.model.nulls)
    cuts = replace(compared.prediction.cuts, margin=np.full(20, 0.3), crossing=np.full(20, 0.3))
    for crossing, said in ((np.full(20, -0.3), True), (np.full(20, 0.3), False)):
        prediction = replace(compared.prediction, cuts=replace(cuts, crossing=crossing))
        (found,) = failures(comparison.model, replace(compared, prediction=prediction), np.ones(20), None)
        assert ("the boundary lies deeper there" in found.text) == said


def test_a_peak_where_the_model_has_no_mode_is_told():
    made = campaign(tip_machine(), receptances=(receptance(np.linspace(900.0, 1500.0, 121) * 2.0 * np.pi),))
    lines = made.receptances[0].frequency
    # A mode of 1200 Hz, twice the model's own, which lies below all lines.
    value = 1e-7 / (1.0 - (lines / (2400.0 * np.pi)) ** 2 + 0.06j * lines / (2400.0 * np.pi))
    found = told(replace(made, receptances=(replace(made.receptances[0], value=value),)))
    assert any("measured peak at 1200 Hz" in f.text for f in found)


def test_a_parameter_that_is_bent_far_is_a_finding_by_itself():
    rng = np.random.default_rng(5)
    plan = planned(rng)
    model = base_model(plan)
    bent = model.nulls
    bent[[p.name for p in model.parameters].index("tip_stiffness")] = 0.6
    made = measured(plan, bent, rng)
    comparison = Comparison(model=base_model(made))
    found = fit(comparison, starts=[bent])
    compared = comparison.compare(found.estimate)
    pulls = [f for f in failures(comparison.model, compared, np.ones(60), found) if f.quantity == "calibration"]
    assert [f.band["parameter"] for f in pulls] == ["tip_stiffness"]
    assert "a factor of 1." in pulls[0].text


def pulled(**widths):
    """Return a fit whose parameters stand so many widths of their priors away, and a few that do not."""
    made = planned(np.random.default_rng(5))
    comparison = Comparison(model=base_model(made))
    parameters = comparison.parameters
    pull = np.array([widths.get(one.name, 0.0) for one in parameters])
    value = pull * [one.prior_width for one in parameters]
    return comparison, SimpleNamespace(parameters=parameters, estimate=value, pull=pull)


def test_labels_that_err_less_than_is_typical_are_no_finding():
    comparison, fitted = pulled(mislabelled=-4.0, outcome_width=-4.5)
    compared = comparison.compare(comparison.model.nulls)
    found = [f for f in failures(comparison.model, compared, np.ones(60), fitted) if f.quantity == "calibration"]
    assert found == []
    _, fitted = pulled(mislabelled=4.0, outcome_width=4.5)
    found = [f for f in failures(comparison.model, compared, np.ones(60), fitted) if f.quantity == "calibration"]
    assert [f.band["parameter"] for f in found] == ["outcome_width", "mislabelled"]


def test_a_pull_counts_for_as_many_as_are_looked_at():
    comparison, fitted = pulled(tip_stiffness=3.5)
    compared = comparison.compare(comparison.model.nulls)
    (found,) = (f for f in failures(comparison.model, compared, np.ones(60), fitted) if f.quantity == "calibration")
    alike = [p for p in comparison.parameters if p.touches == "structure"]
    assert len(alike) > 1
    assert found.chance == pytest.approx(len(alike) * 2.0 * stats.norm.sf(3.5))
    # Coordinates of a curve are none of them, however many they are.
    curve = [p.name for p in alike if p.name != "tip_stiffness"]
    left = failures(comparison.model, compared, np.ones(60), fitted, curve)
    (found,) = (f for f in left if f.quantity == "calibration")
    assert found.chance == pytest.approx(2.0 * stats.norm.sf(3.5))


def test_a_right_model_is_not_told_to_fail_where_labels_err_as_priors_say():
    """Labels err by what is drawn from the priors, and the fit, which knows the margins, has found by how much."""
    ways, alarms, of_typical = 0, 0, 0
    for seed in range(SETS):
        rng = np.random.default_rng(seed)
        plan = planned(rng, 150)
        comparison = Comparison(model=base_model(plan))
        names = [p.name for p in comparison.parameters]
        noisy = comparison.model.nulls
        for name in ("mislabelled", "outcome_width"):
            width = comparison.parameters[names.index(name)].prior_width
            noisy[names.index(name)] = rng.normal(0.0, width)
        made = measured(plan, noisy, rng)
        comparison = Comparison(model=base_model(made))
        compared = comparison.compare(noisy)
        known = SimpleNamespace(parameters=comparison.parameters, estimate=noisy, pull=np.zeros(len(noisy)))
        ways += 2 * 3
        alarms += sum(f.quantity == "outcome" for f in failures(comparison.model, compared, np.ones(150), known))
        of_typical += sum(f.quantity == "outcome" for f in failures(comparison.model, compared, np.ones(150), None))
    assert alarms <= stats.binom.ppf(0.999, ways, CHANCE)
    # With labels that err as is typical, nothing else, right models would be told to fail.
    assert of_typical > 2 * alarms


def test_modes_are_told_one_by_one():
    rng = np.random.default_rng(6)
    plan = planned(rng, 90)
    made = measured(plan, base_model(plan).nulls, rng)
    modes = np.where(np.arange(90) % 2, 3, 1)
    quiet = np.where(modes == 3, OUTCOMES.index("stable"), made.trials.outcome).astype(np.int8)
    found = told(replace(made, trials=replace(made.trials, outcome=quiet)), modes=modes)
    assert [f.band["dominant_mode"] for f in found if "dominant_mode" in f.band] == [3]
    assert any("where mode 3 chatters" in f.text for f in found)
    with pytest.raises(StopIteration):
        next(f for f in found if f.band.get("dominant_mode") == 1)


def test_frequencies_fail_by_chance_as_often_as_frequencies_that_are_drawn_by_their_law():
    """At slow speeds both lines of a motion leave little room beyond them, which a rule for one line overstates."""
    rng, count = np.random.default_rng(8), 60
    speed, depth = rng.choice(np.linspace(1900.0, 2300.0, 12), count) * RPM, rng.uniform(3.3e-3, 4.2e-3, count)
    plan = campaign(tip_machine(), trials=trials(speed, depth))
    nulls = base_model(plan).nulls
    beyond = np.concatenate([beyond_noise(measured(plan, nulls, rng), nulls) for _ in range(SETS)])
    made = measured(plan, nulls, rng)
    aside = made.trials.chatter_frequency + 0.5 * speed * plan.machine.tool.teeth
    found = told(replace(made, trials=replace(made.trials, chatter_frequency=aside)))
    text = next(f.text for f in found if f.quantity == "chatter_frequency" and "spindle_speed_rpm" in f.band)
    seen, expected = (float(re.search(what, text)[1]) for what in (r"Of (\d+) chatter", r"noise explains ([\d.]+)"))
    # Four deviations of the share that is drawn, and the rounding of what is told.
    allowed = 4.0 * math.sqrt(beyond.mean() / len(beyond)) + 0.05 / seen
    assert expected / seen == pytest.approx(beyond.mean(), abs=allowed)


def beyond_noise(made, values):
    """Return which of the chatter frequencies that were heard lie farther off than one in twenty of Student's law."""
    compared = Comparison(model=base_model(made)).compare(values)
    heard = np.isfinite(made.trials.chatter_frequency)
    measured_at = made.trials.chatter_frequency[heard]
    frequency, share, spacing = compared.prediction.motions(heard)
    residual = likelihood.to_lines(measured_at[:, None], frequency, spacing[:, None])
    scale = likelihood.frequency_scale(measured_at, compared.prediction.margin[heard])
    apart = np.abs(likelihood.heard_motion(residual, share, scale, spacing)[0])
    return apart > stats.t.ppf(0.975, likelihood.FREQUENCY_FREEDOM) * scale
