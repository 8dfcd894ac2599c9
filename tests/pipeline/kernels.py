"""Stand-in kernels for the sweep: cheap, deterministic, and failing in the ways that matter."""

import os
import signal
import time

import numpy as np

from chatter_core.errors import NoEquilibrium
from chatter_core.lobes import CROSSINGS, LobeBlock

RPM = 2.0 * np.pi / 60.0


def plain(machine, *, spindle_speed, axial_depth, mode_count, modal_parameters, method):
    """Every number depends on its own cell alone."""
    speed, depth = spindle_speed[:, None] / RPM, axial_depth[None, :] * 1e3
    preload = machine.spindle.preload if machine.spindle else 0.0
    radius = 1e-4 * speed * depth + mode_count + 1e-3 * preload + (modal_parameters == "static")
    shape = radius.shape
    limit = np.full((shape[0], CROSSINGS), np.nan)
    limit[:, 0] = axial_depth[0]
    return LobeBlock(
        spectral_radius=radius,
        multiplier_angle=np.zeros(shape),
        chatter_frequency=np.broadcast_to(spindle_speed[:, None], shape).copy(),
        bifurcation=np.ones(shape, dtype=np.int8),
        dominant_mode=np.ones(shape, dtype=np.int8),
        dominant_mode_share=np.ones(shape),
        error_estimate=np.full(shape[0], 1e-6),
        limit_depth=limit,
        limit_chatter_frequency=limit * 1e6,
        limit_dominant_mode=np.ones((shape[0], CROSSINGS), dtype=np.int8),
        limit_bifurcation=np.ones((shape[0], CROSSINGS), dtype=np.int8),
        status=np.ones(shape, dtype=np.uint8),
    )


def slow(machine, **where):
    time.sleep(0.15)
    return plain(machine, **where)


def failing(machine, *, spindle_speed, **where):
    """Two speeds raise: one without equilibrium, one by a plain bug."""
    if np.any(np.isclose(spindle_speed / RPM, 7000.0)):
        raise NoEquilibrium("no equilibrium here")
    if np.any(np.isclose(spindle_speed / RPM, 9000.0)):
        raise ZeroDivisionError("a bug")
    return plain(machine, spindle_speed=spindle_speed, **where)


def deadly(machine, *, spindle_speed, **where):
    """One speed kills its worker."""
    if np.any(np.isclose(spindle_speed / RPM, 9000.0)):
        os.kill(os.getpid(), signal.SIGKILL)
    return plain(machine, spindle_speed=spindle_speed, **where)
