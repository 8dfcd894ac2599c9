"""Dotted keys such as ``spindle.sections[0].length_mm``: values at their places in nested plain data."""

import re
from typing import Any

#: A name or an index in a dotted key.
_PART = re.compile(r"([A-Za-z0-9_]+)|\[([0-9]{1,9})\]")


def parts_of(key: str) -> list[str | int]:
    """Return the names and indices of a dotted key; raise ValueError when it is none."""
    parts = [int(index) if index else name for name, index in _PART.findall(key)]
    if not parts or "".join(f"[{p}]" if isinstance(p, int) else f".{p}" for p in parts).removeprefix(".") != key:
        raise ValueError("the key is not of the form group.key or group.list[0].key")
    return parts


def put(data: dict[str, Any], key: str, value: Any) -> None:
    """Put a value at a dotted key; new keys are made.

    Raises ValueError when the key leads into a value that holds no such part.
    """
    parts = parts_of(key)
    here: Any = data
    for part, following in zip(parts, [*parts[1:], None], strict=True):
        if isinstance(part, int) and not (isinstance(here, list) and part < len(here)):
            raise ValueError(f"there is no entry [{part}]")
        if isinstance(part, str) and not isinstance(here, dict):
            raise ValueError(f"what stands there has no keys, and so no {part}")
        if following is None:
            here[part] = value
        else:
            if isinstance(part, str) and here.get(part) is None:
                here[part] = {}
            here = here[part]


def get(data: dict[str, Any], key: str) -> Any:
    """Return the value at a dotted key, None where there is none; raise ValueError for what is no key."""
    here: Any = data
    for part in parts_of(key):
        if isinstance(part, int):
            here = here[part] if isinstance(here, list) and part < len(here) else None
        else:
            here = here.get(part) if isinstance(here, dict) else None
    return here
