"""Cutting forces: integral along the edge, engagement, coefficients."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter_core.cutting import CuttingGain, ForceCoefficients, engagement, force_coefficients
from chatter_core.machine import Cutting, Process, Tool
from chatter_core.teeth import equal_teeth, passages


def gain(*, teeth=4, helix=30.0, depth_mm=2.0, direction="down", immersion=0.4, diameter=16.0, rpm=6000.0):
    return CuttingGain(
        axial_depth=np.array([depth_mm * 1e-3]),
        spindle_speed=np.array([rpm * 2.0 * math.pi / 60.0]),
        tool=Tool(teeth=teeth, diameter_mm=diameter, helix_angle_deg=helix, rake_angle_deg=10.0),
        coefficients=ForceCoefficients(tangential=900e6, radial=300e6),
        passages=passages(
            equal_teeth(teeth),
            engagement(Process(direction=direction, radial_immersion=immersion, feed_per_tooth_mm=0.1)),
            1e-4,
        ),
    )


def summed_over_slices(cut: CuttingGain, time: float, slices: int = 20000) -> np.ndarray:
    """K by the plain sum over teeth and axial slices, straight from the definition of the forces."""
    step = cut.axial_depth[0] / slices
    height = (np.arange(slices) + 0.5) * step
    total = np.zeros((2, 2))
    for tooth in range(cut.tool.teeth):
        lag = 2.0 * height * math.tan(cut.tool.helix_angle) / cut.tool.diameter
        angle = np.mod(cut.spindle_speed[0] * time + 2.0 * math.pi * tooth / cut.tool.teeth - lag, 2.0 * math.pi)
        angle = angle[(angle > cut.passages.entry[0]) & (angle < cut.passages.exit[0])]
        sine, cosine = np.sin(angle), np.cos(angle)
        force_x = -cut.coefficients.tangential * cosine - cut.coefficients.radial * sine
        force_y = cut.coefficients.tangential * sine - cut.coefficients.radial * cosine
        total += step * np.array(
            [[(force_x * sine).sum(), (force_x * cosine).sum()], [(force_y * sine).sum(), (force_y * cosine).sum()]]
        )
    return total


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    teeth=st.integers(1, 8),
    helix=st.floats(0.0, 60.0),
    depth_mm=st.floats(0.05, 60.0),
    direction=st.sampled_from(["up", "down"]),
    immersion=st.floats(0.02, 1.0),
    share=st.floats(0.0, 0.999),
)
def test_closed_form_along_the_edge_is_the_sum_over_slices(teeth, helix, depth_mm, direction, immersion, share):
    cut = gain(teeth=teeth, helix=helix, depth_mm=depth_mm, direction=direction, immersion=immersion)
    time = share * float(cut.tooth_period[0])
    closed = cut(np.array([[time]]))[0, 0]
    # One slice at each of the two ends of every engaged arc may fall to the wrong side; a straight
    # edge on the border is in or out as a whole, so it is left out.
    angle = np.mod(cut.spindle_speed[0] * time, 2.0 * math.pi / teeth)
    corners = np.mod([cut.passages.entry[0], cut.passages.exit[0]], 2.0 * math.pi / teeth)
    if helix < 1e-3 and np.any(np.abs(angle - corners) < 1e-3):
        return
    slack = 2.0 * teeth * 1.3e9 * depth_mm * 1e-3 / 20000 * (1.0 + depth_mm)
    assert closed == pytest.approx(summed_over_slices(cut, time), abs=slack)


@pytest.mark.parametrize("helix", [1e-6, 1e-3])
def test_small_helix_tends_to_the_straight_edge(helix):
    inside = 0.37 * float(gain().tooth_period[0])
    # The lag is 4e-9 and 4e-6 rad; K changes by its derivative, of the order of K itself, times that.
    straight, nearly = (gain(helix=h)(np.array([[inside]])) for h in (0.0, helix))
    assert nearly == pytest.approx(straight, rel=20.0 * math.radians(helix))


def test_gain_repeats_with_the_tooth_period():
    cut = gain(depth_mm=30.0)
    time = np.linspace(0.0, 1.0, 23)[None, :] * float(cut.tooth_period[0])
    # Three periods on, rounding of the phase alone: 1e-12 of the largest entry.
    assert cut(time + 3.0 * cut.tooth_period[0]) == pytest.approx(cut(time), abs=1e-9 * np.abs(cut(time)).max())


def test_breakpoints_are_where_the_gain_has_corners():
    cut = gain(depth_mm=3.0)
    period = float(cut.tooth_period[0])
    step = 1e-6 * period
    times = np.linspace(0.0, period, 4001)[1:-1]
    grid = np.stack([times - step, times, times + step])
    values = cut(grid.reshape(1, -1))[0].reshape(3, -1, 2, 2)
    bend = np.abs(values[0] - 2.0 * values[1] + values[2]).max(axis=(1, 2))
    # In a smooth part a second difference over 1e-6 periods is rounding, about 1e-9 of K; at a
    # corner it is the jump of the slope times the step, found within half a grid step of it.
    rough = times[bend > 1e-8 * np.abs(values).max()]
    nearest = np.abs(rough[:, None] - cut.breakpoints()[0]).min(axis=1)
    assert np.all(nearest <= 0.5 * period / 4000 + step)


def test_engagement_of_up_down_and_slot():
    up, down, slot = (
        engagement(Process(direction=d, radial_immersion=a, feed_per_tooth_mm=0.1))
        for d, a in (("up", 0.25), ("down", 0.25), ("slot", 1.0))
    )
    # acos(1 - 2 * 0.25) = 60 degrees, and its mirror image: rounding alone.
    assert (up.entry, up.exit) == pytest.approx((0.0, math.pi / 3.0), abs=1e-12)
    assert (down.entry, down.exit) == pytest.approx((2.0 * math.pi / 3.0, math.pi), abs=1e-12)
    assert (slot.entry, slot.exit) == (0.0, math.pi)


def test_force_coefficients_of_the_paper():
    tool = Tool(teeth=4, diameter_mm=16.0, helix_angle_deg=30.0, rake_angle_deg=10.0)
    found = force_coefficients(Cutting(kt_mpa=900.0, kn=0.3, friction_coefficient=0.2), tool)
    # k1 = 0.3 / cos 30 = 0.34641016; k2 = 1 + 0.57735027 * 0.2 * (0.98480775 - 0.3 * 0.17364818) = 1.10770045
    assert found.radial / 900e6 == pytest.approx(0.34641016, abs=1e-8)
    assert found.tangential / 900e6 == pytest.approx(1.10770045, abs=1e-8)


def test_an_edge_at_the_angle_where_it_leaves_still_cuts():
    """As beside it: K of a straight edge has no hole at the end of a pass."""
    cut = gain(teeth=2, helix=0.0, direction="slot", immersion=1.0)
    before, there = cut(np.array([[-1e-9, 0.0]]))[0]
    assert np.any(before != 0.0)
    assert there == pytest.approx(before, abs=1e-5 * np.abs(before).max())
