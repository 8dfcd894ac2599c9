"""What many chunks cost beside their physics, in counts: the same for each chunk, however many there are."""

import gc
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest
from zarr.storage import LocalStore

from chatter_core.variables import SWEEP
from pipeline import dispatch, report, status, store, verify
from pipeline.chunks import Chunk
from pipeline.places import Folder
from pipeline.task import Task
from tests.pipeline.studies import CHUNKS, lobes, sweep

#: Variables that are written chunk by chunk.
CHUNKED = (*SWEEP, "status")
#: A decade: ten times the chunks of the small study.
FEW, MANY = CHUNKS, 10 * CHUNKS


def study(output: Path, chunks: int, kernel: str = "plain") -> int:
    return sweep(
        output, f"grid.spindle_speed_rpm={{start: 8000, stop: 13000, count: {chunks // 2}}}", kernel=kernel, report=True
    )


@pytest.fixture
def counts(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Files of values that are read and written, and folders that are listed."""
    found = Counter[str]()

    def counted(kind: str, name: str) -> None:
        original = getattr(LocalStore, name)

        async def method(self: LocalStore, key: str, *arguments: Any, **options: Any) -> Any:
            found[kind] += "zarr.json" not in key
            return await original(self, key, *arguments, **options)

        monkeypatch.setattr(LocalStore, name, method)

    for kind, name in (("read", "get"), ("written", "set"), ("deleted", "delete"), ("asked", "exists")):
        counted(kind, name)
    files = Folder._files
    monkeypatch.setattr(Folder, "_files", lambda self, folder: (found.update(listed=1), files(self, folder))[1])
    monkeypatch.setattr(report, "write", lambda output: [])
    return found


def cost(counts: Counter[str], work: Callable[[], object]) -> Counter[str]:
    """Return what a piece of work has cost; what was opened before is opened anew."""
    store.forget()
    counts.clear()
    work()
    return Counter(counts)


def test_a_chunk_costs_the_same_among_few_and_among_many(tmp_path: Path, counts: Counter[str]) -> None:
    spent = dict[int, dict[str, Counter[str]]]()
    # What a process reads once whatever it does is not counted.
    study(tmp_path / "before", FEW)
    for chunks in (FEW, MANY):
        place = Folder(tmp_path / str(chunks))
        work: dict[str, Callable[[], object]] = {
            "computed": partial(study, place.output, chunks),
            "resumed": partial(study, place.output, chunks),
            "status": partial(status.progress, place),
            "verified": partial(verify.damage, place),
        }
        spent[chunks] = {name: cost(counts, one) for name, one in work.items()}
    assert {name: per_chunk(spent[FEW][name], spent[MANY][name]) for name in spent[FEW]} == {
        # Each chunk's own status is looked for before it is computed, and read when all is done.
        "computed": {"read": 2, "written": len(CHUNKED)},
        "resumed": {"read": 1},
        "status": {"read": 1},
        # The status is read by itself too, for it says what must be there.
        "verified": {"read": len(CHUNKED) + 1},
    }


def per_chunk(few: Counter[str], many: Counter[str]) -> dict[str, float]:
    """Return what every further chunk costs, without what costs nothing more."""
    return {kind: (many[kind] - few[kind]) / (MANY - FEW) for kind in many if many[kind] != few[kind]}


def test_no_more_tasks_and_chunks_are_held_among_many(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "write", lambda output: [])
    compute, held = dispatch.compute_chunk, Counter[int]()
    for chunks in (FEW, MANY):
        # What earlier tests of this process have left may be let go of at any time: now, and not in between.
        gc.collect()

        def watched(task: Task, chunks: int = chunks) -> Any:
            # Looking at every object takes long: one of the last chunks is enough, when the others have passed.
            if task.chunk.outer == (0, 1, 1):
                held[chunks] = held[chunks] or tasks_and_chunks()
            return compute(task)

        monkeypatch.setattr(dispatch, "compute_chunk", watched)
        assert study(tmp_path / str(chunks), chunks) == 0
    assert all(held.values())
    # How many of the last records and tasks Python has not let go of yet differs by a few; no study has them all.
    assert held[MANY] - held[FEW] < FEW < MANY - FEW


def tasks_and_chunks() -> int:
    return sum(isinstance(one, Task | Chunk) for one in gc.get_objects())


def test_a_report_of_many_speeds_shows_some_and_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(report, "MOST_LINES", 24)
    assert study(tmp_path, MANY, "lobes_of_a_ramp") == 0
    speeds = lobes(tmp_path)["spindle_speed"].values
    told = (tmp_path / "report.html").read_text()
    assert "One speed of 10 is shown, 6 in all: findings, tables and figures are of these; the store has all." in told
    assert f"{len(speeds) * 16} operating points" in told
    rows = (tmp_path / "tables" / "limit_depths.csv").read_text().splitlines()[1:]
    assert {float(row.split(",")[3]) for row in rows} <= {float(f"{speed:.8g}") for speed in speeds[::10]}
