"""Runs in trouble: Ctrl-C in a terminal or its end, a worker lost or all of them, a second run."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest
import xarray as xr

from chatter_core.variables import STATUS
from pipeline import cluster, store
from pipeline.chunks import Chunk
from pipeline.cluster import Workers
from pipeline.command_line import main
from pipeline.errors import WorkersLost
from pipeline.stopping import SIGNALS, heard, signals
from tests.pipeline.standins import BAD_PRELOAD, BAD_SPEED, GATE
from tests.pipeline.studies import CHUNKS, PATIENCE, ended, journal, lobes, sweep, sweep_process, wait_until


def finished_chunks(output: Path) -> list[Chunk]:
    group = store.zarr.open_group(output / "lobes.zarr", mode="r")
    return [chunk for chunk in store.chunks(group) if store.status_of(group, chunk).all()]


@pytest.fixture(autouse=True)
def hears_signals() -> Iterator[None]:
    """Hear what a program hears that is started by hand: under ``nohup``, or behind ``&``, tests would not."""
    before = {number: signal.signal(number, signal.SIG_DFL) for number in SIGNALS if not heard(number)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    output = tmp_path_factory.mktemp("reference") / "study"
    assert sweep(output) == 0
    return lobes(output)


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -9), (signal.SIGTERM, 143)])
def test_an_interrupted_run_goes_on_to_the_same_store(
    tmp_path: Path, reference: xr.Dataset, number: int, code: int
) -> None:
    output = tmp_path / "study"
    process = sweep_process(output, "cluster=serial")
    wait_until(lambda: len(journal(output, "chunk")) >= 2, process)
    process.send_signal(number)
    process.communicate(timeout=PATIENCE)
    assert process.returncode == code
    assert 0 < len(finished_chunks(output)) < CHUNKS
    assert sweep(output) == 0
    xr.testing.assert_identical(lobes(output).drop_attrs(), reference.drop_attrs())


def test_ctrl_c_in_a_terminal_ends_a_run_with_worker_processes_in_good_order(
    tmp_path: Path, reference: xr.Dataset
) -> None:
    output = tmp_path / "study"
    process = sweep_process(output, "cluster=local", "cluster.workers=1")
    try:
        wait_until(lambda: len(journal(output, "chunk")) >= 2, process)
        # To the whole group, workers and all, as a terminal does.
        os.killpg(process.pid, signal.SIGINT)
        _, told = process.communicate(timeout=PATIENCE)
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "Traceback" not in told
    assert "Go on with: python -m pipeline sweep" in told
    assert len(journal(output, "stopped")) == 1
    done = len(finished_chunks(output))
    assert len(journal(output, "chunk")) == done < CHUNKS
    assert sweep(output) == 0
    assert len(journal(output, "chunk")) == CHUNKS
    xr.testing.assert_identical(lobes(output).drop_attrs(), reference.drop_attrs())


def test_a_closed_terminal_ends_a_run_as_a_signal_does(tmp_path: Path, reference: xr.Dataset) -> None:
    """Whose ssh connection is lost finds in the journal how to go on."""
    output, (ours, theirs) = tmp_path / "study", os.openpty()
    os.set_blocking(ours, False)
    process = sweep_process(output, "cluster=local", "cluster.workers=1", terminal=theirs)
    os.close(theirs)

    def two_done() -> bool:
        with suppress(BlockingIOError):
            # Somebody has to read what a terminal shows.
            os.read(ours, 65536)
        return len(journal(output, "chunk")) >= 2

    with ended(process):
        wait_until(two_done, process)
        # From here on what is written to it is an error, and the whole session is told.
        os.close(ours)
        assert process.wait(PATIENCE) == 128 + signal.SIGHUP
    (stopped,) = journal(output, "stopped")
    assert stopped["signal"] == "SIGHUP"
    assert stopped["again"] == f"python -m pipeline sweep output={output} cluster=local cluster.workers=1"
    assert len(journal(output, "chunk")) == len(finished_chunks(output)) < CHUNKS
    assert sweep(output) == 0
    assert len(journal(output, "chunk")) == CHUNKS
    xr.testing.assert_identical(lobes(output).drop_attrs(), reference.drop_attrs())


def test_a_closed_terminal_that_is_told_of_twice_asks_for_the_end_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """An interactive shell passes the signal on to what it runs, and the kernel sends it again when the shell ends."""
    monkeypatch.setattr("pipeline.stopping.leave_terminal", lambda: None)
    with signals() as stopping:
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGHUP)
        assert stopping.number == signal.SIGHUP
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)


def test_what_a_terminal_sends_while_workers_start_is_heard_by_the_run_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.stopping.leave_terminal", lambda: None)
    with signals() as stopping:
        with cluster._starting_deaf():
            signal.raise_signal(signal.SIGHUP)
            told = subprocess.run(["sh", "-c", "kill -INT $$; kill -HUP $$; echo deaf"], capture_output=True, text=True)
        assert stopping.number == signal.SIGHUP
    assert told.stdout == "deaf\n"


#: Tells of its one worker whether it hears Ctrl-C and the end of a terminal before any plugin speaks to it.
HEARING = """
import signal
from pathlib import Path
from pipeline import cluster

if __name__ == "__main__":
    with cluster._starting_deaf(), cluster._started_here(processes=True, count=1) as started:
        (nanny,) = started.workers.values()
        said = Path(f"/proc/{nanny.pid}/status").read_text().split("SigBlk:")[1].split()[0]
        print([number.name for number in cluster.OF_TERMINALS if not int(said, 16) & 1 << number - 1])
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="asks Linux what a process hears")
def test_workers_hear_no_terminal_from_their_first_moment(tmp_path: Path) -> None:
    """The process that starts them starts other things, too, which may unblock what was blocked."""
    script = tmp_path / "hearing.py"
    script.write_text(HEARING)
    told = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=True)
    assert told.stdout == "[]\n"


@pytest.mark.parametrize(
    ("kernel", "status", "words"),
    [
        ("deadly", "worker_lost", ("cluster.workers=2",)),
        ("hanging", "timed_out", ("cluster.workers=1", "cluster.time_limit_s=1")),
    ],
)
def test_a_speed_that_costs_its_worker_is_marked_and_no_other(
    tmp_path: Path, kernel: str, status: str, words: tuple[str, ...]
) -> None:
    output, one = tmp_path / "study", "grid.mode_count=[1]"
    assert sweep(output, one, "cluster=local", *words, kernel=kernel) == 1
    found = lobes(output)
    bad = (found["preload"] == BAD_PRELOAD) & (found["spindle_speed"] < BAD_SPEED)
    expected = xr.where(bad, STATUS[status], STATUS["ok"]).broadcast_like(found["status"])
    np.testing.assert_array_equal(found["status"], expected.transpose(*found["status"].dims))
    assert sum(status in event["counts"] for event in journal(output, "chunk")) == 1
    assert sweep(output, one, retry_failed=True) == 0
    assert (lobes(output)["status"] == STATUS["ok"]).all()


def test_a_second_run_is_refused_and_told_who_works_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    output, gate = tmp_path / "study", tmp_path / "gate"
    monkeypatch.setenv(GATE, str(gate))
    first = sweep_process(output, "cluster=serial", kernel="gated")
    wait_until(lambda: len(journal(output, "chunk")) >= 1, first)
    second = sweep_process(output, "cluster=serial")
    _, told = second.communicate(timeout=PATIENCE)
    assert second.returncode == 3
    assert f"in use by process {first.pid} on " in told
    assert " since 2" in told
    assert "Traceback" not in told
    gate.touch()
    _, rest = first.communicate(timeout=PATIENCE)
    assert first.returncode == 0, rest
    assert len(journal(output, "chunk")) == CHUNKS


def test_workers_are_counted_as_they_come_and_none_is_not_waited_for_without_end(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    client = Mock()
    monkeypatch.setattr(cluster, "LOOK", 0.0)
    client.nthreads.return_value = {"one": 1}
    workers = Workers(client, patience=0.0)
    client.nthreads.return_value = {"one": 1, "another": 4}
    workers.look()
    assert workers.count == 5
    client.nthreads.return_value = {}
    with pytest.raises(WorkersLost, match="no worker for 0 s; nothing is lost, the same command goes on"):
        workers.look()
    # What was handed out to those that are gone stays theirs until they are given up.
    assert workers.count == 5


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_second_signal_ends_a_run_at_once_with_its_own_code(number: int, monkeypatch: pytest.MonkeyPatch) -> None:
    def twice(words: list[str]) -> int:
        with signals() as stopping:
            stopping(number, None)
            stopping(number, None)
        return 0

    monkeypatch.setattr("pipeline.template.run", twice)
    assert main(["template"]) == 128 + number


def test_a_signal_that_a_library_loses_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is raised in a function that a compiler calls back goes no farther."""
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(signal.SIGTERM))
    went_on = []

    def lost(words: list[str]) -> int:
        callback()
        went_on.append(True)
        threading.Event().wait(60.0)
        return 0

    monkeypatch.setattr("pipeline.template.run", lost)
    assert main(["template"]) == 143
    assert went_on
