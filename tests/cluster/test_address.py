"""Workers by the address of a scheduler: one joins, one leaves midway, and no chunk is lost."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
import xarray as xr
from distributed import Client

from tests.pipeline.standins import GATE
from tests.pipeline.studies import CHUNKS, PATIENCE, ROOT, ended, journal, lobes, sweep, sweep_process, wait_until


@contextmanager
def process(folder: Path, name: str, *words: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a scheduler or a worker of Dask, as its documentation says, in a process group of its own."""
    with (folder / f"{name}.log").open("w") as log:
        started = subprocess.Popen(
            [sys.executable, "-m", *words],
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT)},
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
    with ended(started):
        yield started


@pytest.mark.parametrize("way", ["killed", "retired"])
def test_a_worker_joins_another_leaves_and_no_chunk_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, way: str
) -> None:
    monkeypatch.setattr("pipeline.report.write", lambda output: [])
    file, output, gate = tmp_path / "scheduler.json", tmp_path / "study", tmp_path / "gate"
    monkeypatch.setenv(GATE, str(gate))
    scheduler = ("distributed.cli.dask_scheduler", "--host=127.0.0.1", "--port=0", "--dashboard-address=127.0.0.1:0")
    worker = ("distributed.cli.dask_worker", "--host=127.0.0.1", "--nthreads=1", "--no-dashboard")
    with ExitStack() as started:
        serving = started.enter_context(process(tmp_path, "scheduler", *scheduler, f"--scheduler-file={file}"))
        wait_until(lambda: file.exists() and bool(file.read_text().strip()), serving)
        address = json.loads(file.read_text())["address"]
        first = started.enter_context(process(tmp_path, "first", *worker, "--name=first", address))
        run = started.enter_context(
            ended(sweep_process(output, "cluster=address", f"cluster.address={address}", kernel="gated"))
        )
        # Half of the chunks are done, and the worker is in the midst of one of the others.
        wait_until(lambda: len(journal(output, "chunk")) == CHUNKS // 2, run)
        started.enter_context(process(tmp_path, "second", *worker, "--name=second", address))
        with Client(address) as client:
            client.wait_for_workers(2, timeout=PATIENCE)
            wait_until(lambda: all(client.processing().values()), run)
            if way == "killed":
                os.killpg(first.pid, signal.SIGKILL)
            else:
                client.retire_workers(names=["first"], close_workers=True)
            wait_until(lambda: len(client.nthreads()) == 1, run)
        assert len(journal(output, "chunk")) == CHUNKS // 2
        gate.touch()
        _, told = run.communicate(timeout=PATIENCE)
    assert run.returncode == 0, told
    assert len(journal(output, "chunk")) == CHUNKS
    assert sweep(tmp_path / "serial") == 0
    xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(tmp_path / "serial").drop_attrs())
