"""A study in a job of a SLURM that is cancelled midway: what the test checks and ``make slurm`` shows."""

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline import store
from pipeline.places import Folder
from tests.cluster.slurm import Slurm
from tests.pipeline.studies import PATIENCE, ROOT, ended, journal, wait_until

#: The smoke study by the textbook's method, which takes long enough to be disturbed: 52 chunks.
STUDY = ("study=smoke", "method=semi_discretization", "method.intervals=120", "cluster.cells_per_task=12")
CHUNKS = 52
#: One job with two workers: when it is cancelled there is nothing left to compute with.
JOBS = (
    "cluster=slurm",
    "cluster.job.count=1",
    "cluster.job.cores=2",
    "cluster.job.memory_gib=2",
    "cluster.job.interface=lo",
)


@dataclass(frozen=True, kw_only=True)
class Shown:
    """What became of a study whose job was cancelled.

    code: exit code; done: chunks before the job was cancelled; jobs: in the queue before, and after it was replaced;
    told: what the run said; differing: arrays that are not those of the serial run, bit for bit; left: jobs in the
    queue when all was over.
    """

    code: int
    done: int
    jobs: tuple[str, str]
    told: str
    differing: list[str]
    left: list[str]

    @property
    def held(self) -> bool:
        """Whether the study was disturbed midway, completed nevertheless, and shows nothing of it."""
        return 0 < self.done < CHUNKS and self.code == 0 and not self.differing and not self.left


def sweep(slurm: Slurm, output: Path, *words: str) -> subprocess.Popen[str]:
    """Start a sweep where a SLURM can be reached."""
    return subprocess.Popen(
        [sys.executable, "-m", "pipeline", "sweep", *words, f"output={output}"],
        cwd=output.parent,
        env={**slurm.environment, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def demonstrate(slurm: Slurm, folder: Path, tell: Callable[[str], None]) -> Shown:
    """Compute a study serially, and in a job that is cancelled as soon as it has computed something."""
    tell("the smoke study in a process alone, to compare with")
    with ended(sweep(slurm, folder / "serial", *STUDY, "cluster=serial")) as serial:
        _, told = serial.communicate(timeout=PATIENCE)
    assert serial.returncode == 0, told
    tell("the same study in a job of two workers")
    with ended(sweep(slurm, folder / "slurm", *STUDY, *JOBS)) as run:
        wait_until(lambda: len(journal(folder / "slurm", "chunk")) > 0, run)
        [before] = slurm.jobs()
        slurm.ask("scancel", before)
        done = len(journal(folder / "slurm", "chunk"))
        tell(f"job {before} is cancelled after {done} of {CHUNKS} chunks")
        wait_until(lambda: len(set(slurm.jobs()) - {before}) > 0, run)
        [after] = set(slurm.jobs()) - {before}
        tell(f"job {after} has taken its place")
        _, told = run.communicate(timeout=PATIENCE)
    return Shown(
        code=run.returncode,
        done=done,
        jobs=(before, after),
        told=told,
        differing=differing(folder / "serial", folder / "slurm"),
        left=slurm.left(),
    )


def differing(one: Path, other: Path) -> list[str]:
    """Return the arrays of two studies that are not the same, bit for bit."""
    with store.open_lobes(Folder(one)) as first, store.open_lobes(Folder(other)) as second:
        assert set(first.variables) == set(second.variables)
        return [str(name) for name in first.variables if not _same(first[name].values, second[name].values)]


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether two arrays have the same bits; words, which have none of their own, are compared as such."""
    if one.dtype.kind in "fiub":
        return one.dtype == other.dtype and one.tobytes() == other.tobytes()
    return np.array_equal(one, other)
