"""A disk that runs full: the run ends in words, nothing is lost, and it goes on once there is room."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
import xarray as xr

from pipeline import report
from pipeline.command_line import main
from pipeline.errors import StorageFailed
from tests.pipeline.studies import CHUNKS, ROOT, journal, lobes, sweep

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


@pytest.mark.parametrize(
    ("words", "file"),
    [
        (["identify", f"campaign={ROOT / 'tests' / 'data' / 'campaigns' / 'd04'}"], "machine_tip.yaml"),
        (["point", "spindle_speed_rpm=12000", "axial_depth_mm=1"], "point.json"),
        (["template"], None),
    ],
)
def test_a_file_that_finds_no_room_leaves_what_was_there(
    disk: Path, capsys: pytest.CaptureFixture[str], words: list[str], file: str | None
) -> None:
    earlier = "# Tip modes identified from mine\n"
    if file is not None:
        (disk / file).write_text(earlier)
    place = disk / "new" if file is None else disk / file if words[0] == "identify" else disk
    (disk / "filling").write_bytes(bytes(shutil.disk_usage(disk).free))
    before = {path.name for path in disk.iterdir()}
    assert main([*words, f"output={place}"]) == 2
    told = capsys.readouterr().err
    assert f"output: {place}" in told
    assert "No space left on device" in told
    if file is not None:
        assert (disk / file).read_text() == earlier
        assert {path.name for path in disk.iterdir()} == before
    (disk / "filling").unlink()
    assert main([*words, f"output={place}"]) == 0


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
