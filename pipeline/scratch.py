"""Folders for what lives as long as a run: a run that was killed leaves its own, and the next one clears it away."""

import fcntl
import os
import shutil
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir

#: A file in every such folder that is locked as long as its run lives, however that ends.
HELD = "held"


@contextmanager
def scratch_folder() -> Iterator[Path]:
    """Yield a folder that is removed in the end; those that killed runs of this host have left are removed first."""
    # Folders for what is temporary may be shared with other hosts, whose locks are not seen everywhere.
    prefix = f"chatter-{socket.gethostname()}-"
    _clear(prefix)
    with TemporaryDirectory(prefix=prefix) as name, (Path(name) / f"{HELD}.new").open("w") as lock:
        with suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_EX)
            # Under its name it is locked already: nobody sees it free in between.
            os.rename(lock.name, Path(name) / HELD)
        yield Path(name)


def _clear(prefix: str) -> None:
    """Remove folders whose file is there and not locked."""
    for folder in Path(gettempdir()).glob(f"{prefix}*"):
        # Of other users, without a file, or gone by now.
        with suppress(OSError):
            if folder.is_symlink() or folder.stat().st_uid != os.getuid():
                continue
            # What others have put in the file's place is not waited for.
            descriptor = os.open(folder / HELD, os.O_RDONLY | os.O_NONBLOCK | os.O_NOFOLLOW)
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(descriptor)
