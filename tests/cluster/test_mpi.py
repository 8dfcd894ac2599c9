"""A study in the processes of an MPI run, one of whose workers is killed by what it computes."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from chatter_core.variables import STATUS
from pipeline.command_line import main
from tests.pipeline.standins import BAD_PRELOAD, BAD_SPEED
from tests.pipeline.studies import CHUNKS, PATIENCE, ROOT, ended, journal, lobes, sweep, sweep_process

#: A scheduler, a driver and one worker.
LAUNCHER = ("mpirun", "--oversubscribe", "-n", "3")

needs_mpi = pytest.mark.skipif(
    shutil.which("mpirun") is None, reason="needs mpirun: as root, apt-get install openmpi-bin"
)


@pytest.fixture(autouse=True)
def _allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let Open MPI run as root, and where one process may not read another's memory."""
    for name in ("OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("OMPI_MCA_btl_vader_single_copy_mechanism", "none")


@needs_mpi
def test_a_speed_that_kills_its_worker_is_marked_and_all_others_are_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, one = tmp_path / "study", "grid.mode_count=[1]"
    with ended(sweep_process(output, one, "cluster=mpi", kernel="deadly", launcher=LAUNCHER)) as run:
        _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 1, told
    assert "Traceback" not in told
    assert len(journal(output, "chunk")) == CHUNKS // 2
    monkeypatch.setattr("pipeline.report.write", lambda output: [])
    assert sweep(tmp_path / "serial", one) == 0
    found, serial = lobes(output), lobes(tmp_path / "serial")
    bad = (found["preload"] == BAD_PRELOAD) & (found["spindle_speed"] < BAD_SPEED)
    expected = xr.where(bad, STATUS["worker_lost"], serial["status"]).transpose(*found["status"].dims)
    np.testing.assert_array_equal(found["status"], expected)
    xr.testing.assert_identical(
        found["spectral_radius"].drop_attrs(),
        serial["spectral_radius"].where(~bad).transpose(*found["spectral_radius"].dims).drop_attrs(),
    )


@pytest.mark.parametrize(
    ("launcher", "word", "message"),
    [
        (LAUNCHER, "study=smok", "study: found 'smok'; did you mean smoke?"),
        (
            (),
            "study=smoke",
            "cluster: kind 'mpi' takes 3 processes at least, a scheduler, a driver and workers; found 1. "
            "Say: mpirun -n 4 python -m pipeline ...",
        ),
    ],
    ids=["a misspelt study", "no mpirun"],
)
@needs_mpi
def test_bad_input_is_told_once_and_ends_all_processes(
    tmp_path: Path, launcher: tuple[str, ...], word: str, message: str
) -> None:
    run = subprocess.run(
        [*launcher, sys.executable, "-m", "pipeline", "sweep", word, "cluster=mpi", f"output={tmp_path / 'study'}"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
    )
    assert run.returncode == 2
    assert [line for line in run.stderr.splitlines() if line.startswith("error: ")] == [f"error: {message}"]
    assert "Traceback" not in run.stderr
    assert list(tmp_path.iterdir()) == []


def test_the_scheduler_is_not_looked_for_where_there_is_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", "study=smoke", f"output={tmp_path / 'study'}", "cluster.kind=mpi"]) == 2
    assert "cluster: kind 'mpi' is asked for by cluster=mpi, and not by cluster.kind" in capsys.readouterr().err


def test_a_package_that_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "dask_mpi", None)
    assert main(["sweep", "study=smoke", "cluster=mpi", f"output={tmp_path / 'study'}"]) == 2
    assert "install the extra, in the program's folder: pip install" in capsys.readouterr().err
    assert not (tmp_path / "study").exists()
