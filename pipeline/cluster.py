"""Where chunks are computed: one factory, the same task everywhere."""

import logging
import signal
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from tempfile import TemporaryDirectory
from typing import Any

import dask
from distributed import Client, LocalCluster, WorkerPlugin
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from pipeline.settings import Cluster

#: Seconds to wait for the first worker.
WORKER_PATIENCE = 60
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


class OneThreadEach(WorkerPlugin):  # type: ignore[misc]
    """Keep the linear algebra of a worker to one thread, also where its environment says nothing."""

    name = "one-thread-each"

    def setup(self, worker: Any) -> None:
        """Set the limit in the worker's process."""
        threadpool_limits(1)


class DeafToInterrupts(WorkerPlugin):  # type: ignore[misc]
    """Let a worker process finish its chunk when Ctrl-C reaches the whole terminal: the driver decides."""

    name = "deaf-to-interrupts"

    def setup(self, worker: Any) -> None:
        """Ignore SIGINT in the worker's process."""
        signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _starting_deaf() -> Iterator[None]:
    """Let processes that start meanwhile ignore SIGINT from their first moment: they inherit it.

    A worker that Ctrl-C hits before its plugin is there would end in a traceback. For the second or
    two that this takes the driver does not hear Ctrl-C either.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def open_client(cluster: Cluster) -> Iterator[Client | None]:
    """Yield a client of the cluster, None for ``serial``; what was started here is stopped again."""
    if cluster.kind == "serial":
        yield None
        return
    # What an event loop has left unanswered when its workers are gone is no news to anybody.
    logging.getLogger("asyncio").setLevel(logging.CRITICAL)
    options = {
        "distributed.worker.daemon": True,
        "distributed.admin.low-level-log-length": 0,
        "distributed.nanny.pre-spawn-environ": WORKER_ENVIRONMENT,
        # The sweep itself tries again, one chunk at a time, what was on a worker that died.
        "distributed.scheduler.allowed-failures": 1,
        # A worker that dies is started again by its nanny, however often; by default the cluster gives a
        # name up that is missing at a look 15 s after a death, and is then one worker short for good.
        "distributed.deploy.lost-worker-timeout": "365 days",
    }
    with TemporaryDirectory(prefix="chatter-") as scratch, dask.config.set({**options, "temporary-directory": scratch}):
        if cluster.kind == "address":
            yield from _connect(cluster.address)
        else:
            processes = cluster.kind == "local"
            count = cluster.workers or dask.system.CPU_COUNT
            with ExitStack() as started:
                with _starting_deaf():
                    local = started.enter_context(
                        LocalCluster(
                            n_workers=count if processes else 1,
                            threads_per_worker=1 if processes else count,
                            processes=processes,
                            # Any free port of this machine alone: nothing is open to others, and runs do not collide.
                            dashboard_address=LOOPBACK,
                            worker_dashboard_address=LOOPBACK,
                            **({"host": "127.0.0.1"} if processes else {}),  # threads speak without a network
                            silence_logs=logging.CRITICAL,
                        )
                    )
                    client = started.enter_context(Client(local))
                if processes:
                    client.register_plugin(DeafToInterrupts())
                yield _ready(client)


def _connect(address: str | None) -> Iterator[Client]:
    try:
        client = Client(address, timeout=WORKER_PATIENCE)
    except (OSError, ValueError) as error:
        raise InvalidInput([f"cluster.address: no scheduler answers at {address}: {error}"]) from None
    with client:
        yield _ready(client)


def _ready(client: Client) -> Client:
    try:
        client.wait_for_workers(1, timeout=WORKER_PATIENCE)
    except TimeoutError:
        raise InvalidInput([f"cluster: no worker came within {WORKER_PATIENCE} s"]) from None
    client.register_plugin(OneThreadEach())
    return client


def worker_count(client: Client | None) -> int:
    """Return how many chunks can be computed at once."""
    return 1 if client is None else max(1, sum(client.nthreads().values()))
