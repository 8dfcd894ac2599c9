"""What can go wrong around the physics."""

from chatter_core.errors import ChatterError


class StoreInUse(Exception):
    """Another run holds the store."""


class WorkersLost(ChatterError):
    """Every worker of a cluster has gone and none came back."""


class StorageFailed(ChatterError):
    """A file of a store could not be written or read."""


class StoreUnavailable(OSError):
    """An object store does not answer, or does not let us in; nothing is known of what it holds."""
