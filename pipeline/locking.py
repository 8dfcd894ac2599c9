"""A folder of results that one run holds alone."""

import errno
import json
import os
import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from chatter_core.errors import InvalidInput
from pipeline.errors import StoreInUse, told_where
from pipeline.json_text import parsed

#: What a file system answers that keeps no locks, or whose server keeps none.
NO_LOCKS = {errno.ENOSYS, errno.EOPNOTSUPP, errno.ENOLCK}

#: Who holds a folder, beside the lock itself, and what it says of them.
HOLDER, HELD_BY = "lock.json", ("pid", "host", "since")


def check_folder(output: Path, named: str = "output") -> None:
    """Raise InvalidInput when a folder for results cannot be made, and make none; named: as for ``make_folder``."""
    with suppress(OSError):
        nearest = next(one for one in (output.absolute(), *output.absolute().parents) if one.exists())
        if not nearest.is_dir():
            raise InvalidInput([f"{named}: {str(output)[:200]} cannot be used as a folder: {nearest} is none"])
        if not os.access(nearest, os.W_OK | os.X_OK):
            raise InvalidInput([f"{named}: {nearest} cannot be written: Permission denied"])


def make_folder(output: Path, named: str = "output") -> None:
    """Make a folder for results; raise InvalidInput when it cannot be one. named: by which word people named it."""
    try:
        output.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput([f"{named}: {str(output)[:200]} cannot be used as a folder: {error.strerror}"]) from None
    if not os.access(output, os.W_OK | os.X_OK):
        raise InvalidInput([f"{named}: {output} cannot be written: Permission denied"])


@contextmanager
def locked(output: Path) -> Iterator[None]:
    """Hold the folder for this run; the lock frees itself when the process dies, however it dies.

    Raises InvalidInput when it cannot be held, StoreInUse when another run holds it.
    """
    holder = output / HOLDER
    # Without locks of the file system the library would take the mere file for one; whoever is killed leaves that.
    lock = FileLock(output / ".lock", timeout=0, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        try:
            said = parsed(holder.read_text())
            who = "process {pid} on {host} since {since}".format(**{key: said[key] for key in HELD_BY})
        except (OSError, ValueError, KeyError, TypeError):
            who = "another process"
        raise StoreInUse(f"{output}: in use by {who}; wait for it, or choose another folder with output=DIR") from None
    except OSError as error:
        if error.errno in NO_LOCKS:
            why = f"its file system keeps no locks (flock: {error.strerror}), so that two runs could take it at once"
            raise InvalidInput([f"output: {output} cannot be used: {why}; choose a folder elsewhere"]) from None
        raise InvalidInput([f"output: {output} cannot be written: {error.strerror}"]) from None
    try:
        _refuse_foreign(holder)
        try:
            since = datetime.now(UTC).isoformat(timespec="seconds")
            holder.write_text(json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "since": since}))
            yield
        finally:
            holder.unlink(missing_ok=True)
    finally:
        lock.release()


def process_is_gone(said: Mapping[str, Any]) -> bool:
    """Return whether what a holder says of itself is of this host, and its process has ended.

    Of other hosts nothing is known, and where another process has got its number it counts as going on.
    """
    if said.get("host") != socket.gethostname():
        return False
    try:
        os.kill(int(said["pid"]), 0)
    except ProcessLookupError:
        return True
    except (OSError, ValueError, KeyError, TypeError, OverflowError):
        # It is of another user, or not as a run has written it.
        return False
    return False


def _refuse_foreign(holder: Path) -> None:
    """Raise InvalidInput where a file has the holder's name that no run has left: it would be written over."""
    try:
        said = holder.read_text().strip("\0 \n")
        # A run that was killed while it wrote may have left nothing; one in an object store says more of itself.
        own = not said or {*HELD_BY} <= parsed(said).keys()
    except FileNotFoundError:
        return
    except (IsADirectoryError, ValueError, AttributeError):
        own = False
    if not own:
        why = f"holds a {HOLDER} that no run has written; move it away, or name another folder"
        raise InvalidInput([f"output: {holder.parent} {why}"])


def remove_empty(output: Path) -> None:
    """Remove the folder that was made for a run which then was refused or stopped."""
    with suppress(OSError):
        for name in (".lock", HOLDER):
            (output / name).unlink(missing_ok=True)
        output.rmdir()


@contextmanager
def held_for_results(output: Path) -> Iterator[None]:
    """Hold a folder for results; where there is none in the end, no folder that was made for it stays.

    Raises InvalidInput when it cannot be written, StoreInUse when another run holds it.
    """
    new = [folder for folder in (output, *output.parents) if not folder.exists()]
    try:
        make_folder(output)
        with told_where(output), locked(output):
            yield
    except StoreInUse:
        # What is there belongs to the other run.
        raise
    except BaseException:
        for folder in new:
            remove_empty(folder)
        raise
