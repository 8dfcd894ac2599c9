"""One phase of a study, measured in a process of its own.

``python -m benchmarks.scale.phase PHASE CHUNKS COMPUTED FOLDER`` tells it in a line of JSON, the last.
"""

import json
import os
import shutil
import stat
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.scale.laying import create, lay
from benchmarks.scale.study import KERNEL, study
from pipeline import execution, report, status, verify
from pipeline.places import Folder

#: Measures a study of so many chunks, of which so many are computed by tasks, in a folder.
Phase = Callable[[int, int, Path], dict[str, Any]]
Marks = list[tuple[float, float, float]]


def peak() -> float:
    """Return the most memory that this process has had [MiB]."""
    line = next(text for text in Path("/proc/self/status").read_text().splitlines() if text.startswith("VmHWM"))
    return int(line.split()[1]) / 1024.0


def mark() -> tuple[float, float, float]:
    """Return time, processor time of this process [s] and peak memory [MiB]."""
    return time.perf_counter(), time.process_time(), peak()


def _between(marks: Marks, which: int) -> dict[str, float]:
    """Return what passed between a mark and the next."""
    before, after = marks[which], marks[which + 1]
    return {"seconds": after[0] - before[0], "processor_seconds": after[1] - before[1], "peak_mib": after[2]}


def created(chunks: int, _: int, folder: Path) -> dict[str, Any]:
    """Make the store of a study, anew where an earlier one was not measured to its end."""
    shutil.rmtree(folder, ignore_errors=True)
    before = mark()
    create(chunks, folder)
    return _between([before, mark()], 0)


def laid(chunks: int, computed: int, folder: Path) -> dict[str, Any]:
    """Lay all chunks of a study but so many."""
    before = mark()
    lay(chunks, folder, computed)
    return _between([before, mark()], 0)


def compute(chunks: int, _: int, folder: Path) -> dict[str, Any]:
    """Compute what is missing of a study; return what start, run and end cost the driver, and the chunks computed."""
    marks, computed = [mark()], 0
    report.write = lambda place: []  # type: ignore[assignment]
    dispatched: Callable[..., Iterator[Any]] = execution.dispatched

    def watched(*arguments: Any) -> Iterator[Any]:
        nonlocal computed
        marks.append(mark())
        for record in dispatched(*arguments):
            computed += 1
            yield record
        marks.append(mark())

    execution.dispatched = watched  # type: ignore[assignment]
    code = execution.execute(study(chunks), Folder(folder), kernel=KERNEL)
    if code:
        raise SystemExit(code)
    marks.append(mark())
    names = ("start", "run", "end") if computed else ("resume",)
    return {"computed": computed, **{name: _between(marks, which) for which, name in enumerate(names)}}


def files(_: int, __: int, folder: Path) -> dict[str, Any]:
    """Count the files of a study, what counts as one (folders too), their bytes, and those that they take."""
    found = Counter[str]()
    for at, folders, names in os.walk(folder):
        for name in (*folders, *names):
            one = os.stat(os.path.join(at, name))
            is_file = stat.S_ISREG(one.st_mode)
            found.update(files=is_file, inodes=1, bytes=is_file * one.st_size, bytes_on_disk=512 * one.st_blocks)
    return dict(found)


def once(work: Callable[[Folder], object]) -> Phase:
    """Return a phase that looks at a finished study."""

    def phase(_: int, __: int, folder: Path) -> dict[str, Any]:
        before = mark()
        with threadpool_limits(1):
            work(Folder(folder))
        return _between([before, mark()], 0)

    return phase


def _verified(place: Folder) -> None:
    if verify.damage(place):
        raise SystemExit(f"{place}: damaged")


PHASES: dict[str, Phase] = {
    "created": created,
    "laid": laid,
    "compute": compute,
    "resume": compute,
    "status": once(status.progress),
    "files": files,
    "verify": once(_verified),
    "report": once(report.write),
}


if __name__ == "__main__":
    phase, chunks, computed, folder = sys.argv[1:]
    imported = peak()
    found = PHASES[phase](int(chunks), int(computed), Path(folder))
    print(json.dumps({**found, "imported_mib": imported}))
