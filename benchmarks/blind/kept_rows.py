"""Rows of tables that are computed seed by seed and kept, each for the program that it was computed with."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from benchmarks.blind import kept
from benchmarks.blind.running import spread_calls

Row = dict[str, Any]


def keep_row(root: Path, table: str, seed: int, row: Row) -> None:
    """Keep the row of a seed."""
    kept.write(_place(root, table, seed), {"program": kept.program_digest(), "row": row})


def kept_rows(keep: Callable[..., str], words: Sequence[tuple[Any, ...]], table: str, workers: int) -> list[Row]:
    """Return the row of every seed; those that this program has not kept are computed before, spread over processes.

    keep: a call that keeps the row; words: of its arguments, the folder first and the seed last.
    """
    missing = [given for given in words if not _holds(given[0], table, given[-1])]
    if missing:
        spread_calls(keep, missing, workers)
    return [kept.read(_place(given[0], table, given[-1]))["row"] for given in words]


def _place(root: Path, table: str, seed: int) -> Path:
    return root / table / f"{seed}.json"


def _holds(root: Path, table: str, seed: int) -> bool:
    place = _place(root, table, seed)
    return place.exists() and kept.read(place)["program"] == kept.program_digest()
