"""Tables and blocks of a page in Markdown."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from pydantic import BaseModel

from chatter_core.evidence.columns import column_like
from chatter_core.reading import inner_model

ROOT = Path(__file__).parents[2]


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table; cells that are None stay empty."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(cell) for cell in line) + " |" for line in lines) + "\n"


def block(text: str, language: str = "") -> str:
    """Return a text as it stands, in a block of its own."""
    return f"```{language}\n{text.rstrip()}\n```\n"


def keys(model: type[BaseModel]) -> str:
    """Return a table of the keys that a description declares: meaning, what is allowed, and what holds unless said."""
    rows = []
    for name, field in model.model_fields.items():
        column = column_like(model, name, field.description or "")
        allowed = column.allowed if column.choices or str(column.bounds) else None
        rows.append([f"`{field.alias or name}`", column.doc, allowed, _unless_said(field)])
    return table(["key", "meaning", "allowed", "unless said"], rows)


def _unless_said(field) -> str | None:
    """Return a key's default, None where it must be given."""
    if field.is_required():
        return "needed"
    if isinstance(field.default, str | int | float):
        return f"`{field.default:g}`" if isinstance(field.default, float) else f"`{field.default}`"
    return None if inner_model(field) else "may be left away"


def _cell(cell: object) -> str:
    return "" if cell is None else str(cell).replace("|", r"\|").replace("\n", " ")
