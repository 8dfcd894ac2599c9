"""What a worker does with one chunk: compute, write, report. Idempotent, and never returns arrays."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from chatter_core.variables import STATUS
from pipeline import metadata, store
from pipeline.chunks import Chunk
from pipeline.errors import StoreInUse
from pipeline.kinds import Computed, kind_of
from pipeline.places import Place
from pipeline.time_limit import limited


@dataclass(frozen=True, kw_only=True)
class Task:
    """One chunk of a store; ``kernel`` names module and function that compute it.

    made: ``metadata.identity`` of the store when it was handed out, by which a worker knows it from the one before;
    effects_path: folder with effects of the user's own, as the command line named it; a store never does.
    time_limit: seconds after which the worker's process ends with everything in it, none: never.
    """

    place: Place
    chunk: Chunk
    kernel: str
    made: str
    effects_path: Path | None = None
    time_limit: float | None = None


@dataclass(frozen=True, kw_only=True)
class Record:
    """What became of a chunk: cells by status, seconds, and the errors that were caught."""

    chunk: Chunk
    counts: dict[str, int]
    seconds: float
    errors: tuple[str, ...]


#: Which store each place held when this process was last asked for a chunk of it.
_known: dict[Place, str] = {}


def _know(task: Task) -> None:
    """Forget what is kept of the store that lay in a place before: workers outlive a study that is made anew there."""
    _require_latest(task)
    if _known.get(task.place) != task.made:
        store.forget()
        _described.cache_clear()
        _known[task.place] = task.made


def _require_latest(task: Task) -> None:
    """Raise StoreInUse where the store in its place is not what it was when a task was handed out."""
    if metadata.identity(task.place) != task.made:
        raise StoreInUse(f"{task.place}: was made anew, packed or taken up by another run since this one began")


@lru_cache(maxsize=4)
def _described(place: Place) -> Any:
    """Return what all chunks share as the store holds it, once a process."""
    group = store.open_group(place)
    return kind_of(place).described(group.attrs.asdict(), partial(store.whole, group))


def compute_chunk(task: Task) -> Record:
    """Compute a chunk and write it, unless it is there already: its worker may have died with the news.

    Errors of the physics are narrowed down and marked. Errors of writing are not caught: they end the run. Raises
    StoreInUse, and writes nothing, for a task of a store that is not there any more or of a run that has ended.
    """
    began = time.perf_counter()
    return kept(task) or written(task, _computed(task), began)


def kept(task: Task) -> Record | None:
    """Return the record of a chunk that is there already, None where it is not; raises what ``compute_chunk`` does."""
    began = time.perf_counter()
    _know(task)
    status = store.readable_status(store.open_group(task.place), task.chunk)
    return _record(task, status, began, ()) if status.all() else None


def computed(task: Task) -> Computed:
    """Compute a chunk, or a part of one, and write nothing; raises what ``compute_chunk`` does."""
    _know(task)
    return _computed(task)


def _computed(task: Task) -> Computed:
    with limited(task.time_limit):
        return kind_of(task.place).compute(_described(task.place), task.chunk, task.kernel, task.effects_path)


def written(task: Task, found: Computed, began: float) -> Record:
    """Write a chunk that was computed and return its record; raises what ``compute_chunk`` does."""
    store.write_chunk(task.place, task.chunk, found, partial(_require_latest, task))
    return _record(task, found.status, began, found.errors)


def _record(task: Task, status: np.ndarray, began: float, errors: Sequence[str]) -> Record:
    """Return the record of a chunk by the status of its cells."""
    names = {code: name for name, code in STATUS.items()}
    codes, counts = np.unique(status, return_counts=True)
    return Record(
        chunk=task.chunk,
        counts={names[int(code)]: int(count) for code, count in zip(codes, counts, strict=True)},
        seconds=time.perf_counter() - began,
        errors=tuple(errors),
    )


def compute_first(task: Task) -> None:
    """Compute as little as has everything compiled that a chunk needs, and forget it."""
    _know(task)
    kind = kind_of(task.place)
    if task.kernel == kind.kernel:
        kind.compute_first(_described(task.place), task.effects_path)
