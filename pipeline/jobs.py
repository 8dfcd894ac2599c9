"""Independent pieces of one answer, spread over a cluster, with progress."""

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from distributed import Client, as_completed
from distributed.scheduler import KilledWorker

from pipeline.errors import WorkersLost


@dataclass(frozen=True, kw_only=True)
class Job:
    """A call without arguments that a worker can make, and what it does in a word or two."""

    name: str
    call: Callable[[], Any]


def spread(client: Client | None, jobs: Sequence[Job]) -> list[Any]:
    """Return the answers of jobs in their order, computed one after the other where there is no client.

    Raises what a job raises, and WorkersLost when its worker died.
    """
    began, answers = time.monotonic(), {}
    if client is None:
        for number, job in enumerate(jobs):
            answers[number] = job.call()
            _tell(len(answers), len(jobs), job.name, began)
        return [answers[number] for number in range(len(jobs))]
    futures = {client.submit(job.call, pure=False): number for number, job in enumerate(jobs)}
    try:
        for future in as_completed(futures):
            number = futures[future]
            answers[number] = future.result()
            _tell(len(answers), len(jobs), jobs[number].name, began)
    except KilledWorker:
        raise WorkersLost(f"a worker died over {jobs[number].name}; is there memory enough?") from None
    finally:
        client.cancel(list(futures))
    return [answers[number] for number in range(len(jobs))]


def spread_parts(client: Client | None, parts: Mapping[str, Sequence[Job]]) -> dict[str, list[Any]]:
    """Return the answers of several lists of jobs, all of them spread together.

    Raises what ``spread`` does.
    """
    answers = iter(spread(client, [job for jobs in parts.values() for job in jobs]))
    return {name: [next(answers) for _ in jobs] for name, jobs in parts.items()}


def _tell(done: int, total: int, name: str, began: float) -> None:
    """Tell how far the work is (stderr)."""
    spent = time.monotonic() - began
    left = spent / done * (total - done)
    print(f"{done} of {total}: {name}; {spent:.0f} s, {left:.0f} s left", file=sys.stderr, flush=True)
