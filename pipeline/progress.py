"""Progress on a terminal or in a log, and the journal of a run."""

import json
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from pipeline.store import now

#: Seconds between two lines where there is no terminal.
LINE_INTERVAL = 10.0


class Meter:
    """Count cells done, with rate and time left: a bar on a terminal, plain lines elsewhere (stderr)."""

    def __init__(self, total: int, done: int) -> None:
        self.total, self.begun_with, self.done = total, done, done
        self.started = self.last_line = time.monotonic()
        console = Console(stderr=True)
        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]:>8.0f} cells/s"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
        ) if console.is_terminal else None  # fmt: skip
        self.task = self.bar.add_task("cells", total=total, completed=done, rate=0.0) if self.bar else None

    def __enter__(self) -> Self:
        if self.bar:
            self.bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.bar:
            self.bar.stop()

    @property
    def rate(self) -> float:
        """Cells a second since the start of this run."""
        return (self.done - self.begun_with) / max(time.monotonic() - self.started, 1e-9)

    def advance(self, cells: int) -> None:
        """Count cells as done."""
        self.done += cells
        if self.bar and self.task is not None:
            self.bar.update(self.task, completed=self.done, rate=self.rate)
        elif time.monotonic() - self.last_line >= LINE_INTERVAL or self.done == self.total:
            self.last_line = time.monotonic()
            left = (self.total - self.done) / max(self.rate, 1e-9)
            share = 100.0 * self.done / self.total
            print(
                f"{self.done} of {self.total} cells ({share:.0f} %), {self.rate:.0f} cells/s, {left:.0f} s left",
                file=sys.stderr,
                flush=True,
            )


class Journal:
    """Append what happens in a run to a JSONL file: one event a line, each with its time."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def write(self, event: str, **details: Any) -> None:
        """Append an event."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"time": now(), "event": event, **details}) + "\n")
