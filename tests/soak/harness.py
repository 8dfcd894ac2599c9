"""A study whose workers, driver, or all of it are killed at random moments, and which must not notice in the end."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

from tests.pipeline.studies import ROOT

#: Where the stand-in kernel writes a line for every chunk that it begins.
LOG = "SOAK_LOG"
#: What is killed.
VICTIMS = ("worker", "driver", "everything")
#: Seconds of work between two kills, drawn evenly.
BETWEEN = (0.3, 1.5)
#: A run that shows no chunk for so long has hung [s]; no result depends on it.
PATIENCE = 180.0
#: Seconds between two looks.
POLL = 0.02
#: Chunks that a worker has at hand: one in progress, and those handed out beside it.
AT_HAND = 4

# Worker processes import it again, and need none of this.
SCRIPT = """
if __name__ == "__main__":
    import sys
    from pathlib import Path
    from pipeline import execution, sweep
    from pipeline.command_line import main
    from pipeline.places import Folder
    from tests.pipeline.studies import study
    how = {"kernel": "tests.soak.kernel:logged", "report": False}
    sweep.run = lambda words: execution.execute(study(*words[1:]), Folder(Path(words[0])), **how)
    sys.exit(main(["sweep", *sys.argv[1:]]))
"""


@dataclass(frozen=True, kw_only=True)
class Soak:
    """What a soak has shown.

    kills: what was killed, in order; chunks: of the study; computed: how often chunks were begun; most_again: how
    often the chunk was that was begun most often; differing: files that are not those of the undisturbed store, bit
    for bit; workers.
    """

    kills: list[str]
    chunks: int
    computed: int
    most_again: int
    differing: list[str]
    workers: int

    @property
    def allowed(self) -> int:
        """Chunks that may be begun again: those in progress at each kill, on all workers."""
        return len(self.kills) * self.workers

    @property
    def passed(self) -> bool:
        """Whether nothing was lost, nothing differs, and no more was computed again than was in progress."""
        return not self.differing and self.chunks <= self.computed <= self.chunks + self.allowed


def words(speeds: int, workers: int) -> list[str]:
    """Return the words of a study of two chunks for each of the speeds."""
    return [
        f"grid.spindle_speed_rpm={{start: 8000, stop: 13000, count: {speeds}}}",
        "cluster=local",
        f"cluster.workers={workers}",
    ]


def soak(folder: Path, speeds: int, kills: int, seed: int, workers: int = 2) -> Soak:
    """Compute a study undisturbed, and again while it is killed so many times and resumed each time."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("undisturbed", "disturbed"):
        if (folder / name).exists():
            raise FileExistsError(f"{folder / name}: is there already; name an empty folder")
    process = _start(folder, "undisturbed", words(speeds, workers))
    _, told = process.communicate()
    assert process.returncode == 0, told
    random, done = np.random.default_rng(seed), list[str]()
    while True:
        process = _start(folder, "disturbed", words(speeds, workers))
        done += _disturb(process, folder, random, kills - len(done))
        _, told = process.communicate()
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL, told
    begun = Counter((folder / "disturbed.log").read_text().split())
    return Soak(
        kills=done,
        chunks=len(begun),
        computed=sum(begun.values()),
        most_again=max(begun.values()),
        differing=list(_differing(folder)),
        workers=workers,
    )


def _start(folder: Path, name: str, options: list[str]) -> subprocess.Popen[str]:
    """Start or resume a study in a process group of its own."""
    script = folder / "run.py"
    script.write_text(SCRIPT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT), LOG: str(folder / f"{name}.log")}
    return subprocess.Popen(
        [sys.executable, str(script), str(folder / name), *options],
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def _disturb(process: subprocess.Popen[str], folder: Path, random: np.random.Generator, most: int) -> list[str]:
    """Kill a run, or workers of it until the run itself; return what was killed."""
    killed = list[str]()
    while len(killed) < most:
        if not _works(process, folder / "disturbed.log"):
            return killed
        time.sleep(random.uniform(*BETWEEN))
        victim = str(random.choice(VICTIMS))
        if process.poll() is not None:
            return killed
        if victim == "worker":
            workers = [
                child for child in psutil.Process(process.pid).children() if "spawn_main" in " ".join(child.cmdline())
            ]
            if workers:
                workers[int(random.integers(len(workers)))].kill()
                killed.append(victim)
            continue
        if victim == "driver":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)
        return [*killed, victim]
    return killed


def _workers(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Return the worker processes of a run."""
    return [child for child in psutil.Process(process.pid).children() if "spawn_main" in " ".join(child.cmdline())]


def _works(process: subprocess.Popen[str], log: Path) -> bool:
    """Wait until another chunk is begun; return whether the run still goes on."""
    size = log.stat().st_size if log.exists() else 0
    end = time.monotonic() + PATIENCE
    while process.poll() is None:
        if log.exists() and log.stat().st_size > size:
            return True
        assert time.monotonic() < end, "no chunk was begun for long"
        time.sleep(POLL)
    return False


def _differing(folder: Path) -> Iterator[str]:
    """Yield the chunk files that are not the same in both stores."""
    one, other = (folder / name / "lobes.zarr" for name in ("undisturbed", "disturbed"))
    files = {str(file.relative_to(root)) for root in (one, other) for file in root.rglob("c.*")}
    for name in sorted(files):
        pair = [root / name for root in (one, other)]
        if not all(file.exists() for file in pair) or pair[0].read_bytes() != pair[1].read_bytes():
            yield name
