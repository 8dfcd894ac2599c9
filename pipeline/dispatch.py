"""Chunks handed out to whoever computes them, so that nothing that happens to one is the end of the others."""

import signal
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from types import FrameType

from distributed import Client, Future, as_completed
from distributed.comm import CommClosedError
from distributed.scheduler import KilledWorker

from chatter_core.variables import STATUS
from pipeline import store
from pipeline.cluster import KEPT, POLL, RESULT_PATIENCE, Workers
from pipeline.errors import WorkersLost
from pipeline.task import Record, Task, compute_chunk
from pipeline.telling import note

#: Tasks handed out beyond those being computed, for each worker.
WINDOW = 3
#: Further attempts at a chunk that could not be written; Dask's scheduler counts deaths of workers by itself.
RETRIES = 2
#: Seconds between two looks for whether a task has been begun.
LOOK = 0.1
#: What is said of speeds whose worker is lost while they are computed with nothing beside them.
TOLD = {
    "worker_lost": "the worker died on this speed alone: killed from outside, or out of memory",
    "timed_out": "this speed alone took longer than cluster.time_limit_s",
}


class Stopping:
    """Remembers that a signal asked for the end; a second one ends at once. So does time that was given, when it is up.

    number: of the signal, 0 without one; deadline: on the monotonic clock [s], none without one.
    """

    number: int = 0
    deadline: float | None = None

    @property
    def asked(self) -> bool:
        """Whether nothing more is to be begun."""
        return bool(self.number) or (self.deadline is not None and time.monotonic() > self.deadline)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if self.number:
            raise KeyboardInterrupt
        self.number = number
        note("\nstopping: waiting for the chunks in progress (once more to stop at once)")


@contextmanager
def signals() -> Iterator[Stopping]:
    """Turn SIGINT and SIGTERM into a wish to stop, for as long as chunks are computed."""
    stopping = Stopping()
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = {number: signal.signal(number, stopping) for number in numbers}
    try:
        yield stopping
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def dispatched(tasks: Iterable[Task], client: Client | None, stopping: Stopping, patience: float) -> Iterator[Record]:
    """Yield what became of every task, in the order in which they end, until stopped; without a client, here.

    Raises WorkersLost when there is no worker for ``patience`` seconds, or no scheduler any more.
    """
    if client is not None:
        try:
            yield from _distributed(tasks, client, stopping, Workers(client, patience))
        except CommClosedError as error:
            # A signal to the whole process group may have taken the scheduler along.
            if stopping.number:
                raise
            raise WorkersLost(f"cluster: the scheduler does not answer any more ({error}); {KEPT}") from None
        return
    for task in tasks:
        if stopping.asked:
            return
        yield compute_chunk(task)


def _distributed(tasks: Iterable[Task], client: Client, stopping: Stopping, workers: Workers) -> Iterator[Record]:
    """Hand out tasks in a bounded window, so that the scheduler stays small however many there are.

    The window is as wide as there are workers at the time. A worker that dies puts all tasks it held under suspicion;
    each of those is tried again alone.
    """
    waiting, suspects, taken_away = iter(tasks), list[Task](), list[Task]()
    running = as_completed()
    owner: dict[str, Task] = {}

    def hand_out() -> None:
        while not stopping.asked and len(owner) < workers.count * (1 + WINDOW):
            task = taken_away.pop() if taken_away else next(waiting, None)
            if task is None:
                return
            future = client.submit(compute_chunk, task, pure=False, retries=RETRIES)
            owner[future.key] = task
            running.add(future)

    hand_out()
    while owner:
        if workers.look() and stopping.asked:
            _take_back(running, client)
        if not running.has_ready():
            time.sleep(POLL)
        else:
            future = next(running)
            task = owner.pop(future.key)
            if future.cancelled():
                # By this run, which is to stop, or by whoever restarted the scheduler: then it is handed out again.
                taken_away.append(task)
            elif (record := _record_of(future)) is None:
                suspects.append(task)
            else:
                yield record
        hand_out()
    for task in suspects:
        if not stopping.asked:
            record = _speed_by_speed(task, client, stopping, workers)
            if record is not None:
                yield record


def _take_back(running: as_completed, client: Client) -> None:
    """Take back what no worker has begun; what is in progress is waited for."""
    begun = {key for keys in client.processing().values() for key in keys}
    for future in list(running.futures):
        if future.key not in begun:
            future.cancel()


def _record_of(future: Future) -> Record | None:
    """Return the record of a task that has ended, None where its workers died or took it with them."""
    try:
        record: Record = future.result(timeout=RESULT_PATIENCE)
        return record
    except (KilledWorker, TimeoutError):
        return None


def _speed_by_speed(task: Task, client: Client, stopping: Stopping, workers: Workers) -> Record | None:
    """Compute a chunk on which workers died one speed after another; those that do it again are marked.

    Nothing is computed beside them, so a worker's death is a speed's own. None where stopped midway: what is missing
    stays pending.
    """
    chunk, counts, errors, seconds = task.chunk, dict[str, int](), list[str](), 0.0
    for speed in range(chunk.first, chunk.last):
        if stopping.asked:
            return None
        record = _alone(replace(task, chunk=replace(chunk, first=speed, last=speed + 1)), client, stopping, workers)
        if record is None:
            return None
        for name, count in record.counts.items():
            counts[name] = counts.get(name, 0) + count
        errors += record.errors
        seconds += record.seconds
    return Record(chunk=chunk, counts=counts, seconds=seconds, errors=tuple(errors))


def _alone(task: Task, client: Client, stopping: Stopping, workers: Workers) -> Record | None:
    """Compute a part of a chunk with nothing beside it; where its worker dies, mark it. None where stopped before."""
    future = client.submit(compute_chunk, task, pure=False)
    began = _begun(future, client, stopping, workers)
    while not future.done():
        workers.look()
        time.sleep(POLL)
    if future.cancelled():
        return None if stopping.asked else _alone(task, client, stopping, workers)
    record = _record_of(future)
    if record is not None:
        return record
    took = time.monotonic() - began
    why = "timed_out" if task.time_limit is not None and took >= task.time_limit else "worker_lost"
    store.mark_chunk(task.place, task.chunk, STATUS[why])
    lost = store.status_of(store.open_group(task.place), task.chunk).size
    return Record(chunk=task.chunk, counts={why: lost}, seconds=took, errors=(TOLD[why],))


def _begun(future: Future, client: Client, stopping: Stopping, workers: Workers) -> float:
    """Wait until a task has a worker, or has ended already; return the time. Where stopped it is taken back."""
    while not future.done() and not any(future.key in keys for keys in client.processing().values()):
        if stopping.asked:
            future.cancel()
        workers.look()
        time.sleep(LOOK)
    return time.monotonic()
