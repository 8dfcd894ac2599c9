"""Calibration of whole campaigns: what was put in comes out, within the deviations that are stated."""

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from chatter_core.evidence import Comparison, base_model, calibrate, read_campaign
from chatter_core.evidence.fit import fit
from chatter_core.evidence.intervals import profile_interval
from chatter_core.evidence.likelihood import balanced_error
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.parameters import column
from tests.synthetic import RPM, campaign, drawn_truth, measured, receptance, tip_machine, trials
from tests.unit.test_candidates import candidate
from tests.unit.test_unbent import responses_with, with_one_front_bearing

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
SEEDS = 20
#: Three lines about each resonance: few enough that all of them are independent facts.
LINES = np.array([570.0, 600.0, 630.0]) * 2.0 * np.pi


def planned(rng):
    """Sixteen trials about the lobes of the tip machine, and its response in x."""
    speeds = rng.choice(np.linspace(3500.0, 5000.0, 8), 16) * RPM
    cuts = trials(speeds, rng.uniform(3e-3, 6.5e-3, 16))
    return campaign(tip_machine(), trials=cuts, receptances=(receptance(LINES),))


@pytest.fixture(scope="module")
def fits():
    """Fits of campaigns whose parameters were drawn from the priors: parameters, truths and fits."""
    truths, found = [], []
    for seed in range(SEEDS):
        rng = np.random.default_rng(seed)
        plan = planned(rng)
        truths.append(drawn_truth(base_model(plan), rng))
        problem = Comparison(model=base_model(measured(plan, truths[-1], rng)))
        found.append(fit(problem))
    return np.array(truths), found


def test_fits_arrive(fits):
    _, found = fits
    # Chatter frequencies jump from branch to branch: one fit in ten may end at such an edge, and says so.
    lost = [fit.reason for fit in found if not fit.converged]
    assert len(lost) <= SEEDS // 10
    assert all("edge" in reason for reason in lost)


def test_stated_deviations_cover_the_truth(fits):
    truths, found = fits
    # Truths drawn from the priors: a posterior's 90 % interval holds nine in ten of them, whatever the data.
    standard = np.array(
        [(fit.estimate - truth) / fit.standard_deviation for fit, truth in zip(found, truths, strict=True)]
    )
    inside = (np.abs(standard) < stats.norm.ppf(0.95)).sum(axis=0)
    # Each parameter alone: one in a thousand by the binomial law.
    assert inside.min() >= stats.binom.ppf(1e-3, SEEDS, 0.9)
    # All together; those of one fit are not independent, so the bound is that of SEEDS times two trials.
    share = inside.sum() / standard.size
    low, high = stats.binom.ppf([0.005, 0.995], 2 * SEEDS, 0.9) / (2 * SEEDS)
    assert low <= share <= high
    # Means: no bias beyond three standard errors.
    assert np.abs(standard.mean(axis=0)).max() < 3.0 * standard.std(axis=0).max() / np.sqrt(SEEDS)


def test_data_tell_more_than_the_priors(fits):
    truths, found = fits
    width = column(found[0].parameters, "prior_width")
    before = np.sqrt(((truths / width) ** 2).mean(axis=0))
    after = np.sqrt(((np.array([fit.estimate for fit in found]) - truths) ** 2).mean(axis=0)) / width
    names = [parameter.name for parameter in found[0].parameters]
    for name in ("specific_cutting_energy", "damping", "tip_frequency", "tip_stiffness"):
        assert after[names.index(name)] < 0.75 * before[names.index(name)], name
    stated = np.array([fit.standard_deviation for fit in found]) / width
    # A deviation larger than the prior's would say that data took knowledge away.
    assert stated.max() <= 1.0 + 1e-9


def test_refitting_restarting_and_profiling_agree():
    rng = np.random.default_rng(100)
    plan = planned(rng)
    comparison = Comparison(model=base_model(measured(plan, drawn_truth(base_model(plan), rng), rng)))
    found = calibrate(comparison)
    assert found.converged
    start = Comparison.evaluate(comparison, comparison.model.nulls).log_likelihood
    assert found.log_likelihood > start
    again = calibrate(comparison, start=found.estimate)
    assert again.log_posterior >= found.log_posterior - 0.01
    without = calibrate(comparison, start=found.estimate, fixed=["damping"])
    assert without.estimate[2] == found.estimate[2]
    assert without.log_posterior >= found.log_posterior - 0.01
    interval = profile_interval(comparison, found, "tip_stiffness", coverage=0.9)
    half = 0.5 * (interval.high - interval.low)
    # The posterior is nearly normal in what a response has told well.
    assert half == pytest.approx(1.645 * found.standard_deviation[4], rel=0.3)
    assert interval.low < found.estimate[4] < interval.high


def test_a_campaign_without_effects_is_explained_by_its_nuisances():
    """d01: an independent nonlinear simulation; only what a data sheet gets wrong was changed."""
    measurements = read_campaign(CAMPAIGNS / "d01")
    comparison = Comparison(model=base_model(measurements))
    nominal = comparison.compare(comparison.model.nulls)
    found = calibrate(comparison)
    refitted = comparison.compare(found.estimate)
    assert found.converged
    # No pull is a finding: three widths would be one.
    assert np.abs(found.pull).max() < 3.0
    outcome = measurements.trials.outcome
    before = balanced_error(outcome, nominal.prediction.margin)
    after = balanced_error(outcome, refitted.prediction.margin)
    assert after < before
    # Three in a hundred labels are wrong, and a stable trial weighs half of what one with chatter does.
    assert after <= 0.06
    gained = {name: refitted.log_likelihoods[name] - nominal.log_likelihoods[name] for name in nominal.log_likelihoods}
    assert min(gained.values()) > 0.0


def test_a_model_that_lacks_an_effect_is_calibrated_to_the_highest_of_its_maxima(reference_machine):
    """Responses at speeds that no preload meets together: what the responses alone approach ends 21 nats lower."""
    machine, speeds = with_one_front_bearing(reference_machine), np.array([0.0, 12000.0, 18000.0]) * RPM
    comparison = Comparison(model=base_model(responses_with(machine, candidate("thermal_preload"), speeds, rise=1.5)))
    names, nulls = [p.name for p in comparison.parameters], comparison.model.nulls
    climb = Climb(comparison, np.ones(len(names), dtype=bool))
    starts = [np.where([name == "preload" for name in names], value, nulls) for value in (0.7, 1.4)]
    lower, higher = sorted(climb.from_start(start).log_posterior for start in starts)
    assert lower < higher - 15.0
    # Climbs end where the next step promises a two-hundredth of a nat.
    assert calibrate(comparison).log_posterior > higher - 0.1
