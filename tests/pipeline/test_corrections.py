"""Corrections of a diagnosis as data and as a figure."""

import json
from pathlib import Path

import numpy as np

from chatter_core.evidence import Comparison, base_model, calibrate
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.verdict import Verdict
from pipeline import diagnosis
from pipeline.command_line import main
from pipeline.corrections import correct, data, figure
from tests.documentation.answers import undocumented, unseen
from tests.synthetic import RPM, campaign, measured, tip_machine, trials

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"


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


def test_a_diagnosis_that_explains_nothing_shows_them(tmp_path, monkeypatch):
    def unexplained(*_):
        return Verdict(kind="unexplained", missing=(), text="Something is missing that no candidate explains.")

    monkeypatch.setattr(diagnosis, "decide", unexplained)
    monkeypatch.setattr(diagnosis, "effect_names", lambda *_: ["speed_dependent_damping"])
    folder = tmp_path / "few"
    folder.mkdir()
    (folder / "machine.yaml").write_text((CAMPAIGNS / "r01" / "machine.yaml").read_text())
    lines = (CAMPAIGNS / "r01" / "stability.csv").read_text().splitlines()
    (folder / "stability.csv").write_text("\n".join([lines[0], *lines[1::3]]) + "\n")
    output = tmp_path / "out"
    assert main(["diagnose", f"campaign={folder}", f"output={output}", "cluster=serial"]) == 0
    document = json.loads((output / "diagnosis.json").read_text())
    assert document["corrections"]
    assert undocumented(document, "diagnosis.json") == unseen(document, "diagnosis.json") == set()
    assert document["corrections_text"]
    assert (output / "figures" / "corrections.png").stat().st_size > 5_000
    page = (output / "report.html").read_text()
    assert "Corrections without a formula" in page
    assert "What the measurements want to change: the factor" in page
