"""Independent pieces of one answer, spread over a cluster, with progress."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from distributed import as_completed
from distributed.scheduler import KilledWorker

from pipeline.cluster import POLL, RESULT_PATIENCE, Workers
from pipeline.errors import WorkersLost
from pipeline.telling import note


@dataclass(frozen=True, kw_only=True)
class Job:
    """A call without arguments that a worker can make, and what it does in a word or two."""

    name: str
    call: Callable[[], Any]


def spread(workers: Workers | None, jobs: Sequence[Job]) -> list[Any]:
    """Return the answers of jobs in their order, computed one after the other where there are no workers.

    A job whose worker died is tried once more when the others are done, with nothing beside it. Raises what a job
    raises, and WorkersLost when its worker died again, or there was none for long.
    """
    began, answers = time.monotonic(), dict[int, Any]()

    def take(number: int, answer: Any) -> None:
        answers[number] = answer
        _tell(len(answers), len(jobs), jobs[number].name, began)

    if workers is None:
        for number, job in enumerate(jobs):
            take(number, job.call())
    else:
        for number in _answered(workers, jobs, range(len(jobs)), take):
            if _answered(workers, jobs, [number], take):
                again = "and another with nothing beside it; is there memory enough?"
                raise WorkersLost(f"a worker died over {jobs[number].name}, {again}")
    return [answers[number] for number in range(len(jobs))]


def _answered(
    workers: Workers, jobs: Sequence[Job], numbers: Iterable[int], take: Callable[[int, Any], None]
) -> list[int]:
    """Take the answers of some jobs as they come; return the jobs whose workers died."""
    futures = {workers.client.submit(jobs[number].call, pure=False): number for number in numbers}
    running, lost = as_completed(futures), list[int]()
    workers.begin()
    try:
        while not running.is_empty():
            workers.look()
            if not running.has_ready():
                time.sleep(POLL)
                continue
            future = next(running)
            try:
                answer = future.result(timeout=RESULT_PATIENCE)
            except (KilledWorker, TimeoutError):
                lost.append(futures[future])
            else:
                take(futures[future], answer)
    finally:
        workers.client.cancel(list(futures))
    return lost


def spread_parts(workers: Workers | None, parts: Mapping[str, Sequence[Job]]) -> dict[str, list[Any]]:
    """Return the answers of several lists of jobs, all of them spread together.

    Raises what ``spread`` does.
    """
    answers = iter(spread(workers, [job for jobs in parts.values() for job in jobs]))
    return {name: [next(answers) for _ in jobs] for name, jobs in parts.items()}


def _tell(done: int, total: int, name: str, began: float) -> None:
    """Tell how far the work is (stderr)."""
    spent = time.monotonic() - began
    left = spent / done * (total - done)
    note(f"{done} of {total}: {name}; {spent:.0f} s, {left:.0f} s left")
