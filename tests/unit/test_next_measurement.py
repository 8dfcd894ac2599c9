"""The next measurement: what parts two hypotheses shows in what they act on, and in nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.effects import variants
from chatter_core.evidence import CampaignModel, Comparison, base_model, calibrate
from chatter_core.evidence.candidates import Candidate, Hypothesis, carried, extended
from chatter_core.evidence.fit import fit
from chatter_core.evidence.measured import DIRECTIONS, OUTCOMES, Limits
from chatter_core.evidence.next_measurement import AT_REST, TURNING, divergence, next_receptances, other_cuts
from chatter_core.evidence.next_trial import expected_chatter, next_trial
from tests.synthetic import RPM, campaign, tip_machine, trials

SPEED, DEPTH = (
    axis.ravel()
    for axis in np.meshgrid(np.linspace(800.0, 3000.0, 8) * RPM, np.geomspace(1e-3, 2e-2, 6), indexing="ij")
)


@pytest.fixture(scope="module")
def base():
    plan = campaign(tip_machine(), trials=trials(SPEED, DEPTH))
    model = base_model(plan)
    chatter = model.predict(model.nulls, quantities=("outcome",)).margin > 0.0
    outcome = np.where(chatter, OUTCOMES.index("chatter"), OUTCOMES.index("stable")).astype(np.int8)
    comparison = Comparison(model=base_model(replace(plan, trials=replace(plan.trials, outcome=outcome))))
    return Hypothesis(candidates=(), comparison=comparison, fit=calibrate(comparison))


def at(base, name, variant=0, **sizes):
    """The base model with an effect of known size, as a fit that moved nothing else."""
    effect = variants(name)[variant]
    candidate = Candidate(name=name, settings={}, term=effect, shapes=(), place=effect.place())
    comparison = extended(base.comparison, [candidate])
    values = carried(comparison, base.fit)
    names = [parameter.name for parameter in comparison.parameters]
    for key, size in sizes.items():
        values[names.index(f"{name}.{key}")] = size
    # Fixed altogether: only the base model doubts its parameters.
    found = fit(comparison, starts=[values], fixed=names)
    return Hypothesis(candidates=(candidate,), comparison=comparison, fit=found)


def sure(hypothesis, share=1e-6):
    """A hypothesis that doubts its parameters by a share of what it did."""
    fit = hypothesis.fit
    return replace(hypothesis, fit=replace(fit, standard_deviation=share * fit.standard_deviation))


def test_a_cut_is_called_wrongly_as_often_as_was_fitted(base):
    place = [parameter.name for parameter in base.fit.parameters].index("mislabelled")

    def called(factor):
        estimate = base.fit.estimate.copy()
        estimate[place] = np.log(factor)
        return expected_chatter(
            replace(base, fit=replace(base.fit, estimate=estimate)), base.comparison.model.campaign.trials
        )

    # Usual are 4 %, of stable cuts and of those with chatter alike.
    chatters = (called(1.0) - 0.04) / 0.92
    assert called(2.0) == pytest.approx(0.08 + 0.84 * chatters, rel=1e-12)


def test_ploughing_shows_in_slow_cuts_and_in_no_receptance(base):
    ploughing = at(base, "process_damping", coefficient_n_m=3e5)
    # Both know their parameters alike, not at all worse: only what they say can differ.
    receptances = next_receptances(sure(base, 1e-9), ploughing)
    assert [one.expected_gain for one in receptances] == pytest.approx([0.0] * 9, abs=1e-12)
    cut = next_trial(base, ploughing)
    assert cut.expected_gain > 1.0
    assert cut.spindle_speed < 1500.0 * RPM


def test_asymmetry_shows_in_receptances_along_the_axes_and_best_at_rest_for_its_cost(base):
    softer = at(base, "directional_asymmetry", 1, stiffness_loss=0.2)
    found = next_receptances(base, softer)
    across = [one for one in found if one.kind == "receptance x over y"]
    assert [one.expected_gain for one in across] == pytest.approx([0.0] * 3, abs=1e-9)
    along = [one for one in found if one.kind == "receptance y over y"]
    assert {one.cost for one in along} == {AT_REST, TURNING}
    # Measured modes do not know the speed: it shows alike at all of them, and is most worth its cost at rest.
    gains = [one.expected_gain for one in along]
    assert gains == pytest.approx([gains[0]] * 3, rel=1e-6)
    assert max(along, key=lambda one: one.worth).spindle_speed == 0.0


def test_a_doubt_that_both_share_makes_a_measurement_tell_less():
    along = np.array([2.0, 0.0, 0.0])
    doubt = 1.5 * along[:, None]
    # 1/2 r^T S^-1 r, S being 1 + 9 along what parts them.
    assert divergence((along, doubt), (-along, doubt)) == pytest.approx(0.5 * 4.0 / (1.0 + 9.0))
    assert divergence((along, 0.0 * doubt), (-along, 0.0 * doubt)) == pytest.approx(0.5 * 4.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_divergence_is_that_of_two_normal_distributions(seed):
    """Against the covariances themselves, inverted as they stand."""
    rng = np.random.default_rng(seed)
    one, other = ((rng.standard_normal(7), rng.standard_normal((7, 3))) for _ in range(2))
    covariances = [np.eye(7) + doubt @ doubt.T for _, doubt in (one, other)]
    expected = 0.0
    for (apart, _), own, others in zip((one, other), covariances, covariances[::-1], strict=True):
        inverse = np.linalg.inv(own)
        expected += 0.25 * (np.trace(inverse @ others) - 7.0 + apart @ inverse @ apart)
    assert divergence(one, other) == pytest.approx(expected, rel=1e-12)


def test_other_cuts_stay_within_what_a_cut_can_be():
    machine = tip_machine(radial_immersion=0.8)
    kinds = other_cuts(machine)
    assert list(kinds.values()) == [
        {"feed_per_tooth": pytest.approx(4e-5)},
        {"feed_per_tooth": pytest.approx(2e-4)},
        {"radial_immersion": pytest.approx(0.4)},
        {"direction": DIRECTIONS.index("up")},
    ]
    assert other_cuts(tip_machine(direction="up"))["cut in down-milling"] == {"direction": DIRECTIONS.index("down")}
    across = tip_machine(direction="up", radial_immersion=1.0)
    assert list(other_cuts(across)) == [
        "cut with 0.04 mm per tooth",
        "cut with 0.2 mm per tooth",
        "cut with a radial immersion of 0.50",
    ]
    slot = tip_machine(direction="slot", radial_immersion=1.0)
    assert all("feed_per_tooth" in own for own in other_cuts(slot).values())


def test_a_cut_with_another_width_is_planned_so(base):
    model = base.comparison.model
    assert isinstance(model, CampaignModel)
    thin = at(base, "radial_immersion_error", offset=0.1)
    wide, narrow = (next_trial(base, thin, radial_immersion=width) for width in (0.75, 0.25))
    assert (wide.spindle_speed, wide.axial_depth) != (narrow.spindle_speed, narrow.axial_depth)


def up_milling(hypothesis):
    """The same hypothesis of the same cuts by a machine that mills up."""
    model = hypothesis.comparison.model
    turned = replace(model, campaign=replace(model.campaign, machine=tip_machine(direction="up")))
    return replace(hypothesis, comparison=replace(hypothesis.comparison, model=turned))


def test_a_cut_in_the_other_direction_is_one_by_a_machine_that_mills_so(base):
    wide = at(base, "radial_immersion_error", offset=0.1)
    cut = next_trial(base, wide, direction=DIRECTIONS.index("up"))
    assert cut == next_trial(up_milling(base), up_milling(wide))
    assert cut != next_trial(base, wide)


def test_limiting_depths_are_cuts_by_whose_range_the_next_one_is_planned(base):
    speed, depth = np.array([900.0, 1500.0, 2500.0]) * RPM, np.array([2e-3, 4e-3, 8e-3])
    measured = Limits(spindle_speed=speed, limit_depth=depth, uncertainty=0.1 * depth)
    comparison = Comparison(model=base_model(campaign(tip_machine(), limits=measured)))
    alone = Hypothesis(candidates=(), comparison=comparison, fit=calibrate(comparison))
    ploughing = at(alone, "process_damping", coefficient_n_m=3e5)
    cut = next_trial(sure(alone), ploughing)
    assert speed[0] <= cut.spindle_speed <= speed[-1]
    assert depth[0] <= cut.axial_depth <= depth[-1]
    assert cut.expected_gain > 1.0
    turning = {one.spindle_speed for one in next_receptances(sure(alone), ploughing)}
    assert turning == {0.0, 0.5 * speed[-1], speed[-1]}
