"""The physics of a chunk by its name, so that a task says it in a word and a test puts another in its place."""

from collections.abc import Callable
from importlib import import_module
from typing import Any


def function_of(name: str) -> Callable[..., Any]:
    """Return the function that ``MODULE:FUNCTION`` names."""
    module, function = name.split(":")
    found: Callable[..., Any] = getattr(import_module(module), function)
    return found
