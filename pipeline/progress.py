"""Progress on a terminal or in a log."""

import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from types import TracebackType
from typing import Self, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from pipeline.telling import bars, note

#: Seconds between two lines where there is no terminal.
LINE_INTERVAL = 10.0
#: Seconds before it is shown how far something is that mostly takes no time.
PATIENCE = 2.0

Given = TypeVar("Given")


def watched(given: Iterable[Given], total: int, what: str) -> Iterator[Given]:
    """Yield what is given, so many in all, and show how far it is where that takes long."""
    started, done = time.monotonic(), 0
    with ExitStack() as shown:
        meter = None
        for one in given:
            yield one
            done += 1
            if meter:
                meter.advance(1)
            elif time.monotonic() - started > PATIENCE:
                meter = shown.enter_context(Meter(total, done, what))


class Meter:
    """Count cells done, or others, with rate and time left: a bar on a terminal, plain lines elsewhere (stderr)."""

    def __init__(self, total: int, done: int, what: str = "cells") -> None:
        self.total, self.begun_with, self.done, self.what = total, done, done, what
        self.started = self.last_line = time.monotonic()
        console = Console(stderr=True)
        self.bar = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn(f"{{task.fields[rate]:>8.0f}} {what}/s"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            console=console,
        ) if bars() and not console.is_dumb_terminal else None  # fmt: skip
        self.task = self.bar.add_task(what, total=total, completed=done, rate=0.0) if self.bar else None

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

    def advance(self, count: int) -> None:
        """Count some as done."""
        self.done += count
        if self.bar and self.task is not None:
            self.bar.update(self.task, completed=self.done, rate=self.rate)
        elif time.monotonic() - self.last_line >= LINE_INTERVAL or self.done == self.total:
            self.last_line = time.monotonic()
            left = (self.total - self.done) / max(self.rate, 1e-9)
            share = 100.0 * self.done / self.total
            how_far = f"{self.done} of {self.total} {self.what} ({share:.0f} %)"
            note(f"{how_far}, {self.rate:.0f} {self.what}/s, {left:.0f} s left")
