"""Data sets in trouble: interrupted, on a full disk, with machines that fail now and not then; in an object store."""

import itertools
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from chatter_core.variables import STATUS
from pipeline import dataset, store
from pipeline.command_line import main
from pipeline.errors import StorageFailed
from pipeline.kinds import Dataset
from pipeline.places import DATASET as STORE
from pipeline.places import place_of
from tests.pipeline.object_store.conftest import address, buckets, endpoint  # noqa: F401
from tests.pipeline.object_store.server_side import BUCKET
from tests.pipeline.standins import GATE, wait_at_gate
from tests.pipeline.studies import PATIENCE, ROOT, ended, wait_until
from tests.pipeline.test_dataset import SMALL, assert_same, standin, values
from tests.pipeline.test_disk_full import ENOUGH, disk  # noqa: F401

#: Twenty machines, each a chunk.
WORDS = (*SMALL, "design.machines=20", "cluster.cells_per_task=6")
#: Variable of the environment that makes machines fail.
FAILING = "STANDIN_FAILS"
#: Machines that the gated stand-in has seen in this process, and how many it computes before it waits.
MACHINES, AT_ONCE = itertools.count(), 3


def gated(cuts: Any, **cells: Any) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Wait, after the first machines, until the file is there that the environment names."""
    if next(MACHINES) >= AT_ONCE:
        wait_at_gate()
    return standin(cuts, **cells)


def now_and_then(cuts: Any, **cells: Any) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Fail for machines with two teeth as long as the environment says so."""
    if os.environ.get(FAILING) and cuts[0].machine.tool.teeth == 2:
        raise ZeroDivisionError("an error in the physics")
    return standin(cuts, **cells)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Compute with the stand-in, and write no report."""
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    monkeypatch.setattr(Dataset, "report", lambda self, place: [])


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """The numbers of the data set, computed without trouble."""
    folder = tmp_path_factory.mktemp("reference") / "data"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
        patch.setattr(Dataset, "report", lambda self, place: [])
        assert dataset.run([*WORDS, f"output={folder}"]) == 0
    return values(folder)


def test_an_interrupted_data_set_goes_on_to_the_same_numbers(tmp_path, reference):
    script = (
        "import sys\n"
        "from pipeline.command_line import main\n"
        "from pipeline.kinds import Dataset\n"
        "Dataset.kernel = 'tests.pipeline.test_dataset_trouble:gated'\n"
        "sys.exit(main(['dataset', *sys.argv[1:]]))\n"
    )
    words = [*WORDS, f"output={tmp_path / 'data'}"]
    command = [sys.executable, "-c", script, *words]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    gate = tmp_path / "gate"
    environment = {**os.environ, "PYTHONPATH": str(ROOT), GATE: str(gate)}
    with ended(subprocess.Popen(command, env=environment, start_new_session=True, **pipes)) as process:
        journal = tmp_path / "data" / "journal.jsonl"
        wait_until(lambda: journal.exists() and journal.read_text().count('"chunk"') >= 2, process)
        process.send_signal(signal.SIGINT)
        gate.touch()
        _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert "stopped; nothing is lost. Go on with: python -m pipeline dataset" in told
    assert (values(tmp_path / "data")["status"] == STATUS["pending"]).any()
    assert dataset.run(words) == 0
    assert_same(reference, values(tmp_path / "data"))


def test_machines_that_failed_are_tried_again_where_asked(tmp_path, monkeypatch, reference, capsys):
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset_trouble:now_and_then")
    words = [*WORDS, f"output={tmp_path / 'data'}"]
    monkeypatch.setenv(FAILING, "1")
    assert dataset.run(words) == 1
    assert "compute them again with retry_failed=true" in capsys.readouterr().err
    failed = values(tmp_path / "data")["status"] == STATUS["not_converged"]
    teeth = reference["input"][:, 0, list(reference["input_key"]).index("tool.teeth")]
    assert np.array_equal(failed.all(axis=(1, 2)), teeth == 2.0)
    monkeypatch.delenv(FAILING)
    assert dataset.run(words) == 1
    assert dataset.run([*words, "retry_failed=true"]) == 0
    assert_same(reference, values(tmp_path / "data"))


def test_a_full_disk_is_told_and_the_data_set_goes_on_when_there_is_room(disk, reference):  # noqa: F811
    words = [*WORDS, f"output={disk / 'data'}"]
    # The frame of the data set takes most of the room: what is left is filled by hand, but for some chunks.
    assert dataset.run([*words, "budget_hours=1e-12"]) == 0
    room = os.statvfs(disk)
    (disk / "filling").write_bytes(b"0" * (room.f_bavail * room.f_frsize - 64 * 1024))
    with pytest.raises(StorageFailed, match=r"No space left on device; what was computed is kept, the same command"):
        dataset.run(words)
    subprocess.run(["mount", "-o", f"remount,size={ENOUGH}k", str(disk)], check=True)
    assert dataset.run(words) == 0
    assert_same(reference, values(disk / "data"))


def test_a_data_set_in_an_object_store_is_that_in_a_folder_and_can_be_held_against_it(
    tmp_path: Path,
    endpoint: str,  # noqa: F811
    reference,
    capsys,
):
    there = f"s3://{BUCKET}/data"
    assert dataset.run([*WORDS, f"store={there}", f"output={tmp_path / 'here'}", "lease_s=3"]) == 0
    place = place_of({"output": str(tmp_path / "here")})
    assert place.root == STORE
    with store.open_lobes(place) as data:
        found = {name: data[name].values for name in data.variables}
    assert_same(reference, found)
    assert dataset.run([*WORDS, "cutting.kt_mpa=1000", f"output={tmp_path / 'folder'}"]) == 0
    words = [f"first={there}", f"second={tmp_path / 'folder'}", f"output={tmp_path / 'answer'}"]
    assert main(["contrast", *words]) == 0
    # What varies takes the place of the coefficient: all limit depths are the same.
    assert "Limit depths of the second study are the same" in capsys.readouterr().out
    assert (tmp_path / "answer" / "report.html").exists()


def test_what_a_budget_left_out_is_no_part_of_a_report(tmp_path, monkeypatch):
    monkeypatch.undo()
    monkeypatch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
    assert dataset.run([*WORDS, "budget_hours=1e-12", f"output={tmp_path}"]) == 0
    with xr.open_zarr(tmp_path / STORE) as data:
        pending = int((data["status"] == STATUS["pending"]).sum())
    assert pending > 0
    page = (tmp_path / "report.html").read_text()
    assert f"{pending} of 120 cuts and speeds have no result: pending." in page
    assert f"| pending | {pending} |" in (tmp_path / "card.md").read_text()


def test_more_modes_than_were_measured_are_told_before_anything_is_computed(tmp_path, capsys):
    machine = tmp_path / "machine.yaml"
    machine.write_text(
        "tip: {modes: [{axis: x, natural_frequency_hz: 922, damping_ratio: 0.011, stiffness_n_um: 1.34}]}\n"
        "tool: {teeth: 4, diameter_mm: 16, helix_angle_deg: 30, rake_angle_deg: 10}\n"
        "cutting: {kt_mpa: 900, kn: 0.3, friction_coefficient: 0.2}\n"
        "process: {direction: down, radial_immersion: 0.4, feed_per_tooth_mm: 0.08}\n"
    )
    words = ["dataset", "study=parameter_study", f"machine={machine}", "vary.tip.modes[0].stiffness_n_um=[1, 2]"]
    assert main([*words, f"output={tmp_path / 'new'}"]) == 2
    assert "design.mode_count: found 4, allowed: 1 to 1, as many as tip.modes lists of" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def test_more_modes_than_a_spindle_model_has_are_told_before_anything_is_computed(tmp_path, capsys):
    words = ["dataset", "study=parameter_study", "design.mode_count=60", f"output={tmp_path / 'new'}"]
    assert main([*words, "vary.spindle.preload_n=[60, 120]"]) == 2
    assert "design.mode_count: found 60, allowed at most" in capsys.readouterr().err
    assert not (tmp_path / "new").exists()
