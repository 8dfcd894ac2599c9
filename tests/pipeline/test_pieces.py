"""Pieces of work that verbs share: what is computed in parts is what is computed at once."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from chatter_core.evidence import base_model
from chatter_core.evidence.belief import PRIORS
from pipeline import pieces
from pipeline.pieces import SHARES, lobe_jobs, lobes
from tests.synthetic import RPM, campaign, tip_machine, trials


def test_how_sure_lobes_are_is_joined_in_the_order_of_speeds(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(3)
    cuts = trials(rng.uniform(2500.0, 5000.0, 12) * RPM, rng.uniform(1e-3, 6.5e-3, 12))
    model = base_model(campaign(tip_machine(), trials=cuts))
    # As uncertain as a fit leaves parameters: with all of their priors every cell would be doubtful.
    before = PRIORS.about(model)
    known = replace(before, deviation=0.1 * before.deviation)
    monkeypatch.setattr(pieces, "sure_field", partial(pieces.sure_field, grid=(60, 24)))
    monkeypatch.setattr(pieces, "deviation", partial(pieces.deviation, grid=(60, 24), coarse_grid=(30, 12)))
    jobs = lobe_jobs(model, known, "lobes")
    assert len(jobs) == 1 + SHARES
    (found,) = lobes([job.call() for job in jobs])
    whole = pieces.deviation(model, known, 0)
    # Each share tells anew how far from the boundary deviations matter; within them, both tell the same.
    inside = np.abs(found.growth) < np.minimum(whole, found.deviation)
    assert inside[:30].any()
    assert inside[30:].any()
    np.testing.assert_allclose(found.deviation[inside], whole[inside], rtol=1e-9)
