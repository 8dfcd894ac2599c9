"""A folder is held by a lock of its file system, or not at all."""

import errno
import fcntl
import os
from pathlib import Path

import pytest

from chatter_core.errors import InvalidInput
from pipeline.errors import StoreInUse
from pipeline.locking import locked


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
