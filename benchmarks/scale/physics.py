"""What the reference machine's cells cost beside that: processor time and bytes of one chunk with all modes."""

import shutil
import time
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from benchmarks.scale.study import CHUNKED
from pipeline import metadata, store
from pipeline.configuration import compose_settings, words_for
from pipeline.kinds import KERNEL
from pipeline.places import LOBES, Folder
from pipeline.task import Task, compute_chunk, compute_first
from pipeline.verbs.studies import SweepOptions

#: Cells of a chunk that are tried: those of a small study and ten times as many; depths of a speed.
SIZES, DEPTHS = (1500, 15000), 100


def rows(folder: Path) -> list[dict[str, Any]]:
    """Return seconds and bytes of a chunk of each size, every cell evaluated, and evaluated where needed."""
    with threadpool_limits(1):
        return [
            _row(folder / f"physics-{which}-{cells}", cells, which) for which in ("all", "adaptive") for cells in SIZES
        ]


def _row(folder: Path, cells: int, which: str) -> dict[str, Any]:
    words = [
        "study=reference",
        f"grid.spindle_speed_rpm={{start: 6000, stop: 18000, count: {cells // DEPTHS}}}",
        f"grid.axial_depth_mm={{start: 0.05, stop: 5, count: {DEPTHS}}}",
        "grid.preload_n=[100]",
        "grid.mode_count=[4]",
        "grid.modal_parameters=[dynamic]",
        f"grid.cells={which}",
        f"cluster.cells_per_task={cells}",
    ]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    place = Folder(folder)
    store.create(place, compose_settings(words_for(SweepOptions, words)), [])
    task = Task(
        place=place, chunk=store.chunks(store.open_group(place))[0], kernel=KERNEL, made=metadata.identity(place)
    )
    compute_first(task)
    began = time.process_time()
    compute_chunk(task)
    seconds = time.process_time() - began
    files = [file for name in CHUNKED for file in (folder / LOBES / name).glob("c.*")]
    return {
        "which": which,
        "cells": cells,
        "seconds": seconds,
        "files": len(files),
        "bytes": sum(file.stat().st_size for file in files),
    }
