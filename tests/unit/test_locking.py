"""A folder is held by a lock of its file system, or not at all."""

import errno
import fcntl
import os
from pathlib import Path

import pytest

from chatter_core.errors import InvalidInput
from pipeline.errors import StoreInUse
from pipeline.locking import HOLDER, locked


@pytest.mark.parametrize("answer", [errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK])
def test_a_file_system_that_keeps_no_locks_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, answer: int
) -> None:
    def flock(descriptor: int, operation: int) -> None:
        raise OSError(answer, os.strerror(answer))

    monkeypatch.setattr(fcntl, "flock", flock)
    told = r"its file system keeps no locks \(flock: .*; choose a folder elsewhere"
    with pytest.raises(InvalidInput, match=told), locked(tmp_path):
        pass


def test_a_folder_is_held_once(tmp_path: Path) -> None:
    with locked(tmp_path), pytest.raises(StoreInUse, match=f"in use by process {os.getpid()} on"), locked(tmp_path):
        pass


@pytest.mark.parametrize("text", ["mine", "{}", '["pid", "host", "since"]', '{"pid": 1, "host": "a"}'])
def test_a_file_that_is_called_like_that_of_the_holder_is_kept(tmp_path: Path, text: str) -> None:
    (tmp_path / HOLDER).write_text(text)
    with pytest.raises(InvalidInput, match=r"holds a lock\.json that no run has written"), locked(tmp_path):
        pass
    assert (tmp_path / HOLDER).read_text() == text
    (tmp_path / HOLDER).rename(tmp_path / "mine.json")
    with locked(tmp_path):
        pass


#: Of runs that were killed: while they wrote, when power went, in a folder, and in an object store that was copied.
HELD = '{"pid": 1, "host": "a", "since": "b"}'
LEFT = ["", "\0\0\0", HELD, HELD.replace("}", ', "released": true}')]


@pytest.mark.parametrize("text", LEFT)
def test_what_a_killed_run_has_left_is_no_hindrance(tmp_path: Path, text: str) -> None:
    (tmp_path / HOLDER).write_text(text)
    with locked(tmp_path):
        assert f'"pid": {os.getpid()}' in (tmp_path / HOLDER).read_text()
    assert not (tmp_path / HOLDER).exists()
