"""Answers that are kept, ablations of files, and diagnoses that fail: none is lost, none is computed in vain."""

import io
import json
import subprocess
import sys
import tarfile
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.blind import archive, kept, running
from benchmarks.blind.__main__ import spread_evenly
from benchmarks.blind.ablations import ABLATIONS, prepare
from benchmarks.blind.kept import DONE, FAILED, ROOT
from benchmarks.blind.opening import data_of
from benchmarks.blind.report import write
from benchmarks.blind.tables import read_rows
from tests.hidden_effect.design import TEST_SEEDS, plan

CAMPAIGN = ROOT / "tests" / "data" / "campaigns" / "d01"


@pytest.fixture
def task(tmp_path):
    """A task whose campaign is one small file."""
    campaign = tmp_path / "campaigns" / "7"
    campaign.mkdir(parents=True)
    (campaign / "machine.yaml").write_text("tool: none\n")
    return kept.task_of(tmp_path, "campaigns", 7, "whole")


def keep(task, **known):
    content = {"program": kept.program_digest(), "campaign": kept.folder_digest(task.campaign), "state": DONE}
    kept.write(task.path, {**content, "limit_s": 60.0, **known})


def test_an_answer_holds_for_its_program_and_its_campaign(task):
    assert not kept.holds(task, 60.0)
    keep(task)
    assert kept.holds(task, 60.0)
    assert [path.name for path in task.path.parent.iterdir()] == ["7.json"]
    keep(task, program="of another version")
    assert not kept.holds(task, 60.0)
    assert kept.holds(task, 60.0, any_program=True)
    keep(task)
    (task.campaign / "machine.yaml").write_text("tool: other\n")
    assert not kept.holds(task, 60.0, any_program=True)


def test_a_failure_is_tried_again_with_more_time_alone(task):
    keep(task, state=FAILED)
    assert kept.holds(task, 60.0)
    assert kept.holds(task, 30.0)
    assert not kept.holds(task, 61.0)


def test_a_diagnosis_that_raises_is_kept_as_failed_with_its_reason(task, tmp_path):
    found = running.run(task, 300.0, "digest", tmp_path)
    assert found["state"] == FAILED
    assert "machine.yaml" in found["reason"]
    assert kept.read(task.path) == found
    assert found["program"] == "digest"


def test_a_diagnosis_that_hangs_is_ended_and_kept_as_failed(task, tmp_path):
    # No interpreter starts within a millisecond.
    found = running.run(task, 0.001, "digest", tmp_path)
    assert (found["state"], found["reason"]) == (FAILED, "not done after 0.001 s")


def test_a_diagnosis_ends_with_whoever_started_it(tmp_path):
    words = [sys.executable, "-m", "benchmarks.blind.program", str(CAMPAIGN), str(tmp_path / "answer.json")]
    # It would take minutes to be done, and then return 0.
    ended = subprocess.run(words, cwd=ROOT, input="", capture_output=True, text=True, timeout=120.0, check=False)
    assert (ended.returncode, "standard input has ended" in ended.stderr) == (1, True)
    assert not (tmp_path / "answer.json").exists()


def test_the_truth_stays_sealed_until_all_answers_are_there(task, tmp_path):
    with pytest.raises(ValueError, match=r"the truth stays sealed: 1 diagnoses are not there, 7 whole first"):
        write(tmp_path, {("campaigns", "whole"): [task]}, 1)


@pytest.mark.parametrize(
    ("imported", "hidden"),
    [
        ("benchmarks.blind.program", ("tests", "benchmarks.blind.opening", "benchmarks.blind.judgement")),
        (
            "benchmarks.blind.judgement, benchmarks.blind.targets, benchmarks.blind.summary",
            ("chatter_core", "pipeline"),
        ),
    ],
)
def test_diagnosis_knows_no_truth_and_judgement_no_program(imported, hidden):
    code = f"import json, sys, {imported}; print(json.dumps(list(sys.modules)))"
    told = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert not [name for name in json.loads(told) if name.startswith(hidden)]


def test_an_ablation_takes_what_it_says_and_nothing_else(tmp_path):
    assert prepare(CAMPAIGN, "whole", tmp_path / "whole") == CAMPAIGN
    assert prepare(CAMPAIGN, "frozen", tmp_path / "frozen") == CAMPAIGN
    without = prepare(CAMPAIGN, "without_responses", tmp_path / "without")
    assert {path.name for path in without.iterdir()} == {"machine.yaml", "stability.csv"}
    assert (without / "stability.csv").read_bytes() == (CAMPAIGN / "stability.csv").read_bytes()
    rows = read_rows(CAMPAIGN / "stability.csv")
    alone = read_rows(prepare(CAMPAIGN, "labels_alone", tmp_path / "alone") / "stability.csv")
    assert alone == [{**row, "chatter_frequency_hz": ""} for row in rows]
    dealt = read_rows(prepare(CAMPAIGN, "shuffled", tmp_path / "dealt") / "stability.csv")
    labels = [sorted((row["outcome"], row["chatter_frequency_hz"]) for row in some) for some in (rows, dealt)]
    assert labels[0] == labels[1]
    assert [row["outcome"] for row in rows] != [row["outcome"] for row in dealt]
    unjudged = [[(row["spindle_speed_rpm"], row["axial_depth_mm"]) for row in some] for some in (rows, dealt)]
    assert unjudged[0] == unjudged[1]


def test_an_ablation_concerns_campaigns_that_have_what_it_takes(tmp_path):
    (tmp_path / "stability.csv").write_text("trial\n")
    assert not ABLATIONS["without_responses"].concerns(tmp_path)
    assert ABLATIONS["without_responses"].concerns(CAMPAIGN)
    assert ABLATIONS["shuffled"].concerns(tmp_path)
    assert ABLATIONS["frozen"].concerns(tmp_path)


def test_ablated_seeds_are_spread_over_the_composition():
    chosen = spread_evenly(TEST_SEEDS, 24)
    assert len(set(chosen)) == 24
    kinds = [plan(seed).kind for seed in chosen]
    assert {"none", "one", "two", "foreign"} == set(kinds)
    # A quarter of the seeds hides nothing: 6 of 24, give or take what a spread leaves to chance.
    assert 3 <= kinds.count("none") <= 9
    assert spread_evenly(range(5), 24) == [0, 1, 2, 3, 4]


def test_the_kind_of_measurement_is_told_by_the_files(tmp_path):
    assert data_of(tmp_path) == "cuts alone"
    (tmp_path / "modes.csv").write_text("spindle_speed_rpm\n0\n")
    assert data_of(tmp_path) == "cuts, modes or bearings"
    (tmp_path / "frf.csv").write_text("spindle_speed_rpm\n0\n")
    assert data_of(tmp_path) == "cuts, responses at rest"
    (tmp_path / "frf.csv").write_text("spindle_speed_rpm\n0\n9000\n")
    assert data_of(tmp_path) == "cuts, responses at rest and rotating"


def test_a_task_is_named_by_campaign_and_ablation(task):
    assert str(task) == "7 whole"
    assert str(replace(task, ablation="frozen")) == "7 frozen"
    assert task.path == Path(task.campaign).parents[1] / "diagnoses" / "campaigns" / "whole" / "7.json"


def test_answers_are_handed_on_in_one_file_and_what_is_there_stays(task, tmp_path):
    keep(task, answer="one")
    file, other = tmp_path / "answers.tar.xz", tmp_path / "other"
    assert archive.pack(tmp_path, file) == 1
    first = file.read_bytes()
    assert archive.unpack(file, other) == 1
    elsewhere = kept.task_of(other, "campaigns", 7, "whole")
    assert elsewhere.path.read_bytes() == task.path.read_bytes()
    # The same answers make the same file, and those that are there are not replaced.
    archive.pack(other, file)
    assert file.read_bytes() == first
    kept.write(elsewhere.path, {"answer": "another"})
    assert archive.unpack(file, other) == 0
    assert kept.read(elsewhere.path) == {"answer": "another"}


@pytest.mark.parametrize("name", ["../diagnoses/7.json", "/diagnoses/7.json", "truth/7.json"])
def test_a_file_of_answers_reaches_nothing_else(tmp_path, name):
    with tarfile.open(tmp_path / "answers.tar.xz", "w:xz") as made:
        made.addfile(tarfile.TarInfo(name), io.BytesIO())
    with pytest.raises(ValueError, match="is no answer of a diagnosis"):
        archive.unpack(tmp_path / "answers.tar.xz", tmp_path / "folder")
    assert not (tmp_path / "folder").exists()
