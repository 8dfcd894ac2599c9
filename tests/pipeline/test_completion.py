"""What counts as computed: damaged chunks, failing points, stores continued with other tasks."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS
from pipeline import dispatch, metadata, store
from pipeline.chunks import Chunk
from pipeline.errors import StorageFailed
from pipeline.places import Folder
from pipeline.task import Record, Task
from tests.pipeline.standins import BAD_PRELOAD, BAD_SPEED
from tests.pipeline.studies import CELLS, CHUNKS, journal, lobes, sweep


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    """The small study, computed in one process."""
    output = tmp_path_factory.mktemp("reference") / "study"
    assert sweep(output) == 0
    return lobes(output)


def test_a_store_keeps_its_chunks_when_continued_with_another_task_size(tmp_path: Path) -> None:
    output = tmp_path / "study"
    assert sweep(output) == 0
    store.mark_chunk(Folder(output), Chunk(outer=(0, 1, 0), first=2, last=4), 0)
    assert sweep(output, "cluster.cells_per_task=1000") == 0
    assert [event["speeds"] for event in journal(output, "chunk")][CHUNKS:] == [[2, 4]]


def test_a_damaged_chunk_is_computed_again(tmp_path: Path, reference: xr.Dataset) -> None:
    output = tmp_path / "study"
    assert sweep(output) == 0
    (output / "lobes.zarr/status/c.0.1.0.1.0").write_bytes(b"cut short by a power failure")
    assert sweep(output) == 0
    assert len(journal(output, "chunk")) == CHUNKS + 1
    xr.testing.assert_identical(lobes(output).drop_attrs(), reference.drop_attrs())


def test_what_is_removed_while_a_run_goes_on_does_not_count_whatever_workers_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reference: xr.Dataset
) -> None:
    output, removed = tmp_path / "study", "status/c.0.0.0.0.0"
    compute = dispatch.compute_chunk

    def compute_and_remove(task: Task) -> Record:
        (output / "lobes.zarr" / removed).unlink(missing_ok=True)
        return compute(task)

    with monkeypatch.context() as patched:
        patched.setattr(dispatch, "compute_chunk", compute_and_remove)
        with pytest.raises(StorageFailed, match="1 chunks that were written are not"):
            sweep(output)
    assert not metadata.attributes(Folder(output))["complete"]
    assert sweep(output) == 0
    assert len(journal(output, "chunk")) == CHUNKS + 1
    assert metadata.attributes(Folder(output))["complete"]
    xr.testing.assert_identical(lobes(output).drop_attrs(), reference.drop_attrs())


@pytest.mark.parametrize(
    ("kernel", "status"), [("without_equilibrium", "outside_validity"), ("broken", "not_converged")]
)
def test_failing_points_are_marked_and_the_rest_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], reference: xr.Dataset, kernel: str, status: str
) -> None:
    output = tmp_path / "study"
    assert sweep(output, kernel=kernel) == 1
    found = lobes(output)
    bad = (found["preload"] == BAD_PRELOAD) & (found["spindle_speed"] < BAD_SPEED)
    expected = (
        xr.where(bad, STATUS[status], STATUS["ok"]).broadcast_like(found["status"]).transpose(*found["status"].dims)
    )
    np.testing.assert_array_equal(found["status"], expected)
    assert bool(found["spectral_radius"].isnull().where(bad, True).all())
    xr.testing.assert_equal(found["spectral_radius"].where(~bad), reference["spectral_radius"].where(~bad))
    told = capsys.readouterr().err
    assert f"of {CELLS} cells failed" in told
    assert "journal.jsonl" in told
    assert any("8000 rpm" in error for event in journal(output, "chunk") for error in event.get("errors", []))


def test_more_modes_than_the_machine_has_are_refused_before_a_store_is_made(tmp_path: Path) -> None:
    output = tmp_path / "study"
    with pytest.raises(InvalidInput, match="mode_count: found 90"):
        sweep(output, "grid.mode_count=[90]")
    assert not (output / "lobes.zarr").exists()
