"""Jobs as they are submitted, kept and replaced: their scripts, and a queue that stands in for PBS."""

import json
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from dask_jobqueue.pbs import PBSJob
from dask_jobqueue.slurm import SLURMJob
from distributed import Client
from distributed.security import Security

from chatter_core.variables import STATUS
from pipeline import queue_jobs
from pipeline.cluster import WORKER_ENVIRONMENT
from pipeline.command_line import main
from pipeline.configuration import compose_settings, sort_words
from tests.cluster import standin_pbs
from tests.pipeline.standins import BAD_PRELOAD, BAD_SPEED, GATE
from tests.pipeline.studies import CHUNKS, PATIENCE, POLL, ended, journal, lobes, sweep, sweep_process, wait_until

#: A job of which everything is said.
WORDS = (
    "cluster.job.cores=4",
    "cluster.job.memory_gib=10",
    "cluster.job.walltime_min=90",
    "cluster.job.drain_s=300",
    "cluster.job.queue=fast",
    "cluster.job.account=shop",
    "cluster.job.directives=[--constraint=haswell, --exclusive]",
    "cluster.job.prologue=[export LOADED=yes]",
    "cluster.job.interface=lo",
)


def script(job_class: type, kind: str, *words: str) -> str:
    """Return the script of a job of the smoke study."""
    cluster = compose_settings(sort_words(["study=smoke", f"cluster={kind}", *words], ())).cluster
    described = queue_jobs._described(cluster.job, WORKER_ENVIRONMENT)
    return str(job_class(scheduler="tls://192.0.2.1:8786", name="job1", **described).job_script())


@pytest.mark.parametrize(
    ("job_class", "kind", "directives"),
    [
        (
            SLURMJob,
            "slurm",
            [
                "#SBATCH -J chatter",
                "#SBATCH -p fast",
                "#SBATCH -A shop",
                "#SBATCH -n 1",
                "#SBATCH --cpus-per-task=4",
                "#SBATCH --mem=10G",
                "#SBATCH -t 01:30:00",
                "#SBATCH --constraint=haswell",
                "#SBATCH --exclusive",
            ],
        ),
        (
            PBSJob,
            "pbs",
            [
                "#PBS -N chatter",
                "#PBS -q fast",
                "#PBS -A shop",
                "#PBS -l select=1:ncpus=4:mem=10GB",
                "#PBS -l walltime=01:30:00",
                "#PBS --constraint=haswell",
                "#PBS --exclusive",
            ],
        ),
    ],
)
def test_a_job_is_asked_for_as_it_is_described(job_class: type, kind: str, directives: list[str]) -> None:
    written = script(job_class, kind, *WORDS)
    assert [line for line in written.splitlines() if line.startswith(("#SBATCH", "#PBS"))] == directives
    assert "--nthreads 1 --memory-limit 2.50GiB --nworkers 4 --nanny" in written
    # A worker has it from its nanny, and that from its configuration.
    [environment] = [word for word in shlex.split(written) if "NANNY__PRE_SPAWN_ENVIRON" in word]
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        assert f"'{name}': 1" in environment
    assert "--interface lo" in written


def test_workers_leave_before_their_job_is_ended() -> None:
    written = script(SLURMJob, "slurm", *WORDS)
    [life], [stagger] = (re.findall(rf"--{name} ([0-9]+)s", written) for name in ("lifetime", "lifetime-stagger"))
    # Dask draws a life evenly between the one less the other and the sum of both [s].
    assert int(life) + int(stagger) == 90 * 60 - 300
    assert int(stagger) > 0


def test_workers_have_the_environment_of_local_ones_and_what_the_prologue_says() -> None:
    *head, _ = script(SLURMJob, "slurm", *WORDS).strip().splitlines()
    asked = "import dask, distributed, json, os; " + (
        "print(json.dumps([dask.config.get('distributed.nanny.pre-spawn-environ'), os.environ['LOADED'], os.getcwd()]))"
    )
    ran = subprocess.run(["bash", "-c", "\n".join([*head, f'{sys.executable} -c "{asked}"'])], capture_output=True)
    environment, loaded, place = json.loads(ran.stdout)
    assert environment == WORKER_ENVIRONMENT
    assert (loaded, place) == ("yes", str(Path.cwd()))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("cluster=local", "cluster.kind=slurm"), "cluster.job: needed for kind 'slurm' or 'pbs', and only there"),
        (("cluster=slurm", "cluster.kind=local"), "cluster.job: needed for kind 'slurm' or 'pbs', and only there"),
        (
            ("cluster=slurm", "cluster.workers=8"),
            "cluster.workers: not allowed for kind 'slurm'; say job.count and job.cores",
        ),
        (
            ("cluster=pbs", "cluster.job.drain_s=3241"),
            "cluster.job.drain_s: found 3241 of a walltime of 3600 s, allowed: at most 0.9 of it",
        ),
        (
            ("cluster=slurm", "cluster.time_limit_s=1800"),
            "cluster.time_limit_s: found 1800, allowed: at most half of the 3480 s that a worker lives "
            "(job.walltime_min less job.drain_s)",
        ),
        (("cluster=slurm", "cluster.job.walltime_min=1h"), "cluster.job.walltime_min: found '1h', allowed: "),
        (("cluster=slurm", "cluster.job.quue=fast"), "cluster.job.quue: unknown key; did you mean queue?"),
        (("cluster=slurm", "cluster.job.queue=a b"), "cluster.job.queue: found 'a b', allowed: "),
    ],
)
def test_what_cannot_be_a_job_is_told_in_one_sentence(
    words: tuple[str, ...],
    message: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "study=smoke", *words]) == 2
    [told] = capsys.readouterr().err.splitlines()
    assert told.startswith(f"error: {message}")
    assert list(tmp_path.iterdir()) == []


def test_a_package_or_command_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path))
    words = ["sweep", "study=smoke", "cluster=pbs"]
    assert main(words) == 2
    assert "kind 'pbs' needs the command qsub, which is not found; start where it is" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "dask_jobqueue.pbs", None)
    assert main(words) == 2
    assert "not installed; install the extra, in the program's folder: pip install" in capsys.readouterr().err


#: One job of two workers in the queue that stands in for PBS.
JOB = (
    "cluster=pbs",
    "cluster.job.count=1",
    "cluster.job.cores=2",
    "cluster.job.memory_gib=2",
    "cluster.job.interface=lo",
)


@pytest.fixture
def queue(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A queue whose jobs are processes of this machine, and a gate for the gated kernel."""
    (tmp_path / "queue").mkdir()
    for name, value in standin_pbs.install(tmp_path / "queue").items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv(GATE, str(tmp_path / "gate"))
    monkeypatch.setattr("pipeline.report.write", lambda output: [])


@pytest.mark.usefixtures("queue")
def test_jobs_of_pbs_are_replaced_and_the_study_is_the_serial_one(tmp_path: Path) -> None:
    output = tmp_path / "study"
    with ended(sweep_process(output, *JOB, kernel="gated")) as run:
        # Half of the chunks are done, and both workers are in the midst of others, when their job is gone.
        wait_until(lambda: len(journal(output, "chunk")) == CHUNKS // 2, run)
        [before] = living()
        subprocess.run(["qdel", before], check=True)
        wait_until(lambda: set(living()) - {before} != set(), run)
        (tmp_path / "gate").touch()
        _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, told
    assert re.search(r"job [0-9]+ has ended\njob [0-9]+ is submitted in its place\n", told)
    wait_for_an_empty_queue()
    assert len(journal(output, "chunk")) == CHUNKS
    assert sweep(tmp_path / "serial") == 0
    xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(tmp_path / "serial").drop_attrs())


@pytest.mark.usefixtures("queue")
def test_a_study_outlives_its_workers(tmp_path: Path) -> None:
    output, speeds = tmp_path / "study", "grid.spindle_speed_rpm={start: 8000, stop: 13000, count: 32}"
    # A worker lives for 12 s at most, and 64 chunks take it 12.8 s at least.
    life = ("cluster.job.walltime_min=1", "cluster.job.drain_s=48", "cluster.time_limit_s=null")
    with ended(sweep_process(output, speeds, *JOB, *life, "cluster.job.cores=1")) as run:
        _, told = run.communicate(timeout=2.0 * PATIENCE)
    assert run.returncode == 0, told
    assert re.search(r"job [0-9]+ has ended\njob [0-9]+ is submitted in its place\n", told)
    assert sweep(tmp_path / "serial", speeds) == 0
    xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(tmp_path / "serial").drop_attrs())


@pytest.mark.usefixtures("queue")
def test_a_speed_that_hangs_in_a_job_is_marked_and_no_other(tmp_path: Path) -> None:
    output, one = tmp_path / "study", "grid.mode_count=[1]"
    with ended(sweep_process(output, one, *JOB, "cluster.time_limit_s=1", kernel="hanging")) as run:
        _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1, told
    found = lobes(output)
    bad = (found["preload"] == BAD_PRELOAD) & (found["spindle_speed"] < BAD_SPEED)
    expected = xr.where(bad, STATUS["timed_out"], STATUS["ok"]).broadcast_like(found["status"])
    np.testing.assert_array_equal(found["status"], expected.transpose(*found["status"].dims))


@pytest.mark.usefixtures("queue")
def test_a_killed_run_leaves_no_job_behind_and_its_scheduler_listens_to_nobody_else(tmp_path: Path) -> None:
    output = tmp_path / "study"
    with ended(sweep_process(output, *JOB, kernel="gated")) as run:
        wait_until(lambda: len(journal(output, "chunk")) == CHUNKS // 2, run)
        script = next((tmp_path / "queue").glob("script-*")).read_text()
        [address] = re.findall(r"tls://[0-9.:]+", script)[:1]
        with pytest.raises(OSError, match=r"(?i)ssl|tls|certificate|closed|timed out"):
            Client(address, security=Security.temporary(), timeout=5)
        keys = next((tmp_path / "results" / "jobs").glob(".keys-*"))
        assert {file.stat().st_mode & 0o777 for file in [keys, *keys.iterdir()]} == {0o700, 0o600}
        run.kill()
        run.wait()
        (tmp_path / "gate").touch()
    wait_for_an_empty_queue()


def wait_for_an_empty_queue() -> None:
    """Wait until no job is left: one that is cancelled takes its time to end."""
    end = time.monotonic() + PATIENCE
    while living():
        assert time.monotonic() < end
        time.sleep(POLL)


def living() -> list[str]:
    """Return the numbers of the jobs that have not ended."""
    said = subprocess.run(["qselect", "-u", "me"], capture_output=True, text=True, check=True).stdout
    return [line.partition(".")[0] for line in said.splitlines()]


def test_a_look_at_the_jobs_that_fails_is_not_the_last(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    kept = queue_jobs.KeptJobs(queue_jobs.Arrivals(), "slurm", 1, lambda name: None, tmp_path)
    looked = list[set[str]]()

    def replace(living: set[str]) -> None:
        looked.append(living)
        if len(looked) == 1:
            raise OSError(116, "Stale file handle")
        kept._over.set()

    monkeypatch.setattr("pipeline.queue_jobs.LOOK", 0.0)
    monkeypatch.setattr("pipeline.queue_jobs._living", lambda kind: {"17"})
    monkeypatch.setattr(kept, "_replace", replace)
    kept._watch()
    assert looked == [{"17"}] * 2
    assert "the jobs could not be looked after" in capsys.readouterr().err
