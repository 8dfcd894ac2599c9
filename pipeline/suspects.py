"""Chunks on which workers died: tried entry by entry, each with nothing beside it, and written once, by one process."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from distributed import Client, Future
from distributed.scheduler import KilledWorker

from chatter_core.variables import STATUS
from pipeline import metadata, store
from pipeline.cluster import POLL, RESULT_PATIENCE, Workers
from pipeline.kinds import Computed, joined
from pipeline.stopping import Stopping
from pipeline.task import Record, Task, computed, kept, written

#: Seconds between two looks for whether a task has been begun.
LOOK = 0.1
#: What is said of entries whose worker is lost while they are computed with nothing beside them.
TOLD = {
    "worker_lost": "the worker died on this part alone: killed from outside, or out of memory",
    "timed_out": "this part alone took longer than cluster.time_limit_s",
}


def answer(future: Future) -> Any:
    """Return what a task that has ended came to, None where its workers died or took it with them."""
    try:
        return future.result(timeout=RESULT_PATIENCE)
    except (KilledWorker, TimeoutError):
        return None


def tried_alone(tasks: Sequence[Task], client: Client, stopping: Stopping, workers: Workers) -> Iterator[Record]:
    """Yield what became of chunks on which workers died; entries that cost their worker again are marked.

    Nothing is computed beside an entry, so a worker's death is the entry's own. Where stopped midway nothing of the
    chunk is written: it stays pending.
    """
    if not tasks or stopping.asked:
        return
    # Their workers may only have been thought to be dead. What comes of them late is not written any more.
    made = metadata.begin(tasks[0].place, f"{len(tasks)} chunks tried in parts, their workers were lost")
    for task in tasks:
        record = _in_parts(replace(task, made=made), client, stopping, workers)
        if record is not None:
            yield record


def _in_parts(task: Task, client: Client, stopping: Stopping, workers: Workers) -> Record | None:
    """Compute a chunk entry by entry and write it; None where stopped before."""
    began, parts = time.perf_counter(), list[Computed]()
    if (record := kept(task)) is not None:
        return record
    for entry in range(task.chunk.first, task.chunk.last):
        chunk = replace(task.chunk, first=entry, last=entry + 1)
        part = None if stopping.asked else _alone(replace(task, chunk=chunk), client, stopping, workers)
        if part is None:
            return None
        parts.append(part)
    return written(task, joined(parts), began)


def _alone(task: Task, client: Client, stopping: Stopping, workers: Workers) -> Computed | None:
    """Compute a part of a chunk with nothing beside it; where its worker dies, mark it. None where stopped before."""
    future = client.submit(computed, task, pure=False)
    began = _begun(future, client, stopping, workers)
    while not future.done():
        workers.look()
        time.sleep(POLL)
    if future.cancelled():
        return None if stopping.asked else _alone(task, client, stopping, workers)
    part: Computed | None = answer(future)
    if part is not None:
        return part
    took = time.monotonic() - began
    why = "timed_out" if task.time_limit is not None and took >= task.time_limit else "worker_lost"
    return store.without_result(task.place, task.chunk, STATUS[why], TOLD[why])


def _begun(future: Future, client: Client, stopping: Stopping, workers: Workers) -> float:
    """Wait until a task has a worker, or has ended already; return the time. Where stopped it is taken back."""
    while not future.done() and not any(future.key in keys for keys in client.processing().values()):
        if stopping.asked:
            future.cancel()
        workers.look()
        time.sleep(LOOK)
    return time.monotonic()
