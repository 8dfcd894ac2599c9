"""Where chunks are computed: one factory, the same task everywhere."""

import logging
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import resource_tracker
from typing import Any
from urllib.parse import urlsplit

import dask
from distributed import Client, LocalCluster, SchedulerPlugin, WorkerPlugin
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from pipeline.errors import WorkersLost
from pipeline.queue_jobs import open_queue
from pipeline.scratch import scratch_folder
from pipeline.settings import Cluster
from pipeline.telling import note

#: Seconds to wait for a scheduler to answer.
SCHEDULER_PATIENCE = 60
#: Seconds to wait for the answer of a task that has ended; it is lost when its worker died since.
RESULT_PATIENCE = 10.0
#: Seconds between two looks for tasks that have ended; a task takes about a second.
POLL = 0.01
#: Seconds between two looks at which workers there are.
LOOK = 1.0
#: Seconds between two looks for the first worker, and between two words of how long that takes.
FIRST_LOOK, WORD_INTERVAL = 0.1, 10.0
#: Address of the pages that Dask always serves: any free port, from this machine alone.
LOOPBACK = "127.0.0.1:0"

#: Environment of a worker process. The C library gives freed memory back to the system at once by
#: default, and Dask asks it to; a chunk then spends a third of its time in page faults, because it
#: takes and frees arrays of some megabytes all the time. With 256 MiB kept it does not.
WORKER_ENVIRONMENT = {
    "OMP_NUM_THREADS": 1,
    "OPENBLAS_NUM_THREADS": 1,
    "MKL_NUM_THREADS": 1,
    "MALLOC_TRIM_THRESHOLD_": 256 * 1024**2,
    "MALLOC_MMAP_THRESHOLD_": 32 * 1024**2,
}


#: How Dask's schedulers and workers are to be.
CONFIGURATION = {
    "distributed.worker.daemon": True,
    "distributed.admin.low-level-log-length": 0,
    "distributed.nanny.pre-spawn-environ": WORKER_ENVIRONMENT,
    # The sweep itself tries again, one chunk at a time, what was on a worker that died.
    "distributed.scheduler.allowed-failures": 1,
    # A worker that dies is started again by its nanny, however often; by default the cluster gives a
    # name up that is missing at a look 15 s after a death, and is then one worker short for good.
    "distributed.deploy.lost-worker-timeout": "365 days",
}

#: What becomes of a study that has lost its workers.
KEPT = "nothing is lost, the same command goes on"


class OneThreadEach(WorkerPlugin):  # type: ignore[misc]
    """Keep the linear algebra of a worker to one thread, also where its environment says nothing."""

    name = "one-thread-each"

    def setup(self, worker: Any) -> None:
        """Set the limit in the worker's process."""
        threadpool_limits(1)


class SmallScheduler(SchedulerPlugin):  # type: ignore[misc]
    """Keep a scheduler from growing with every task: it notes of each where it came from, and never forgets that."""

    name = "small-scheduler"

    def update_graph(self, scheduler: Any, **_: Any) -> None:
        """Forget what was noted of tasks that came."""
        for span in scheduler.extensions["spans"].spans.values():
            span._metadata = None


#: What a terminal sends to all that was started from it: Ctrl-C, and that it is closed.
OF_TERMINALS = (signal.SIGINT, signal.SIGHUP)


class DeafToTerminals(WorkerPlugin):  # type: ignore[misc]
    """Let a worker process finish its chunk when Ctrl-C reaches the whole terminal, or its end: the driver decides."""

    name = "deaf-to-terminals"

    def setup(self, worker: Any) -> None:
        """Ignore what a terminal sends in the worker's process."""
        for number in OF_TERMINALS:
            signal.signal(number, signal.SIG_IGN)


@contextmanager
def _starting_deaf() -> Iterator[None]:
    """Let processes that start meanwhile not hear what a terminal sends from their first moment: they inherit it.

    A worker that Ctrl-C hits before its plugin is there would end in a traceback. The driver hears afterwards what was
    sent meanwhile: the end of a terminal is told of once.
    """
    # A thread that has to start the tracker of multiprocessing hears Ctrl-C afterwards, and so would its processes.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, OF_TERMINALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class Workers:
    """The workers of a client, looked at every so often: they come and go.

    patience: seconds without any worker after which there is no hope of one; then: what is told of what was computed.
    """

    def __init__(self, client: Client, patience: float, then: str = KEPT) -> None:
        self.client, self.patience, self.then = client, patience, then
        self.count = max(1, _count(client))
        self.begin()

    def begin(self) -> None:
        """Begin to wait for workers: nobody has looked for them meanwhile."""
        self.seen = self.looked = time.monotonic()

    def look(self) -> bool:
        """Count the workers, unless that was done just now; return whether it was done.

        Raises WorkersLost when there was none for long.
        """
        now = time.monotonic()
        if now - self.looked < LOOK:
            return False
        self.looked, found = now, _count(self.client)
        if found:
            self.count, self.seen = found, now
        elif now - self.seen > self.patience:
            raise WorkersLost(f"cluster: no worker for {self.patience:g} s; {self.then}")
        return True


@contextmanager
def open_client(cluster: Cluster, stopping: Callable[[], bool] = lambda: False) -> Iterator[Client | None]:
    """Yield a client of the cluster, None for ``serial``; what was started here is stopped again.

    stopping: whether nothing is to be waited for any more. Raises InvalidInput where the cluster cannot be had as it
    is described, WorkersLost when no worker came.
    """
    if cluster.kind == "serial":
        yield None
        return
    # What an event loop has left unanswered when its workers are gone is no news to anybody.
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    with ExitStack() as started:
        scratch = str(started.enter_context(scratch_folder()))
        started.enter_context(dask.config.set({**CONFIGURATION, "temporary-directory": scratch}))
        told: Callable[[], str] = str
        if cluster.kind in ("address", "mpi"):
            client = started.enter_context(_connected(cluster.address or _scheduler_of_mpi()))
        elif cluster.job is not None:
            with _starting_deaf():
                client, told = started.enter_context(
                    open_queue(cluster.kind, cluster.job, WORKER_ENVIRONMENT, LOOPBACK)
                )
        else:
            client = started.enter_context(_local(cluster))
        _await_worker(client, cluster.patience, stopping, told)
        client.register_plugin(OneThreadEach())
        if cluster.kind != "address":
            # A scheduler that somebody else has started need not know the program.
            client.register_plugin(SmallScheduler())
        yield client


def _started_here(processes: bool, count: int) -> LocalCluster:
    """Return workers that have been started on this machine; raise WorkersLost where they could not be."""
    try:
        return LocalCluster(
            n_workers=count if processes else 1,
            threads_per_worker=1 if processes else count,
            processes=processes,
            # Any free port of this machine alone: nothing is open to others, and runs do not collide.
            dashboard_address=LOOPBACK,
            worker_dashboard_address=LOOPBACK,
            **({"host": "127.0.0.1"} if processes else {}),  # threads speak without a network
            silence_logs=logging.CRITICAL,
        )
    except RuntimeError as error:
        raise WorkersLost(f"cluster: the workers could not be started: {error}") from error


@contextmanager
def _local(cluster: Cluster) -> Iterator[Client]:
    """Yield a client of threads or worker processes on this machine."""
    processes = cluster.kind == "local"
    count = cluster.workers or dask.system.CPU_COUNT
    with ExitStack() as started:
        with _starting_deaf():
            client = started.enter_context(Client(started.enter_context(_started_here(processes, count))))
        if processes:
            client.register_plugin(DeafToTerminals())
        yield client


def _scheduler_of_mpi() -> str:
    """Return the address of the scheduler of the MPI run that this process is of; raise InvalidInput without one."""
    address = dask.config.get("scheduler_address", None)
    if address is None:
        raise InvalidInput(["cluster: kind 'mpi' is asked for by cluster=mpi, and not by cluster.kind"])
    return str(address)


def _connected(address: str) -> Client:
    """Return a client of a scheduler that is there; raise InvalidInput where there is none."""
    note(f"cluster: asking the scheduler at {address}, {SCHEDULER_PATIENCE} s at most")
    try:
        return Client(address, timeout=SCHEDULER_PATIENCE)
    except (OSError, ValueError) as error:
        raise InvalidInput([f"cluster.address: no scheduler answers at {address}: {error}"]) from None


def _await_worker(client: Client, patience: float, stopping: Callable[[], bool], told: Callable[[], str]) -> None:
    """Wait for the first worker and tell how long already (stderr); ``told`` says what there is to wait for.

    Raises WorkersLost when none came, and what ``told`` raises.
    """
    began = word = time.monotonic()
    while not _count(client) and not stopping():
        now = time.monotonic()
        if now - began > patience:
            raise WorkersLost(f"cluster: no worker came within {patience:g} s (cluster.patience_s){told()}; {KEPT}")
        said = told()
        if now - word >= WORD_INTERVAL:
            word = now
            note(f"waiting for the first worker, {now - began:.0f} s of {patience:g}{said}")
        time.sleep(FIRST_LOOK)


def pages(client: Client | None) -> str | None:
    """Return the address of the pages on which Dask shows what its workers do; None where it serves none."""
    port = None if client is None else client.scheduler_info()["services"].get("dashboard")
    if client is None or port is None:
        return None
    # A scheduler of this process, or of threads, says no host.
    host = urlsplit(client.scheduler.address).hostname if client.cluster is None else None
    return f"http://{host or '127.0.0.1'}:{port}/status"


def _count(client: Client) -> int:
    """Return how many chunks can be computed at once."""
    return sum(client.nthreads().values())
