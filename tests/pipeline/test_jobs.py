"""Pieces of one answer over workers: what becomes of them when workers die, or there are none."""

import os
import signal
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import pytest
from distributed.scheduler import KilledWorker

from pipeline.cluster import Workers, open_client
from pipeline.errors import WorkersLost
from pipeline.jobs import Job, spread
from pipeline.judging import NOT_KEPT
from pipeline.settings import Cluster

#: Seconds without a worker after which there is no hope; what is told does not depend on how long that takes.
PATIENCE = 60.0
THREAD = Cluster(kind="threads", workers=1)


def answer(number: int) -> int:
    return number


def deadly(deaths: Path) -> str:
    """Kill the worker until it was killed twice, where Dask itself gives a task up."""
    if len(list(deaths.iterdir())) < 2:
        (deaths / str(os.getpid())).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "alive"


def given_up(attempts: Path, deaths: int) -> str:
    """End as a task does whose workers died, until it did so many times."""
    if len(list(attempts.iterdir())) < deaths:
        (attempts / str(len(list(attempts.iterdir())))).touch()
        raise KilledWorker("the task", SimpleNamespace(address="tcp://127.0.0.1:1"), 1)
    return "alive"


def test_a_job_is_tried_again_when_workers_died_over_it(tmp_path: Path) -> None:
    jobs = [Job(name="the deadly one", call=partial(deadly, tmp_path)), Job(name="one", call=partial(answer, 1))]
    with open_client(Cluster(kind="local", workers=1)) as client:
        assert client is not None
        assert spread(Workers(client, PATIENCE), jobs) == ["alive", 1]
    assert len(list(tmp_path.iterdir())) == 2


@pytest.mark.parametrize("deaths", [1, 2])
def test_a_job_is_tried_once_more_and_then_told_by_name(tmp_path: Path, deaths: int) -> None:
    name = "the deadly one"
    jobs = [Job(name=name, call=partial(given_up, tmp_path, deaths)), Job(name="one", call=partial(answer, 1))]
    with open_client(THREAD) as client:
        assert client is not None
        workers = Workers(client, PATIENCE)
        if deaths == 1:
            assert spread(workers, jobs) == ["alive", 1]
        else:
            with pytest.raises(WorkersLost, match=f"a worker died over {name}, and another with nothing beside it"):
                spread(workers, jobs)
        # What is asked next has its answer.
        assert spread(workers, jobs) == ["alive", 1]


def test_without_workers_nothing_is_waited_for_without_end() -> None:
    with open_client(THREAD) as client:
        assert client is not None
        workers = Workers(client, 0.5, NOT_KEPT)
        client.cluster.scale(0)
        with pytest.raises(WorkersLost, match=r"cluster: no worker for 0\.5 s; the same command begins again"):
            spread(workers, [Job(name="one", call=partial(answer, 1))])
