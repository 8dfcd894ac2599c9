"""The search for limit depths on curves whose crossings are known in closed form."""

import numpy as np
import pytest

from chatter_core.crossings import DEPTH_TOLERANCE, find_crossings

FIRST = np.array([1e-5, 2.5e-3, 1e-2])


class Curve:
    """ln|mu| and angle over depth for some speeds, counting what is asked."""

    def __init__(self, *growths, angle=lambda depth: 0.0 * depth + 1.0):
        self.growths, self.angle = growths, angle
        self.asked = np.zeros(len(growths), dtype=int)

    def __call__(self, speed, depth):
        np.add.at(self.asked, speed, 1)
        growth = np.array([self.growths[s](d) for s, d in zip(speed, depth, strict=True)], dtype=float)
        return np.where(np.isnan(growth), np.nan, np.exp(np.nan_to_num(growth) + 1j * self.angle(depth)))

    def search(self, depth=FIRST, coarsest=np.inf, most=8):
        known = np.array([[self(np.array([s]), np.array([d]))[0] for d in depth] for s in range(len(self.growths))])
        return find_crossings(self, depth, known, finest=depth[-1] / 64.0, coarsest=coarsest, most=most)


def test_a_smooth_curve_is_crossed_once_within_the_tolerance_and_fifteen_looks():
    curve = Curve(
        lambda d: -0.52 + 200.0 * d, lambda d: np.log(d / 3.3e-3), lambda d: 0.2 - 0.4 / (1.0 + (d / 2e-3) ** 2)
    )
    found = curve.search()
    assert found.depth[:, 0] == pytest.approx([2.6e-3, 3.3e-3, 2e-3], abs=DEPTH_TOLERANCE)
    assert np.isnan(found.depth[:, 1:]).all()
    assert found.complete.all()
    assert curve.asked.max() <= 15


def test_no_crossing_where_there_is_none_and_few_looks():
    curve = Curve(lambda d: -0.3 - d, lambda d: 0.4 + 10.0 * d)
    found = curve.search()
    assert np.isnan(found.depth).all()
    # One is unstable from the first depth on: stability is lost above it.
    assert found.complete.tolist() == [True, False]
    assert curve.asked.max() <= 6


def test_an_island_and_a_lens_between_two_branches_are_found():
    """An island rises out of the stable side and sinks again; between two unstable branches lies a stable gap."""

    def island(d):
        return max(-0.2 + 10.0 * d, 0.1 - 100.0 * abs(d - 6e-3))

    def gap(d):
        return max(0.2 - 100.0 * (d - 2e-3), -0.8 + 150.0 * (d - 2e-3))

    found = Curve(island, gap).search()
    assert found.depth[0, :2] == pytest.approx([5e-3, 7e-3], abs=DEPTH_TOLERANCE)
    assert found.depth[1, :2] == pytest.approx([4e-3, 2e-3 + 0.8 / 150.0], abs=DEPTH_TOLERANCE)
    assert np.isnan(found.depth[:, 2:]).all()


def test_narrow_islands_are_found_where_the_cut_changes_on_a_fine_scale():
    """As with a helix: islands a tenth as wide as the period in depth, on a flat stable floor."""

    def islands(d):
        return -0.1 + 0.15 * np.exp(-((((d % 2e-3) - 1e-3) / 1e-4) ** 2))

    half = 1e-4 * np.sqrt(np.log(1.5))
    expected = np.sort(np.concatenate([np.arange(5) * 2e-3 + 1e-3 - half, np.arange(5) * 2e-3 + 1e-3 + half]))
    found = Curve(islands).search(coarsest=2e-3 / 8.0, most=12)
    assert found.depth[0, :10] == pytest.approx(expected, abs=DEPTH_TOLERANCE)


def test_many_first_depths_tell_by_themselves_and_cost_no_further_looks():
    depth = np.linspace(1e-4, 1e-2, 100)
    curve = Curve(lambda d: -0.5 + 200.0 * d)
    found = curve.search(depth)
    assert found.depth[0, 0] == pytest.approx(2.5e-3, abs=DEPTH_TOLERANCE)
    assert curve.asked[0] <= len(depth) + 6


def test_beyond_what_is_not_known_nothing_is_said():
    curve = Curve(lambda d: np.nan if 3e-3 < d < 4e-3 else np.sin(d * np.pi / 2e-3 - 0.1))
    found = curve.search(np.linspace(5e-4, 1e-2, 20))
    assert not found.complete[0]
    assert np.all(found.depth[0, np.isfinite(found.depth[0])] < 3e-3)
    assert np.isfinite(found.depth[0]).sum() == 1


def test_a_limit_before_answers_end_is_found_however_far_apart_the_first_depths_are():
    """Deep cuts of unlike teeth may have no motion that repeats, at several times the limit."""

    def until(rising):
        return lambda d: rising(d) if d < 7e-3 else np.nan

    curve = Curve(until(lambda d: -0.8 + 200.0 * d), until(lambda d: -2.0 + 200.0 * d))
    found = curve.search()
    assert found.depth[0, 0] == pytest.approx(4e-3, abs=DEPTH_TOLERANCE)
    assert np.isnan(found.depth[0, 1:]).all()
    assert np.isnan(found.depth[1]).all()
    assert found.complete.tolist() == [False, False]
    # Where answers end is found by halving, to 1/64 of the deepest.
    assert curve.asked.max() <= 24


def test_more_crossings_than_are_kept_are_not_complete():
    found = Curve(lambda d: np.sin(d * np.pi / 5e-4 + 0.3)).search(np.linspace(1e-4, 1e-2, 120), most=8)
    assert np.isfinite(found.depth[0]).all()
    assert not found.complete[0]


def test_a_crossing_about_which_nothing_is_known_ends_what_is_told():
    """Found by its two sides, and on the way to it there is no answer."""
    blind = Curve(lambda d: np.nan if abs(d - 2.03e-3) < 2e-4 and d not in FIRST else 400.0 * (d - 2.03e-3))
    found = blind.search()
    assert np.isnan(found.depth).all()
    assert found.complete.tolist() == [False]
