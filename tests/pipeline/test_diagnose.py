"""The commands ``diagnose`` and ``improve`` on real cuts: everything is written and agrees; bad input is told."""

import csv
import io
import json
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import yaml

from chatter_core.evidence import base_model, read_campaign
from chatter_core.evidence.belief import PRIORS
from chatter_core.evidence.scores import Score
from pipeline import diagnosis_document, improvement_figure, improvement_page
from pipeline.command_line import main
from pipeline.comparison_page import PLOTTED
from pipeline.improvement import row_as_described
from tests.documentation.answers import undocumented, undocumented_columns, unseen
from tests.documentation.commands import ROOT, answer_below, asked_for

CAMPAIGNS = ROOT / "tests" / "data" / "campaigns"
PAGE = ROOT / "docs" / "how_to" / "cuts.md"
VERDICTS = ("none", "effect", "ambiguous", "unexplained", "underpowered")


@pytest.fixture(scope="module")
def improvement(tmp_path_factory):
    """What ``improve`` leaves and prints of the real cuts in up-milling, as docs/how_to/cuts.md asks for it."""
    output = tmp_path_factory.mktemp("improve") / "r01"
    told, said = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patched, redirect_stdout(told), redirect_stderr(said):
        patched.chdir(ROOT)
        assert main([*asked_for(PAGE, "improve"), f"output={output}", "cluster=serial", "format=json"]) == 0
    (output / "told.json").write_text(told.getvalue())
    return output, said.getvalue()


@pytest.fixture(scope="module")
def improved(improvement):
    return improvement[0]


def test_the_first_step_is_the_diagnosis_that_the_page_quotes(improvement):
    assert asked_for(PAGE, "improve")[1:] == asked_for(PAGE, "diagnose")[1:] == ["campaign=tests/data/campaigns/r01"]
    for line in answer_below(PAGE, "diagnose").splitlines():
        assert line in improvement[1]


def test_scripts_are_told_what_was_added_and_the_last_diagnosis(improved):
    told = json.loads((improved / "told.json").read_text())
    assert (told["verb"], told["campaign"], told["exit_code"], told["errors"]) == ("improve", "r01", 0, [])
    with (improved / "history.csv").open() as file:
        assert [row["effect"] for row in told["history"]] == [row["effect"] for row in csv.DictReader(file)]
    assert told["diagnosis"]["verdict"] in VERDICTS
    assert {Path(path).name for path in told["written"]} >= {"model.yaml", "history.csv", "diagnosis.json"}


def test_a_diagnosis_has_one_of_five_answers_and_its_reasons(improved):
    document = json.loads((improved / "diagnosis.json").read_text())
    assert document["verdict"] in VERDICTS
    assert bool(document["missing"]) == (document["verdict"] in ("effect", "ambiguous"))
    probability = [one["probability"] for one in document["ranking"]]
    assert sum(probability) + document["probability_of_none"] == pytest.approx(1.0)
    assert probability == sorted(probability, reverse=True)
    for one in document["ranking"]:
        for told in one["parameters"].values():
            assert told["low"] <= told["estimate"] <= told["high"]
    assert {row["effect"] for row in document["power"]} == {one["effect"] for one in document["ranking"]}
    # A spindle's effects cannot act on measured modes, and say nothing here.
    assert "thermal_preload" not in {one["effect"] for one in document["ranking"]}
    assert set(document["calibration"]) >= {"specific_cutting_energy", "tip_frequency", "mislabelled"}
    for name in ("ranking", "power", "history"):
        assert (improved / "figures" / f"{name}.png").stat().st_size > 5_000
    page = (improved / "report.html").read_text()
    assert "What was missing: r01" in page


def test_what_is_written_is_what_the_reference_says(improved):
    for name in ("diagnosis.json", "diagnosis_last.json"):
        document = json.loads((improved / name).read_text())
        assert undocumented(document, "diagnosis.json") == unseen(document, "diagnosis.json") == set()
    for name in ("history.csv", "power.csv"):
        assert undocumented_columns(pd.read_csv(improved / name).columns, name) == set()


def test_a_history_begins_as_described_and_its_model_predicts(improved, tmp_path):
    with (improved / "history.csv").open() as file:
        history = list(csv.DictReader(file))
    assert [row["effect"] for row in history[:2]] == ["as described", "calibrated"]
    assert 0.0 <= float(history[1]["outcome_held_out"]) <= 1.0
    model = yaml.safe_load((improved / "model.yaml").read_text())
    document = json.loads((improved / "diagnosis.json").read_text())
    added = document["missing"][:1] if document["verdict"] == "ambiguous" else document["missing"]
    assert list(model["effects"])[: len(added)] == added
    trials = tmp_path / "trials.csv"
    trials.write_text("trial,spindle_speed_rpm,axial_depth_mm\n1,3200,2.0\n2,2850,0.3\n")
    words = [f"campaign={CAMPAIGNS / 'r01'}", f"model={improved / 'model.yaml'}", f"trials={trials}"]
    assert main(["predict", *words, f"predictions={tmp_path / 'out.csv'}"]) == 0
    with (tmp_path / "out.csv").open() as file:
        predicted = list(csv.DictReader(file))
    assert [row["predicted_outcome"] for row in predicted] == ["chatter", "stable"]
    own = predicted[0].keys() - {"trial", "spindle_speed_rpm", "axial_depth_mm"}
    assert undocumented_columns(own, "predictions") == unseen(dict.fromkeys(own, 1), "predictions") == set()


def test_the_page_of_an_improvement_tells_how_the_error_fell_step_by_step(improved):
    page = (improved / "report.html").read_text()
    for head in ("How the error fell", "Step by step", "The first diagnosis", "Calibration of the final model"):
        assert f"<h2>{head}</h2>" in page
    assert "1. Base model: " in page
    pictures = {path.stem for path in (improved / "figures").glob("*.png")}
    assert page.count("data:image/png;base64,") == len(pictures - set(PLOTTED))


def test_errors_of_an_improvement_stand_with_their_units_and_what_is_not_known_is_left_out():
    table = pd.DataFrame(
        {
            "step": [0, 1],
            "effect": ["as described", "tool_runout + process_damping"],
            "outcome_in_sample": [0.255, 0.08],
            "chatter_frequency_in_sample": [12.0, np.nan],
            "outcome_held_out": [0.255, 0.1],
            "log_evidence": [-40.0, -12.3],
        }
    )
    assert improvement_page.error_columns(table) == ["model", "outcome, balanced", "chatter frequency", "log evidence"]
    assert improvement_page.error_rows(table) == [
        ["as described", "25.5 % (25.5 %)", "12 Hz", "-40.0"],
        ["tool runout + process damping", "8.0 % (10.0 %)", "", "-12.3"],
    ]
    (outcome, frequency) = improvement_figure.history(table).axes
    assert outcome.get_ylabel() == "outcome, balanced [%]"
    assert [line.get_label() for line in outcome.lines] == ["on the data of the fit", "on data held out"]
    # Drawn where it was told: never joined to what is not known.
    assert np.isnan(frequency.lines[0].get_ydata()[1])


def test_cuts_that_a_model_was_fitted_to_are_not_called_held_out():
    model = base_model(read_campaign(CAMPAIGNS / "r01"))
    first, again = (row_as_described(model, PRIORS, unseen=unseen) for unseen in (True, False))
    assert {name for name in first if name not in again} == {"outcome_held_out", "depth_margin_held_out"}
    assert first["outcome_in_sample"] == first["outcome_held_out"] == again["outcome_in_sample"]
    table = pd.DataFrame([{"effect": "as described"}, {"effect": "calibrated", "outcome_held_out": 0.12}])
    assert improvement_page.headline(table) == ["Outcomes told wrongly, on cuts held out: 12.0 % calibrated."]


def refused(capsys, *words):
    assert main(list(words)) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def test_bad_input_is_told(tmp_path, capsys, improved):
    campaign = f"campaign={CAMPAIGNS / 'r01'}"
    assert "base: found 'half'" in refused(capsys, "diagnose", campaign, "base=half")
    assert "modes: found '0'" in refused(capsys, "diagnose", campaign, "modes=0")
    assert "did you mean process_damping" in refused(capsys, "diagnose", campaign, "effects=[process_damp]")
    model = f"model={improved / 'model.yaml'}"
    assert "modes: not beside model" in refused(capsys, "diagnose", campaign, model, "modes=2")


@pytest.mark.parametrize("verb", ["compare", "diagnose", "improve", "predict"])
@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("base=static_bearing", "base: static_bearing holds bearings at rest; this machine has measured tip modes"),
        ("modes=2", "modes: found 2, allowed: 1 to 1, as many as were measured of an axis"),
        (
            "effects=[thermal_preload]",
            "effects.thermal_preload: acts on spindle and bearing; this machine has measured tip modes",
        ),
    ],
)
def test_what_is_not_for_a_machine_of_tip_modes_is_told_in_a_sentence(tmp_path, capsys, verb, word, told):
    trials = tmp_path / "trials.csv"
    trials.write_text("trial,spindle_speed_rpm,axial_depth_mm\n1,3200,2.0\n")
    own = [f"trials={trials}", f"predictions={tmp_path / 'out.csv'}"]
    words = own if verb == "predict" else [f"output={tmp_path / 'out'}"]
    said = refused(capsys, verb, f"campaign={CAMPAIGNS / 'r01'}", word, *words)
    assert said.startswith(f"error: {told}")
    assert said.count("\n") == 1
    assert list(tmp_path.iterdir()) == [trials]


@pytest.mark.parametrize("verb", ["diagnose", "improve"])
def test_too_few_cuts_to_judge_by_are_counted(tmp_path, capsys, verb):
    few = tmp_path / "few"
    few.mkdir()
    (few / "machine.yaml").write_text((CAMPAIGNS / "r01" / "machine.yaml").read_text())
    (few / "stability.csv").write_text(
        "trial,spindle_speed_rpm,axial_depth_mm,outcome\n1,3200,1.0,chatter\n2,2900,0.5,stable\n"
    )
    said = refused(capsys, verb, f"campaign={few}", f"output={tmp_path / 'out'}")
    assert said.startswith("error: campaign: found 2 cuts and nothing else that was measured; needed to judge a model")
    assert "8 cuts or limiting depths, or a receptance of 8 lines, natural frequency or bearing stiffness" in said
    assert said.count("\n") == 1
    (few / "frf.csv").write_text(
        "spindle_speed_rpm,frequency_hz,output_axis,input_axis,real_um_n,imag_um_n\n0,100,x,x,0.2,-0.1\n"
    )
    said = refused(capsys, verb, f"campaign={few}", f"output={tmp_path / 'out'}")
    assert said.startswith("error: campaign: found 2 cuts and 1 receptance of fewer than 8 lines; needed to judge")


def test_an_error_that_is_not_known_is_null(tmp_path: Path):
    """JSON knows no number that is none."""
    unknown = Score(value=float("nan"), low=float("nan"), high=float("nan"), count=1)
    told = diagnosis_document.errors(SimpleNamespace(held_out={"none": {"limit_depth": unknown}}))
    assert told["limit_depth"]["none"] is None
    diagnosis_document.write(told, tmp_path / "diagnosis.json")
