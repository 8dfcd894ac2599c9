"""Workers in jobs of a queue, SLURM or PBS: submitted, watched, and replaced when they end.

Scripts and commands are dask-jobqueue's. The jobs are kept here, by what the queue itself says of them: its clusters
learn of an end from the workers alone, and so not of a job that ended before they came, nor of one with several.
"""

import asyncio
import getpass
import logging
import os
import re
import shlex
import shutil
import signal
import subprocess
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import import_module
from itertools import count
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from distributed import Client, Scheduler, SchedulerPlugin, SpecCluster
from distributed.security import Security

from chatter_core.errors import InvalidInput
from pipeline.errors import WorkersLost
from pipeline.settings import QueueJobs
from pipeline.telling import note


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of queue: dask-jobqueue's class of its jobs, and the command that lists the living jobs of a user."""

    job_class: str
    living: tuple[str, ...]


#: Kinds of queues, by their name in the settings and in dask-jobqueue.
KINDS = {
    "slurm": Kind(job_class="SLURMJob", living=("squeue", "--noheader", "--format=%i", "--user")),
    "pbs": Kind(job_class="PBSJob", living=("qselect", "-u")),
}
#: Name of the jobs in the queue, and of what they write.
NAME = "chatter"
#: Seconds between two looks at the queue, and to wait for its answer.
LOOK, PATIENCE = 10.0, 30.0
#: Jobs that may end one after the other without a worker; then something is wrong, and no more are submitted.
MOST_IN_VAIN = 3
#: What comes of a command that submits: it failed, it is gone, or its answer names no job.
REFUSALS = (RuntimeError, OSError, ValueError)
#: Jobs that are named where many are told of.
SHOWN = 8
#: Dask's word for connections that are encrypted, and refused without the keys.
TLS = "tls://"
#: Part of a worker's life within which the workers leave one after the other.
STAGGER = 0.1


@contextmanager
def open_queue(
    kind: str, jobs: QueueJobs, environment: Mapping[str, Any], pages: str
) -> Iterator[tuple[Client, Callable[[], str]]]:
    """Yield a client of workers in jobs of a queue, and a function that tells of the jobs while no worker is there.

    environment: of the worker processes; pages: where Dask serves its pages. The scheduler is in this process. Raises
    InvalidInput where the queue cannot be used as it is described.
    """
    job_class, folder = _job_class(kind), _log_folder(jobs)
    with ExitStack() as started:
        keys = started.enter_context(TemporaryDirectory(prefix=".keys-", dir=folder))
        security, words = _secured(Path(keys))
        reached = {"interface": name} if (name := jobs.scheduler_interface or jobs.interface) else {}
        arrivals = Arrivals()
        options = {"protocol": TLS, "security": security, "dashboard_address": pages, "plugins": [arrivals], **reached}
        scheduler = {"cls": Scheduler, "options": options}
        try:
            cluster = SpecCluster(scheduler=scheduler, security=security, silence_logs=logging.CRITICAL)
        except (RuntimeError, ValueError) as error:
            raise InvalidInput([f"cluster.job: no scheduler can be started here: {error}"]) from None
        client = started.enter_context(Client(started.enter_context(cluster)))
        words |= {**_described(jobs, environment), "scheduler": cluster.scheduler_address, "log_directory": str(folder)}
        kept = KeptJobs(arrivals, kind, jobs.count, lambda name: job_class(name=name, **words), folder)
        with kept.submitted():
            yield client, kept.told


class Arrivals(SchedulerPlugin):  # type: ignore[misc]
    """Which jobs have brought workers: those whose workers are here now, by address, and all that ever did."""

    def __init__(self) -> None:
        self.here, self.ever = dict[str, str](), set[str]()

    def add_worker(self, scheduler: Scheduler, worker: str) -> None:
        """Note the job of a worker that has come; it bears the job's name, and its number in it."""
        self.here[worker] = str(scheduler.workers[worker].name).partition("-")[0]
        self.ever.add(self.here[worker])

    def remove_worker(self, scheduler: Scheduler, worker: str, **_: Any) -> None:
        """Note that a worker has gone."""
        self.here.pop(worker, None)


class KeptJobs:
    """So many jobs of a queue, each bringing workers; one that has ended is replaced.

    arrivals: of their workers; make: a job of dask-jobqueue, by the name of its workers; folder: where jobs write what
    they say.
    """

    def __init__(self, arrivals: Arrivals, kind: str, number: int, make: Callable[[str], Any], folder: Path) -> None:
        self.arrivals, self.kind, self.number, self.make, self.folder = arrivals, kind, number, make, folder
        self._jobs, self._names = list[Any](), count(1)
        self._in_vain, self._last_words, self._over = 0, "", threading.Event()

    @contextmanager
    def submitted(self) -> Iterator[None]:
        """Submit the jobs, keep them as many, and cancel them in the end.

        Raises InvalidInput where the queue refuses one.
        """
        watch = threading.Thread(target=self._watch, name="jobs", daemon=True)
        try:
            try:
                for _ in range(self.number):
                    self._submit()
            except REFUSALS as error:
                raise InvalidInput([f"cluster.job: the queue refuses a job: {_complaint(error)}"]) from None
            watch.start()
            yield
        finally:
            self._over.set()
            if watch.is_alive():
                watch.join()
            asyncio.run(_cancelled(self._jobs))

    def told(self) -> str:
        """Return which jobs are in the queue, as the end of a sentence.

        Raises WorkersLost when there are none, because all have ended before a worker came.
        """
        if self._in_vain >= MOST_IN_VAIN and not self._jobs:
            raise WorkersLost(f"cluster: {self._in_vain} jobs in a row ended before a worker came; {self._last_words}")
        names = ", ".join(job.job_id for job in self._jobs[:SHOWN])
        return f"; in the queue: {names}{', ...' if len(self._jobs) > SHOWN else ''}"

    def _submit(self) -> Any:
        """Submit one more job and return it; raise one of REFUSALS where the queue does not take it."""
        job = self.make(f"job{next(self._names)}")
        asyncio.run(job.start())
        self._jobs.append(job)
        return job

    def _watch(self) -> None:
        """Look at the queue every so often, until all is over."""
        while not self._over.wait(LOOK):
            living = _living(self.kind)
            if living is not None:
                try:
                    self._replace(living)
                except OSError as error:
                    # A log that cannot be read, a process that cannot be started: the next look may find better.
                    note(f"the jobs could not be looked after: {error}")

    def _replace(self, living: set[str]) -> None:
        """Submit a job for every one that is not among the living any more."""
        here = set(self.arrivals.here.values())
        if here:
            self._in_vain = 0
        # Whatever a queue says: a job whose workers are here has not ended.
        ended = [job for job in self._jobs if job.job_id not in living and job.name not in here]
        for job in ended:
            self._jobs.remove(job)
            how = "has ended"
            if job.name not in self.arrivals.ever:
                self._in_vain += 1
                self._last_words = _last_words(self.folder, job.job_id)
                how = f"has ended before a worker came; {self._last_words}"
            note(f"job {job.job_id} {how}")
        asyncio.run(_cancelled(ended))
        while len(self._jobs) < self.number and self._in_vain < MOST_IN_VAIN:
            try:
                note(f"job {self._submit().job_id} is submitted in its place")
            except REFUSALS as error:
                # The queue may take it at the next look; who waits for workers loses patience on its own.
                note(f"the queue refuses a job: {_complaint(error)}")
                return


async def _cancelled(jobs: list[Any]) -> None:
    """Cancel jobs."""
    await asyncio.gather(*(job.close() for job in jobs))


def _living(kind: str) -> set[str] | None:
    """Return the user's jobs that have not ended, None where the queue does not say."""
    try:
        said = subprocess.run(
            [*KINDS[kind].living, getpass.getuser()], capture_output=True, text=True, timeout=PATIENCE, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return set(re.findall(r"^\d+", said.stdout, re.MULTILINE))


def _last_words(folder: Path, job: str) -> str:
    """Return the last line that a job wrote, and where."""
    # The file's name has the job's number in it, and no other one: chatter-17.err, or chatter.e17.
    for file in sorted(folder.glob(f"{NAME}*")):
        if re.findall(r"\d+", file.name) != [job]:
            continue
        lines = [line.strip() for line in file.read_text(errors="replace").splitlines() if line.strip()]
        if lines:
            return f"its last words, in {file}: {lines[-1][:200]}"
    return f"it left no word in {folder}"


def _complaint(error: Exception) -> str:
    """Return what the command that submits a job had to say, on one line."""
    return " ".join(str(error).partition("stderr:")[2].split()) or str(error)


def _job_class(kind: str) -> Any:
    """Return dask-jobqueue's class of jobs; raise InvalidInput where something that it takes is not there."""
    try:
        import_module("cryptography")
        with _hearing_as_before():
            found = getattr(import_module(f"dask_jobqueue.{kind}"), KINDS[kind].job_class)
    except ModuleNotFoundError as error:
        raise InvalidInput([missing_extra(kind, error)]) from None
    commands = (found.submit_command, found.cancel_command, KINDS[kind].living[0])
    missing = [command for command in commands if not shutil.which(command)]
    if missing:
        raise InvalidInput(
            [f"cluster: kind '{kind}' needs the command {missing[0]}, which is not found; start where it is"]
        )
    return found


@contextmanager
def _hearing_as_before() -> Iterator[None]:
    """Keep the answer to Ctrl-C: dask-jobqueue, when imported, puts one in its place that ends the process at once."""
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def missing_extra(kind: str, error: ModuleNotFoundError) -> str:
    """Return the sentence for a package that is not installed."""
    return (
        f"cluster: kind '{kind}' needs {error.name}, which is not installed; "
        "install the extra, in the program's folder: pip install --constraint constraints.txt --editable '.[cluster]'"
    )


def _log_folder(jobs: QueueJobs) -> Path:
    """Return the folder for what jobs say, made if need be; raise InvalidInput where it cannot be."""
    folder = jobs.log_folder.resolve()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput([f"cluster.job.log_folder: {folder} cannot be made: {error.strerror}"]) from None
    return folder


def _secured(folder: Path) -> tuple[Security, dict[str, Any]]:
    """Return keys made for this run, and the words that lead jobs to them in a folder of which only the user reads.

    Whoever else is on the network of a cluster cannot reach the scheduler without them: it does what it is told.
    """
    security, files = Security.temporary(), dict[str, Path]()
    for key, text in security.get_tls_config_for_role("worker").items():
        if key != "ciphers":
            files[key] = folder / f"{key}.pem"
            files[key].touch(mode=0o600)
            files[key].write_text(text)
    of_jobs = Security(
        tls_ca_file=str(files["ca_file"]),
        tls_worker_cert=str(files["cert"]),
        tls_worker_key=str(files["key"]),
        require_encryption=True,
    )
    return security, {"security": of_jobs, "protocol": TLS}


def _described(jobs: QueueJobs, environment: Mapping[str, Any]) -> dict[str, Any]:
    """Return a job as dask-jobqueue describes it."""
    minutes, seconds = divmod(round(60.0 * jobs.walltime), 60)
    # Dask draws the life of a worker evenly from around the middle that it is given.
    spread = 0.5 * STAGGER * jobs.lifetime
    life = ["--lifetime", f"{jobs.lifetime - spread:.0f}s", "--lifetime-stagger", f"{spread:.0f}s"]
    # A worker has its environment from its nanny, and that from its configuration.
    nanny = f"export DASK_DISTRIBUTED__NANNY__PRE_SPAWN_ENVIRON={shlex.quote(repr(dict(environment)))}"
    return {
        "job_name": NAME,
        "cores": jobs.cores,
        "processes": jobs.cores,
        "memory": f"{jobs.memory}GiB",
        "walltime": f"{minutes // 60:02d}:{minutes % 60:02d}:{seconds:02d}",
        "queue": jobs.queue,
        "account": jobs.account,
        "job_extra_directives": list(jobs.directives),
        "job_script_prologue": [*jobs.prologue, nanny, f"cd {shlex.quote(os.getcwd())}"],
        "interface": jobs.interface,
        "worker_extra_args": ["--no-dashboard", *life],
    }
