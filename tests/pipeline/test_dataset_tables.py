"""What people read of a data set: numbers as they were said, words as they were written, dependence on choices."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from markdown_it import MarkdownIt
from SALib.analyze import pawn

from chatter_core.errors import InvalidInput
from pipeline import dataset, report, sensitivity
from pipeline.by_value import by_value
from pipeline.dataset_card import prose
from pipeline.dataset_tables import inputs_table, stable_throughout
from pipeline.kinds import Dataset
from pipeline.places import DATASET as STORE
from tests.pipeline.test_dataset import SMALL, standin

#: The stand-in has its limits at these speeds near 1.7, 2.2 and 2.8 mm, by preload.
SHALLOW = (
    "study=parameter_study",
    "cluster=serial",
    "design.spindle_speed_rpm=[6000, 6100]",
    "design.deepest_mm=2",
    "margins.speed_percent=0",
)
PRELOADS = "vary.spindle.preload_n=[100, 50, 150]"


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    """A parameter study of whole numbers, fractions and words, with its report."""
    folder = tmp_path_factory.mktemp("tables") / "study"
    vary = ["vary.tool.teeth=[2, 4]", "vary.process.radial_immersion=[0.1, 1]", "vary.process.direction=[up, down]"]
    words = ["study=parameter_study", "design.spindle_speed_rpm=[6000, 9000]", "cluster=serial", *vary]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
        assert dataset.run([*words, "design.title=<b>a|b</b> *c*", f"output={folder}"]) == 0
    return folder


def test_whole_numbers_stay_whole_in_tables_pages_and_choices(output):
    with xr.open_zarr(output / STORE) as data:
        table = inputs_table(data)
    assert table["tool.teeth"].tolist() == [2, 2, 2, 2, 4, 4, 4, 4]
    assert table["tool.teeth"].dtype.kind == "i"
    assert table["process.radial_immersion"].tolist()[:4] == [0.1, 0.1, 1.0, 1.0]
    assert table["process.direction"].tolist()[:2] == ["up", "down"]
    first = (output / "tables" / "samples.csv").read_text().splitlines()[1].split(",")
    assert first[3:6] == ["2", "0.1", "up"]
    page = (output / "report.html").read_text()
    assert "teeth 2, radial_immersion 1, direction up" in page
    assert "teeth 2.0" not in page


def test_a_cut_of_which_a_limit_may_have_been_missed_is_not_called_stable():
    dims, arrays = (
        ("machine", "cut", "spindle_speed"),
        {"limit_depth": [1.0, np.nan, np.nan, np.nan], "limits_complete": [0, 1, 0, 1], "status": [1, 1, 1, 2]},
    )
    data = xr.Dataset(
        {name: (dims, np.reshape(values, (1, 1, 4))) for name, values in arrays.items()},
        attrs={"settings": {"design": {"deepest_mm": 4.0}}},
    )
    assert stable_throughout(data).tolist() == [[False, True, False, False]]


def complete(cuts, **told):
    """Return what the stand-in does, of a search that missed no boundary."""
    arrays, status = standin(cuts, **told)
    return {**arrays, "limits_complete": np.ones_like(arrays["limits_complete"])}, status


@pytest.fixture
def searched(monkeypatch):
    """Compute with the stand-in whose search is complete."""
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset_tables:complete")


def test_the_deepest_depth_is_not_told_as_a_limit_depth(searched, tmp_path):
    assert dataset.run([*SHALLOW, PRELOADS, f"output={tmp_path}"]) == 0
    table = pd.read_csv(tmp_path / "tables" / "samples.csv").set_index("spindle.preload_n")
    for column in ("limit_above_deepest", "with_limit_above_deepest"):
        assert table[column].to_dict() == {100: True, 50: False, 150: True}
    assert table["lowest_limit_depth_mm"][100] == 2.0
    page = (tmp_path / "report.html").read_text()
    assert "is at least 2 mm in the median" in page
    assert "2 of 3 cuts have no limit depth down to 2 mm, the deepest looked at." in page
    assert "and 1.8 mm: no boundary was found near it down to 2 mm." in page
    assert "above the deepest" in page


def test_what_the_limit_depends_on_says_how_many_limits_are_only_bounds(searched, tmp_path):
    assert dataset.run([*SHALLOW, PRELOADS, "design.sampling=one_at_a_time", f"output={tmp_path}"]) == 0
    with xr.open_zarr(tmp_path / STORE) as data:
        _, text = sensitivity.sensitivity(data.load())
    assert "at least 2 mm as described" in text
    assert text.endswith(" 2 of 3 cuts are stable down to 2 mm at all speeds, and count with that depth.")


def test_shares_and_counts_are_of_what_has_a_result(searched, tmp_path):
    words = [*SHALLOW, "vary.spindle.preload_n=[100, 50, 600]", f"output={tmp_path}"]
    # The stand-in has no result at 600 N.
    assert dataset.run(words) == 1
    assert "50.0% of all cuts and speeds with a result are stable" in (tmp_path / "report.html").read_text()
    with xr.open_zarr(tmp_path / STORE) as data:
        found = by_value(data.load())["spindle.preload_n"]
    assert [(one.name, one.cuts) for one in found] == [("50", 1), ("100", 1), ("600", 0)]


def test_a_title_is_shown_as_it_was_written(output):
    shown = MarkdownIt("gfm-like", {"linkify": False}).render((output / "card.md").read_text())
    assert "<h1>&lt;b&gt;a|b&lt;/b&gt; *c*</h1>" in shown
    assert "<b>" not in shown


@pytest.mark.parametrize("text", ["# a", "[a](b)", "`a` _b_ ~c~ **d**", "a | b", "\\a &amp; <!-- b -->", "CC-BY-4.0"])
def test_text_in_a_card_is_shown_as_it_was_written(text):
    # An independent reader of Markdown, with the tables that cards have; what it writes of quotes is HTML's own.
    shown = MarkdownIt("gfm-like", {"linkify": False}).render(f"Of {prose(text)}.")
    expected = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    assert shown == f"<p>Of {expected}.</p>\n"


def test_distances_are_those_of_salib_but_for_the_largest_value_which_it_leaves_out():
    rng = np.random.default_rng(3)
    known = rng.random((400, 1))
    told = known[:, 0] + 0.3 * rng.random(400)
    problem = {"num_vars": 1, "names": ["a"], "bounds": [[0.0, 1.0]]}
    reference = pawn.analyze(problem, known, told, S=sensitivity.CLASSES)["median"][0]
    # One of 400 in one class of 50 changes its distance by at most a fiftieth, and the median of eight by no more.
    assert sensitivity._distance(known[:, 0], told) == pytest.approx(reference, abs=0.02)


def test_each_of_two_weighted_choices_is_a_class():
    known = np.repeat([2.0, 4.0], [90, 10])
    # Knowing which is chosen tells all: the distances are 1 - 0.9 and 1 - 0.1, half and half.
    assert sensitivity._distance(known, known + 0.001 * np.arange(100)) == pytest.approx(0.5, abs=1e-12)


def test_what_stands_twice_names_the_word_of_the_command_line(tmp_path):
    with pytest.raises(InvalidInput, match=r"cutting\.kt_mpa stands twice.*say vary\.KEY="):
        dataset.run(["study=sensitivity", "design.machine.vary.cutting.kt_mpa=[800, 900]", f"output={tmp_path / 'a'}"])


@pytest.mark.parametrize("name", ["input", "split"])
def test_an_array_that_is_gone_is_told_in_a_sentence(tmp_path, monkeypatch, name):
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    monkeypatch.setattr(Dataset, "report", lambda self, place: [])
    assert dataset.run([*SMALL, f"output={tmp_path}"]) == 0
    for file in (tmp_path / STORE / name).glob("c*"):
        file.unlink()
    monkeypatch.undo()
    with pytest.raises(InvalidInput, match=f"{name} is missing.*verify .* repair=true"):
        report.run([f"output={tmp_path}"])


@pytest.mark.parametrize("sampling", ["grid", "one_at_a_time"])
def test_lines_of_a_value_are_those_of_the_cuts_that_have_it(tmp_path, monkeypatch, sampling):
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    monkeypatch.setattr(Dataset, "report", lambda self, place: [])
    words = ["study=parameter_study", "design.spindle_speed_rpm=[6000, 9000]", "cluster=serial"]
    words += [
        f"design.sampling={sampling}",
        "vary.spindle.preload_n=[100, 50, 150]",
        "vary.cutting.kt_mpa=[900, 500, 700]",
    ]
    assert dataset.run([*words, f"output={tmp_path}"]) == 0
    with xr.open_zarr(tmp_path / STORE) as data:
        found = by_value(data.load())
    # The stand-in: exp(preload / 200 + kt / 4000) times something of speed; as described preload is 100 N and kt 900.
    speed = 1.0 + 1e-4 * np.array([6000.0, 9000.0]) * 2.0 * np.pi / 60.0
    others = {"grid": (500.0, 700.0, 900.0), "one_at_a_time": (900.0, 900.0, 900.0)}[sampling]
    assert [own.name for own in found["spindle.preload_n"]] == ["50", "100", "150"]
    for own, preload in zip(found["spindle.preload_n"], (50.0, 100.0, 150.0), strict=True):
        for line, energy in zip((own.low, own.middle, own.high), others, strict=True):
            # The store keeps seven digits.
            assert line == pytest.approx(np.exp(preload / 200.0 + energy / 4000.0) * speed, rel=1e-6)
    kept = {"grid": 3, "one_at_a_time": 2}[sampling]
    assert len(found["cutting.kt_mpa"]) == kept


def test_inputs_of_many_values_have_no_lines(tmp_path, monkeypatch):
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    monkeypatch.setattr(Dataset, "report", lambda self, place: [])
    words = ["study=parameter_study", "design.spindle_speed_rpm=[6000]", "cluster=serial"]
    varied = f"vary.spindle.preload_n={list(range(100, 113))}"
    assert dataset.run([*words, varied, "vary.tool.teeth=[2, 4]", f"output={tmp_path}"]) == 0
    with xr.open_zarr(tmp_path / STORE) as data:
        assert list(by_value(data.load())) == ["tool.teeth"]


def test_the_band_of_a_value_that_many_cuts_have_is_their_middle_half(tmp_path, monkeypatch):
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    monkeypatch.setattr(Dataset, "report", lambda self, place: [])
    words = ["study=parameter_study", "design.spindle_speed_rpm=[6000]", "cluster=serial"]
    energies = np.arange(500, 825, 13)
    varied = [f"vary.cutting.kt_mpa={energies.tolist()}", "vary.tool.teeth=[2, 4]"]
    assert dataset.run([*words, *varied, f"output={tmp_path}"]) == 0
    with xr.open_zarr(tmp_path / STORE) as data:
        two, _ = by_value(data.load())["tool.teeth"]
    assert two.cuts == len(energies) == 25
    # The stand-in rises with kt, so that of 25 cuts in order the 7th and the 19th are the quartiles.
    ends = np.exp((energies[[6, 18]] - energies[12]) / 4000.0)
    assert [two.low[0], two.high[0]] == pytest.approx(two.middle[0] * ends, rel=1e-6)
