"""Tables of text, as campaigns have them."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

Rows = list[dict[str, str]]


def read_rows(path: Path) -> Rows:
    """Return the rows of a table."""
    with path.open(newline="", encoding="utf-8") as table:
        return list(csv.DictReader(table))


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows under the keys of the first."""
    with path.open("w", newline="", encoding="utf-8") as table:
        writer = csv.DictWriter(table, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
