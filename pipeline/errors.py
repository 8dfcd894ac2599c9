"""What can go wrong around the physics."""

import errno
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chatter_core.errors import ChatterError, InvalidInput

#: What a disk answers of a file that it has lost a part of.
LOST = {errno.EIO, errno.EBADMSG, errno.EUCLEAN}


class StoreInUse(Exception):
    """Another run holds the store."""


class WorkersLost(ChatterError):
    """Every worker of a cluster has gone and none came back."""


class StorageFailed(ChatterError):
    """A file of a store could not be written or read."""


class StoreUnavailable(OSError):
    """An object store does not answer, or does not let us in; nothing is known of what it holds."""


class Unreadable(ValueError):
    """Something in a store is not as it was written."""


def is_damage(error: OSError) -> bool:
    """Return whether an error is of the one file that was read: another may well be whole."""
    return not isinstance(error, StoreUnavailable) and error.errno in LOST


@contextmanager
def told_where(path: Path, named: str = "output") -> Iterator[None]:
    """Have an error of what is written told with its path; named: by which word people named it."""
    try:
        yield
    except OSError as error:
        raise InvalidInput([f"{named}: {path} cannot be written: {error.strerror or error}"]) from None
