"""Where the fit of an effect begins beside a model that has bent, and beside the machine as described."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.evidence import Comparison, base_model
from chatter_core.evidence.candidates import extended
from chatter_core.evidence.likelihood import LINE_ERROR
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.pursuit import LEFT_GAIN, fit_hypothesis, ground
from chatter_core.evidence.starts import starts_at
from chatter_core.evidence.unbent import BENT, UNSEEN_AMPLITUDES, at_rest, has_bent, height_at_rest, unseen_starts
from chatter_core.machine import Machine
from tests.synthetic import RPM, campaign, measured, receptance, tip_machine, trials
from tests.unit.test_candidates import base_of, candidate

FREQUENCY = 2.0 * np.pi * np.arange(100.0, 4000.0, 5.0)


def responses_with(machine, new, speeds=(0.0,), **true):
    """A campaign of both direct responses at speeds, of a machine with an effect and other parameters, with noise."""
    plan = campaign(
        machine, receptances=tuple(receptance(FREQUENCY, speed=speed, axis=axis) for speed in speeds for axis in (0, 1))
    )
    model = extended(Comparison(model=base_model(plan)), [new]).model
    values = np.array([true.get(p.name.split(".")[-1], p.null) for p in model.parameters])
    rng = np.random.default_rng(1)
    parts = rng.standard_normal((2, 2 * len(speeds), FREQUENCY.size))
    noise = LINE_ERROR * (parts[0] + 1j * parts[1])
    exact = model.predict(values).receptances
    made = [replace(one, value=h * (1.0 + n)) for one, h, n in zip(plan.receptances, exact, noise, strict=True)]
    return replace(plan, receptances=tuple(made))


def comparison_with(new):
    plan = campaign(tip_machine(), trials=trials(np.array([8000.0, 9000.0]) * RPM, np.array([1e-3, 2e-3])))
    return extended(Comparison(model=base_model(plan)), [new])


def test_an_effect_on_modes_begins_where_it_tells_most_beside_a_bent_machine_or_an_unbent_one():
    new = candidate("directional_asymmetry")
    comparison = comparison_with(new)
    names = [parameter.name for parameter in comparison.parameters]
    unbent = np.array([p.null for p in comparison.parameters])
    bent = unbent.copy()
    bent[names.index("damping")] = 0.6
    places = [start for own in (bent, unbent) for start in starts_at(comparison, own, new, UNSEEN_AMPLITUDES, ())]
    climb = Climb(comparison, np.ones(len(bent), dtype=bool))
    heights = sorted((climb.place(place).height for place in places), reverse=True)
    assert [start.height for start in unseen_starts(climb, bent, new)] == heights[:2]
    # Where nothing has bent the two places are one, of which both strengths are left.
    strength = names.index(new.amplitudes[0].name)
    found = unseen_starts(climb, np.where(unbent == bent, unbent, 0.02), new)
    sizes = {round(start.values[strength] / new.amplitudes[0].prior_width, 6) for start in found}
    assert sizes == set(UNSEEN_AMPLITUDES)


def test_where_cuts_alone_tell_of_modes_shapes_are_begun_from(reference_machine):
    """A housing that gives at the front seat alone: where both give alike its modes lie elsewhere."""
    new = candidate("housing_compliance")
    speed, depth = (axis.ravel() for axis in np.meshgrid(np.linspace(7000.0, 12000.0, 6) * RPM, [1e-3, 2e-3, 3e-3]))
    plan = campaign(reference_machine, trials=trials(speed, depth))
    model = base_model(plan, (new.term,))
    names = [p.name for p in model.parameters]
    true = model.nulls
    true[[names.index(f"housing_compliance.{one}") for one in ("compliance_um_n", "rear_difference")]] = 0.01, -1.2
    comparison = extended(
        Comparison(model=base_model(measured(plan, true, np.random.default_rng(3), (new.term,)))), [new]
    )
    climb = Climb(comparison, np.ones(len(true), dtype=bool))
    first, _ = unseen_starts(climb, np.array([p.null for p in comparison.parameters]), new)
    known = dict(zip((p.name for p in comparison.parameters), first.values, strict=True))
    assert known["housing_compliance.rear_difference"] == -1.2
    assert known["housing_compliance.compliance_um_n"] == 0.01


def test_an_effect_on_forces_has_none():
    new = candidate("process_damping")
    comparison = comparison_with(new)
    climb = Climb(comparison, np.ones(len(comparison.parameters), dtype=bool))
    assert unseen_starts(climb, comparison.model.nulls, new) == []


@pytest.mark.parametrize(("lateral", "rotational"), [(0.0325, 8.8), (0.05, 20.0)])
def test_a_soft_joint_is_found_although_the_model_without_it_has_bent(lateral, rotational, reference_machine):
    """From where the damping of a bent model stands, every joint looks worse than none."""
    new = candidate("holder_joint", 1)
    true = {"lateral_compliance_um_n": lateral, "rotational_compliance_urad_n_m": rotational}
    base = base_of(responses_with(reference_machine, new, **true, damping=0.2, shaft_stiffness=0.03))
    assert has_bent(base)
    found = fit_hypothesis(base.comparison, [new], ground(base))
    stands = dict(zip((p.name.split(".")[-1] for p in found.fit.parameters), found.fit.estimate, strict=True))
    # Within 5 %: the deviations that the fit states are 1 to 3 %.
    for name, value in true.items():
        assert stands[name] == pytest.approx(value, rel=0.05)


@pytest.mark.parametrize(("variant", "loss"), [(2, 1.3), (3, 0.9), (3, 1.3), (3, 1.6)])
def test_seats_that_give_along_one_axis_are_found_however_soft(variant, loss, reference_machine):
    """Modes that part by a third leave the peaks that they were at, and others come to lie there."""
    new = candidate("directional_asymmetry", variant)
    base = base_of(responses_with(reference_machine, new, stiffness_loss=loss))
    found = fit_hypothesis(base.comparison, [new], ground(base))
    at = [p.name.split(".")[-1] for p in found.fit.parameters].index("stiffness_loss")
    # Responses without noise: what is left is the pull of the priors, 0.3 wide, on a loss that the rear seat's may
    # make up for in part. Other peaks lie a fifth and more away.
    assert found.fit.standard_deviation[at] < 0.05
    assert found.fit.estimate[at] == pytest.approx(loss, abs=3.0 * found.fit.standard_deviation[at])


def with_one_front_bearing(machine):
    """Another arrangement of a machine: a stiff rear seat, and a front one of a single bearing with little preload."""
    described = machine.described()
    described["spindle"]["bearings"] = [{"position_mm": 124.0, "count": 1}, {"position_mm": 332.0, "count": 2}]
    described["spindle"]["preload_n"] = 150.0
    lengths, diameters = (56.0, 43.0, 309.0), (14.4, 42.656, 50.0)
    steel = {"inner_diameter_mm": 0.0, "youngs_modulus_gpa": 206.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0}
    described["spindle"]["sections"] = [
        {"part": part, "length_mm": length, "outer_diameter_mm": diameter, **steel}
        for part, length, diameter in zip(("tool", "holder", "shaft"), lengths, diameters, strict=True)
    ]
    return Machine.model_validate(described)


@pytest.mark.parametrize(
    ("name", "variant", "true"),
    [
        ("housing_compliance", 0, {"compliance_um_n": 0.00103, "rear_difference": -0.94}),
        ("housing_compliance", 0, {"compliance_um_n": 0.0005, "rear_difference": -1.2}),
        ("holder_joint", 1, {"lateral_compliance_um_n": 0.003, "rotational_compliance_urad_n_m": 0.7}),
    ],
)
def test_what_gives_a_tenth_of_the_usual_is_found_at_rest(name, variant, true, reference_machine):
    """The rear seat that gives where the front one does makes a second maximum, at which half of the climbs end."""
    new = candidate(name, variant)
    made = responses_with(with_one_front_bearing(reference_machine), new, **true)
    comparison = extended(Comparison(model=base_model(made)), [new])
    truth = np.array([true.get(p.name.split(".")[-1], p.null) for p in comparison.parameters])
    found = at_rest(comparison, np.array([p.null for p in comparison.parameters]), new)
    best = Climb(comparison.structural, np.ones(len(truth), dtype=bool)).from_start(truth, LEFT_GAIN)
    # A climb ends where its next step promises a third of a nat; the other maximum lies 17 nats lower.
    assert found.log_posterior > best.log_posterior - 1.0


def test_cuts_alone_do_not_say_where_the_modes_of_a_bent_model_lie():
    """Effects that move modes are climbed whatever they promise then; with responses these say where to."""
    cuts = trials(np.array([8000.0, 9000.0]) * RPM, np.array([1e-3, 2e-3]))
    plan = campaign(tip_machine(), trials=cuts)
    responses = (receptance(FREQUENCY), receptance(FREQUENCY, axis=1))
    for made, bent, unsure in (
        (plan, False, False),
        (plan, True, True),
        (replace(plan, receptances=responses), True, False),
    ):
        fitted = base_of(made)
        pull = np.where([p.name == "damping" for p in fitted.fit.parameters], BENT + 0.1 if bent else 0.0, 0.0)
        assert ground(replace(fitted, fit=replace(fitted.fit, pull=pull))).unsure is unsure


def test_a_model_that_is_right_has_not_bent(reference_machine):
    new = candidate("holder_joint", 1)
    made = responses_with(reference_machine, new, damping=0.2, shaft_stiffness=0.03)
    assert not has_bent(base_of(made))


def test_where_nothing_was_measured_without_cutting_nothing_leads_anywhere():
    new = candidate("directional_asymmetry")
    comparison = comparison_with(new)
    assert at_rest(comparison, np.array([p.null for p in comparison.parameters]), new) is None


def test_a_bent_model_is_told_what_the_machine_as_described_leads_to_without_an_effect(reference_machine):
    """What an effect gains beside the machine as described counts for it only as far as the machine alone does not.

    Responses at two speeds that no preload meets together make a maximum at each.
    """
    new, speeds = candidate("thermal_preload"), (0.0, 16000.0 * RPM)
    base = base_of(responses_with(reference_machine, new, speeds, rise=0.5))
    aside = np.where([p.name == "preload" for p in base.fit.parameters], -1.0, base.fit.estimate)
    own = Climb(base.comparison.structural, ~base.fit.fixed).from_start(aside).log_posterior
    # Hundreds of nats lie between the two.
    assert own < base.fit.log_posterior - 100.0
    assert height_at_rest(replace(base, fit=replace(base.fit, estimate=aside))) > own + 100.0


def test_nothing_measured_without_cutting_leads_to_no_height():
    cuts = trials(np.array([8000.0, 9000.0]) * RPM, np.array([1e-3, 2e-3]))
    assert height_at_rest(base_of(campaign(tip_machine(), trials=cuts))) is None
