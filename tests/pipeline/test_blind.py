"""The hidden-effect test from end to end: kept answers become a report; two small campaigns are diagnosed rightly."""

import json
import shutil

import pytest

from benchmarks.blind import kept, own_model
from benchmarks.blind.choosing import disagreeing
from benchmarks.blind.judgement import Case, word_of
from benchmarks.blind.kept import DONE, FAILED, ROOT
from benchmarks.blind.opening import case_of, truth_folder
from benchmarks.blind.program import answer
from benchmarks.blind.report import GENERATED, OWN, write
from benchmarks.blind.tables import read_rows, write_rows
from chatter_core.evidence import read_campaign
from tests.hidden_effect.campaign import make_campaign
from tests.hidden_effect.design import CALIBRATION_SEEDS, plan

CAMPAIGN = ROOT / "tests" / "data" / "campaigns" / "d01"
TRUTH = {"kind": "one", "effect_names": ["tool_runout"], "foreign": [], "strengths": [0.5], "label_flips": 0.1}
RUNOUT = {
    "effect": "tool_runout",
    "score": 12.0,
    "probability": 0.97,
    "settings": {"tool_runout": {}},
    "parameters": {"runout_um": {"low": 15.0, "high": 25.0}},
}
DOCUMENT = {
    "verdict": "effect", "missing": ["tool_runout"], "ranking": [RUNOUT], "probability_of_none": 0.03, "pair": None,
    "power": [{"effect": "tool_runout", "nats": 20.0}],
}  # fmt: skip
ANSWERED = {
    "state": DONE, "document": DOCUMENT, "chances": {"none": [], "tool_runout": []}, "models": {}, "evaluations": 300,
    "processor_s": 90.0, "wall_s": 90.0,
}  # fmt: skip


def keep(root, campaigns, seed, ablation, answer):
    """A campaign with its truth, and an answer to it."""
    task = kept.task_of(root, campaigns, seed, ablation)
    shutil.copytree(CAMPAIGN, task.campaign, dirs_exist_ok=True)
    truth = truth_folder(root, campaigns, seed)
    truth.mkdir(parents=True, exist_ok=True)
    hidden = {"hidden": {"runout_m": 1e-5}, "machine": {}}
    (truth / "truth.json").write_text(json.dumps({**TRUTH, **hidden}))
    write_rows(truth / "stability_test.csv", read_rows(CAMPAIGN / "stability.csv")[:6])
    head = {"seed": seed, "ablation": ablation, "program": "older", "campaign": "c", "limit_s": 60.0, "elapsed_s": 9.0}
    kept.write(task.path, {**head, **answer})
    return task


def test_kept_answers_become_a_report(tmp_path):
    failed = {"state": FAILED, "reason": "Traceback\nnot done after 60 s"}
    tasks = {
        (GENERATED, "whole"): [
            keep(tmp_path, GENERATED, 1000, "whole", ANSWERED), keep(tmp_path, GENERATED, 1001, "whole", failed),
        ],
        (GENERATED, "shuffled"): [keep(tmp_path, GENERATED, 1000, "shuffled", failed)],
        (OWN, "whole"): [keep(tmp_path, OWN, 1000, "whole", ANSWERED)],
    }  # fmt: skip
    written = write(tmp_path, tasks, 1)
    assert all(path.stat().st_size for path in written)
    report = (tmp_path / "report.md").read_text()
    assert "2 campaigns" in report
    assert "seeds 1000 to 1001" in report
    assert "- failed: 1001 whole: not done after 60 s" in report
    assert "Not all answers are of the program as it is now." in report
    assert "| shuffled | labels shuffled, and nothing but cuts | nothing named |" in report
    (row,) = (row for row in read_rows(tmp_path / "table.csv") if row["table"] == "strength")
    assert (row["count"], row["right"], row["failed"]) == ("2", "1", "1")
    targets = {row["target"]: row for row in read_rows(tmp_path / "targets.csv")}
    assert targets["most probable is right, one effect"]["measured"] == "0.5"
    assert targets["90 % intervals that hold the true amplitude"]["count"] == "1"
    right, failed_row = read_rows(tmp_path / "cases.csv")
    told = ("seed", "hidden", "missing", "worth", "amplitudes_held", "amplitudes_missed", "evaluations")
    assert [right[key] for key in told] == ["1000", "tool_runout", "tool_runout", "right", "runout_um", "", "300"]
    assert [failed_row[key] for key in ("worth", "most_probable", "error_nominal")] == ["failed", "", ""]
    found = case_of(tmp_path, GENERATED, tasks[GENERATED, "whole"][0])
    assert float(right["error_nominal"]) == pytest.approx(found.errors["nominal"], abs=5e-4)
    assert word_of(found) == "right"
    assert 0.0 <= found.errors["nominal"] <= 1.0


def test_a_campaign_of_the_own_model_is_read_as_one(tmp_path):
    seed = next(seed for seed in CALIBRATION_SEEDS if plan(seed).effects == ("tool_runout",))
    place, truth_place = tmp_path / "campaign", tmp_path / "truth"
    assert own_model.draw(CAMPAIGN, place, truth_place, seed)
    drawn, example = read_campaign(place), read_campaign(CAMPAIGN)
    assert (drawn.trials.spindle_speed == example.trials.spindle_speed).all()
    assert len(drawn.receptances) == len(example.receptances)
    truth = json.loads((truth_place / "truth.json").read_text())
    assert truth["parameters"]["tool_runout.runout_um"] > 0.0
    assert {row["outcome"] for row in read_rows(truth_place / "stability_test.csv")} <= {"stable", "chatter"}
    before = (place / "stability.csv").read_bytes()
    assert own_model.draw(CAMPAIGN, place, truth_place, seed)
    assert (place / "stability.csv").read_bytes() == before
    foreign = next(seed for seed in CALIBRATION_SEEDS if plan(seed).kind == "foreign")
    assert not own_model.draw(CAMPAIGN, tmp_path / "other", truth_place, foreign)


def thinned(seed, folder):
    """A generated campaign with a fifth of its speeds and a quarter of the lines of its direct responses."""
    whole, truth = folder / "whole", folder / "truth"
    make_campaign(seed, whole, truth)
    thin = folder / "thin"
    thin.mkdir()
    shutil.copyfile(whole / "machine.yaml", thin / "machine.yaml")
    cuts = read_rows(whole / "stability.csv")
    speeds = sorted({float(row["spindle_speed_rpm"]) for row in cuts})[::5]
    write_rows(thin / "stability.csv", [row for row in cuts if float(row["spindle_speed_rpm"]) in speeds])
    lines = [row for row in read_rows(whole / "frf.csv") if row["output_axis"] == row["input_axis"]]
    frequencies = sorted({float(row["frequency_hz"]) for row in lines})[::4]
    write_rows(thin / "frf.csv", [row for row in lines if float(row["frequency_hz"]) in frequencies])
    return thin


#: Seeds whose diagnosis is cheap: one that hides nothing, and one with a strong effect.
SMALL = {1078: set(), 1040: {"speed_dependent_damping"}}


@pytest.mark.parametrize("seed", SMALL)
def test_a_small_campaign_is_diagnosed_rightly(seed, tmp_path):
    """Nothing is named where nothing is hidden, and the strong effect where it is; an answer can be had again."""
    assert set(plan(seed).effects) == SMALL[seed]
    found = answer(thinned(seed, tmp_path), frozen=False)
    document = found["document"]
    assert set(document["missing"]) == SMALL[seed]
    assert found["evaluations"] > 0
    assert document["verdict"] in (("effect",) if SMALL[seed] else ("none", "underpowered"))
    probabilities = {one["effect"]: one["probability"] for one in document["ranking"]}
    # What makes teeth unlike is tried with all else.
    assert {"tool_runout", "variable_pitch"} <= set(probabilities)
    probabilities["none"] = document["probability_of_none"]
    known = Case(
        seed=seed, kind="one", verdict=document["verdict"], missing=tuple(document["missing"]),
        probabilities=probabilities,
    )  # fmt: skip
    assert disagreeing([(known, found)]) == []
