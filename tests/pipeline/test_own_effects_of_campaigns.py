"""Effects of a user's own in the verbs of a campaign: found missing, written, read back, and predicted with."""

import csv
import io
import json
import shutil
from contextlib import redirect_stdout
from pathlib import Path

import pytest
import yaml

from pipeline.command_line import main

ROOT = Path(__file__).parents[2]
OWN = f"effects_path={ROOT / 'docs' / 'examples' / 'own_effects'}"
MACHINE = ROOT / "tests" / "data" / "campaigns" / "r01" / "machine.yaml"
#: Of the example's effect: as plausible as its prior has it. A fixed frequency cannot stand for it at all speeds.
LOSS = 0.2
#: Spindle speeds of the limiting depths that are measured, over a factor of two: the clamp loosens among them [rpm].
SPEEDS = range(1600, 3400, 200)


def limit_depths(speed):
    """The limiting depths of the machine with the clamp [mm]; none where it cuts as deep as is looked."""
    words = [f"machine={MACHINE}", f"spindle_speed_rpm={speed}", "axial_depth_mm=1", "format=json"]
    answer = io.StringIO()
    with redirect_stdout(answer):
        assert main(["point", *words, OWN, "effects=[loosening_clamp]", f"effects.loosening_clamp.loss={LOSS}"]) == 0
    return json.loads(answer.getvalue())["limit_depths_mm"]


@pytest.fixture(scope="module")
def clamped(tmp_path_factory):
    """A campaign of limiting depths on a machine whose clamp loosens."""
    folder = tmp_path_factory.mktemp("campaigns") / "clamped"
    folder.mkdir()
    shutil.copy(MACHINE, folder)
    rows = [(speed, depth) for speed in SPEEDS for depth in limit_depths(speed)[:1]]
    lines = [f"{speed},{depth:.5g},{0.05 * depth:.3g}" for speed, depth in rows]
    (folder / "limits.csv").write_text("\n".join(["spindle_speed_rpm,limit_depth_mm,uncertainty_mm", *lines, ""]))
    return folder


def refused(capsys, *words):
    assert main(list(words)) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def test_an_effect_of_ones_own_is_found_missing_and_predicts(tmp_path, capsys, clamped):
    output = tmp_path / "out"
    # One worker of its own: the effect has to get there.
    words = [f"campaign={clamped}", OWN, "cluster=local", "cluster.workers=1"]
    assert main(["improve", *words, f"output={output}"]) == 0
    found = json.loads((output / "diagnosis.json").read_text())
    assert (found["verdict"], found["missing"]) == ("effect", ["loosening_clamp"])
    loss = found["ranking"][0]["parameters"]["loss"]
    assert loss["low"] <= LOSS <= loss["high"]
    model = output / "model.yaml"
    assert yaml.safe_load(model.read_text())["effects"] == {"loosening_clamp": {}}
    page = (output / "report.html").read_text()
    for words in (
        "Added to the model: loosening clamp.",
        "Error of limit depths, on limit depths held out: ",
        "2. With loosening clamp: ",
        "<h2>Before and after</h2>",
    ):
        assert words in page
    with (output / "history.csv").open() as file:
        history = {row["effect"]: row for row in csv.DictReader(file)}
    assert list(history) == ["as described", "calibrated", "loosening_clamp"]
    # The limits were computed with the effect: with it they are met to their uncertainty, and not without it.
    before, after = (float(history[name]["limit_depth_held_out"]) for name in ("calibrated", "loosening_clamp"))
    assert after < 0.05 < before
    # The model is read with the folder of its effect, and says so without it.
    trials, predictions = tmp_path / "plan.csv", tmp_path / "predicted.csv"
    trials.write_text("trial,spindle_speed_rpm,axial_depth_mm\n1,3000,1.0\n")
    asked = ["predict", f"campaign={clamped}", f"model={model}", f"trials={trials}", f"predictions={predictions}"]
    said = refused(capsys, *asked)
    assert said.count("error:") == 1
    assert "found 'loosening_clamp', which the program has not; where it is your own, name its folder by" in said
    # Another law under the same name is not what was fitted.
    changed = shutil.copytree(OWN.partition("=")[2], tmp_path / "changed")
    with (changed / "loosening_clamp.py").open("a") as file:
        file.write("# Changed.\n")
    said = refused(capsys, *asked, f"effects_path={changed}")
    assert "effects.loosening_clamp: loosening_clamp.py was changed since the model was fitted" in said
    assert main([*asked, OWN]) == 0
    with predictions.open() as file:
        (row,) = csv.DictReader(file)
    # The program's own answer at this point: an odd number of limits lies above the cut where it is unstable.
    above = sum(depth < 1.0 for depth in limit_depths(3000))
    assert (row["predicted_outcome"] == "chatter") == (above % 2 == 1)
    compared = tmp_path / "compared"
    assert main(["compare", f"campaign={clamped}", f"model={model}", OWN, f"output={compared}", "cluster=serial"]) == 0
    errors = json.loads((compared / "comparison.json").read_text())["errors"]["limit_depth"]
    # As described it is what was fitted: the depths are met to their uncertainty.
    assert errors["as_described"]["value"] < 0.05


def test_named_as_the_programs_effects_are(tmp_path, capsys, clamped):
    trials = tmp_path / "plan.csv"
    trials.write_text("trial,spindle_speed_rpm,axial_depth_mm\n1,3000,1.0\n")
    words = [f"campaign={clamped}", f"trials={trials}", "effects=[loosening_clamp]"]
    radius = []
    for loss in (0.0, LOSS):
        predictions = tmp_path / "predicted.csv"
        asked = ["predict", *words, OWN, f"effects.loosening_clamp.loss={loss}", f"predictions={predictions}"]
        assert main(asked) == 0
        with predictions.open() as file:
            radius.append(float(next(csv.DictReader(file))["spectral_radius"]))
    assert radius[0] != radius[1]
    assert "effects: found 'loosening_clamp'" in refused(capsys, "compare", *words[:1], words[2])


def test_the_folder_of_effects_is_no_place_for_an_answer(tmp_path, capsys, clamped):
    own = shutil.copytree(OWN.partition("=")[2], tmp_path / "own")
    for verb in ("compare", "diagnose", "improve"):
        said = refused(capsys, verb, f"campaign={clamped}", f"effects_path={own}", f"output={own}")
        assert "is the folder of the effects" in said
    assert "effects_path: is empty" in refused(capsys, "diagnose", f"campaign={clamped}", "effects_path=")
