"""Corrections: the covariance that is stated, and curves that an effect or a nuisance makes just as well."""

from types import SimpleNamespace

import numpy as np
import pytest

from chatter_core.effects import variants
from chatter_core.evidence import CampaignModel, Comparison, base_model
from chatter_core.evidence.corrections.curve import LENGTH, MOST_KNOTS, Curve, curve_over, matern
from chatter_core.evidence.corrections.fitted import checks_failed, corrected_model
from chatter_core.evidence.corrections.terms import (
    AMPLITUDE,
    DAMPING,
    FEED,
    FORCE,
    IMMERSION,
    MODES,
    SEATS,
    SPEED,
    TRIAL,
    Correction,
    corrections_of,
)
from chatter_core.stages import Stages
from tests.synthetic import RPM, campaign, receptance, tip_machine, trials

SPEEDS = np.linspace(3000.0, 12000.0, 9) * RPM
DEPTHS = np.geomspace(5e-4, 5e-3, 9)
#: Eigenvectors and splines of seven knots lose a few digits of sixteen.
ROUNDING = 1e-12


@pytest.mark.parametrize("level", [True, False])
def test_independent_coordinates_have_the_covariance_that_is_stated(level):
    curve = curve_over(SPEEDS, amplitude=AMPLITUDE, level=level)
    knots = np.array(curve.knots)
    apart = np.sqrt(5.0) * np.abs(knots[:, None] - knots) / (LENGTH * (knots[-1] - knots[0]))
    stated = AMPLITUDE**2 * (1.0 + apart + apart**2 / 3.0) * np.exp(-apart)
    if not level:
        stated = stated - stated.mean(axis=0) - stated.mean(axis=1)[:, None] + stated.mean()
    assert len(knots) == MOST_KNOTS
    assert curve.count == MOST_KNOTS - (not level)
    np.testing.assert_allclose(curve.root @ curve.root.T, stated, atol=ROUNDING)
    np.testing.assert_allclose(curve.slope(knots), curve.root, atol=ROUNDING)


def test_the_spline_follows_the_process_between_its_knots():
    knots = np.array(curve_over(SPEEDS, amplitude=AMPLITUDE, level=True).knots)
    between = np.linspace(knots[0], knots[-1], 200)
    both = matern(np.concatenate([between, knots]), LENGTH * (knots[-1] - knots[0]), AMPLITUDE)
    curve = Curve(knots=tuple(knots), amplitude=AMPLITUDE, level=True)
    spline = curve.slope(between) @ np.linalg.inv(curve.root)
    apart = np.concatenate([np.eye(200), -spline], axis=1)
    # As the comment on the number of knots says: a tenth of the width.
    assert np.sqrt(np.diag(apart @ both @ apart.T)).max() < 0.1 * AMPLITUDE


def test_beyond_the_range_a_curve_stays_as_at_its_ends():
    curve = curve_over(SPEEDS, amplitude=AMPLITUDE, level=True)
    ends = curve.slope(np.array([SPEEDS[0], SPEEDS[-1]]))
    np.testing.assert_array_equal(curve.slope(np.array([0.0, 2.0 * SPEEDS[-1]])), ends)


def plan(machine, **stated):
    cuts = trials(SPEEDS, DEPTHS, chatter_frequency=np.ones(len(SPEEDS)), **stated)
    lines = np.linspace(300.0, 1500.0, 40) * 2.0 * np.pi
    responses = tuple(receptance(lines, speed=speed * RPM) for speed in (0.0, 9000.0))
    return campaign(machine, trials=cuts, receptances=responses)


def numbers(curve, log_factor):
    """The coordinates of a curve that has these values at its knots."""
    found = np.linalg.lstsq(curve.root, log_factor, rcond=None)[0]
    np.testing.assert_allclose(curve.root @ found, log_factor, atol=1e-10)
    return found


def predicted(model, named):
    values = model.nulls
    names = [p.name for p in model.parameters]
    for name, value in named.items():
        values[names.index(name)] = value
    return model.predict(values)


def same(one, other):
    """What two predictions say is the same, to what the root finder of the margins and rounding leave."""
    np.testing.assert_allclose(one.margin, other.margin, atol=1e-6)
    np.testing.assert_allclose(one.chatter_frequency, other.chatter_frequency, rtol=1e-6)
    for left, right in zip(one.receptances, other.receptances, strict=True):
        np.testing.assert_allclose(left, right, rtol=1e-8)


def correction(model, quantity, axis):
    (found,) = [one for one in corrections_of(model, model.nulls) if (one.quantity, one.axis) == (quantity, axis)]
    return found


def corrected_prediction(model, found, log_factor, **others):
    """Predict with a curve of these values at its knots, and other parameters by name."""
    z = numbers(found.curve, log_factor)
    named = {p.name: value for p, value in zip(found.parameters, z, strict=True)}
    return predicted(corrected_model(model, found), {**named, **others})


def test_damping_that_an_effect_makes_rise_is_a_curve_and_the_nuisance():
    made = plan(tip_machine())
    model, change = base_model(made), 0.4
    found = correction(model, DAMPING, SPEED)
    log_factor = change * np.array(found.curve.knots) / (10_000.0 * RPM)
    got = corrected_prediction(model, found, log_factor - log_factor.mean(), damping=log_factor.mean())
    (effect,) = variants("speed_dependent_damping")
    wanted = predicted(base_model(made, (effect,)), {"speed_dependent_damping.change": change})
    same(got, wanted)


@pytest.mark.parametrize("axis", [SPEED, FEED, IMMERSION, TRIAL])
def test_a_force_that_is_larger_as_a_whole_is_that_of_the_nuisance(axis):
    feeds, immersions = np.tile([0.05, 0.1, 0.2], 3) * 1e-3, np.tile([0.3, 0.5, 0.7], 3)
    model = base_model(plan(tip_machine(), feed_per_tooth=feeds, radial_immersion=immersions))
    curve = curve_over(_range(model, axis), amplitude=AMPLITUDE, level=True)
    at = 0.0 if axis is TRIAL else None
    whole = Correction(quantity=FORCE, axis=axis, curve=curve, at=at)
    got = corrected_prediction(model, whole, np.full(len(curve.knots), 0.25))
    same(got, predicted(model, {"specific_cutting_energy": 0.25}))


def _range(model, axis):
    cuts = model.campaign.trials
    return {
        SPEED.name: cuts.spindle_speed,
        FEED.name: cuts.feed_per_tooth,
        IMMERSION.name: cuts.radial_immersion,
        TRIAL.name: cuts.trial.astype(float),
    }[axis.name]


@pytest.mark.parametrize("axis", [SPEED, TRIAL])
def test_stiffer_modes_of_the_same_mass_are_two_nuisances(axis):
    model = base_model(plan(tip_machine()))
    found = correction(model, MODES, axis)
    got = corrected_prediction(model, found, np.full(len(found.curve.knots), 0.1))
    # k larger by exp(0.1) at the same mass raises frequencies by exp(0.05).
    same(got, predicted(model, {"tip_stiffness": 0.1, "tip_frequency": 0.05}))


@pytest.mark.parametrize("axis", [SPEED, TRIAL])
def test_softer_seats_are_a_factor_on_all_of_them(axis, reference_machine):
    model = base_model(plan(reference_machine))
    found = correction(model, SEATS, axis)
    got = corrected_prediction(model, found, np.full(len(found.curve.knots), -0.3))

    class Softer:
        """Seats with a factor, written down for itself."""

        parameters = ()

        def apply(self, stages, values):
            before = stages.seat_stiffness
            return Stages(
                **{**vars(stages), "seat_stiffness": lambda rotor, state: np.exp(-0.3) * before(rotor, state)}
            )

    same(got, predicted(CampaignModel(campaign=model.campaign, terms=(*model.terms, Softer())), {}))


def test_what_cannot_be_told_is_not_asked():
    few = campaign(tip_machine(), trials=trials(np.full(9, 6000.0) * RPM, DEPTHS))
    model = base_model(few)
    assert {str(one) for one in corrections_of(model, model.nulls)} == {
        "cutting force against the order of the trials",
        "stiffness of the modes against the order of the trials",
    }


def test_a_wearing_edge_is_felt_trial_by_trial():
    """Every stretch of trials is told by its own force: as if each had been a campaign of its own."""
    model = base_model(plan(tip_machine()))
    found = correction(model, FORCE, TRIAL)
    rising = np.linspace(-0.3, 0.3, len(found.curve.knots))
    got = corrected_prediction(model, found, rising)
    ordered = corrected_model(model, found)
    for rows in ordered.stretches:
        factor = np.interp(rows.mean(), found.curve.knots, rising)
        alone = predicted(model, {"specific_cutting_energy": factor})
        np.testing.assert_allclose(got.margin[rows], alone.margin[rows], atol=1e-6)


@pytest.mark.parametrize("at_bound", [False, True])
def test_how_large_an_effect_has_to_be_is_no_check_that_a_correction_could_mend(at_bound):
    (effect,) = variants("cutting_speed_coefficient")
    (size,) = effect.parameters
    model = base_model(plan(tip_machine()), (effect,))
    own = np.array([parameter.name == size.name for parameter in model.parameters])
    pull = np.where(own, 5.0, 0.0)
    fit = SimpleNamespace(
        parameters=model.parameters, estimate=model.nulls, pull=pull, at_bound=own if at_bound else np.zeros_like(own)
    )
    found = checks_failed(Comparison(model=model), fit)
    assert [one.band["parameter"] for one in found if one.quantity == "calibration"] == [size.name] * at_bound
