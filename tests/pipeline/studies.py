"""A study of twelve small chunks, and how to run it with a kernel in the place of the physics."""

import fcntl
import json
import os
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import xarray as xr

from pipeline.configuration import compose_settings, words_for
from pipeline.execution import execute
from pipeline.places import Folder, place_of
from pipeline.settings import Settings
from pipeline.verbs.studies import SweepOptions

ROOT = Path(__file__).parents[2]
#: 2 preloads x 2 numbers of modes x 3 blocks of two speeds x 4 depths.
WORDS = (
    "study=smoke",
    "grid.spindle_speed_rpm={start: 8000, stop: 13000, count: 6}",
    "grid.axial_depth_mm=[0.5, 1.0, 1.5, 2.0]",
    "grid.preload_n=[100, 200]",
    "grid.mode_count=[1, 2]",
    "grid.modal_parameters=[dynamic]",
    "cluster.cells_per_task=8",
    "cluster=serial",
)
CHUNKS = 12
CELLS = 96
#: What has not come about after two minutes never will; no result depends on it [s].
PATIENCE = 120.0
#: Seconds between two looks.
POLL = 0.02


def study(*words: str) -> Settings:
    """Return the settings of the small study, changed by words (a word replaces one of the same key)."""
    keys = {word.partition("=")[0] for word in words}
    kept = [word for word in WORDS if word.partition("=")[0] not in keys]
    return compose_settings(words_for(SweepOptions, [*kept, *words]))


def sweep(output: Path, *words: str, kernel: str = "plain", retry_failed: bool = False, report: bool = False) -> int:
    """Run the small study in this process; its report would take longer than everything else."""
    kernel = f"tests.pipeline.standins:{kernel}"
    return execute(study(*words), Folder(output), retry_failed=retry_failed, kernel=kernel, report=report)


def run(words: list[str], kernel: str = "plain") -> int:
    """Run the small study in this process where words of a command line say, without its report."""
    place = place_of(words_for(SweepOptions, words).options)
    return execute(study(*words), place, argv=words, kernel=f"tests.pipeline.standins:{kernel}", report=False)


def sweep_process(
    output: Path, *words: str, kernel: str = "slow", launcher: tuple[str, ...] = (), terminal: int | None = None
) -> subprocess.Popen[str]:
    """Run the small study in a process of its own, in a process group of its own.

    launcher: what starts it; terminal: descriptor of the one that it speaks to and is closed with, pipes without one.
    """
    # Worker processes import the script again, and need none of this.
    script = (
        "if __name__ == '__main__':\n"
        "    import sys\n"
        "    from pipeline import sweep\n"
        "    from pipeline.command_line import main\n"
        "    from tests.pipeline.studies import run\n"
        f"    sweep.run = lambda words: run(words, kernel='{kernel}')\n"
        "    sys.exit(main(['sweep', *sys.argv[1:]]))\n"
    )
    file = output.parent / "run_sweep.py"
    file.write_text(script)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        [*launcher, sys.executable, str(file), f"output={output}", *words],
        cwd=output.parent,
        env=environment,
        stdin=terminal,
        stdout=subprocess.PIPE if terminal is None else terminal,
        stderr=subprocess.PIPE if terminal is None else terminal,
        text=True,
        start_new_session=True,
        preexec_fn=None if terminal is None else _take_terminal,
    )


def _take_terminal() -> None:
    """Make what this process reads from the terminal that its session belongs to."""
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@contextmanager
def ended(process: subprocess.Popen[Any]) -> Iterator[subprocess.Popen[Any]]:
    """Have a process, and the group that it leads, gone in the end, whatever a test finds."""
    try:
        yield process
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def wait_until(done: Callable[[], bool], process: subprocess.Popen[Any]) -> None:
    """Wait until something is so, while a process goes on."""
    end = time.monotonic() + PATIENCE
    while not done():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(POLL)


def lobes(output: Path) -> xr.Dataset:
    """Return a finished store, loaded."""
    with xr.open_zarr(output / "lobes.zarr", consolidated=False) as opened:
        return opened.load()


def journal(output: Path, event: str) -> list[dict[str, Any]]:
    """Return the events of one kind from the journal."""
    path = output / "journal.jsonl"
    events = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return [found for found in events if found["event"] == event]
