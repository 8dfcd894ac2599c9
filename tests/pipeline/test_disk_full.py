"""A disk that runs full: the run ends in words, nothing is lost, and it goes on once there is room."""

import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray as xr

from pipeline import report
from pipeline.errors import StorageFailed
from tests.pipeline.studies import CHUNKS, journal, lobes, sweep

#: Room for the frame of the small study and some of its chunks, and for all of it [KiB].
SCANT, ENOUGH = 768, 16384


@pytest.fixture(autouse=True)
def _without_report(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out tables and figures, which take longer than everything else."""
    monkeypatch.setattr(report, "write", lambda output: [])


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A disk in memory with scant room."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={SCANT}k", "tmpfs", str(place)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"needs a disk that can be filled: mounting a tmpfs takes root ({error})")
    yield place
    subprocess.run(["umount", "--lazy", str(place)], check=True)


@pytest.mark.parametrize("cluster", [("cluster=serial",), ("cluster=local", "cluster.workers=2")])
def test_a_run_on_a_full_disk_stops_in_words_and_goes_on_when_there_is_room(
    disk: Path, tmp_path: Path, cluster: tuple[str, ...]
) -> None:
    with pytest.raises(StorageFailed, match=r"No space left on device; what was computed is kept, the same command"):
        sweep(disk / "study", *cluster)
    assert 0 < len(journal(disk / "study", "chunk")) < CHUNKS
    with pytest.raises(StorageFailed, match="No space left on device"):
        sweep(disk / "study", *cluster)
    subprocess.run(["mount", "-o", f"remount,size={ENOUGH}k", str(disk)], check=True)
    assert sweep(disk / "study", *cluster) == 0
    # What was on its way when the room was gone may have been written without being told of.
    assert len(journal(disk / "study", "chunk")) <= CHUNKS
    assert sweep(tmp_path / "undisturbed") == 0
    xr.testing.assert_identical(lobes(disk / "study").drop_attrs(), lobes(tmp_path / "undisturbed").drop_attrs())
