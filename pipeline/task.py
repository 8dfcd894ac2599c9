"""What a worker does with one chunk: compute, write, report. Idempotent, and never returns arrays."""

import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from importlib import import_module
from pathlib import Path
from typing import Any, cast

import numpy as np

from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import CROSSINGS, LobeBlock, lobe_block
from chatter_core.machine import Machine
from chatter_core.units import SUFFIXES
from chatter_core.variables import STATUS, SWEEP
from pipeline import store
from pipeline.chunks import Chunk
from pipeline.places import Place
from pipeline.settings import model_with
from pipeline.time_limit import limited

Kernel = Callable[..., LobeBlock]
#: Module and function of the physics that a task computes.
KERNEL = "chatter_core.lobes:lobe_block"


@dataclass(frozen=True, kw_only=True)
class Task:
    """One chunk of a store; ``kernel`` names module and function that compute it.

    effects_path: folder with effects of the user's own, as the command line named it; a store never does.
    time_limit: seconds after which the worker's process ends with everything in it, none: never.
    """

    place: Place
    chunk: Chunk
    kernel: str = KERNEL
    effects_path: Path | None = None
    time_limit: float | None = None


@dataclass(frozen=True, kw_only=True)
class Record:
    """What became of a chunk: cells by status, seconds, and the errors that were caught."""

    chunk: Chunk
    counts: dict[str, int]
    seconds: float
    errors: tuple[str, ...]


@lru_cache(maxsize=4)
def _described(place: Place) -> tuple[Machine, dict[str, Any], dict[str, Any], dict[str, np.ndarray]]:
    """Return machine, effects, what all chunks share and coordinates as the store holds them, once a process."""
    group = store.open_group(place)
    settings = cast(dict[str, Any], group.attrs["settings"])
    names = ("modal_parameters", "preload", "mode_count", "spindle_speed", "axial_depth")
    values = {name: np.asarray(cast(Any, group[name])[...]) for name in names}
    common = {
        "method": MethodSettings.model_validate(settings["method"]),
        "mode_selection": settings["grid"]["mode_selection"],
        "cells": settings["grid"]["cells"],
    }
    return Machine.model_validate(settings["machine"]), settings.get("effects", {}), common, values


def compute_chunk(task: Task) -> Record:
    """Compute a chunk and write it, unless it is there already: its worker may have died with the news.

    An error in the block is narrowed down to its speeds; those are marked and the rest goes on.
    Errors of writing are not caught: they end the run.
    """
    began = time.perf_counter()
    status = store.readable_status(store.open_group(task.place), task.chunk)
    if status.all():
        return _record(task, status, began, ())
    machine, effects, common, values = _described(task.place)
    parameters, preload, modes = (
        values[name][i] for name, i in zip(("modal_parameters", "preload", "mode_count"), task.chunk.outer, strict=True)
    )
    if machine.spindle is not None:
        machine = machine.with_preload(float(preload))
    model = model_with(machine, effects, task.effects_path)
    module, function = task.kernel.split(":")
    kernel: Kernel = getattr(import_module(module), function)
    depth = values["axial_depth"] * SUFFIXES["mm"][0]
    speed = values["spindle_speed"][task.chunk.first : task.chunk.last] * SUFFIXES["rpm"][0]

    def compute(speeds: np.ndarray) -> LobeBlock:
        return kernel(
            model,
            spindle_speed=speeds,
            axial_depth=depth,
            mode_count=int(modes),
            modal_parameters=str(parameters),
            **common,
        )

    with limited(task.time_limit):
        block, errors = _guarded(compute, speed, len(depth))
    store.write_chunk(task.place, task.chunk, block)
    return _record(task, block.status, began, errors)


def _record(task: Task, status: np.ndarray, began: float, errors: Sequence[str]) -> Record:
    """Return the record of a chunk by the status of its cells."""
    names = {code: name for name, code in STATUS.items()}
    codes, counts = np.unique(status, return_counts=True)
    return Record(
        chunk=task.chunk,
        counts={names[int(code)]: int(count) for code, count in zip(codes, counts, strict=True)},
        seconds=time.perf_counter() - began,
        errors=tuple(errors),
    )


def compute_point(task: Task) -> None:
    """Compute the first cell of a chunk and forget it: what is compiled when first used is compiled then."""
    machine, effects, common, values = _described(task.place)
    if task.kernel == KERNEL:
        lobe_block(
            model_with(machine, effects, task.effects_path),
            spindle_speed=values["spindle_speed"][:1] * SUFFIXES["rpm"][0],
            axial_depth=values["axial_depth"][:1] * SUFFIXES["mm"][0],
            mode_count=1,
            modal_parameters="static",
            **{**common, "mode_selection": "up_to"},
        )


def _guarded(compute: Callable[[np.ndarray], LobeBlock], speed: np.ndarray, depths: int) -> tuple[LobeBlock, list[str]]:
    """Compute a block; where that raises, compute it speed by speed and mark those that raise."""
    try:
        return compute(speed), []
    except Exception:
        blocks, errors = [], []
        for one in speed:
            try:
                blocks.append(compute(np.array([one])))
            except Exception as error:
                code = STATUS[
                    "outside_validity" if isinstance(error, NoEquilibrium | InvalidInput) else "not_converged"
                ]
                blocks.append(_marked(depths, code))
                errors.append(f"{one / SUFFIXES['rpm'][0]:.6g} rpm: " + traceback.format_exc(limit=-3).strip())
        joined = {f.name: np.concatenate([getattr(block, f.name) for block in blocks]) for f in fields(LobeBlock)}
        return replace(blocks[0], **joined), errors


def _marked(depths: int, code: int) -> LobeBlock:
    """Return the block of one speed without results, every cell with one status."""
    sizes = {"axial_depth": (1, depths), "crossing": (1, CROSSINGS), "spindle_speed": (1,)}
    empty = {
        name: np.full(sizes[v.dims[-1]], np.nan if v.dtype.startswith("f") else 0, dtype=v.dtype)
        for name, v in SWEEP.items()
    }
    return LobeBlock(**empty, status=np.full((1, depths), code, dtype=np.uint8))
