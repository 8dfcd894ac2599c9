"""What holds for every bearing under axial load: similarity, symmetry, order of speeds, monotony.

No number here comes from elsewhere: each property follows from the equations of Jones (1960).
"""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from chatter_core.bearing import BearingState, axisymmetric_state
from chatter_core.bearing.ball import Ball, balance, ball_of, unloaded_groove_distance
from chatter_core.machine import Bearing

Array = NDArray[np.float64]
RPM = 2.0 * math.pi / 60.0
#: Two solves of the same state agree to this: the solver holds forces to 1e-12 of the largest plus the
#: rounding of distances, which light preloads magnify a thousandfold on their way to the stiffness.
SOLVED = 1e-8

BEARINGS = st.fixed_dictionaries(
    {
        "ball_diameter_mm": st.floats(4.0, 12.0),
        "ball_count": st.integers(8, 14),
        "contact_angle_deg": st.floats(12.0, 30.0),
        "inner_groove_conformity": st.floats(0.515, 0.57),
        "outer_groove_conformity": st.floats(0.515, 0.57),
        "density": st.sampled_from([3200.0, 7800.0]),
    }
)
PRELOADS = st.floats(20.0, 1000.0)
KINDS = st.sampled_from(["constant", "rigid"])
EXAMPLES = settings(max_examples=15, deadline=None, derandomize=True)


def bearing_of(drawn: dict[str, Any], *, length: float = 1.0, modulus: float = 1.0, mass: float = 1.0) -> Bearing:
    """Return a bearing with its lengths, moduli and the balls' density multiplied."""
    rest = {key: value for key, value in drawn.items() if key not in ("density", "ball_diameter_mm")}
    steel = {"youngs_modulus_gpa": 206.0 * modulus, "poisson_ratio": 0.3, "density_kg_m3": 7800.0}
    return Bearing.model_validate(
        {
            **rest,
            "pitch_diameter_mm": 60.0 * length,
            "ball_diameter_mm": drawn["ball_diameter_mm"] * length,
            "ball": {**steel, "density_kg_m3": drawn["density"] * mass},
            "ring": steel,
        }
    )


def same(found: BearingState, expected: BearingState, *, force: float = 1.0, stiffness: float = 1.0) -> None:
    """Check that two states agree, forces and stiffnesses of the second multiplied."""
    assert np.array_equal(found.solved, expected.solved)
    for name, factor in {
        "inner_contact_angle": 1.0,
        "outer_contact_angle": 1.0,
        "axial_load": force,
        "inner_contact_force": force,
        "outer_contact_force": force,
        "centrifugal_force": force,
        "radial_stiffness": stiffness,
        "axial_stiffness": stiffness,
    }.items():
        assert getattr(found, name) == pytest.approx(factor * getattr(expected, name), rel=SOLVED), name


@EXAMPLES
@given(drawn=BEARINGS, preload=PRELOADS, kind=KINDS, factor=st.floats(0.3, 3.0))
def test_similar_bearings_have_similar_states(drawn: Any, preload: float, kind: Any, factor: float) -> None:
    """Forces scale as E L^2, speeds as (E / rho)^0.5 / L, stiffnesses as E L."""
    speeds = np.array([0.0, 6000.0, 14000.0]) * RPM
    base = axisymmetric_state(bearing_of(drawn), preload, speeds, kind)
    longer = axisymmetric_state(bearing_of(drawn, length=factor), preload * factor**2, speeds / factor, kind)
    same(longer, base, force=factor**2, stiffness=factor)
    stiffer = axisymmetric_state(bearing_of(drawn, modulus=factor, mass=factor), preload * factor, speeds, kind)
    same(stiffer, base, force=factor, stiffness=factor)


@EXAMPLES
@given(drawn=BEARINGS, preload=PRELOADS, kind=KINDS, factor=st.floats(0.5, 2.0))
def test_speed_acts_through_mass_times_its_square(drawn: Any, preload: float, kind: Any, factor: float) -> None:
    speeds = np.array([0.0, 5000.0, 11000.0]) * RPM
    base = axisymmetric_state(bearing_of(drawn), preload, speeds, kind)
    lighter = axisymmetric_state(bearing_of(drawn, mass=factor**-2), preload, speeds * factor, kind)
    same(lighter, base)


@EXAMPLES
@given(
    rpm=st.lists(st.floats(0.0, 30000.0), min_size=1, max_size=8),
    shuffled=st.randoms(use_true_random=False),
    kind=KINDS,
)
def test_order_repeats_and_neighbours_change_no_bit(rpm: list[float], shuffled: Any, kind: Any) -> None:
    bearing = bearing_of(
        {
            "ball_diameter_mm": 8.731,
            "ball_count": 16,
            "contact_angle_deg": 15.0,
            "inner_groove_conformity": 0.57,
            "outer_groove_conformity": 0.54,
            "density": 7800.0,
        }
    )
    order = [*range(len(rpm)), 0]
    shuffled.shuffle(order)
    speeds = np.array(rpm) * RPM
    together = axisymmetric_state(bearing, 80.0, speeds, kind)
    mixed = axisymmetric_state(bearing, 80.0, speeds[order], kind)
    alone = axisymmetric_state(bearing, 80.0, speeds[:1], kind)
    for name in ("radial_stiffness", "axial_stiffness", "inner_contact_angle", "axial_load", "axial_displacement"):
        assert np.array_equal(getattr(mixed, name), getattr(together, name)[order])
        assert getattr(alone, name)[0] == getattr(together, name)[0]


@EXAMPLES
@given(drawn=BEARINGS, preload=PRELOADS)
def test_inertia_spreads_the_contact_angles(drawn: Any, preload: float) -> None:
    speeds = np.linspace(0.0, 14000.0, 8) * RPM
    state = axisymmetric_state(bearing_of(drawn), preload, speeds, "constant")
    state.require_solved()
    assert state.centrifugal_force[0] == 0.0
    assert state.gyroscopic_moment[0] == 0.0
    assert np.all(np.diff(state.inner_contact_angle) > 0.0)
    assert np.all(np.diff(state.outer_contact_angle) < 0.0)
    assert np.all(np.diff(state.centrifugal_force) > 0.0)
    assert np.all(np.diff(state.gyroscopic_moment) > 0.0)


def settled_inner_force(ball: Ball, groove: Array, guess: Array, speed: float) -> Array:
    """Return the inner force (2,) [N] of a ball that has settled between held grooves."""
    centre = guess
    for _ in range(8):  # Newton's method doubles the digits: from 1e-3 of a step eight steps are plenty
        found = balance(ball, groove, centre, speed)
        centre = centre - np.linalg.solve(found.by_centre, found.residual)
    return balance(ball, groove, centre, speed).ring_load[:2]


def ring_force(bearing: Bearing, state: BearingState, shift: Array) -> Array:
    """Return the force (3,) of all balls on a ring that is shifted by (axial, y, z) [m] from its state."""
    ball, speed = ball_of(bearing), float(state.spindle_speed[0])
    rest = unloaded_groove_distance(bearing) + np.array([state.axial_displacement[0], 0.0])
    give = (state.outer_contact_force[0] / ball.outer_factor) ** (2.0 / 3.0)
    angle = float(state.outer_contact_angle[0])
    centre = (ball.outer_reach + give) * np.array([math.sin(angle), math.cos(angle)])
    total = np.zeros(3)
    for place in 2.0 * math.pi * np.arange(bearing.ball_count) / bearing.ball_count:
        groove = rest + np.array([shift[0], shift[1] * math.cos(place) + shift[2] * math.sin(place)])
        axial, radial = settled_inner_force(ball, groove, centre, speed)
        total += np.array([axial, radial * math.cos(place), radial * math.sin(place)])
    return total


@settings(max_examples=8, deadline=None, derandomize=True)
@given(drawn=BEARINGS, preload=PRELOADS, kind=KINDS, rpm=st.floats(0.0, 14000.0))
def test_stiffness_is_the_slope_of_all_balls_on_a_moved_ring(drawn: Any, preload: float, kind: Any, rpm: float) -> None:
    """Every ball settles anew for each place of the ring; forces are differenced, stiffness is not used."""
    bearing = bearing_of(drawn)
    state = axisymmetric_state(bearing, preload, np.array([rpm * RPM]), kind)
    step = 1e-3 * float(state.inner_contact_force[0] / ball_of(bearing).inner_factor) ** (2.0 / 3.0)
    slopes = np.array(
        [(ring_force(bearing, state, d) - ring_force(bearing, state, -d)) / (2.0 * step) for d in step * np.eye(3)]
    )
    axial, radial = float(state.axial_stiffness[0]), float(state.radial_stiffness[0])
    # Central differences over a thousandth of the contact's own compression err by about 1e-6, several
    # times more where speed has bent the curve; the directions do not couple.
    assert slopes == pytest.approx(np.diag([axial, radial, radial]), rel=1e-4, abs=1e-5 * (axial + radial))


def test_constant_preload_ends_where_the_axial_stiffness_vanishes() -> None:
    """Lightly loaded balls at a steep angle: past a fold no axial displacement carries the preload any more."""
    bearing = bearing_of(
        {
            "ball_diameter_mm": 4.447 * 60.0 / 23.02,
            "ball_count": 7,
            "contact_angle_deg": 42.9,
            "inner_groove_conformity": 0.5195,
            "outer_groove_conformity": 0.5893,
            "density": 7800.0,
        }
    )
    preload = 18.33 * (60.0 / 23.02) ** 2
    speeds = np.linspace(0.0, 9000.0, 37) * RPM
    state = axisymmetric_state(bearing, preload, speeds, "constant")
    solved = np.flatnonzero(state.solved)
    assert 0 < len(solved) < len(speeds)
    assert np.array_equal(solved, np.arange(len(solved)))
    assert np.all(state.axial_stiffness[solved] > 0.0)
    # The fold lies within one of the 36 steps beyond the last solved speed; stiffness falls to it as a root.
    assert state.axial_stiffness[solved[-1]] < 0.01 * state.axial_stiffness[0]
    locked = axisymmetric_state(bearing, preload, speeds, "rigid")
    assert np.all(locked.solved), "the fold belongs to the constant load, locked rings run through it"
