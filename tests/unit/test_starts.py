"""Where the fit of an effect begins: beside what a model has come to, and beside the machine as described."""

import numpy as np

from chatter_core.evidence import Comparison, base_model
from chatter_core.evidence.candidates import extended
from chatter_core.evidence.starts import UNSEEN_AMPLITUDES, unseen_starts
from tests.synthetic import RPM, campaign, tip_machine, trials
from tests.unit.test_candidates import candidate


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
    sides = {(round(start[strength] / new.amplitudes[0].prior_width, 6), start[damping]) for start in starts}
    assert sides == {(sign * size, own) for sign in (-1, 1) for size in UNSEEN_AMPLITUDES for own in (0.3, 0.0)}
    # Where nothing is bent the two places are one.
    assert len(unseen_starts(comparison, np.array([p.null for p in comparison.parameters]), new)) == 4


def test_an_effect_on_forces_has_none():
    new = candidate("process_damping")
    comparison = comparison_with(new)
    assert unseen_starts(comparison, np.array([p.null for p in comparison.parameters]), new) == []
