"""The processes of an MPI run: the first schedules, the second drives, and each of the others has a worker."""

import logging
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import dask

from chatter_core.errors import InvalidInput
from pipeline.cluster import CONFIGURATION, LOOPBACK
from pipeline.queue_jobs import missing_extra
from pipeline.scratch import scratch_folder
from pipeline.telling import program

#: What Dask's processes say of themselves is nothing that a user could use.
QUIET = {"logging": {"distributed": "critical"}}


@contextmanager
def joined() -> Iterator[bool]:
    """Yield whether this process drives: of an MPI run the second one does, and it alone.

    To the others nothing is yielded before it is done. Raises InvalidInput where there is no MPI run to join.
    """
    try:
        from dask_mpi import initialize, send_close_signal
        from mpi4py import MPI
    except ModuleNotFoundError as error:
        raise InvalidInput([missing_extra("mpi", error)]) from None
    except (ImportError, RuntimeError) as error:
        raise InvalidInput([f"cluster: kind 'mpi': the MPI library cannot be loaded: {error}"]) from None
    processes = MPI.COMM_WORLD.Get_size()
    if processes < 3:
        needed = f"kind 'mpi' takes 3 processes at least, a scheduler, a driver and workers; found {processes}"
        raise InvalidInput([f"cluster: {needed}. Say: mpirun -n 4 {program()} ..."])
    with ExitStack() as started:
        scratch = str(started.enter_context(scratch_folder()))
        started.enter_context(dask.config.set({**CONFIGURATION, **QUIET, "temporary-directory": scratch}))
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        drives = initialize(
            # A worker in a process of its own, which may be ended; one of MPI's that ends takes all others with it.
            worker_class="distributed.Nanny",
            worker_options={"silence_logs": logging.CRITICAL, "dashboard": False},
            dashboard_address=LOOPBACK,
            exit=False,
        )
        if drives:
            started.callback(send_close_signal)
        yield drives
