"""Sweeps: what is written, wherever it is computed; what is refused."""

import numpy as np
import pytest

from chatter_core.errors import InvalidInput
from chatter_core.variables import CELL_STATUS, STATUS, STRUCTURE, SWEEP
from pipeline import store
from pipeline.command_line import main
from pipeline.places import Folder
from pipeline.sweep import run
from tests.pipeline.studies import CHUNKS, journal, sweep


def arrays(folder):
    with store.open_lobes(Folder(folder)) as lobes:
        return {name: lobes[name].values for name in lobes.variables}


def assert_same(one, other):
    assert one.keys() == other.keys()
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


@pytest.fixture(scope="module")
def smoke(tmp_path_factory):
    """The smoke study with the real physics, serially."""
    folder = tmp_path_factory.mktemp("smoke")
    assert run(["study=smoke", "cluster=serial", f"output={folder}"]) == 0
    return folder


def test_store_opens_in_xarray_with_names_units_and_coordinates(smoke):
    with store.open_lobes(Folder(smoke)) as lobes:
        for name, variable in {**SWEEP, **STRUCTURE, "status": CELL_STATUS}.items():
            assert lobes[name].dims == variable.dims
            assert lobes[name].attrs["units"] == variable.unit
            assert lobes[name].attrs["long_name"] == variable.doc
        assert list(lobes["modal_parameters"].values) == ["dynamic", "static"]
        assert lobes["spindle_speed"].attrs["units"] == "rpm"
        assert bool((lobes["status"] == 1).all())
        assert lobes.attrs["complete"] is True
        # One chunk of each variable belongs to one task: all blocks of speeds are alike.
        blocks = {lobes[name].encoding["chunks"][3] for name in SWEEP}
        assert len(blocks) == 1


def test_smoke_study_has_the_limit_depths_of_the_reference_machine(smoke):
    with store.open_lobes(Folder(smoke)) as lobes:
        limit = lobes["limit_depth"].sel(mode_count=4, preload=100.0, crossing=1)
        found = limit.sel(spindle_speed=[12000.0, 14000.0, 16000.0, 18000.0]).load()
    # Found once by an independent order-1 semi-discretization with n = 60, and good to 3 % here.
    assert found.sel(modal_parameters="dynamic").values == pytest.approx([2.07, 0.87, 0.95, 0.98], rel=0.03)
    assert found.sel(modal_parameters="static").values[:3] == pytest.approx([2.96, 0.98, 1.67], rel=0.03)


def test_report_tables_and_figures_are_written(smoke):
    page = (smoke / "report.html").read_text()
    assert "Crossover" in page
    assert page.count("data-root-id") >= 12
    assert len(list((smoke / "figures").glob("*.png"))) == 7
    header = (smoke / "tables" / "limit_depths.csv").read_text().splitlines()[0]
    assert "limit_depth_mm" in header
    assert "spindle_speed_rpm" in header


@pytest.mark.parametrize("cluster", ["threads", "local"])
def test_the_same_store_wherever_it_is_computed(smoke, tmp_path, cluster):
    assert run(["study=smoke", f"cluster={cluster}", "cluster.workers=2", "report=false", f"output={tmp_path}"]) == 0
    assert_same(arrays(smoke), arrays(tmp_path))


def test_chunking_changes_no_number(tmp_path):
    sweep(tmp_path / "one")
    sweep(tmp_path / "two", "cluster.cells_per_task=12")
    assert_same(arrays(tmp_path / "one"), arrays(tmp_path / "two"))


def test_chunking_changes_the_physics_by_rounding_alone(smoke, tmp_path):
    words = ["study=smoke", "cluster=serial", "cluster.cells_per_task=24", "report=false", f"output={tmp_path}"]
    assert run(words) == 0
    one, two = arrays(smoke), arrays(tmp_path)
    # The Krylov space starts from vectors of another length; it is left at a residual of 1e-9.
    np.testing.assert_allclose(one["spectral_radius"], two["spectral_radius"], rtol=1e-7)
    np.testing.assert_allclose(one["limit_depth"], two["limit_depth"], atol=2e-4)  # [mm], the root's tolerance


def test_an_adaptive_study_has_the_same_boundary_and_counts_as_complete(smoke, tmp_path):
    output = tmp_path / "adaptive"
    assert run(["study=smoke", "cluster=serial", "grid.cells=adaptive", "report=false", f"output={output}"]) == 0
    with store.open_lobes(Folder(smoke)) as dense, store.open_lobes(Folder(output)) as sparse:
        assert np.array_equal(dense["spectral_radius"].values > 1.0, sparse["spectral_radius"].values > 1.0)
        # Roots to 5e-7 m each.
        assert sparse["limit_depth"].values == pytest.approx(dense["limit_depth"].values, abs=1e-3, nan_ok=True)
        assert set(np.unique(sparse["status"])) == {STATUS["ok"], STATUS["interpolated"]}


def test_resuming_computes_only_what_is_missing(tmp_path):
    sweep(tmp_path)
    whole = arrays(tmp_path)
    chunk = store.chunks(store.open_group(Folder(tmp_path)))[3]
    store.mark_chunk(Folder(tmp_path), chunk, STATUS["pending"])
    (tmp_path / "lobes.zarr" / "status" / "c.partial").write_text("cut short")
    (tmp_path / "journal.jsonl").unlink()
    assert sweep(tmp_path) == 0
    done = [(tuple(event["outer"]), *event["speeds"]) for event in journal(tmp_path, "chunk")]
    assert done == [(chunk.outer, chunk.first, chunk.last)]
    assert not list(tmp_path.rglob("*.partial"))
    assert_same(whole, arrays(tmp_path))


def test_retry_failed_computes_just_those(tmp_path):
    assert sweep(tmp_path, kernel="broken") == 1
    assert sweep(tmp_path) == 1  # nothing is missing, so nothing is computed
    (tmp_path / "journal.jsonl").unlink()
    assert sweep(tmp_path, retry_failed=True) == 0
    done = {(*event["outer"], *event["speeds"]) for event in journal(tmp_path, "chunk")}
    assert done == {(0, 1, 0, 0, 2), (0, 1, 1, 0, 2)}


def test_a_store_of_other_settings_is_refused_with_the_keys(tmp_path):
    sweep(tmp_path)
    before = arrays(tmp_path)
    with pytest.raises(InvalidInput, match=r"differ in: machine\.process\.radial_immersion, machine\.tool\.teeth"):
        sweep(tmp_path, "tool.teeth=3", "process.radial_immersion=0.5")
    assert_same(before, arrays(tmp_path))


def test_a_number_may_be_written_with_a_point_or_without(tmp_path):
    effect = "effects=[thermal_preload]"
    assert sweep(tmp_path, effect, "effects.thermal_preload.rise=1") == 0
    assert sweep(tmp_path, effect, "effects.thermal_preload.rise=1.0") == 0
    assert len(journal(tmp_path, "chunk")) == CHUNKS
    with pytest.raises(InvalidInput, match=r"differ in: effects\.thermal_preload\.rise$"):
        sweep(tmp_path, effect, "effects.thermal_preload.rise=1.5")


def test_a_folder_with_other_files_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InvalidInput, match="holds files that are no study"):
        sweep(tmp_path)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


def test_a_report_that_was_not_asked_for_is_written_later(tmp_path, capsys):
    words = ["study=smoke", "cluster=serial", "grid.axial_depth_mm=[1, 2]", f"output={tmp_path}"]
    assert main(["sweep", *words, "report=false"]) == 0
    assert f"report output={tmp_path}" in capsys.readouterr().err
    made = {"figures", "report.html", "tables"}
    assert not made & {file.name for file in tmp_path.iterdir()}
    assert main(["report", f"output={tmp_path}"]) == 0
    assert made <= {file.name for file in tmp_path.iterdir()}
    capsys.readouterr()
    assert main(["sweep", *words, "report=false"]) == 0
    assert "those that are there are of before" in capsys.readouterr().err


def test_a_study_with_failed_points_has_its_report_and_says_so(tmp_path):
    assert sweep(tmp_path, kernel="broken", report=True) == 1
    assert "have no result" in (tmp_path / "report.html").read_text()


def test_a_flipped_bit_is_seen_on_reading(tmp_path):
    sweep(tmp_path)
    file = tmp_path / "lobes.zarr" / "spectral_radius" / "c.0.0.0.0.0"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0x10
    file.write_bytes(bytes(data))
    with pytest.raises(ValueError, match=r"(?i)checksum"):
        arrays(tmp_path)
