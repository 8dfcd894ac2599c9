"""What happened in the runs of a study: written as events, a JSON object a line, and told in sentences."""

import json
import os
import zlib
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS, WITH_RESULT
from pipeline import store
from pipeline.errors import is_damage
from pipeline.json_text import parsed
from pipeline.kinds import kind_of
from pipeline.places import Place
from pipeline.provenance import now
from pipeline.study_place import study_place
from pipeline.telling import fact, say
from pipeline.verbs.stores import JournalOptions

FILE = "journal.jsonl"
#: What a line begins with: the checksum of all the rest of it, as if it stood alone; or none.
SEALED, UNSEALED = '{"crc32": "', '{"time": "'
Event = dict[str, Any]
#: Statuses of cells with a result.
GOOD = {name for name, code in STATUS.items() if code in WITH_RESULT}
#: Characters of an error that are told; the file has all.
TOLD_ERROR = 200


class Journal:
    """Append what happens in a run to a JSONL file: one event a line, each with its checksum and time."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE
        if self.path.exists() and not _ends_a_line(self.path):
            # A run was killed while it wrote: what comes is not to be lost with its half line.
            self._append("\n")

    def write(self, event: str, **details: Any) -> None:
        """Append an event."""
        told = json.dumps({"time": now(), "event": event, **details})
        self._append(f'{SEALED}{zlib.crc32(told.encode()):08x}", {told[1:]}\n')

    def _append(self, text: str) -> None:
        with self.path.open("a", encoding="utf-8") as file:
            file.write(text)


def _ends_a_line(path: Path) -> bool:
    """Return whether a file is empty or its last line is whole."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - 1))
        return file.read() in (b"", b"\n")


def run(words: list[str]) -> int:
    """Tell what happened in the runs of a study."""
    place, _ = study_place(words, JournalOptions)
    path = place.make_output() / FILE
    if not path.exists():
        raise InvalidInput([f"{path}: there is no journal; it is written where a study is computed"])
    events, torn = read(path)
    kept = list(events)
    fact(events=kept, torn_lines=torn)
    say("\n".join(sentences(kept, torn, _places(place))))
    return 0


def read(path: Path) -> tuple[Iterator[Event], int]:
    """Return the events of a journal, and how many lines are none: a run that was killed may leave half a line."""
    return (event for event in _lines(path) if event is not None), torn_lines(path)


def torn_lines(path: Path) -> int:
    """Return how many lines of a journal are not as they were written; none where there is no journal."""
    return sum(event is None for event in _lines(path)) if path.exists() else 0


def _lines(path: Path) -> Iterator[Event | None]:
    try:
        with path.open(encoding="utf-8", errors="replace", newline="\n") as file:
            yield from (_event(line.removesuffix("\n")) for line in file)
    except OSError as error:
        if not is_damage(error):
            raise
        # From here on the disk has lost it.
        yield None


def _event(line: str) -> Event | None:
    """Return what a line tells, None where it is not as it was written. Lines of earlier versions bear no checksum."""
    told = line
    if not line.startswith(UNSEALED):
        told = "{" + line[len(SEALED) + 11 :]
        if line != f'{SEALED}{zlib.crc32(told.encode()):08x}", {told[1:]}':
            return None
    try:
        return dict(parsed(told))
    except (ValueError, TypeError):
        return None


def _places(place: Place) -> Callable[[Event], str]:
    """Return what tells which chunk an event is of."""
    kind, group = kind_of(place), store.check(place)
    attributes: dict[str, Any] = group.attrs.asdict()
    values = {name: store.whole(group, name).tolist() for name in kind.told_by}

    def told(event: Event) -> str:
        first, last = event[f"{kind.entry}s"]
        return f"chunk {kind.told(attributes['settings'], values, tuple(event['outer']), first, last)}"

    return told


def sentences(events: Iterable[Event], torn: int, place: Callable[[Event], str]) -> Iterator[str]:
    """Yield a line for every event, one for all chunks in a row in which nothing failed.

    torn: lines of the journal that could not be read; place: tells which chunk an event is of.
    """
    for plain, group in groupby(events, key=_is_plain_chunk):
        if plain:
            yield _told_together(group)
        else:
            yield from (f"{_clock(event)}  {_told(event, place)}" for event in group)
    if torn:
        yield f"lines that could not be read: {torn}; a run was killed while it wrote"


def _told_together(chunks: Iterator[Event]) -> str:
    """Return the events of chunks in a row as one sentence."""
    first = last = next(chunks)
    number, cells = 1, sum(first["counts"].values())
    for last in chunks:
        number, cells = number + 1, cells + sum(last["counts"].values())
    until = f" to {_clock(last)}" if number > 1 else ""
    return f"{_clock(first)}{until}  {number} chunk{'s' if number > 1 else ''} computed, {cells} cells"


def _is_plain_chunk(event: Event) -> bool:
    return event.get("event") == "chunk" and set(event["counts"]) <= GOOD


def _clock(event: Event) -> str:
    return str(event["time"])[:19].replace("T", " ")


def _told(event: Event, place: Callable[[Event], str]) -> str:
    """Return an event as a sentence."""
    kind = event["event"]
    if kind == "start":
        return f"begun by process {event['pid']} on {event['host']}: {' '.join(event['argv'])}".rstrip(": ")
    if kind == "workers":
        return f"workers: {event['cluster']}, to be watched at {event['pages']}"
    if kind == "stopped":
        return f"stopped by {event['signal']}" + (f"; goes on with: {event['again']}" if "again" in event else "")
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in event["counts"].items())
    if kind == "end":
        return f"ended: {counts}"
    why = "".join(f"\n    {error.splitlines()[-1][:TOLD_ERROR]}" for error in event.get("errors", []))
    return f"{place(event)}: {counts}{why}"
