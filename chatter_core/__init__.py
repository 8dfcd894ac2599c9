"""Milling chatter from a bearing's data sheet: the physics, on numpy and scipy alone.

``read_machine`` and ``stability_lobes`` are the whole chain in two lines (see ``chatter_core.interactive``).
"""

from importlib import import_module
from typing import Any

_AT_HAND = {
    "read_machine": "chatter_core.reading",
    "read_campaign": "chatter_core.evidence",
    "stability_lobes": "chatter_core.interactive",
    "Lobes": "chatter_core.interactive",
}


def __getattr__(name: str) -> Any:
    """Return what is at hand by its name, loaded when first asked for: a part of the physics does not need it all."""
    if name not in _AT_HAND:
        raise AttributeError(f"module 'chatter_core' has no attribute {name!r}")
    return getattr(import_module(_AT_HAND[name]), name)
