"""What a JSON document says that something else may have damaged, or written."""

import json
from typing import Any


def parsed(text: str | bytes) -> Any:
    """Return what a text says; raise ValueError where it is no JSON, or nested more deeply than it can be read."""
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("nested too deeply") from None
