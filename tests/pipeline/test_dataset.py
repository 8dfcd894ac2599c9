"""Data sets: the same numbers however they are computed, what is missing is told, and what a colleague loads."""

import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
import yaml

from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.lobes import lobe_block
from chatter_core.units import SUFFIXES
from chatter_core.variables import CUT_STATUS, DATASET, DATASET_INPUTS, STATUS, STRUCTURE
from pipeline import dataset, store
from pipeline.command_line import main
from pipeline.configuration import compose_settings, sort_words
from pipeline.design import DatasetSettings
from pipeline.kinds import Dataset
from pipeline.pack import pack
from pipeline.places import DATASET as STORE
from pipeline.places import Folder
from pipeline.sensitivity import sensitivity

#: Five machines with two cuts at three speeds, in chunks of two machines.
SMALL = (
    "study=dataset_small",
    "design.machines=5",
    "design.spindle_speed_rpm=[6000, 12000, 18000]",
    "cluster=serial",
    "cluster.cells_per_task=12",
)


def standin(
    cuts: Any, *, spindle_speed: Any, mode_count: int, deepest: float, **_: Any
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return numbers that depend on machine, cut and speed, and on nothing else: exp(preload + kt), scaled."""
    machines = [stages.machine for stages in cuts]
    if machines[0].spindle.preload == 600.0:
        raise NoEquilibrium("the ball leaves its race")
    logarithm = np.array([m.spindle.preload / 200.0 + m.cutting.specific_cutting_energy / 4e9 for m in machines])
    limit = np.exp(logarithm)[:, None] * (1e-3 + 1e-7 * spindle_speed)
    sizes = {"spindle_speed": len(spindle_speed), "cut": len(cuts), "axis": 2, "mode": mode_count}
    arrays = {name: v.without_result(tuple(sizes[d] for d in v.dims[1:])) for name, v in DATASET.items()}
    arrays["limit_depth"] = np.where(limit < deepest, limit, np.nan)
    return arrays, np.ones(limit.shape, dtype=np.uint8)


@pytest.fixture
def quick(monkeypatch):
    """Compute with the stand-in, and write no report."""
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    monkeypatch.setattr(Dataset, "report", lambda self, place: [])


def values(folder: Path) -> dict[str, np.ndarray]:
    with xr.open_zarr(folder / STORE) as data:
        return {name: data[name].values for name in data.variables}


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """A small data set by the real physics, serially."""
    folder = tmp_path_factory.mktemp("dataset") / "small"
    assert dataset.run([*SMALL, f"output={folder}"]) == 0
    return folder


def test_store_opens_in_xarray_with_names_units_and_parts(small):
    with xr.open_zarr(small / STORE) as data:
        for name, variable in {**DATASET, **DATASET_INPUTS, "status": CUT_STATUS}.items():
            assert data[name].dims == variable.dims
            assert data[name].attrs.get("units") == variable.unit
            assert data[name].dtype == np.dtype(variable.dtype)
        # Each key has its own: none holds for all of them.
        assert "units" not in data["input"].attrs
        assert data.sizes == {
            "machine": 5, "cut": 2, "spindle_speed": 3, "input_key": 22, "axis": 2, "mode": 4,
        }  # fmt: skip
        assert bool((data["status"] == STATUS["ok"]).all())
        assert data.attrs["complete"] is True


def test_a_machine_has_the_limits_and_modes_that_the_lobes_of_its_description_have(small):
    data = xr.open_zarr(small / STORE).load()
    settings = compose_settings(sort_words(list(SMALL), ()), DatasetSettings)
    group = store.open_group(Folder(small, STORE))
    described = Dataset().described(group.attrs.asdict(), partial(store.whole, group))
    for machine, cut in ((0, 0), (3, 1)):
        block = lobe_block(
            described.cuts_of(machine, None)[cut],
            spindle_speed=data["spindle_speed"].values * SUFFIXES["rpm"][0],
            axial_depth=np.array([settings.design.deepest * 1e-3]),
            mode_count=4,
            modal_parameters="dynamic",
            method=settings.method,
            cells="adaptive",
        )
        # The same computation; the store keeps seven digits.
        expected = 1e3 * block.limit_depth[:, 0]
        assert data["limit_depth"].values[machine, cut] == pytest.approx(expected, rel=1e-6, nan_ok=True)
    names = [str(name) for name in data["input_key"].values]
    assert data["input"].values[0, 0, names.index("tool.teeth")] in (2.0, 3.0, 4.0)
    assert np.array_equal(data["input"].values[:, 0, :18], data["input"].values[:, 1, :18])
    assert (data["input"].values[:, 0, 18:] != data["input"].values[:, 1, 18:]).any()


@pytest.mark.parametrize("words", [("cluster.cells_per_task=1000",), ("cluster=local", "cluster.workers=2")])
def test_the_same_numbers_however_they_are_computed(small, tmp_path, words):
    # A group takes one word.
    others = [word for word in SMALL if word.partition("=")[0] not in {own.partition("=")[0] for own in words}]
    assert dataset.run([*others, *words, f"output={tmp_path}"]) == 0
    assert_same(values(small), values(tmp_path))


def test_the_first_machines_of_a_larger_data_set_are_those_of_a_smaller(quick, tmp_path):
    for folder, count in (("few", 4), ("many", 9)):
        assert dataset.run([*SMALL, f"design.machines={count}", f"output={tmp_path / folder}"]) == 0
    few, many = values(tmp_path / "few"), values(tmp_path / "many")
    for name in ("input", "limit_depth", "status"):
        np.testing.assert_array_equal(few[name], many[name][:4])


def test_card_tables_figures_and_page_are_written_and_the_cards_code_runs(small, monkeypatch):
    assert {"card.md", "report.html", "settings.yaml"} <= {path.name for path in small.iterdir()}
    card = (small / "card.md").read_text()
    for part in ("limit_depth", "bearing.ball_count", "CC-BY-4.0", "Cite as", "0 constant, 1 rigid", "seed 20261122"):
        assert part in card
    monkeypatch.chdir(small)
    names: dict[str, Any] = {}
    for code in re.findall(r"```python\n(.*?)```", card, flags=re.S):
        if "torch" in code:
            continue  # not installed with the program: what it does is told and is its own
        exec(code, names)
    assert names["train"].sizes["machine"] == int((names["data"]["split"] == 0).sum())
    assert names["limits"].shape == (5, 2, 3)
    rows = (small / "tables" / "samples.csv").read_text().splitlines()
    assert len(rows) == 1 + 5 * 2
    assert rows[0].startswith("machine,cut,part,bearing.pitch_diameter_mm")
    assert (small / "report.html").stat().st_size < 5e6


def test_what_fails_is_marked_and_told_and_the_rest_is_there(quick, tmp_path, capsys):
    words = [*SMALL, "vary.spindle.preload_n=[100, 600, 200]", "design.sampling=grid", "design.machines=null"]
    words += ["design.cuts_per_machine=null", f"output={tmp_path}"]
    assert dataset.run(words) == 1
    told = capsys.readouterr().err
    assert "3 of 9 cells failed and are marked (3 outside_validity)" in told
    found = values(tmp_path)
    assert found["status"][1].tolist() == [[STATUS["outside_validity"]] * 3]
    assert np.isnan(found["limit_depth"][1]).all()
    assert np.isfinite(found["limit_depth"][[0, 2]]).all()
    assert main(["journal", f"output={tmp_path}"]) == 0
    assert "machines 0 to 2" in capsys.readouterr().out


def test_time_that_is_up_is_no_failure_and_the_same_command_goes_on(quick, tmp_path, capsys):
    words = [*SMALL, f"output={tmp_path}"]
    assert dataset.run([*words, "budget_hours=1e-12"]) == 0
    assert "are not computed yet: the time is up" in capsys.readouterr().err
    assert (values(tmp_path)["status"] == 0).any()
    assert main(["status", f"output={tmp_path}", "format=json"]) == 0
    assert json.loads(capsys.readouterr().out)["state"] != "complete"
    assert dataset.run(words) == 0
    assert (values(tmp_path)["status"] == 1).all()


def test_a_damaged_data_set_is_found_and_repaired_and_a_finished_one_packed(quick, tmp_path, capsys):
    words = [*SMALL, f"output={tmp_path}"]
    assert dataset.run(words) == 0
    before = values(tmp_path)
    for name in ("limit_depth", "input"):
        file = max((tmp_path / STORE / name).glob("c*"), key=lambda path: path.stat().st_size)
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 4
        file.write_bytes(content)
    assert main(["verify", f"output={tmp_path}"]) == 1
    out = capsys.readouterr().out
    assert "damaged: input: cannot be read" in out
    assert "damaged: limit_depth: machines" in out
    assert main(["verify", f"output={tmp_path}", "repair=true"]) == 0
    assert_same(before, values(tmp_path))
    files, packed = pack(Folder(tmp_path, STORE))
    assert packed < files
    assert_same(before, values(tmp_path))


def test_one_at_a_time_and_indices_are_those_of_a_function_that_is_known(quick, tmp_path):
    """ln(limit) is preload / 200 + kt / 4000: of uniform inputs shares of variance go by the squares of the swings."""
    vary = (
        "vary.spindle.preload_n={distribution: uniform, low: 80, high: 120}",  # swings ln(limit) by 0.2
        "vary.cutting.kt_mpa={distribution: uniform, low: 700, high: 1100}",  # by 0.1
        "vary.tool.teeth=[4, 5]",  # not at all
    )
    alone = ("study=sensitivity", "cluster=serial", "design.spindle_speed_rpm=[6000]")
    assert dataset.run([*alone, *vary, f"output={tmp_path / 'alone'}"]) == 0
    table, text = sensitivity(xr.open_zarr(tmp_path / "alone" / STORE).load())
    assert "as described" in text
    assert table["key"].tolist() == ["spindle.preload_n", "cutting.kt_mpa", "tool.teeth"]
    # The store keeps seven digits; as described preload is 100 N and kt 900 MPa.
    assert table["change_at_high_percent"].tolist() == pytest.approx(
        [100 * np.expm1(0.1), 100 * np.expm1(0.05), 0.0], abs=1e-4
    )
    found = {}
    for sampling, machines in (("saltelli", 256), ("sobol", 512)):
        words = (*alone, *vary, f"design.sampling={sampling}", f"design.machines={machines}")
        assert dataset.run([*words, f"output={tmp_path / sampling}"]) == 0
        table, _ = sensitivity(xr.open_zarr(tmp_path / sampling / STORE).load())
        assert table["key"].tolist()[:2] == ["spindle.preload_n", "cutting.kt_mpa"]
        found[sampling] = table.set_index("key").loc[["spindle.preload_n", "cutting.kt_mpa", "tool.teeth"]]
    # Variances as 4 : 1 : 0. Sobol's indices of some hundreds of points; their own intervals are about 0.1.
    for column in ("share", "total_share"):
        assert found["saltelli"][column].tolist() == pytest.approx([0.8, 0.2, 0.0], abs=0.1)
    # Correlations are the roots; of ranks, which a sum of two uniform numbers changes little.
    assert found["sobol"]["rank_correlation"].tolist() == pytest.approx([0.894, 0.447, 0.0], abs=0.05)


def test_a_key_follows_from_one_that_varies(quick, tmp_path):
    study = ("study=parameter_study", "cluster=serial", "design.spindle_speed_rpm=[6000]")
    words = [
        *study,
        "vary.spindle.preload_n=[60, 90]",
        "formula.cutting.kt_mpa=9 * spindle.preload_n",
        f"output={tmp_path}",
    ]
    assert dataset.run(words) == 0
    low, high = np.log(values(tmp_path)["limit_depth"].ravel())
    # As the stand-in goes with preload and kt; the store keeps seven digits.
    assert high - low == pytest.approx(30.0 / 200.0 + 9.0 * 30.0 / 4000.0, abs=1e-6)


def test_a_formula_alone_comes_to_those_of_a_design(quick, tmp_path):
    words = [*SMALL, "formula.spindle.sections[3].inner_diameter_mm=0.5 * spindle.sections[3].outer_diameter_mm"]
    assert dataset.run([*words, f"output={tmp_path}"]) == 0
    kept = yaml.safe_load((tmp_path / "settings.yaml").read_text())["design"]["machine"]["formulas"]
    assert list(kept)[-1] == "spindle.sections[3].inner_diameter_mm"
    assert kept["spindle.sections[0].outer_diameter_mm"] == "0.9 * tool.diameter_mm"


def test_a_formula_of_what_differs_from_cut_to_cut_is_one_of_the_cut(quick, tmp_path):
    formulas = ["formula.process.feed_per_tooth_mm=0.1 * process.radial_immersion"]
    formulas += ["formula.cutting.kt_mpa=900 + 1000 * process.feed_per_tooth_mm"]
    own = tmp_path / "design.yaml"
    own.write_text(
        "title: T\nsampling: grid\nseed: 1\nspindle_speed_rpm: [6000]\ndeepest_mm: 20\nmode_count: 2\n"
        "machine: {vary: {tool.teeth: [2]}, formulas: {cutting: {kt_mpa: 500}}}\n"
        "cut: {vary: {process.radial_immersion: [0.2, 1.0]}}\n"
    )
    words = ["study=dataset_small", f"design={own}", "cluster=serial", *formulas, f"output={tmp_path / 'out'}"]
    assert dataset.run(words) == 0
    low, high = np.log(values(tmp_path / "out")["limit_depth"].ravel())
    # Feeds of 0.02 and 0.1 mm: kt differs by 80 MPa. As the stand-in goes with kt; the store keeps seven digits.
    assert high - low == pytest.approx(80.0 / 4000.0, abs=1e-6)


def refused_grid(tmp_path, machine, cut):
    """Return why a design of a grid is refused, whose machine and cut are as said."""
    own = tmp_path / "design.yaml"
    own.write_text(
        "title: T\nsampling: grid\nseed: 1\nspindle_speed_rpm: [9000]\ndeepest_mm: 5\nmode_count: 2\n"
        f"machine: {machine}\ncut: {cut}\n"
    )
    with pytest.raises(InvalidInput) as caught:
        dataset.run(["study=dataset_small", f"design={own}", f"output={tmp_path / 'new'}"])
    return caught.value.problems


@pytest.mark.parametrize(
    ("level", "told"),
    [
        (
            "formulas: {process.feed_per_tooth_mm: 0.1 * process.radial_immersion}",
            "design.machine.formulas: process.feed_per_tooth_mm: found process.radial_immersion, which differs from "
            "cut to cut, allowed: keys that all cuts of a machine share; what of tool, cutting and process follows "
            "from the others stands in cut",
        ),
        ("formulas: {spindle.preload_n: 900 * cutting.kn}", "spindle.preload_n: found cutting.kn, which differs"),
        (
            "formulas: {spindle.preload_n: '900 * cutting[\"kn\"]'}",
            "spindle.preload_n: found cutting.kn, which differs",
        ),
        ("formulas: {cutting.kt_mpa: '3 * tool.pitch_angles_deg[0]'}", "found tool.pitch_angles_deg, which differs"),
        ("constraints: [tool.teeth > 3 * process.radial_immersion]", "machine.constraints: tool.teeth > 3 *"),
    ],
)
def test_what_is_said_of_a_machine_names_nothing_that_differs_from_cut_to_cut(tmp_path, level, told):
    cut = "{vary: {process.radial_immersion: [0.1], tool.pitch_angles_deg: [1]}, formulas: {cutting.kn: 0.3}}"
    problems = refused_grid(tmp_path, f"{{vary: {{tool.teeth: [2]}}, {level}}}", cut)
    assert told in "\n".join(problems)
    assert len(problems) == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("study=parameter_study",), "nothing varies"),
        (("study=parameter_study", "vary.tool.teeth=[3]", "formula.cutting.kn=1 +"), "which is no formula"),
        (("study=parameter_study", "vary.tool.teeth=[3]", "formula.cutting.kn=0.3; 9"), "which is no formula"),
        (("study=parameter_study", "vary.tool.teeth=[3]", "formula.tool.teeth=4"), "tool.teeth varies already"),
        (("study=parameter_study", "vary.tool.teeth=[3]", "formula.cutting.kn=tool.teethh"), "teethh"),
        (("study=parameter_study", "formula.cutting.kn=0.3"), "nothing varies"),
        (("study=reference",), "design: missing; study reference has none"),
        (("study=dataset_small", "grid.preload_n=[1]"), "grid.preload_n=[1]: not for this verb"),
        (("study=parameter_study", "vary.tool.teeth=3"), "allowed: a list of values, or a distribution"),
        (("study=parameter_study", "vary.tool.teethh=[3]"), "unknown key; did you mean teeth?"),
        (("study=parameter_study", "vary.tool.teeth=[3, -1]"), "machine 1 cannot be: tool.teeth: found -1"),
        (("study=dataset_small", "budget_hours=soon"), "budget_hours: found 'soon', allowed: a finite number"),
        (("study=dataset_small", "design=nowhere.yaml"), "nowhere.yaml: no such file"),
        (("study=dataset_small", "design.machines=0"), "design.machines: found 0, allowed: at least 1"),
        (("study=dataset_small", "design.sampling=halton"), "design.sampling: found 'halton'"),
        (("study=dataset_small", "design.machine.constraints=[tool.teeth > 9]"), "too few to go on"),
        (
            ("study=parameter_study", "vary.effects.thermal_preload.rise=[1]"),
            "not on; say effects=[thermal_preload]",
        ),
    ],
)
def test_what_is_wrong_is_told_in_a_sentence(tmp_path, words, told):
    with pytest.raises(InvalidInput) as caught:
        dataset.run([*words, f"output={tmp_path / 'new'}"])
    assert told in str(caught.value)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("cut", "told"),
    [
        ("{vary: {process.radial_immersion: [0.1]}, formulas: {cutting.kn: 1 / 0}}", "division by zero"),
        ("{vary: {'tool[0]': [1]}}", "tool[0] cannot be put there"),
    ],
)
def test_what_is_wrong_with_the_cuts_of_a_grid_is_told(tmp_path, cut, told):
    assert told in "\n".join(refused_grid(tmp_path, "{vary: {tool.teeth: [2]}}", cut))


@pytest.mark.parametrize("study", ["sensitivity", "parameter_study"])
def test_a_study_without_any_result_is_reported_without_numbers(monkeypatch, tmp_path, study):
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    words = [f"study={study}", "design.spindle_speed_rpm=[9000]", "cluster=serial", "spindle.preload_n=600"]
    assert dataset.run([*words, "vary.tool.teeth=[2, 3, 4]", f"output={tmp_path}"]) == 1
    rows = [row.split(",") for row in (tmp_path / "tables" / "samples.csv").read_text().splitlines()]
    for name in ("lowest_limit_depth_mm", "at_spindle_speed_rpm"):
        assert {row[rows[0].index(name)] for row in rows[1:]} == {""}
    assert not (tmp_path / "tables" / "sensitivity.csv").exists()


def test_an_input_of_one_value_has_no_part_in_what_limits_depend_on(quick, tmp_path):
    words = ["study=sensitivity", "cluster=serial", "design.spindle_speed_rpm=[6000]", "design.sampling=random"]
    words += ["design.machines=64", "vary.tool.teeth=[4]", "vary.spindle.preload_n=[50, 80, 100, 150]"]
    assert dataset.run([*words, f"output={tmp_path}"]) == 0
    table, _ = sensitivity(xr.open_zarr(tmp_path / STORE).load())
    assert table["key"].tolist() == ["spindle.preload_n", "tool.teeth"]
    assert table.iloc[1][["rank_correlation", "distance"]].tolist() == [0.0, 0.0]
    assert table.iloc[0]["rank_correlation"] == pytest.approx(1.0)


def test_a_sweep_says_that_a_data_set_is_another_verbs(tmp_path, capsys):
    assert main(["sweep", "study=dataset_small", f"output={tmp_path / 'new'}"]) == 2
    assert "python -m pipeline dataset" in capsys.readouterr().err


def test_a_choice_of_an_effect_may_vary_with_what_it_leaves_unused(tmp_path):
    words = [
        "study=dataset_small", "effects=[directional_asymmetry]", "cluster=serial", "design.machines=2",
        "design.spindle_speed_rpm=[9000]", "vary.effects.directional_asymmetry.where=[modes, seats]",
    ]  # fmt: skip
    assert dataset.run([*words, f"output={tmp_path / 'out'}"]) == 0
    found = values(tmp_path / "out")
    assert (found["status"] == 1).all()
    # What is softer differs, along y alone.
    frequency = found["natural_frequency"][:, 0]
    assert np.array_equal(frequency[0, 0], frequency[1, 0])
    assert not np.isclose(frequency[0, 1], frequency[1, 1], rtol=1e-3).all()


def test_a_design_of_ones_own_and_an_effect_of_the_command_line(quick, tmp_path):
    own = tmp_path / "design.yaml"
    own.write_text(
        "title: My study\nsampling: grid\nseed: 1\nspindle_speed_rpm: [9000]\ndeepest_mm: 5\nmode_count: 2\n"
        "machine:\n  vary:\n    effects.thermal_preload.rise: [0.0, 0.5]\n    tool: {teeth: [2, 4]}\n"
    )
    words = ["study=dataset_small", f"design={own}", "effects=[thermal_preload]", "cluster=serial"]
    assert dataset.run([*words, f"output={tmp_path / 'out'}"]) == 0
    found = values(tmp_path / "out")
    assert found["input"][:, 0].tolist() == [[0.0, 2.0], [0.0, 4.0], [0.5, 2.0], [0.5, 4.0]]
    assert set(STRUCTURE) <= found.keys()
