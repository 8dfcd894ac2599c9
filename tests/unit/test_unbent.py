"""Where the fit of an effect begins beside a model that has bent, and beside the machine as described."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.evidence import Comparison, base_model
from chatter_core.evidence.candidates import extended
from chatter_core.evidence.likelihood import LINE_ERROR
from chatter_core.evidence.pursuit import fit_hypothesis, ground
from chatter_core.evidence.unbent import UNSEEN_AMPLITUDES, at_rest, has_bent, unseen_starts
from tests.synthetic import RPM, campaign, receptance, tip_machine, trials
from tests.unit.test_candidates import base_of, candidate

FREQUENCY = 2.0 * np.pi * np.arange(100.0, 4000.0, 5.0)


def responses_with(machine, new, **true):
    """A campaign of both direct responses, of a machine with an effect and other parameters, and their noise."""
    plan = campaign(machine, receptances=(receptance(FREQUENCY), receptance(FREQUENCY, axis=1)))
    model = extended(Comparison(model=base_model(plan)), [new]).model
    values = np.array([true.get(p.name.split(".")[-1], p.null) for p in model.parameters])
    rng = np.random.default_rng(1)
    noise = LINE_ERROR * (rng.standard_normal((2, FREQUENCY.size)) + 1j * rng.standard_normal((2, FREQUENCY.size)))
    exact = model.predict(values).receptances
    made = [replace(one, value=h * (1.0 + n)) for one, h, n in zip(plan.receptances, exact, noise, strict=True)]
    return replace(plan, receptances=tuple(made))


def comparison_with(new):
    plan = campaign(tip_machine(), trials=trials(np.array([8000.0, 9000.0]) * RPM, np.array([1e-3, 2e-3])))
    return extended(Comparison(model=base_model(plan)), [new])


def test_an_effect_on_modes_begins_beside_a_bent_machine_and_beside_an_unbent_one():
    new = candidate("directional_asymmetry")
    comparison = comparison_with(new)
    names = [parameter.name for parameter in comparison.parameters]
    bent = np.array([p.null for p in comparison.parameters])
    bent[names.index("damping")] = 0.3
    starts = unseen_starts(comparison, bent, new)
    strength, damping = names.index(new.amplitudes[0].name), names.index("damping")
    places = {(round(start[strength] / new.amplitudes[0].prior_width, 6), start[damping]) for start in starts}
    assert places == {(size, own) for size in UNSEEN_AMPLITUDES for own in (0.3, 0.0)}
    # Where nothing is bent the two places are one.
    assert len(unseen_starts(comparison, np.array([p.null for p in comparison.parameters]), new)) == 2


def test_an_effect_on_forces_has_none():
    new = candidate("process_damping")
    comparison = comparison_with(new)
    assert unseen_starts(comparison, np.array([p.null for p in comparison.parameters]), new) == []


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
    stands = dict(zip((p.name.split(".")[-1] for p in found.fit.parameters), found.fit.estimate, strict=True))
    # Within 5 %: the deviations that the fit states are 2 %.
    assert stands["stiffness_loss"] == pytest.approx(loss, rel=0.05)


def test_a_model_that_is_right_has_not_bent(reference_machine):
    new = candidate("holder_joint", 1)
    made = responses_with(reference_machine, new, damping=0.2, shaft_stiffness=0.03)
    assert not has_bent(base_of(made))


def test_where_nothing_was_measured_without_cutting_nothing_leads_anywhere():
    new = candidate("directional_asymmetry")
    comparison = comparison_with(new)
    assert at_rest(comparison, np.array([p.null for p in comparison.parameters]), new) is None
