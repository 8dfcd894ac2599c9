"""Docstrings are plain text with ``code`` in it; here each becomes what a page is written in."""

import re
from collections.abc import Callable

#: What a docstring calls the page of equations, and the anchor in it.
EQUATIONS = re.compile(r"docs/physics\.md#([a-z0-9-]+)")


def as_markdown(text: str) -> str:
    """Return a docstring as Markdown of a page of the reference."""
    escaped = _outside_code(text, lambda part: re.sub(r"([*<\[\]])", r"\\\1", part))
    return EQUATIONS.sub(r"[the equations](../physics.md#\1)", escaped)


def as_restructured_text(text: str) -> str:
    """Return a docstring as reStructuredText of a page of the reference."""
    escaped = _outside_code(text, lambda part: re.sub(r"(?<=\w)_(?!\w)", r"\_", re.sub(r"([*|])", r"\\\1", part)))
    return EQUATIONS.sub(r"`the equations <../physics.html#\1>`__", escaped)


def _outside_code(text: str, change: Callable[[str], str]) -> str:
    """Return a text with everything changed but what stands between double backticks."""
    return "".join(part if part.startswith("``") else change(part) for part in re.split(r"(``.*?``)", text))
