"""The cuts that remove most: against removal rates and boundaries that are reckoned by hand."""

import numpy as np
import pytest
import xarray as xr

from chatter_core.errors import InvalidInput
from pipeline import report
from pipeline.best_cuts import best_cuts, removal_rate, safe_depth
from pipeline.figures import lobes_static_and_dynamic
from pipeline.places import Folder
from pipeline.settings import Margins, margins_of
from tests.pipeline.studies import sweep

SPEED = np.arange(5000.0, 15001.0, 50.0)
SETTINGS = {
    "machine": {
        "tool": {"teeth": 4, "diameter_mm": 16.0},
        "process": {"direction": "down", "radial_immersion": 0.4, "feed_per_tooth_mm": 0.08},
    }
}


def study(limit_mm, *, hollow=(), doubtful=()):
    """Return a study of one line of lobes, with cells that have no result at some speeds, and doubtful limits."""
    outer = {"modal_parameters": ["dynamic"], "preload": [100.0], "mode_count": [4]}
    radius = np.ones((1, 1, 1, len(SPEED), 3))
    radius[..., list(hollow), 1] = np.nan
    complete = np.ones((1, 1, 1, len(SPEED)), dtype=np.int8)
    complete[..., list(doubtful)] = 0
    line, cell = (*outer, "spindle_speed", "crossing"), (*outer, "spindle_speed", "axial_depth")
    return xr.Dataset(
        {
            "limit_depth": (line, np.asarray(limit_mm, dtype=float).reshape(1, 1, 1, -1, 1)),
            "limits_complete": (line[:-1], complete),
            "spectral_radius": (cell, radius),
        },
        coords={**outer, "spindle_speed": SPEED, "axial_depth": [1.0, 2.0, 3.0]},
        attrs={"settings": SETTINGS},
    )


def test_a_removal_rate_is_depth_times_width_times_feed_speed():
    # 2 mm x 0.4 x 16 mm x (4 x 0.08 mm x 10000 / min) = 12.8 mm2 x 3200 mm/min.
    assert removal_rate(SETTINGS["machine"], 10000.0, 2.0) == pytest.approx(40.96, rel=1e-12)


def test_a_slot_is_as_wide_as_the_tool():
    machine = SETTINGS["machine"]
    slot = {**machine, "process": {**machine["process"], "direction": "slot"}}
    assert removal_rate(slot, 10000.0, 2.0) == pytest.approx(2.5 * 40.96, rel=1e-12)


def test_without_margins_the_best_cut_lies_on_the_boundary_where_depth_times_speed_is_largest():
    limit = 2.5 - np.abs(SPEED - 9000.0) / 2000.0
    lobes = study(limit)
    lobes.attrs["margins"] = {"depth_percent": 0.0, "speed_percent": 0.0}
    assert safe_depth(limit, SPEED, margins_of(lobes.attrs)) == pytest.approx(limit, rel=1e-12)
    found = best_cuts(lobes)
    assert found["spindle_speed"][0] == 9000.0
    assert len(found) == 1
    assert not found["limit_above_grid"][0]


def test_a_speed_without_a_limit_is_recommended_only_where_none_can_have_been_missed():
    without = (SPEED >= 12000.0) & (SPEED <= 13000.0)
    limit = np.where(without, np.nan, 1.0)
    sure = best_cuts(study(limit)).iloc[0]
    assert 12000.0 < sure["spindle_speed"] < 13000.0
    assert sure["axial_depth"] == pytest.approx(0.9 * 3.0, rel=1e-12)
    # A cut that chatters from the shallowest depth on has no limit either.
    doubted = best_cuts(study(limit, doubtful=np.flatnonzero(without))).iloc[0]
    assert doubted["spindle_speed"] * 0.98 > 13000.0
    assert doubted["axial_depth"] == pytest.approx(0.9, rel=1e-12)


def test_a_picture_shows_as_stable_only_what_is_known_to_be():
    """At 10000 rpm a cell has no result, at 12000 rpm a limit may have been missed, at 14000 rpm there is none."""
    without = np.isin(SPEED, [10000.0, 12000.0, 14000.0])
    hollow, doubtful = (np.flatnonzero(speed == SPEED) for speed in (10000.0, 12000.0))
    lobes = study(np.where(without, np.nan, 1.0), hollow=hollow, doubtful=doubtful).assign(radial_stiffness=np.nan)
    lobes.attrs = {"settings": {**SETTINGS, "grid": {"mode_selection": "up_to"}}}
    (axes,) = lobes_static_and_dynamic(lobes, 100.0).axes
    corners = np.concatenate([path.vertices for path in axes.collections[0].get_paths()])
    deepest = {speed: corners[corners[:, 0] == speed, 1].max(initial=0.0) for speed in SPEED}
    assert [deepest[speed] for speed in (9000.0, 10000.0, 12000.0, 14000.0)] == [1.0, 0.0, 0.0, 3.0]


def test_margins_keep_free_of_the_boundary_at_all_speeds_nearby():
    peak = np.where(SPEED == 10000.0, 2.9, 1.0)
    found = best_cuts(study(peak)).iloc[0]
    # A peak that is narrower than the spindle's own error is none: the fastest cut below 1 mm removes most.
    assert found["axial_depth"] == pytest.approx(0.9, rel=1e-12)
    assert found["spindle_speed"] == pytest.approx(14700.0)
    # 15000 rpm is 2 % above 14706 rpm: faster ones are too near to the end of the grid to be judged.
    assert found["removal_rate_cm3_min"] == pytest.approx(0.9 * 6.4 * 4 * 0.08 * 14700.0 * 1e-3, rel=1e-12)


def test_margins_keep_free_of_the_boundary_between_speeds_of_a_coarse_grid():
    """At 1000 rpm from speed to speed, a margin of 2 % ends before the next speed: the boundary runs straight there."""
    speed, limit = np.array([9e3, 10e3, 11e3, 12e3]), np.array([[1.0, 3.0, 2.0, 2.0], [3.0, np.nan, 2.0, 2.0]])
    found = safe_depth(limit, speed, Margins(depth_percent=0.0))
    # 200 rpm below 10000 rpm the boundary lies 200 / 1000 of the way to 1 mm; 220 rpm above 11000 rpm it is at 2 mm.
    assert found[0] == pytest.approx([np.nan, 2.6, 2.0, np.nan], rel=1e-12, nan_ok=True)
    # On the way to what is not known nothing is.
    assert np.isnan(found[1]).all()
    # A margin that ends at a speed of the grid asks for no speed beyond it.
    beyond = np.array([1.0, 3.0, 2.0, np.nan])
    assert safe_depth(beyond, speed, Margins(depth_percent=0.0, speed_percent=10.0))[1] == pytest.approx(1.0, rel=1e-12)


def test_what_was_not_computed_nearby_is_not_recommended():
    hollow = np.flatnonzero((SPEED >= 14000.0) & (SPEED <= 14100.0))
    found = best_cuts(study(np.where(SPEED > 13900.0, 2.0, 1.0), hollow=hollow)).iloc[0]
    assert found["spindle_speed"] * 0.98 > 14100.0


def test_a_boundary_above_the_grid_counts_as_its_last_depth_and_is_told():
    found = best_cuts(study(np.full(len(SPEED), np.nan))).iloc[0]
    assert found["axial_depth"] == pytest.approx(0.9 * 3.0, rel=1e-12)
    assert found["limit_above_grid"]


def test_a_line_without_any_result_has_no_best_cut():
    assert best_cuts(study(np.ones(len(SPEED)), hollow=range(len(SPEED)))).empty


def test_margins_are_kept_with_a_study_changed_without_computing_and_told_on_its_page(tmp_path, monkeypatch):
    # Pictures take longer than everything else.
    monkeypatch.setattr("pipeline.figures.write", lambda *_: [])
    assert sweep(tmp_path / "study", kernel="lobes_of_a_ramp", report=True) == 0
    place = Folder(tmp_path / "study")
    computed = list(place.written("lobes.zarr/status"))
    assert sweep(tmp_path / "study", "margins.depth_percent=25", kernel="lobes_of_a_ramp", report=True) == 0
    page = place.output / "report.html"
    assert "25 % below the boundary at all speeds within 2 %" in page.read_text()
    assert list(place.written("lobes.zarr/status")) == computed
    assert report.run([place.option, "margins.speed_percent=0"]) == 0
    assert "25 % below the boundary at all speeds within 0 %" in page.read_text()


def test_margins_that_are_none_are_told(tmp_path, monkeypatch):
    monkeypatch.setattr("pipeline.report.write", lambda *_, **__: [])
    assert sweep(tmp_path / "study") == 0
    with pytest.raises(InvalidInput, match=r"margins\.depth_percent: found '100', allowed: less than 100"):
        report.run([f"output={tmp_path / 'study'}", "margins.depth_percent=100"])
    with pytest.raises(InvalidInput, match=r"margins\.speed_percent: found -1, allowed: at least 0"):
        sweep(tmp_path / "study", "margins.speed_percent=-1")
