"""A study in jobs of a real SLURM of one node, and what is told where that does not work."""

import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.cluster.demonstration import CHUNKS, demonstrate, sweep
from tests.cluster.slurm import NotStarted, Slurm, missing, one_node
from tests.pipeline.studies import PATIENCE, ended, journal

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())

#: One small job.
JOB = ("study=smoke", "cluster=slurm", "cluster.job.count=1", "cluster.job.cores=1", "cluster.job.memory_gib=1")


@pytest.fixture(scope="module")
def slurm() -> Iterator[Slurm]:
    with ExitStack() as started:
        try:
            slurm = started.enter_context(one_node())
        except NotStarted as error:
            pytest.skip(f"needs a machine on which a SLURM starts: {error}")
        yield slurm


def test_a_study_whose_only_job_is_cancelled_is_the_serial_one_bit_for_bit(slurm: Slurm, tmp_path: Path) -> None:
    shown = demonstrate(slurm, tmp_path, print)
    assert 0 < shown.done < CHUNKS, "the job was cancelled too late for this to be a test"
    assert shown.code == 0, shown.told
    assert shown.differing == []
    assert shown.left == []
    before, after = shown.jobs
    assert f"job {before} has ended\njob {after} is submitted in its place\n" in shown.told
    computed = [(*event["outer"], *event["speeds"]) for event in journal(tmp_path / "slurm", "chunk")]
    assert len(computed) == len(set(computed)) == CHUNKS


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("cluster.job.queue=nowhere",), 2, "cluster.job: the queue refuses a job: sbatch: error: invalid partition"),
        (
            ("cluster.job.directives=[--hold]", "cluster.patience_s=2"),
            1,
            "cluster: no worker came within 2 s (cluster.patience_s); in the queue: ",
        ),
        (
            (
                "cluster.job.count=3",
                "cluster.job.prologue=[echo the module is not there >&2, exit 1]",
            ),
            1,
            "cluster: 3 jobs in a row ended before a worker came; its last words, in ",
        ),
    ],
)
def test_jobs_that_never_bring_a_worker_are_told_in_one_sentence_and_not_left_behind(
    slurm: Slurm, tmp_path: Path, words: tuple[str, ...], code: int, message: str
) -> None:
    with ended(sweep(slurm, tmp_path / "study", *JOB, *words)) as run:
        _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == code, told
    assert message in told
    assert "Traceback" not in told
    assert slurm.left() == []


def test_ctrl_c_ends_the_wait_for_a_worker_and_cancels_what_was_waited_for(slurm: Slurm, tmp_path: Path) -> None:
    with ended(sweep(slurm, tmp_path / "study", *JOB, "cluster.job.directives=[--hold]")) as run:
        assert run.stderr is not None
        waiting = next(line for line in run.stderr if line.startswith("waiting for the first worker, 1"))
        assert slurm.jobs() == [waiting.split()[-1]]
        run.send_signal(signal.SIGINT)
        _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 130, told
    assert "Go on with: python -m pipeline sweep study=smoke cluster=slurm" in told
    assert slurm.left() == []
