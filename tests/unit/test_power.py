"""What an effect of usual size would leave, held against fits to data that it has made."""

import numpy as np
import pytest

from chatter_core.evidence import Comparison, base_model
from chatter_core.evidence.candidates import Hypothesis, carried, extended, slope_of
from chatter_core.evidence.fit import fit
from chatter_core.evidence.measured import Limits
from chatter_core.evidence.power import USUAL, power
from tests.synthetic import RPM, campaign, tip_machine
from tests.unit.test_candidates import candidate


def limited(depth, slow):
    """A comparison with limit depths (row,), known to 15 %, of which one lies at a low speed."""
    speed = np.array([slow, *np.linspace(11000.0, 15000.0, 8)]) * RPM
    table = Limits(spindle_speed=speed, limit_depth=depth, uncertainty=0.15 * depth)
    return Comparison(model=base_model(campaign(tip_machine(), limits=table)))


def moved_to_its_limits(comparison, slow, values):
    """The same with the limit depths that the model has at values (parameter,)."""
    margin = comparison.evaluate(values).state.prediction.limit_margin
    return limited(comparison.model.campaign.limits.limit_depth / np.exp(margin), slow)


@pytest.mark.parametrize("slow", [1300.0, 3000.0])
def test_a_limit_depth_that_moves_far_tells_no_more_than_a_fit_would_find(slow):
    """Process damping raises the limit at one low speed by far, and hardly the others."""
    plain = limited(np.full(9, 3e-3), slow)
    plain = moved_to_its_limits(plain, slow, np.array([p.null for p in plain.parameters]))
    base = Hypothesis(candidates=(), comparison=plain, fit=fit(plain))
    new = candidate("process_damping")
    found = power(base, new, slope_of(base))
    acting = extended(plain, [new])
    strong = carried(acting, base.fit)
    (strength,) = new.amplitudes
    strong[[p.name for p in acting.parameters].index(strength.name)] = strength.searched_at(USUAL)
    made = moved_to_its_limits(acting, slow, strong)
    gain = fit(extended(made, [new]), starts=[strong]).log_likelihood - fit(made).log_likelihood
    # A quadratic lets all else follow farther than Student's law does: it tells less than there is, and some of it.
    assert 0.3 * gain < found.nats < gain
    assert found.by_quantity == {"limit_depth": found.nats}
