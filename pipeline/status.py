"""How far a study is: what its store says, whether it is being computed or not."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from chatter_core.variables import FAILED, STATUS
from pipeline import store, survey
from pipeline.json_text import parsed
from pipeline.locking import process_is_gone
from pipeline.places import LOCK, Place
from pipeline.study_place import study_place
from pipeline.telling import fact, say
from pipeline.verbs.stores import StatusOptions

#: The rate is that of the chunks that were written in so many seconds before the last.
RECENT = 600.0
#: Without a chunk for so many times the usual distance between two, nobody seems to compute.
SILENT = 20.0
#: Seconds without a chunk below which a study counts as being computed, however short its chunks are.
PATIENCE = 60.0


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far a study is.

    study: its name; cells: by status; chunks: how many there are, and chunks_written: how many of them are there;
    written: when each of their files was, ascending [s since 1970]; packed: whether those hold many chunks each; now:
    when this was seen; held: whether a run may be at work, as far as is known.
    """

    study: str
    cells: dict[str, int]
    chunks: int
    chunks_written: int
    written: np.ndarray
    packed: bool
    now: float
    held: bool

    @property
    def done(self) -> int:
        """Cells that are not pending."""
        return sum(count for name, count in self.cells.items() if name != "pending")

    @property
    def failed(self) -> int:
        """Cells that are marked as failed."""
        return sum(count for name, count in self.cells.items() if STATUS[name] in FAILED)

    @property
    def rate(self) -> float | None:
        """Chunks a second, lately; None where fewer than two were written, and where files do not tell of chunks."""
        if self.packed:
            return None
        recent = self.written[self.written > self.written[-1] - RECENT] if len(self.written) else self.written
        apart = float(np.ptp(recent)) if len(recent) > 1 else 0.0
        return (len(recent) - 1) / apart if apart > 0.0 else None

    @property
    def last_ago(self) -> float | None:
        """Seconds since the last chunk was written; None where there is none, and where files do not tell of chunks."""
        return None if self.packed or not len(self.written) else self.now - float(self.written[-1])

    @property
    def state(self) -> str:
        """Whether it is ``complete``, ``computing``, or ``interrupted``; ``empty`` before the first chunk."""
        if "pending" not in self.cells:
            return "complete"
        if not len(self.written):
            return "empty"
        usual = 1.0 / self.rate if self.rate else 0.0
        heard = self.now - self.written[-1] < max(PATIENCE, SILENT * usual)
        return "computing" if self.held and heard else "interrupted"

    @property
    def seconds_left(self) -> float | None:
        """Seconds until all chunks are there at the latest rate; None where that is not known."""
        missing = self.chunks - self.chunks_written
        return missing / self.rate if self.rate else None


def run(words: list[str]) -> int:
    """Tell how far a study is; return 1 where cells have failed, else 0."""
    place, _ = study_place(words, StatusOptions)
    found = progress(place)
    fact(store=place.where(place.root), **document(found))
    say(text(found))
    return 1 if found.failed else 0


def progress(place: Place) -> Progress:
    """Return how far the study in a place is.

    Raises InvalidInput when the store is damaged beyond its chunks.
    """
    group = store.check(place)
    return Progress(
        study=str(group.attrs["study"]),
        cells=dict(survey.counts(place)),
        chunks=len(store.chunks(group)),
        chunks_written=int(np.count_nonzero(survey.written_chunks(place, group, "status"))),
        written=store.written_at(place),
        packed=store.is_packed(group),
        now=time.time(),
        held=_may_be_held(place),
    )


def _may_be_held(place: Place) -> bool:
    """Return whether a run may hold a place: surely none does that has given it back, or whose process has ended."""
    try:
        said = dict(parsed(place.read(LOCK)))
    except FileNotFoundError:
        return False
    except (OSError, ValueError, TypeError):
        return True
    return "released" not in said and not process_is_gone(said)


def document(found: Progress) -> dict[str, Any]:
    """Return progress as plain data."""
    return {
        "study": found.study,
        "state": found.state,
        "cells": found.cells,
        "cells_done": found.done,
        "cells_failed": found.failed,
        "cells_total": sum(found.cells.values()),
        "chunks_written": found.chunks_written,
        "chunks_total": found.chunks,
        "chunks_per_second": found.rate,
        "last_chunk_seconds_ago": found.last_ago,
        "seconds_left": found.seconds_left if found.state == "computing" else None,
    }


def text(found: Progress) -> str:
    """Return progress in words."""
    total = sum(found.cells.values())
    lines = [
        f"study {found.study}: {found.state}",
        f"cells:  {found.done} of {total} ({100.0 * found.done / total:.1f} %)"
        + "".join(f", {count} {name}" for name, count in found.cells.items()),
        f"chunks: {found.chunks_written} of {found.chunks}",
    ]
    if found.rate:
        lines.append(f"rate:   {found.rate:.3g} chunks a second, {found.rate * total / found.chunks:.0f} cells")
    if found.last_ago is not None:
        lines.append(f"last:   a chunk {_duration(found.last_ago)} ago")
    if found.state == "computing" and found.seconds_left is not None:
        lines.append(f"left:   {_duration(found.seconds_left)} at this rate")
    if found.state == "interrupted":
        lines.append("The command that began it goes on where it was.")
    if found.failed:
        lines.append(f"{found.failed} cells have failed; computed again with retry_failed=true")
    return "\n".join(lines)


def _duration(seconds: float) -> str:
    """Return a time span in words, in its largest unit that is whole."""
    if seconds < 120.0:
        return f"{max(seconds, 0.0):.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 7200.0 else f"{seconds / 3600.0:.1f} h"
