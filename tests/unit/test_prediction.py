"""Predictions of a campaign: the chain's own answers at each trial's setup, and nothing computed for nothing."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core import chain, tip
from chatter_core.contact import forced_contact
from chatter_core.effects import variants
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Comparison, base_model, cuts
from chatter_core.evidence.likelihood import to_lines
from chatter_core.evidence.margin import LIMIT_REACH, REACH
from chatter_core.evidence.measured import (
    DIRECTIONS,
    OUTCOMES,
    BearingStiffness,
    Limits,
    NaturalFrequencies,
)
from chatter_core.evidence.nuisances import machine_nuisances
from chatter_core.evidence.parameters import Parameter
from chatter_core.evidence.prediction import FITTING_METHOD, STRUCTURAL, CampaignModel
from chatter_core.lobes import lobe_block
from chatter_core.stability import motions
from tests.synthetic import RPM, campaign, receptance, tip_machine, trials

SPEEDS = np.array([3600.0, 4700.0, 7000.0]) * RPM
FREQUENCIES = np.linspace(300.0, 3000.0, 40) * 2.0 * np.pi


def first_limits(machine, speeds, mode_count):
    """First limit depths (speed,) [m] by the search of the lobes."""
    block = lobe_block(
        machine,
        spindle_speed=speeds,
        axial_depth=np.linspace(2e-4, 6e-3, 30),
        mode_count=mode_count,
        modal_parameters="dynamic",
        method=FITTING_METHOD,
    )
    return block.limit_depth[:, 0]


def test_margins_are_measured_from_the_limit_depth():
    machine = tip_machine()
    limit = first_limits(machine, SPEEDS, 1)
    shares = np.log([0.8, 0.95, 1.1])
    model = base_model(campaign(machine, trials=trials(SPEEDS, limit * np.exp(shares))))
    # Limit depths are found to 5e-7 m, margins to 1e-5.
    assert model.predict(model.nulls).margin == pytest.approx(shares, abs=2e-3)
    assert model.predict(model.nulls).failed == 0


def test_chatter_is_heard_where_it_grows_also_where_its_growth_leaps():
    """Before a leap, as where another tooth comes to cut, there is another motion: rounding would tell which."""
    machine = tip_machine(teeth=3)
    # Of 22 speeds those at which it leaps, and some others.
    speeds = np.linspace(2500.0, 8000.0, 22)[[1, 5, 10, 18]] * RPM
    speed, depth = np.meshgrid(speeds, np.geomspace(5e-4, 8e-3, 8), indexing="ij")
    unequal = variants("variable_pitch")[2]
    model = CampaignModel(campaign=campaign(machine, trials=trials(speed.ravel(), depth.ravel())), terms=(unequal,))
    found = model.predict(np.array([0.12, 30.0, *model.nulls[2:]]))
    quiet = (found.cuts.margin < 0.0) & (found.cuts.crossing > 0.0)

    def growth(offset):
        return np.log(model.stability(found, np.where(quiet, offset, 0.0)).spectral_radius[quiet])

    assert unequal.pattern == "sinusoidal"
    # To what ln|mu| at smooth crossings is found.
    assert growth(cuts.where_it_chatters(found.cuts.margin, found.cuts.crossing)).min() > -1e-4
    # There is a leap among them.
    assert growth(found.cuts.crossing - 1e-3).min() < -0.01


def test_limit_depths_are_cuts_that_should_have_no_margin():
    machine = tip_machine()
    limit = first_limits(machine, SPEEDS, 1)
    table = Limits(spindle_speed=SPEEDS, limit_depth=1.02 * limit, uncertainty=0.05 * limit)
    comparison = Comparison(model=base_model(campaign(machine, limits=table)))
    found = comparison.compare(comparison.model.nulls)
    assert found.prediction.limit_margin == pytest.approx(np.full(3, np.log(1.02)), abs=2e-3)
    # In deviations, each of which Student's t with 4 degrees of freedom takes for the root of 5/7.
    assert found.contributions["limit_depth"].coordinates[:, 0] == pytest.approx(
        np.full(3, np.sqrt(5.0 / 7.0) * np.log(1.02) * 1.02 / 0.05), abs=0.05
    )
    assert list(found.log_likelihoods) == ["limit_depth"]


def test_limit_depths_that_are_far_off_are_told_as_far_and_draw_a_fit():
    machine = tip_machine()
    limit = first_limits(machine, SPEEDS[:1], 1)[0]
    far = np.log([5.0, 0.3, 100.0])
    table = Limits(spindle_speed=np.repeat(SPEEDS[:1], 3), limit_depth=limit * np.exp(far), uncertainty=np.ones(3))
    cut = trials(SPEEDS[:1], np.array([0.3 * limit]))
    model = base_model(campaign(machine, trials=cut, limits=table))
    found = model.predict(model.nulls)
    assert found.limit_margin == pytest.approx([far[0], far[1], LIMIT_REACH], abs=2e-3)
    # A cut that is so far from the boundary is sure, and told as sure as before.
    assert found.margin.tolist() == [-REACH]
    # A force that is larger by a twentieth of its prior's width takes the limit less deep by as much.
    harder, step = model.nulls, 0.02 * model.parameters[0].prior_width
    harder[0] = step
    moved = model.predict(harder, found).limit_margin - found.limit_margin
    assert model.parameters[0].name == "specific_cutting_energy"
    assert moved == pytest.approx([step, step, 0.0], abs=1e-4)


def test_trials_are_cut_as_each_was_set_up(reference_machine):
    speeds, depths = np.repeat(SPEEDS[:1], 5) * 3.0, np.full(5, 1.2e-3)
    stated = {
        "preload": np.array([np.nan, 300.0, 300.0, np.nan, np.nan]),
        "radial_immersion": np.array([np.nan, np.nan, 0.1, np.nan, np.nan]),
        "feed_per_tooth": np.array([np.nan, np.nan, np.nan, 0.2e-3, np.nan]),
        "direction": np.array([-1, -1, -1, -1, DIRECTIONS.index("up")], dtype=np.int8),
        "outcome": np.full(5, OUTCOMES.index("chatter"), dtype=np.int8),
        "chatter_frequency": np.full(5, 3000.0),
    }
    values = np.array([0.02, -0.05, 0.1, 0.01, 0.05, 0.0, 0.0])
    together = base_model(campaign(reference_machine, trials=trials(speeds, depths, **stated))).predict(values)
    for index in range(5):
        setup = {"radial_immersion": stated["radial_immersion"], "feed_per_tooth": stated["feed_per_tooth"]}
        update = {key: float(value[index]) for key, value in setup.items() if np.isfinite(value[index])}
        if index == 4:
            update["direction"] = "up"
        machine = reference_machine
        if np.isfinite(stated["preload"][index]):
            machine = machine.with_preload(float(stated["preload"][index]))
        machine = machine.model_copy(update={"process": machine.process.model_copy(update=update)})
        alone = trials(
            speeds[:1], depths[:1], outcome=stated["outcome"][:1], chatter_frequency=stated["chatter_frequency"][:1]
        )
        found = base_model(campaign(machine, trials=alone)).predict(values)
        # Alone or in a batch the Krylov spaces end at another step.
        assert together.margin[index] == pytest.approx(found.margin[0], abs=1e-5)
        assert together.chatter_frequency[index] == pytest.approx(found.chatter_frequency[0], rel=1e-5)
    # The force is proportional to the chip, and up-milling mirrors down-milling on an axisymmetric rotor.
    assert len(np.unique(together.margin.round(5))) == 3


def everything(machine):
    """A campaign with something of every kind."""
    count = 4
    preload = machine.spindle.preload if machine.spindle else 100.0
    return campaign(
        machine,
        trials=trials(
            np.linspace(6000.0, 9000.0, count) * RPM,
            np.full(count, 1e-3),
            outcome=np.array([0, 1, 2, 2], dtype=np.int8),
            chatter_frequency=np.array([np.nan, np.nan, 9000.0, np.nan]),
        ),
        receptances=(receptance(FREQUENCIES), receptance(FREQUENCIES, speed=5000.0 * RPM, axis=1)),
        natural_frequencies=NaturalFrequencies(
            spindle_speed=np.array([0.0, 0.0, 600.0]),
            mode=np.array([1, 2, 1]),
            natural_frequency=np.array([5000.0, 8000.0, 4900.0]),
            damping_ratio=np.array([0.02, np.nan, 0.03]),
        ),
        stiffness=BearingStiffness(
            spindle_speed=np.array([0.0, 900.0]),
            preload=np.array([preload, 2.0 * preload]),
            radial_stiffness=np.array([1e8, 1.2e8]),
            axial_stiffness=np.array([np.nan, 3e7]),
        ),
        limits=Limits(spindle_speed=np.array([700.0]), limit_depth=np.array([1.1e-3]), uncertainty=np.array([1e-4])),
    )


def fields(prediction):
    """The numbers of a prediction."""
    return [
        prediction.margin,
        prediction.chatter_frequency,
        prediction.limit_margin,
        *prediction.receptances,
        prediction.natural_frequency,
        prediction.damping_ratio,
        prediction.radial_stiffness,
        prediction.axial_stiffness,
    ]


def test_what_is_taken_over_from_nearby_is_what_would_be_computed(reference_machine):
    model = base_model(everything(reference_machine))
    here = model.predict(model.nulls)
    for index, parameter in enumerate(model.parameters):
        for share in (0.02, 0.5):
            values = model.nulls.copy()
            values[index] = share * parameter.prior_width
            there, fresh = model.predict(values, here), model.predict(values)
            for found, expected in zip(fields(there), fields(fresh), strict=True):
                # Followed crossings: what moved, squared.
                assert found == pytest.approx(expected, rel=1e-9, abs=5e-5, nan_ok=True), parameter.name
            kept = {"cut": "response", "measurement": "cuts"}.get(parameter.touches)
            assert kept is None or getattr(there, kept) is getattr(here, kept)


def test_motions_that_cannot_grow_are_not_looked_for_nearby(reference_machine, monkeypatch):
    # Shallow cuts, where one motion grows at most, and deep ones, where several do.
    speeds, depths = np.linspace(4000.0, 14000.0, 8) * RPM, np.tile([4e-4, 4e-3], 4)
    plan = trials(speeds, depths)
    plan = replace(plan, chatter_frequency=np.full(8, 900.0 * 2.0 * np.pi))
    model = base_model(campaign(reference_machine, trials=plan))
    here = model.predict(model.nulls)
    aside = model.nulls + [0.01 * p.prior_width if p.touches == "structure" else 0.0 for p in model.parameters]
    fresh, asked = model.predict(aside).cuts, []

    def noted(stages, built, speed_index, depth, method, count):
        asked.append(len(depth))
        return motions(stages, built, speed_index, depth, method, count)

    monkeypatch.setattr(cuts, "motions", noted)
    found = model.predict(aside, here).cuts
    several = np.isfinite(fresh.other_frequency).any(axis=1)
    assert several.sum() <= sum(asked) < len(speeds)
    # Crossings that are followed are off by the square of what moved.
    for name in ("chatter_frequency", "other_frequency", "share", "tooth_passing"):
        assert getattr(found, name) == pytest.approx(getattr(fresh, name), rel=1e-4, abs=1e-6, nan_ok=True), name
    # What is not known of the second motion is asked.
    asked.clear()
    unknown = replace(here, cuts=replace(here.cuts, runner_up=np.full(8, np.nan)))
    model.predict(aside, unknown)
    assert sum(asked) == len(speeds)


def test_motions_of_unlike_teeth_are_found_from_those_nearby(reference_machine, monkeypatch):
    """Those of every cut, at its crossing and where it is heard, once they are known of the model nearby."""
    plan = trials(np.repeat(np.array([8000.0, 11000.0]) * RPM, 2), np.tile([4e-4, 1.6e-3], 2))
    plan = replace(plan, chatter_frequency=np.full(4, 900.0 * 2.0 * np.pi))
    model = base_model(campaign(reference_machine, trials=plan), variants("tool_runout"))
    own = np.array(
        [{"tool_runout.runout_um": 60.0, "tool_runout.phase_deg": 20.0}.get(p.name, 0.0) for p in model.parameters]
    )
    here = model.predict(own)
    step = 0.005 * np.array([p.prior_width for p in model.parameters])
    model.predict(own + step, here)
    # The same lines, and no forces.
    unknown = replace(here, cuts=replace(here.cuts))
    unknown.cuts.forces[0] = None
    fresh, asked = model.predict(own - step, unknown).cuts, []

    def noted(*arguments):
        cut, known = arguments[0], arguments[-1]
        asked.append(None if known is None else np.isfinite(known.near(cut.spindle_speed, cut.axial_depth)))
        return forced_contact(*arguments)

    monkeypatch.setattr(chain, "forced_contact", noted)
    found = model.predict(own - step, here).cuts
    assert asked
    assert all(known is not None and known.all() for known in asked)
    # Forces arrive at 1e-9 of the largest, and multipliers at 1e-7.
    for name in ("margin", "crossing", "chatter_frequency", "other_frequency", "share"):
        assert getattr(found, name) == pytest.approx(getattr(fresh, name), rel=1e-6, abs=1e-6, nan_ok=True), name


def test_teeth_that_are_hardly_unlike_are_heard_as_alike_ones_are(reference_machine):
    """Every motion that grows, by its strongest line: not by those a revolution apart that have vanished."""
    count = 4
    plan = trials(np.array([2500.0, 3000.0, 4500.0, 5000.0]) * RPM, np.full(count, 4e-3))
    plan = replace(plan, chatter_frequency=np.full(count, 900.0 * 2.0 * np.pi))
    model = base_model(campaign(reference_machine, trials=plan), variants("tool_runout"))
    alike = np.array([p.null for p in model.parameters])
    unlike = np.array([{"tool_runout.runout_um": 1e-4}.get(p.name, p.null) for p in model.parameters])
    (frequency, share, passing), (other, other_share, _) = (
        model.predict(values).motions(np.ones(count, dtype=bool)) for values in (alike, unlike)
    )
    assert (np.isfinite(frequency).sum(axis=1) > 1).sum() > 1
    assert np.array_equal(np.isfinite(frequency), np.isfinite(other))
    assert share.sum(axis=1) == pytest.approx(np.ones(count))
    # Multipliers beside the critical one are found to a residual of 1e-3.
    assert other_share == pytest.approx(share, abs=5e-3)
    apart = np.abs(to_lines(other, frequency, passing[:, None])).min(axis=-1)[np.isfinite(frequency)]
    assert apart == pytest.approx(np.zeros(len(apart)), abs=2.0 * np.pi * 0.5)


def test_sensors_show_gain_phase_and_frequency_scale():
    machine = tip_machine()
    model = base_model(campaign(machine, receptances=(receptance(FREQUENCIES),)))
    values = model.nulls.copy()
    values[-3:] = 0.02, 0.05, 0.003
    modes = tip.measured_modes(machine.tip, np.zeros(1))
    expected = tip.receptance(modes, FREQUENCIES * np.exp(-0.003))[0, :, 0, 0] * np.exp(0.02 + 0.05j)
    assert model.predict(values).receptances[0] == pytest.approx(expected, rel=1e-12)


def test_tables_hold_the_structures_own_numbers(reference_machine):
    model = base_model(everything(reference_machine))
    found = model.predict(model.nulls)
    built = chain.structure(reference_machine, np.array([0.0, 600.0]), mode_count=2)
    assert found.natural_frequency == pytest.approx(built.modes.natural_frequency[[0, 0, 1], [0, 1, 0]], rel=1e-9)
    assert found.damping_ratio == pytest.approx(built.modes.damping_ratio[[0, 0, 1], [0, 1, 0]], rel=1e-9)
    double = reference_machine.with_preload(2.0 * reference_machine.spindle.preload)
    bearing = chain.structure(double, np.array([900.0]), mode_count=1).bearing
    assert found.radial_stiffness[1] == pytest.approx(bearing.radial_stiffness[0], rel=1e-9)
    assert found.axial_stiffness[1] == pytest.approx(bearing.axial_stiffness[0], rel=1e-9)


def test_every_quantity_has_its_likelihood_and_the_cheap_ones_come_alone(reference_machine):
    comparison = Comparison(model=base_model(everything(reference_machine)))
    found = comparison.compare(comparison.model.nulls)
    assert {name: len(part.log_density) for name, part in found.contributions.items()} == {
        "outcome": 4,
        "chatter_frequency": 1,
        "receptance": 80,
        "natural_frequency": 3,
        "damping_ratio": 2,
        "bearing_stiffness": 3,
        "limit_depth": 1,
    }
    evaluation = comparison.evaluate(comparison.model.nulls)
    assert evaluation.log_likelihood == pytest.approx(sum(found.log_likelihoods.values()), rel=1e-12)
    assert len(evaluation.coordinates) == 4 * 3 + 1 + 2 * 80 + 3 + 2 + 3 + 1
    assert evaluation.datum.max() == len(evaluation.log_density) - 1
    cheap = comparison.structural.compare(comparison.model.nulls)
    assert cheap.prediction.cuts is None
    assert set(cheap.log_likelihoods) == set(STRUCTURAL)
    assert "chatter_frequency" not in comparison.smooth.quantities
    assert comparison.smooth.smooth is None


def test_what_the_model_cannot_answer_is_marked_and_counts_as_wrong():
    machine = tip_machine()
    table = NaturalFrequencies(
        spindle_speed=np.zeros(2),
        mode=np.array([1, 7]),
        natural_frequency=np.array([3770.0, 9000.0]),
        damping_ratio=np.full(2, np.nan),
    )
    stiffness = BearingStiffness(
        spindle_speed=np.zeros(1), preload=np.ones(1), radial_stiffness=np.ones(1), axial_stiffness=np.full(1, np.nan)
    )
    # At 0.4 rad/s more than 600 waves of the mode pass between two teeth: nothing is said of such a cut.
    crawling = trials([0.4], [1e-3], outcome=np.array([2], dtype=np.int8), chatter_frequency=np.array([3770.0]))
    measured = campaign(machine, trials=crawling, natural_frequencies=table, stiffness=stiffness)
    found = Comparison(model=base_model(measured)).compare(base_model(measured).nulls)
    assert found.prediction.failed == 3
    assert found.contributions["outcome"].log_density == pytest.approx([np.log(0.04)])
    assert found.contributions["natural_frequency"].coordinates[1, 0] == 10.0
    assert found.contributions["bearing_stiffness"].coordinates[0, 0] == 10.0


class Stiffer:
    """An effect: a stage that is wrapped, with two parameters of its own."""

    parameters = (
        Parameter(name="rise", unit="", doc="", prior_width=0.1, lower=0.0),
        Parameter(name="exponent", unit="", doc="", prior_width=0.5, prior_mean=2.0, null=2.0),
    )

    def apply(self, stages, values):
        def tip_modes(known, spindle_speed, mode_count):
            modes = stages.tip_modes(known, spindle_speed, mode_count)
            factor = 1.0 + values[0] * (spindle_speed[:, None] / 1000.0) ** values[1]
            return replace(modes, natural_frequency=modes.natural_frequency * factor)

        return replace(stages, tip_modes=tip_modes)


def test_an_effect_joins_the_vector_and_its_null_is_the_base_model():
    measured = everything(tip_machine())
    base, wider = base_model(measured), base_model(measured, effects=(Stiffer(),))
    names = [parameter.name for parameter in wider.parameters]
    assert names[5:7] == ["rise", "exponent"]
    assert names[:5] + names[7:] == [parameter.name for parameter in base.parameters]
    for found, expected in zip(fields(wider.predict(wider.nulls)), fields(base.predict(base.nulls)), strict=True):
        assert found == pytest.approx(expected, rel=1e-12, nan_ok=True)
    values = wider.nulls.copy()
    values[5] = 0.1
    plain, changed = base.predict(base.nulls), wider.predict(values)
    # Speed squared: nothing at rest, 0.1 times (600/1000)^2 at 600 rad/s.
    expected = plain.natural_frequency * [1.0, 1.0, 1.036]
    assert changed.natural_frequency == pytest.approx(expected, rel=1e-9, nan_ok=True)


def test_a_mode_that_only_the_cut_feels_is_judged_with_the_others():
    measured = everything(tip_machine())
    (effect,) = [one for one in variants("workpiece_mode") if one.axis == "y"]
    model = base_model(measured, effects=(effect,))
    values = model.nulls.copy()
    values[[p.name for p in model.parameters].index("workpiece_mode.compliance_um_n")] = 0.5
    prediction = model.predict(values)
    found = model.stability(prediction, np.zeros(len(model.cuts)))
    highest = int(prediction.structures[0].modes.label.max())
    assert found.mode_share.shape == (len(model.cuts), highest + 1)
    assert np.isfinite(found.spectral_radius).all()


def test_two_terms_cannot_share_a_name():
    measured = everything(tip_machine())
    twice = CampaignModel(campaign=measured, terms=machine_nuisances(measured.machine) * 2)
    with pytest.raises(InvalidInput, match=r"parameter kn: two terms of the model have one of this name"):
        twice.nulls  # noqa: B018
