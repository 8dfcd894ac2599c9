"""What happened in the runs of a study: written as events, a JSON object a line, and told in sentences."""

import json
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS, WITH_RESULT
from pipeline import store
from pipeline.store import now
from pipeline.study_place import study_place

FILE = "journal.jsonl"
Event = dict[str, Any]
#: Statuses of cells with a result.
GOOD = {name for name, code in STATUS.items() if code in WITH_RESULT}
#: Characters of an error that are told; the file has all.
TOLD_ERROR = 200


class Journal:
    """Append what happens in a run to a JSONL file: one event a line, each with its time."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / FILE

    def write(self, event: str, **details: Any) -> None:
        """Append an event."""
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"time": now(), "event": event, **details}) + "\n")


def run(words: list[str]) -> int:
    """Tell what happened in the runs of a study."""
    place, _ = study_place(words, "journal")
    path = place.make_output() / FILE
    if not path.exists():
        raise InvalidInput([f"{path}: there is no journal; it is written where a study is computed"])
    print("\n".join(sentences(*read(path), axes(store.open_lobes(place)))))
    return 0


def read(path: Path) -> tuple[list[Event], int]:
    """Return the events of a journal, and how many lines are none: a run that was killed may leave half a line."""
    events, torn = list[Event](), 0
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
        try:
            events.append(dict(json.loads(line)))
        except (ValueError, TypeError):
            torn += 1
    return events, torn


def axes(lobes: Any) -> dict[str, list[Any]]:
    """Return the values of the dimensions that a chunk is told by."""
    names = ("modal_parameters", "preload", "mode_count", "spindle_speed")
    with lobes:
        return {name: lobes[name].values.tolist() for name in names}


def sentences(events: Sequence[Event], torn: int, values: dict[str, list[Any]]) -> Iterator[str]:
    """Yield a line for every event, one for all chunks in a row in which nothing failed.

    torn: lines of the journal that could not be read; values: of the dimensions, for chunks are told by their place.
    """
    for plain, group in groupby(events, key=_is_plain_chunk):
        some = list(group)
        if plain:
            cells = sum(sum(event["counts"].values()) for event in some)
            until = f" to {_clock(some[-1])}" if len(some) > 1 else ""
            yield f"{_clock(some[0])}{until}  {len(some)} chunk{'s' if len(some) > 1 else ''} computed, {cells} cells"
        else:
            yield from (f"{_clock(event)}  {_told(event, values)}" for event in some)
    if torn:
        yield f"lines that could not be read: {torn}; a run was killed while it wrote"


def _is_plain_chunk(event: Event) -> bool:
    return event.get("event") == "chunk" and set(event["counts"]) <= GOOD


def _clock(event: Event) -> str:
    return str(event["time"])[:19].replace("T", " ")


def _told(event: Event, values: dict[str, list[Any]]) -> str:
    """Return an event as a sentence."""
    kind = event["event"]
    if kind == "start":
        return f"begun by process {event['pid']} on {event['host']}: {' '.join(event['argv'])}".rstrip(": ")
    if kind == "workers":
        return f"workers: {event['cluster']}, to be watched at {event['pages']}"
    if kind == "stopped":
        return f"stopped by {event['signal']}"
    counts = ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in event["counts"].items())
    if kind == "end":
        return f"ended: {counts}"
    why = "".join(f"\n    {error.splitlines()[-1][:TOLD_ERROR]}" for error in event.get("errors", []))
    return f"{_place(event, values)}: {counts}{why}"


def _place(event: Event, values: dict[str, list[Any]]) -> str:
    """Return which chunk an event tells of."""
    parameters, preload, modes = (
        values[name][index]
        for name, index in zip(("modal_parameters", "preload", "mode_count"), event["outer"], strict=True)
    )
    first, last = event["speeds"]
    begin, end = values["spindle_speed"][first], values["spindle_speed"][last - 1]
    return f"chunk {parameters}, {preload:g} N, {modes} mode{'s' if modes > 1 else ''}, {begin:g} to {end:g} rpm"
