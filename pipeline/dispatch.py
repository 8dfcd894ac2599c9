"""Chunks handed out to whoever computes them, so that nothing that happens to one is the end of the others."""

import time
from collections.abc import Iterable, Iterator

from distributed import Client, as_completed
from distributed.comm import CommClosedError

from pipeline.cluster import KEPT, POLL, Workers
from pipeline.errors import WorkersLost
from pipeline.stopping import Stopping
from pipeline.suspects import answer, tried_alone
from pipeline.task import Record, Task, compute_chunk, kept

#: Tasks handed out beyond those being computed, for each worker.
WINDOW = 3
#: Further attempts at a chunk that could not be written; Dask's scheduler counts deaths of workers by itself.
RETRIES = 2


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
                # It may have ended in the moment between the look at what had been begun and its end.
                if stopping.asked and (record := kept(task)) is not None:
                    yield record
            elif (record := answer(future)) is None:
                suspects.append(task)
            else:
                yield record
        hand_out()
    yield from tried_alone(suspects, client, stopping, workers)


def _take_back(running: as_completed, client: Client) -> None:
    """Take back what no worker has begun; what is in progress is waited for."""
    begun = {key for keys in client.processing().values() for key in keys}
    for future in list(running.futures):
        if future.key not in begun:
            future.cancel()
