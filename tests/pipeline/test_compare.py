"""The commands ``compare`` and ``predict``: from a campaign's folder to numbers, pictures, a page and a model."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import yaml
from PIL import Image
from threadpoolctl import threadpool_limits

from chatter_core.evidence import Comparison, base_model, calibrate, read_campaign
from chatter_core.evidence.failures import failures
from chatter_core.evidence.likelihood import balanced_error
from chatter_core.evidence.measured import OUTCOMES
from pipeline import comparison_figures, identify, model_file, predict
from pipeline.command_line import main
from pipeline.locking import check_folder
from tests.documentation.answers import undocumented, undocumented_columns, unseen
from tests.pipeline.browser import needs_chromium, opened
from tests.synthetic import campaign, tip_machine, trials

DATA = Path(__file__).parents[1] / "data"
CAMPAIGNS = DATA / "campaigns"
SERIAL = "cluster=serial"


@pytest.fixture(scope="module")
def down_milling(tmp_path_factory):
    """The comparison with real cuts, down-milling."""
    output = tmp_path_factory.mktemp("compare") / "r02"
    assert main(["compare", f"campaign={CAMPAIGNS / 'r02'}", f"output={output}", SERIAL]) == 0
    return output


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


def predicted(campaign, trials, output, *words):
    assert main(["predict", f"campaign={campaign}", f"trials={trials}", f"predictions={output}", *words]) == 0
    return table(output)


def plan(tmp_path, rows, head=("trial", "spindle_speed_rpm", "axial_depth_mm")):
    file = tmp_path / "plan.csv"
    with file.open("w", newline="") as stream:
        csv.writer(stream).writerows([head, *rows])
    return file


@pytest.mark.parametrize(
    ("name", "least", "most"),
    # Published for the nominal model of these cuts: 23 of 24 or better, and 16 of 22.
    [("r01", 23, 24), ("r02", 15, 17)],
)
def test_real_cuts_are_told_as_published(tmp_path, name, least, most):
    rows = table(CAMPAIGNS / name / "stability.csv")
    file = plan(tmp_path, [[r["trial"], r["spindle_speed_rpm"], r["axial_depth_mm"]] for r in rows])
    said = {r["trial"]: r["predicted_outcome"] for r in predicted(CAMPAIGNS / name, file, tmp_path / "out.csv")}
    right = sum(said[r["trial"]] == r["outcome"] for r in rows if r["outcome"] != "marginal")
    assert least <= right <= most


def test_everything_is_written_and_says_the_same(down_milling):
    document = json.loads((down_milling / "comparison.json").read_text())
    assert document["measured"]["trials"] == {"stable": 11, "marginal": 5, "chatter": 11}
    outcome = document["errors"]["outcome"]
    trials = table(down_milling / "trials.csv")
    codes = np.array([OUTCOMES.index(row["outcome"]) for row in trials], dtype=np.int8)
    for version in ("as_described", "calibrated", "held_out"):
        margin = np.array([float(row[f"margin_{version}"]) for row in trials])
        assert outcome[version]["value"] == pytest.approx(balanced_error(codes, margin))
        assert outcome[version]["low"] <= outcome[version]["value"] <= outcome[version]["high"]
    # Calibration is by the same cuts: it must not be worse on them.
    assert (
        document["errors"]["log_loss"]["calibrated"]["value"] < document["errors"]["log_loss"]["as_described"]["value"]
    )
    for told in document["calibration"].values():
        assert told["low"] <= told["estimate"] <= told["high"]
    assert sum(row["cuts"] for row in document["reliability"]) == len(trials)
    page = (down_milling / "report.html").read_text()
    for text in ("Model and measurements: r02", "Where it fails", "Probability of chatter", "held out"):
        assert text in page
    for name in ("lobes", "residuals", "pulls"):
        with Image.open(down_milling / "figures" / f"{name}.png") as picture:
            assert picture.size[0] > 1000
    assert not (down_milling / "figures" / "receptances.png").exists()


def test_what_is_written_is_what_the_reference_says_and_nothing_else(down_milling):
    document = json.loads((down_milling / "comparison.json").read_text())
    assert undocumented(document, "comparison.json") == unseen(document, "comparison.json") == set()
    assert undocumented_columns(table(down_milling / "trials.csv")[0], "trials.csv") == set()
    model = yaml.safe_load((down_milling / "model.yaml").read_text())
    assert undocumented(model, "model.yaml", but=["machine"]) == set()


#: What the plot of the lobes shows: how many points its boundary has, and which colours its trials of an outcome.
SHOWN = """(mark) => {
    const plot = Bokeh.documents.flatMap((own) => own.roots()).find((one) => one.title?.text?.startsWith("Cuts"))
    const sources = plot.renderers.map((one) => [one.glyph.type, one.glyph.marker?.value, one.data_source.data])
    const boundary = sources.find(([type]) => type === "MultiLine")[2]
    const trials = sources.find(([type, marker]) => type === "Scatter" && marker === mark)[2]
    return [boundary.xs[0].length, Array.from(trials.colour), Array.from(trials.trial)]
}"""


@needs_chromium
def test_the_page_shows_the_trials_on_the_lobes_of_the_model_that_is_chosen(down_milling):
    rows = table(down_milling / "trials.csv")
    chattered = [row for row in rows if row["outcome"] == "chatter"]
    with opened(down_milling / "report.html") as page:
        boundaries = []
        for title, version in (("Calibrated", "calibrated"), ("Model as described", "as_described")):
            page.get_by_label("model").select_option(title)
            points, colours, numbers = page.evaluate(SHOWN, "x")
            boundaries.append(points)
            assert numbers == [int(row["trial"]) for row in chattered]
            right = [float(row[f"margin_{version}"]) > 0.0 for row in chattered]
            assert [colour == comparison_figures.RIGHT for colour in colours] == right
    assert min(boundaries) > 10
    assert boundaries[0] != boundaries[1]


def test_marginal_cuts_and_those_without_an_answer_are_not_drawn_as_told_right():
    cuts = trials(np.ones(5), np.ones(5), outcome=np.array([0, 1, 2, 0, 2], dtype=np.int8))
    drawn = comparison_figures.trial_colours(cuts, np.array([-0.1, 0.2, 0.2, np.nan, np.nan]))
    right, wrong, neither = (getattr(comparison_figures, name) for name in ("RIGHT", "WRONG", "NEITHER"))
    assert drawn.tolist() == [right, neither, right, wrong, wrong]


@pytest.mark.parametrize("heard", [True, False])
def test_residuals_lie_over_speed_depth_order_and_frequency(heard):
    cuts = trials(
        np.array([3600.0, 4000.0]),
        [1e-3, 2e-3],
        outcome=np.array([0, 2], dtype=np.int8),
        chatter_frequency=np.array([np.nan, 4000.0 if heard else np.nan]),
    )
    told = SimpleNamespace(margin=np.array([-0.1, 0.2]), chatter_frequency=np.array([np.nan, 4050.0]))
    model = SimpleNamespace(campaign=campaign(tip_machine(), trials=cuts))
    found = SimpleNamespace(comparison=SimpleNamespace(model=model), refitted=SimpleNamespace(told=told))
    panels = comparison_figures.residuals(found).axes
    over = {axes.get_xlabel() for axes in panels}
    # Without a single frequency there is neither a row nor a column for them.
    assert ("measured chatter frequency [Hz]" in over) == heard
    assert over >= {"spindle speed [rpm]", "axial depth [mm]", "trial"}
    assert len(panels) == (8 if heard else 3)


def test_a_written_model_predicts_what_the_comparison_said(down_milling, tmp_path, capsys):
    trials = table(down_milling / "trials.csv")
    file = plan(tmp_path, [[r["trial"], r["spindle_speed_rpm"], r["axial_depth_mm"]] for r in trials])
    model = f"model={down_milling / 'model.yaml'}"
    found = predicted(CAMPAIGNS / "r02", file, tmp_path / "out.csv", model)
    chatters = [float(row["margin_calibrated"]) > 0.0 for row in trials]
    assert [row["predicted_outcome"] == "chatter" for row in found] == chatters
    assert [float(row["spectral_radius"]) > 1.0 for row in found] == chatters
    assert {row["status"] for row in found} == {"ok"}
    again = tmp_path / "again"
    capsys.readouterr()
    assert main(["compare", f"campaign={CAMPAIGNS / 'r02'}", model, f"output={again}", SERIAL, "format=json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["comparison"] == json.loads((again / "comparison.json").read_text())
    assert str(again / "model.yaml") in told["written"]
    # From its own calibration: as described is what it was calibrated to.
    first, second = (json.loads((f / "comparison.json").read_text())["errors"] for f in (down_milling, again))
    assert second["outcome"]["as_described"]["value"] == first["outcome"]["calibrated"]["value"]
    no_test = "the model was fitted to all of these cuts already; its errors on them as described are no test of it"
    assert told["remarks"] == [f"remark: {no_test}"]
    assert no_test in (again / "report.html").read_text()


def test_columns_and_order_of_planned_cuts_are_kept(tmp_path):
    head = ("operator", "trial", "spindle_speed_rpm", "axial_depth_mm", "direction", "radial_immersion")
    rows = [["Ann", 7, 3600, 2.0, "up", 0.2], ["Bob", 3, 3300, 1.0, "", ""]]
    found = predicted(CAMPAIGNS / "r02", plan(tmp_path, rows, head), tmp_path / "out.csv")
    assert [(r["trial"], r["operator"], r["direction"]) for r in found] == [("7", "Ann", "up"), ("3", "Bob", "")]
    probability = [float(r["probability_chatter"]) for r in found]
    assert all(0.0 < p < 1.0 for p in probability)
    assert [bool(r["predicted_chatter_frequency_hz"]) for r in found] == [
        r["predicted_outcome"] == "chatter" for r in found
    ]


def test_what_cannot_be_computed_is_marked_and_told_by_the_exit_code(tmp_path, capsys):
    file = plan(tmp_path, [[1, 0.5, 1.0], [2, 3600, 1.0]])
    output = tmp_path / "out.csv"
    assert main(["predict", f"campaign={CAMPAIGNS / 'r02'}", f"trials={file}", f"predictions={output}"]) == 1
    slow, usual = table(output)
    assert (slow["status"], slow["predicted_outcome"], slow["spectral_radius"]) == ("outside_validity", "", "")
    assert usual["status"] == "ok"
    assert "no result for 1 cuts" in capsys.readouterr().err


def refused(capsys, *words):
    assert main(list(words)) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    return said


def test_bad_input_is_told_and_leaves_nothing_behind(tmp_path, capsys):
    campaign, output = f"campaign={CAMPAIGNS / 'r02'}", f"output={tmp_path / 'out'}"
    assert "campaign: missing" in refused(capsys, "compare", output)
    assert "no such folder" in refused(capsys, "compare", "campaign=nowhere", output)
    assert "not for compare" in refused(capsys, "compare", campaign, "grid=smoke", output)
    assert "not for compare" in refused(capsys, "compare", campaign, "tool.teeth=3", output)
    file = plan(tmp_path, [[1, 3600, 1.0]])
    same = refused(capsys, "predict", campaign, f"trials={file}", f"predictions={file}")
    assert "is the table of trials itself" in same
    head = plan(tmp_path, [])
    assert "holds a header and no rows" in refused(capsys, "predict", campaign, f"trials={head}", "predictions=x.csv")
    wrong = plan(tmp_path, [[1, -3, 1.0]])
    assert "line 2, column spindle_speed_rpm" in refused(
        capsys, "predict", campaign, f"trials={wrong}", "predictions=x.csv"
    )
    assert "output: not for predict" in refused(capsys, "predict", campaign, f"trials={file}", output)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("verb", ["predict", "compare"])
def test_a_machine_in_the_place_of_a_model_gets_one_sentence(tmp_path, capsys, verb):
    rest = [f"trials={plan(tmp_path, [[1, 3600, 1.0]])}", "predictions=x.csv"] if verb == "predict" else []
    machine = CAMPAIGNS / "r02" / "machine.yaml"
    said = refused(capsys, verb, f"campaign={CAMPAIGNS / 'r02'}", f"model={machine}", *rest)
    assert said == (
        f"error: {machine}: is no calibrated model but has the keys 'tip', 'tool', 'cutting', 'process'; needed: a "
        "model.yaml that compare, diagnose or improve wrote\n"
    )


def test_preloads_of_a_plan_for_a_machine_that_knows_none_are_told(tmp_path, capsys):
    head = ("trial", "spindle_speed_rpm", "axial_depth_mm", "preload_n")
    for preload, told in ((100, True), ("", False)):
        predicted(CAMPAIGNS / "r02", plan(tmp_path, [[1, 3600, 1.0, preload]], head), tmp_path / "out.csv")
        said = "remark: plan.csv: preload_n is not used, the machine's measured tip modes know no preload\n"
        assert (said in capsys.readouterr().out) is told


def test_predictions_are_not_written_over_what_was_read(tmp_path, capsys, down_milling):
    campaign = tmp_path / "campaign"
    shutil.copytree(CAMPAIGNS / "r02", campaign)
    model, file = tmp_path / "model.yaml", plan(tmp_path, [[1, 3600, 1.0]])
    shutil.copy(down_milling / "model.yaml", model)
    before = {path: path.read_bytes() for path in (*campaign.iterdir(), model, file)}
    words = (f"campaign={campaign}", f"model={model}")
    for place in (campaign / "stability.csv", campaign / "machine.yaml", campaign / "new.uff", model):
        said = refused(capsys, "predict", *words, f"trials={file}", f"predictions={place}")
        assert "is read for the prediction" in said
    assert {path: path.read_bytes() for path in before} == before
    assert set(campaign.iterdir()) | {model, file} == set(before)
    words = ("predict", *words, f"trials={file}")
    assert f"predictions: {tmp_path} is a folder" in refused(capsys, *words, f"predictions={tmp_path}")
    assert "allowed: a file name ending in .csv" in refused(capsys, *words, f"predictions={tmp_path / 'p.xlsx'}")
    assert f"predictions: {file} cannot be used as a folder" in refused(capsys, *words, f"predictions={file / 'x.csv'}")


def test_places_that_cannot_be_written_are_told_before_anything_is_computed(tmp_path, capsys, monkeypatch):
    file = plan(tmp_path, [[1, 3600, 1.0]])
    for module, function, words in (
        (predict, "predict_planned", ("predict", f"trials={file}", f"predictions={file / 'x.csv'}")),
        (identify, "identify_tip", ("identify", f"output={file / 'x.yaml'}")),
    ):
        monkeypatch.setattr(module, function, lambda *_, **__: pytest.fail("was computed"))
        said = refused(capsys, *words, f"campaign={CAMPAIGNS / 'd03'}")
        assert f"{file} cannot be used as a folder" in said


def test_a_place_that_is_looked_at_is_not_made(tmp_path):
    check_folder(tmp_path / "new" / "deep")
    assert list(tmp_path.iterdir()) == []


def test_predictions_take_the_place_of_earlier_ones_and_of_nothing_else(tmp_path, capsys):
    words = ("predict", f"campaign={CAMPAIGNS / 'r02'}", f"trials={plan(tmp_path, [[1, 3600, 1.0]])}")
    for mine in (tmp_path / "mine.txt", tmp_path / "process_damping.yaml"):
        mine.write_text("coefficient: 1\n")
        assert "that no earlier answer is" in refused(capsys, *words, f"predictions={mine}")
        assert mine.read_text() == "coefficient: 1\n"
    out = tmp_path / "out.csv"
    out.touch()
    for _ in range(2):
        assert main([*words, f"predictions={out}"]) == 0
    # An earlier prediction is a plan like any other.
    assert main([*words[:2], f"trials={out}", f"predictions={tmp_path / 'again.csv'}"]) == 0
    assert (tmp_path / "again.csv").read_text() == out.read_text()


def test_a_column_of_ones_own_is_not_replaced(tmp_path, capsys):
    file = tmp_path / "plan.csv"
    file.write_text("trial,spindle_speed_rpm,axial_depth_mm,status\n1,3600,1.0,ask Anna\n")
    words = ("predict", f"campaign={CAMPAIGNS / 'r02'}", f"trials={file}", f"predictions={tmp_path / 'out.csv'}")
    assert f"{file}: column status is one of those that are written; rename it" in refused(capsys, *words)
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("text", ["mine, and no json", "{}", "[]"])
def test_a_document_that_no_answer_has_written_is_kept(tmp_path, capsys, text):
    for name in ("comparison.json", "report.html"):
        (tmp_path / name).write_text(text)
    words = ("compare", f"campaign={CAMPAIGNS / 'r02'}", f"output={tmp_path}", SERIAL)
    assert "holds a comparison.json that no earlier answer has written" in refused(capsys, *words)
    assert (tmp_path / "report.html").read_text() == text


def test_links_in_a_circle_where_an_answer_goes_are_no_model(tmp_path, down_milling):
    (tmp_path / "trials.csv").symlink_to("trials.csv")
    words = (f"campaign={CAMPAIGNS / 'r02'}", f"model={down_milling / 'model.yaml'}", f"output={tmp_path}", SERIAL)
    assert main(["compare", *words]) == 0
    assert not (tmp_path / "trials.csv").is_symlink()


@pytest.mark.parametrize(("number", "kind"), [(signal.SIGTERM, "serial"), (signal.SIGINT, "local")])
def test_a_stopped_comparison_ends_in_order_and_leaves_nothing(tmp_path, number, kind):
    output, scratch = tmp_path / "out", tmp_path / "scratch"
    scratch.mkdir()
    words = ["compare", f"campaign={CAMPAIGNS / 'd01'}", f"output={output}", f"cluster={kind}"]
    process = subprocess.Popen(
        [sys.executable, "-m", "pipeline", *words, *(["cluster.workers=1"] if kind == "local" else [])],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(scratch)},
        # A shell that runs the tests in the background has them, and what they start, ignore SIGINT.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    try:
        # The first piece of work is done, and others are under way.
        first = process.stderr.readline()
        os.killpg(process.pid, number)
        _, told = process.communicate(timeout=60.0)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 128 + number, told
    assert "1 of 5" in first
    assert "Traceback" not in told
    assert not output.exists()
    assert not list(scratch.iterdir())
    # A worker in the middle of a compiled loop hears of the end when the loop is done: moments, bounded generously.
    left = [one for one in psutil.process_iter() if _runs_in_session(one, process.pid)]
    assert not psutil.wait_procs(left, timeout=30.0)[1]


def _runs_in_session(process, session):
    """Whether a process lives and belongs to a session; one that has ended may wait for whoever adopted it."""
    try:
        return os.getsid(process.pid) == session and process.status() != psutil.STATUS_ZOMBIE
    except (ProcessLookupError, psutil.NoSuchProcess):
        return False


def test_a_model_of_another_machine_or_with_odd_content_is_refused(tmp_path, capsys, down_milling):
    model, file = tmp_path / "model.yaml", plan(tmp_path, [[1, 3600, 1.0]])
    content = yaml.safe_load((down_milling / "model.yaml").read_text())

    def said(change, campaign="r02"):
        changed = json.loads(json.dumps(content))
        change(changed)
        model.write_text(yaml.safe_dump(changed))
        words = (f"campaign={CAMPAIGNS / campaign}", f"model={model}", f"trials={file}", "predictions=x.csv")
        return refused(capsys, "predict", *words)

    assert "they differ in process.direction" in said(lambda c: None, "r01")
    assert "parameters: 'nonsense': unknown" in said(lambda c: c["parameters"][0].update(name="nonsense"))
    assert "estimate" in said(lambda c: c["parameters"][0].update(estimate="many"))
    # True is no 1.
    assert "estimate: found true, a number" in said(lambda c: c["parameters"][0].update(estimate=True))
    assert "modes: found true, a number" in said(lambda c: c.update(modes=True))
    assert "effects: found 'nonsense'" in said(lambda c: c.update(effects={"nonsense": {}}))
    assert "needed: axis" in said(lambda c: c.update(effects={"workpiece_mode": {}}))
    assert "effects.workpiece_mode.axis: found 'z'" in said(
        lambda c: c.update(effects={"workpiece_mode": {"axis": "z"}})
    )
    assert "effects: found" in said(lambda c: c.update(effects=["process_damping"]))
    assert "'kn' stands twice" in said(lambda c: c["parameters"][0].update(name="kn"))
    assert "found unit 'Hz', allowed: 'ln'" in said(lambda c: c["parameters"][0].update(unit="Hz"))
    # Its factor would be infinite.
    assert "outcome_width: found 800 ln, allowed -50 to 50" in said(
        lambda c: next(p for p in c["parameters"] if p["name"] == "outcome_width").update(estimate=800.0)
    )
    assert "found 99" in said(lambda c: c["parameters"][0].update(estimate=99.0))
    assert "correlation" in said(lambda c: c["correlation"].pop())
    assert "symmetric" in said(lambda c: c["correlation"][0].__setitem__(1, 5.0))
    assert "by 1, on the diagonal" in said(lambda c: c["correlation"][0].__setitem__(0, 25.0))
    assert "found the standard deviation 1e+300 ln, allowed 0 to" in said(
        lambda c: c["parameters"][0].update(standard_deviation=1e300)
    )
    assert "own_effects: found 'mine', which is not among" in said(lambda c: c.update(own_effects={"mine": "0"}))
    assert "machine: missing" in said(lambda c: c.pop("machine"))


def test_responses_alone_can_be_compared(tmp_path):
    campaign = tmp_path / "responses"
    shutil.copytree(CAMPAIGNS / "d05", campaign)
    (campaign / "stability.csv").unlink()
    output = tmp_path / "out"
    assert main(["compare", f"campaign={campaign}", f"output={output}", SERIAL]) == 0
    document = json.loads((output / "comparison.json").read_text())
    assert list(document["errors"]) == ["receptance"]
    assert document["held_out_groups"] == 0
    assert document["errors"]["receptance"]["calibrated"]["value"] < 0.1
    assert not (output / "figures" / "lobes.png").exists()
    assert not (output / "trials.csv").exists()


def test_a_machine_with_nothing_missing_is_told_right_once_calibrated(tmp_path):
    comparison = Comparison(model=base_model(read_campaign(CAMPAIGNS / "d01")))
    with threadpool_limits(1):
        found = calibrate(comparison)
    # Nothing is left beyond what noise explains.
    assert failures(comparison.model, comparison.compare(found.estimate), np.zeros(92), found) == []
    model_file.write(tmp_path / "model.yaml", comparison.model.campaign, found, model_file.Content())
    rows = table(DATA / "clean_trials" / "d01.csv")
    file = plan(tmp_path, [[r["trial"], r["spindle_speed_rpm"], r["axial_depth_mm"]] for r in rows])
    said = predicted(CAMPAIGNS / "d01", file, tmp_path / "out.csv", f"model={tmp_path / 'model.yaml'}")
    codes = np.array([OUTCOMES.index(row["outcome"]) for row in rows], dtype=np.int8)
    margin = np.array([1.0 if row["predicted_outcome"] == "chatter" else -1.0 for row in said])
    # Labels of such simulations agree with linear theory of the true machine in 97 to 100 %.
    assert balanced_error(codes, margin) <= 0.05
