"""How objects show themselves to people: a few rows as text, and as a small table in a notebook."""

from abc import abstractmethod
from dataclasses import dataclass
from html import escape


@dataclass(frozen=True, kw_only=True)
class Card:
    """What an object shows of itself: a title, and rows of cells; columns: their heads, none where they need none."""

    title: str
    rows: tuple[tuple[str, ...], ...]
    columns: tuple[str, ...] = ()

    def text(self) -> str:
        """Return the card as lines of text."""
        table = [*([self.columns] if self.columns else []), *self.rows]
        widths = [max(len(cell) for cell in column) for column in zip(*table, strict=True)]
        lines = ["  ".join(f"{cell:{width}}" for cell, width in zip(row, widths, strict=True)) for row in table]
        return "\n".join([self.title, *(f"  {line}".rstrip() for line in lines)])

    def html(self) -> str:
        """Return the card as a table; what stands in cells does nothing to it."""
        head = _row("th", self.columns) if self.columns else ""
        body = "".join(_row("td", row) for row in self.rows)
        return f"<table><caption>{escape(self.title)}</caption>{head}{body}</table>"


class ShownAsCard:
    """An object that shows itself as a card, in a console and in a notebook."""

    @abstractmethod
    def card(self) -> Card:
        """Return what the object shows of itself."""

    def __repr__(self) -> str:
        return self.card().text()

    def __str__(self) -> str:
        return repr(self)

    def _repr_html_(self) -> str:
        return self.card().html()


def _row(kind: str, cells: tuple[str, ...]) -> str:
    # Notebooks set cells to the right, where words read badly.
    style = ' style="text-align: left"'
    return f"<tr>{''.join(f'<{kind}{style}>{escape(cell)}</{kind}>' for cell in cells)}</tr>"
