"""What runs that were killed have left in the folder for temporary files is cleared away, and nothing else."""

import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.scratch import HELD, scratch_folder

KILLED = """
import os, signal
from pipeline.scratch import scratch_folder
with scratch_folder() as folder:
    (folder / "worker-space").mkdir()
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture(autouse=True)
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    return tmp_path


def test_what_a_killed_run_has_left_is_cleared_away_by_the_next(temporary: Path) -> None:
    assert subprocess.run([sys.executable, "-c", KILLED], check=False).returncode == -signal.SIGKILL
    [left] = temporary.iterdir()
    assert (left / "worker-space").is_dir()
    with scratch_folder() as folder:
        assert [*temporary.iterdir()] == [folder]
    assert not [*temporary.iterdir()]


def test_folders_of_living_runs_of_other_hosts_and_of_nobody_known_are_kept(temporary: Path) -> None:
    elsewhere, unknown = temporary / "chatter-elsewhere.invalid-1", temporary / f"chatter-{socket.gethostname()}-1"
    for folder in (elsewhere, unknown):
        folder.mkdir()
    (elsewhere / HELD).touch()
    with scratch_folder() as first, scratch_folder() as second:
        assert {*temporary.iterdir()} == {first, second, elsewhere, unknown}
    assert {*temporary.iterdir()} == {elsewhere, unknown}


def test_what_others_put_in_the_place_of_the_file_is_not_waited_for(temporary: Path) -> None:
    folder = temporary / f"chatter-{socket.gethostname()}-1"
    folder.mkdir()
    os.mkfifo(folder / HELD)
    with scratch_folder() as own:
        assert own.is_dir()
