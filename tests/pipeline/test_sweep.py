"""Sweeps: what is written, what survives interruption, what is refused."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import zarr

from chatter_core.errors import InvalidInput
from chatter_core.variables import CELL_STATUS, STRUCTURE, SWEEP
from pipeline import store
from pipeline.errors import StoreInUse
from pipeline.sweep import execute, run
from tests.pipeline.conftest import settings_of

PLAIN = "tests.pipeline.kernels:plain"


def arrays(folder):
    with store.open_lobes(folder / "lobes.zarr") as lobes:
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
    with store.open_lobes(smoke / "lobes.zarr") as lobes:
        for name, variable in {**SWEEP, **STRUCTURE, "status": CELL_STATUS}.items():
            assert lobes[name].dims == variable.dims
            assert lobes[name].attrs["units"] == variable.unit
            assert lobes[name].attrs["long_name"] == variable.doc
        assert list(lobes["modal_parameters"].values) == ["dynamic", "static"]
        assert lobes["spindle_speed"].attrs["units"] == "rpm"
        assert bool((lobes["status"] == 1).all())
        assert lobes.attrs["complete"] is True
        # One chunk of each variable belongs to one task: all blocks of speeds are alike.
        blocks = {lobes[name].chunksizes["spindle_speed"] for name in SWEEP}
        assert len(blocks) == 1


def test_smoke_study_has_the_limit_depths_of_the_reference_machine(smoke):
    with store.open_lobes(smoke / "lobes.zarr") as lobes:
        limit = lobes["limit_depth"].sel(mode_count=4, preload=100.0, crossing=1)
        found = limit.sel(spindle_speed=[12000.0, 14000.0, 16000.0, 18000.0]).load()
    # Found once by an independent order-1 semi-discretization with n = 60, and good to 3 % here.
    assert found.sel(modal_parameters="dynamic").values == pytest.approx([2.07, 0.87, 0.95, 0.98], rel=0.03)
    assert found.sel(modal_parameters="static").values[:3] == pytest.approx([2.96, 0.98, 1.67], rel=0.03)


def test_report_tables_and_figures_are_written(smoke):
    page = (smoke / "report.html").read_text()
    assert "Crossover" in page
    assert page.count("data:image/png;base64,") == 7
    header = (smoke / "tables" / "limit_depths.csv").read_text().splitlines()[0]
    assert "limit_depth_mm" in header
    assert "spindle_speed_rpm" in header


@pytest.mark.parametrize("cluster", ["threads", "local"])
def test_the_same_store_wherever_it_is_computed(smoke, tmp_path, cluster):
    assert run(["study=smoke", f"cluster={cluster}", "cluster.workers=2", f"output={tmp_path}"]) == 0
    assert_same(arrays(smoke), arrays(tmp_path))


def test_chunking_changes_no_number(small, tmp_path):
    execute(small, tmp_path / "one", kernel=PLAIN)
    other = settings_of("study=smoke", "cluster=serial", "cluster.cells_per_task=60")
    execute(other, tmp_path / "two", kernel=PLAIN)
    assert_same(arrays(tmp_path / "one"), arrays(tmp_path / "two"))


def test_chunking_changes_the_physics_by_rounding_alone(smoke, tmp_path):
    words = ["study=smoke", "cluster=serial", "cluster.cells_per_task=24", f"output={tmp_path}"]
    assert run(words) == 0
    one, two = arrays(smoke), arrays(tmp_path)
    # The Krylov space starts from vectors of another length; it is left at a residual of 1e-9.
    np.testing.assert_allclose(one["spectral_radius"], two["spectral_radius"], rtol=1e-7)
    np.testing.assert_allclose(one["limit_depth"], two["limit_depth"], atol=2e-4)  # [mm], the root's tolerance


def test_resuming_computes_only_what_is_missing(small, tmp_path):
    execute(small, tmp_path, kernel=PLAIN)
    whole = arrays(tmp_path)
    group = zarr.open_group(tmp_path / "lobes.zarr")
    chunk = store.chunks(group)[3]
    store.mark_chunk(tmp_path / "lobes.zarr", chunk, 0)
    (tmp_path / "lobes.zarr" / "status" / "c.partial").write_text("cut short")
    (tmp_path / "journal.jsonl").unlink()
    assert execute(small, tmp_path, kernel=PLAIN) == 0
    events = [json.loads(line) for line in (tmp_path / "journal.jsonl").read_text().splitlines()]
    done = [(tuple(e["outer"]), *e["speeds"]) for e in events if e["event"] == "chunk"]
    assert done == [(chunk.outer, chunk.first, chunk.last)]
    assert not list(tmp_path.rglob("*.partial"))
    assert_same(whole, arrays(tmp_path))


SCRIPT = """
import sys
from pathlib import Path
from pipeline.sweep import execute
from tests.pipeline.conftest import settings_of
if __name__ == "__main__":
    settings = settings_of("study=smoke", "cluster={cluster}", "cluster.cells_per_task=36")
    sys.exit(execute(settings, Path(sys.argv[1]), kernel="tests.pipeline.kernels:{kernel}"))
"""


def start(tmp_path, cluster, kernel):
    script = tmp_path / "job.py"
    script.write_text(SCRIPT.format(cluster=cluster, kernel=kernel))
    environment = {**os.environ, "PYTHONPATH": os.getcwd()}
    with (tmp_path / "said").open("w") as said:
        return subprocess.Popen([sys.executable, str(script), str(tmp_path / "out")], env=environment, stderr=said)


def wait_for_chunks(folder, count):
    for _ in range(600):
        journal = folder / "journal.jsonl"
        if journal.exists() and journal.read_text().count('"chunk"') >= count:
            return
        time.sleep(0.05)
    raise AssertionError("the sweep did not begin")


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_an_interrupted_sweep_goes_on_to_the_same_store(small, tmp_path, number, code):
    execute(small, tmp_path / "undisturbed", kernel=PLAIN)
    job = start(tmp_path, "serial", "slow")
    wait_for_chunks(tmp_path / "out", 3)
    job.send_signal(number)
    assert job.wait(timeout=60) == code
    status = arrays(tmp_path / "out")["status"]
    assert 0 < int((status == 0).sum()) < status.size
    assert execute(small, tmp_path / "out", kernel=PLAIN) == 0
    assert_same(arrays(tmp_path / "undisturbed"), arrays(tmp_path / "out"))


def test_a_drained_cluster_leaves_a_store_that_goes_on(small, tmp_path):
    job = start(tmp_path, "local", "slow")
    wait_for_chunks(tmp_path / "out", 2)
    job.send_signal(signal.SIGINT)
    assert job.wait(timeout=60) == 130
    assert "nothing is lost" in (tmp_path / "said").read_text()
    assert execute(small, tmp_path / "out", kernel=PLAIN) == 0
    assert bool((arrays(tmp_path / "out")["status"] == 1).all())


def test_a_second_run_on_one_store_is_refused_and_told_who_holds_it(small, tmp_path):
    job = start(tmp_path, "serial", "slow")
    wait_for_chunks(tmp_path / "out", 1)
    with pytest.raises(StoreInUse, match=f"in use by process {job.pid} on "):
        execute(small, tmp_path / "out", kernel=PLAIN)
    job.kill()
    job.wait(timeout=60)
    assert execute(small, tmp_path / "out", kernel=PLAIN) == 0


def test_a_store_of_other_settings_is_refused_with_the_keys(small, tmp_path):
    execute(small, tmp_path, kernel=PLAIN)
    before = arrays(tmp_path)
    other = settings_of("study=smoke", "cluster=serial", "tool.teeth=3", "process.radial_immersion=0.5")
    with pytest.raises(InvalidInput, match=r"differ in: machine\.process\.radial_immersion, machine\.tool\.teeth"):
        execute(other, tmp_path, kernel=PLAIN)
    assert_same(before, arrays(tmp_path))


def test_a_folder_with_other_files_is_refused(small, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InvalidInput, match="holds files that are no study"):
        execute(small, tmp_path, kernel=PLAIN)
    assert (tmp_path / "thesis.tex").read_text() == "years of work"


@pytest.mark.parametrize("cluster", ["serial", "local"])
def test_failing_points_are_marked_and_the_rest_completes(tmp_path, cluster, capsys):
    settings = settings_of("study=smoke", f"cluster={cluster}", "cluster.cells_per_task=36")
    assert execute(settings, tmp_path, kernel="tests.pipeline.kernels:failing") == 1
    status = arrays(tmp_path)["status"]
    speeds = arrays(tmp_path)["spindle_speed"]
    assert bool((status[..., speeds == 7000.0, :] == 3).all())
    assert bool((status[..., speeds == 9000.0, :] == 2).all())
    assert bool((status[..., (speeds != 7000.0) & (speeds != 9000.0), :] == 1).all())
    assert "retry_failed=true" in capsys.readouterr().err
    assert "ZeroDivisionError" in (tmp_path / "journal.jsonl").read_text()
    assert "have no result" in (tmp_path / "report.html").read_text()


def test_retry_failed_computes_just_those(small, tmp_path):
    execute(small, tmp_path, kernel="tests.pipeline.kernels:failing")
    (tmp_path / "journal.jsonl").unlink()
    assert execute(small, tmp_path, kernel=PLAIN) == 1  # nothing is missing, so nothing is computed
    assert '"chunk"' not in (tmp_path / "journal.jsonl").read_text()
    assert execute(small, tmp_path, kernel=PLAIN, retry_failed=True) == 0
    done = [json.loads(line) for line in (tmp_path / "journal.jsonl").read_text().splitlines() if '"chunk"' in line]
    assert {tuple(e["speeds"]) for e in done} == {(0, 3), (3, 6)}


def test_a_point_that_kills_its_worker_is_marked(tmp_path):
    settings = settings_of("study=smoke", "cluster=local", "cluster.workers=1", "cluster.cells_per_task=36")
    small_grid = settings.model_copy(
        update={"grid": settings.grid.model_copy(update={"modal_parameters": ("dynamic",)})}
    )
    assert execute(small_grid, tmp_path, kernel="tests.pipeline.kernels:deadly") == 1
    status, speeds = arrays(tmp_path)["status"], arrays(tmp_path)["spindle_speed"]
    assert bool((status[..., speeds == 9000.0, :] == 4).all())
    assert bool((status[..., speeds > 11500.0, :] == 1).all())


def test_a_flipped_bit_is_seen_on_reading(small, tmp_path):
    execute(small, tmp_path, kernel=PLAIN)
    file = tmp_path / "lobes.zarr" / "spectral_radius" / "c" / "0" / "0" / "0" / "0" / "0"
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 0x10
    file.write_bytes(bytes(data))
    with pytest.raises(ValueError, match=r"(?i)checksum"):
        arrays(tmp_path)
