"""Corrections of a diagnosis as data and as a figure."""

import json

import numpy as np

from chatter_core.evidence import Comparison, base_model, calibrate
from chatter_core.evidence.candidates import Hypothesis
from pipeline.corrections import correct, data, figure
from tests.synthetic import RPM, campaign, measured, tip_machine, trials


def test_corrections_are_ranked_written_and_drawn(tmp_path):
    rng = np.random.default_rng(7)
    speed, depth = np.meshgrid(np.linspace(3000.0, 9000.0, 5) * RPM, np.geomspace(5e-4, 4e-3, 5))
    feed = rng.choice([0.05e-3, 0.1e-3], speed.size)
    planned = campaign(tip_machine(), trials=trials(speed.ravel(), depth.ravel(), feed_per_tooth=feed))
    made = measured(planned, base_model(planned).nulls, rng)
    comparison = Comparison(model=base_model(made))
    found = correct(None, Hypothesis(candidates=(), comparison=comparison, fit=calibrate(comparison)))
    written = data(found)
    json.dumps(written, allow_nan=False)
    assert {(one["quantity"], one["against"]) for one in written} == {
        ("modal_stiffness", "spindle_speed_rpm"),
        ("damping", "spindle_speed_rpm"),
        ("cutting_force", "spindle_speed_rpm"),
        ("cutting_force", "feed_per_tooth_mm"),
        ("cutting_force", "trial"),
        ("modal_stiffness", "trial"),
    }
    gains = [one["evidence_nats"] for one in written]
    assert gains == sorted(gains, reverse=True)
    assert not any(one["wanted"] for one in written)
    assert found.text.startswith("No correction of these mends it")
    for one in written:
        low, factor, high = (np.array(one[key]) for key in ("low", "factor", "high"))
        assert len(one["places"]) == len(factor)
        assert np.all((low < factor) & (factor < high))
    by_feed = next(one for one in written if one["against"] == "feed_per_tooth_mm")
    np.testing.assert_allclose([by_feed["places"][0], by_feed["places"][-1]], [0.05, 0.1])
    path = tmp_path / "corrections.png"
    figure(found).savefig(path)
    assert path.stat().st_size > 5_000


def test_where_none_were_asked_for_there_are_none():
    assert data(None) == []
