"""A SLURM of one node on this machine, from Debian's packages, with everything that it writes in one folder."""

import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

#: What it takes, by Debian's packages slurm-wlm and munge.
COMMANDS = ("slurmctld", "slurmd", "munged", "sbatch", "squeue", "scancel", "sinfo")
#: A daemon that has not come up within so long never will [s]; no result depends on it.
PATIENCE = 30.0
#: Seconds between two looks.
POLL = 0.1
#: Processors and memory [MiB] that the node says it has, whatever the machine has: jobs share what there is.
PROCESSORS, MEMORY = 4, 4096

CONFIGURATION = """
ClusterName=alone
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={controller_port}
SlurmdPort={node_port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.socket
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1
MpiDefault=none
KillWait=5
ReturnToService=2
NodeName={host} NodeAddr=127.0.0.1 CPUs={processors} RealMemory={memory} State=UNKNOWN
PartitionName=all Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


class NotStarted(Exception):
    """A daemon did not come up; what the daemons said."""


@dataclass(frozen=True)
class Slurm:
    """A SLURM that runs: the environment in which its commands find it."""

    environment: dict[str, str]

    def ask(self, *words: str) -> list[str]:
        """Return what a command answers, line by line."""
        done = subprocess.run(words, env=self.environment, capture_output=True, text=True, check=True)
        return done.stdout.split("\n")[:-1]

    def jobs(self) -> list[str]:
        """Return the jobs that have not ended."""
        return self.ask("squeue", "--noheader", "--format=%i")

    def left(self) -> list[str]:
        """Return the jobs that are there when those that are cancelled have had their time to end."""
        end = time.monotonic() + PATIENCE
        while self.jobs() and time.monotonic() < end:
            time.sleep(POLL)
        return self.jobs()


def missing() -> str:
    """Return what this machine lacks, "" where a SLURM can be started."""
    lacking = [command for command in COMMANDS if not shutil.which(command)]
    if lacking:
        return f"needs {lacking[0]}: as root, apt-get install slurm-wlm munge"
    return "" if os.geteuid() == 0 else "needs root, to start the daemons of a SLURM"


@contextmanager
def one_node() -> Iterator[Slurm]:
    """Start a SLURM, and end it with all that it runs."""
    # Not in a test's own folder: the path of a socket has at most 107 characters.
    with TemporaryDirectory(prefix="slurm-") as place, ExitStack() as started:
        folder = Path(place)
        for name in ("state", "spool"):
            (folder / name).mkdir()
        key = folder / "munge.key"
        key.touch(mode=0o400)
        key.write_bytes(os.urandom(128))
        configuration = folder / "slurm.conf"
        configuration.write_text(
            CONFIGURATION.format(
                folder=folder,
                host=socket.gethostname().partition(".")[0],
                controller_port=_free_port(),
                node_port=_free_port(),
                processors=PROCESSORS,
                memory=MEMORY,
            )
        )
        slurm = Slurm({**os.environ, "SLURM_CONF": str(configuration)})
        files = [f"--{name}-file={folder}/munge.{name}" for name in ("key", "pid", "log", "seed")]
        started.enter_context(
            _daemon(slurm, folder, "munged", "--foreground", "--force", f"--socket={folder}/munge.socket", *files)
        )
        _wait(lambda: (folder / "munge.socket").exists(), folder)
        started.enter_context(_daemon(slurm, folder, "slurmctld", "-D"))
        started.enter_context(_daemon(slurm, folder, "slurmd", "-D"))
        _wait(lambda: _answer(slurm) == ["idle"], folder)
        try:
            yield slurm
        finally:
            subprocess.run(["scancel", "--user=root"], env=slurm.environment, check=True)
            _wait(lambda: not slurm.jobs(), folder)


@contextmanager
def _daemon(slurm: Slurm, folder: Path, *words: str) -> Iterator[None]:
    """Run a daemon, and end it."""
    with (folder / f"{words[0]}.said").open("w") as said:
        process = subprocess.Popen(words, env=slurm.environment, stdout=said, stderr=said, start_new_session=True)
    try:
        yield
    finally:
        process.terminate()
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


def _answer(slurm: Slurm) -> list[str]:
    """Return the state of the node, nothing while the controller does not answer."""
    try:
        return slurm.ask("sinfo", "--noheader", "--format=%T")
    except subprocess.CalledProcessError:
        return []


def _wait(done: Callable[[], bool], folder: Path) -> None:
    """Wait until something is done; raise NotStarted, with what the daemons said, where it is not."""
    end = time.monotonic() + PATIENCE
    while not done():
        if time.monotonic() > end:
            said = [*folder.glob("*.said"), *folder.glob("*.log")]
            raise NotStarted("; ".join(f"{file.name}: {file.read_text()[-300:]}" for file in said))
        time.sleep(POLL)


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])
