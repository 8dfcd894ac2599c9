"""Statements about lobes: who sets the boundary, where it is handed over, where static lobes mislead."""

import numpy as np
import pytest
import xarray as xr

from chatter_core.variables import STATUS, WITH_RESULT
from pipeline.lobes import crossover_speeds, dominance, most_misjudged


def lobes(dominant, *, static=None, dynamic=None, status=None, complete=1):
    """Return lobes of one preload and one number of modes at 1000, 2000, ... rpm."""
    speeds = 1000.0 * np.arange(1, len(dominant) + 1)
    kinds = ["dynamic"] if static is None else ["dynamic", "static"]
    outer = ("modal_parameters", "preload", "mode_count", "spindle_speed")
    shape = (len(kinds), 1, 1, len(speeds))
    limit = np.full(shape, 1.0) if static is None else np.array([dynamic, static])[:, None, None]
    cells = np.full((*shape, 2), STATUS["ok"]) if status is None else np.broadcast_to(status, (*shape, 2))
    return xr.Dataset(
        {
            "limit_dominant_mode": ((*outer, "crossing"), np.broadcast_to(dominant, shape)[..., None]),
            "limit_depth": ((*outer, "crossing"), limit[..., None]),
            "limits_complete": (outer, np.broadcast_to(complete, shape)),
            "status": ((*outer, "axial_depth"), cells),
            "spectral_radius": ((*outer, "axial_depth"), np.where(np.isin(cells, WITH_RESULT), 0.5, np.nan)),
        },
        coords={"modal_parameters": kinds, "preload": [100.0], "mode_count": [4], "spindle_speed": speeds,
                "axial_depth": [1.0, 6.0]},
    )  # fmt: skip


def ranges(dominant):
    frame = dominance(lobes(dominant))
    return [tuple(row) for row in frame[["from_rpm", "to_rpm", "dominant_mode"]].to_numpy()]


def test_a_boundary_above_the_grid_belongs_to_no_range():
    assert ranges([1, 0, 1, 2]) == [(1000, 1000, 1), (3000, 3000, 1), (4000, 4000, 2)]


def test_modes_hand_over_between_neighbours_only():
    assert crossover_speeds(lobes([4, 4, 1]))["crossover_rpm"].tolist() == [2500.0]
    assert crossover_speeds(lobes([1, 0, 0, 2])).empty


def test_static_lobes_mislead_most_where_the_ratio_is_largest():
    found = most_misjudged(lobes([4, 4, 4], static=[1.0, 4.0, np.nan], dynamic=[1.0, 1.0, 3.0]), 100.0, 4)
    # Above the grid counts as its last depth, 6 mm: twice at 3000 rpm, four times at 2000 rpm.
    assert (found.spindle_speed_rpm, found.static_limit_mm, found.dynamic_limit_mm) == pytest.approx((2000.0, 4.0, 1.0))
    assert not found.static_above_grid
    assert most_misjudged(lobes([4], static=[np.nan], dynamic=[3.0]), 100.0, 4).static_above_grid


def test_static_lobes_without_a_limit_mislead_only_where_none_can_have_been_missed():
    # At 2000 rpm the static cut may chatter from the shallowest depth on: it promises nothing there.
    mislead = {"static": [4.0, np.nan], "dynamic": [3.0, 1.0]}
    assert most_misjudged(lobes([4, 4], **mislead), 100.0, 4).spindle_speed_rpm == 2000.0
    assert most_misjudged(lobes([4, 4], **mislead, complete=[1, 0]), 100.0, 4).spindle_speed_rpm == 1000.0


def test_speeds_without_a_result_do_not_mislead():
    status = np.array([[1, 1], [1, 2], [1, 1]])
    found = most_misjudged(lobes([4, 4, 4], static=[1.0, 4.0, 6.0], dynamic=[1.0, 1.0, 3.0], status=status), 100.0, 4)
    assert found.spindle_speed_rpm == 3000.0
