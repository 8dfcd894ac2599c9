"""What can go wrong around the physics."""


class StoreInUse(Exception):
    """Another run holds the store."""
