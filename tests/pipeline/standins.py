"""Kernels in the place of the physics: exact functions of a cell, slow ones, and ones that fail."""

import itertools
import os
import signal
import time
from typing import Any

import numpy as np
from threadpoolctl import threadpool_info

from chatter_core.errors import NoEquilibrium
from chatter_core.lobes import CROSSINGS, LobeBlock
from chatter_core.stages import stages_of
from chatter_core.units import SUFFIXES

#: Preload [N] at which the failing kernels fail.
BAD_PRELOAD = 200.0
#: Variable of the environment that names the file for which the gated kernel waits.
GATE = "STANDIN_GATE"
#: Below this speed [rpm] the failing kernels fail.
BAD_SPEED = 9000.0


def plain(
    model: Any, *, spindle_speed: Any, axial_depth: Any, mode_count: int, modal_parameters: str, **_: Any
) -> LobeBlock:
    """Return numbers that depend on every coordinate of a cell and on nothing else."""
    preload = stages_of(model).machine.spindle.preload if stages_of(model).machine.spindle else 0.0
    outer = preload + 7.0 * mode_count + (0.5 if modal_parameters == "static" else 0.0)
    cell = np.sin(spindle_speed[:, None] * outer) + 1e3 * axial_depth[None, :]
    line = cell[:, :1] + np.arange(CROSSINGS)
    return LobeBlock(
        spectral_radius=cell,
        multiplier_angle=cell + 0.25,
        chatter_frequency=1e3 * cell,
        bifurcation=np.full(cell.shape, 1, dtype=np.int8),
        dominant_mode=np.full(cell.shape, mode_count, dtype=np.int8),
        dominant_mode_share=cell / 8.0,
        error_estimate=cell[:, 0] * 1e-6,
        limits_complete=np.ones(len(cell), dtype=np.int8),
        limit_depth=1e-3 * line,
        limit_chatter_frequency=1e3 * line,
        limit_dominant_mode=np.full(line.shape, mode_count, dtype=np.int8),
        limit_bifurcation=np.full(line.shape, 1, dtype=np.int8),
        status=np.ones(cell.shape, dtype=np.uint8),
    )


def slow(model: Any, **cells: Any) -> LobeBlock:
    """Take a tenth of a second for each speed."""
    time.sleep(0.1 * len(cells["spindle_speed"]))
    return plain(model, **cells)


def _is_bad(model: Any, cells: dict[str, Any]) -> bool:
    slowest = cells["spindle_speed"].min() / SUFFIXES["rpm"][0]
    return bool(stages_of(model).machine.spindle.preload == BAD_PRELOAD and slowest < BAD_SPEED)


def without_equilibrium(model: Any, **cells: Any) -> LobeBlock:
    """Find no equilibrium in one corner of the grid."""
    if _is_bad(model, cells):
        raise NoEquilibrium("the ball leaves its race")
    return plain(model, **cells)


def broken(model: Any, **cells: Any) -> LobeBlock:
    """Fail in a way that nobody foresaw in one corner of the grid."""
    if _is_bad(model, cells):
        raise ZeroDivisionError("an error in the physics")
    return plain(model, **cells)


def deadly(model: Any, **cells: Any) -> LobeBlock:
    """Kill the worker in one corner of the grid, as the kernel does when memory runs out."""
    if _is_bad(model, cells):
        os.kill(os.getpid(), signal.SIGKILL)
    return plain(model, **cells)


def hanging(model: Any, **cells: Any) -> LobeBlock:
    """Never come back in one corner of the grid, and let no other thread of the process run."""
    if _is_bad(model, cells):
        while True:
            # One call of many hours that holds the interpreter: no Python thread could end it.
            sum(itertools.repeat(0))
    return plain(model, **cells)


def one_threaded(model: Any, **cells: Any) -> LobeBlock:
    """Fail where linear algebra takes more than one thread."""
    pools = {pool["filepath"]: pool["num_threads"] for pool in threadpool_info()}
    if set(pools.values()) != {1}:
        raise RuntimeError(f"threads: {pools}")
    return plain(model, **cells)


def gated(model: Any, **cells: Any) -> LobeBlock:
    """Wait at one preload until the file is there that the environment names."""
    if stages_of(model).machine.spindle.preload == BAD_PRELOAD:
        wait_at_gate()
    return plain(model, **cells)


def wait_at_gate() -> None:
    """Wait until the file is there that the environment names."""
    while not os.path.exists(os.environ[GATE]):
        time.sleep(0.02)


def lobes_of_a_ramp(model: Any, *, spindle_speed: Any, mode_count: int, **cells: Any) -> LobeBlock:
    """Return limits within the grid that rise with speed, and by preload and modes, each chattering at 1 kHz."""
    block = plain(model, spindle_speed=spindle_speed, mode_count=mode_count, **cells)
    preload = stages_of(model).machine.spindle.preload
    limit = 1e-3 * (0.4 + 1e-4 * spindle_speed / SUFFIXES["rpm"][0] + 1e-3 * preload - 0.1 * mode_count)
    block.limit_depth[:] = np.nan
    block.limit_depth[:, 0] = limit
    block.limit_chatter_frequency[:] = 1e3 * SUFFIXES["hz"][0]
    block.spectral_radius[:] = cells["axial_depth"] / limit[:, None]
    return block
