"""What the bearing stage promises beyond published numbers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter_core.bearing import axisymmetric_state
from chatter_core.bearing.ball import balance, ball_inertia, ball_of, unloaded_groove_distance
from chatter_core.errors import NoEquilibrium
from chatter_core.machine import Bearing

RPM = 2.0 * math.pi / 60.0


def central(function, at, step):
    return (function(at + step) - function(at - step)) / (2.0 * step)


CONTROLS = pytest.mark.parametrize("control", ["outer", "inner", "hybrid"])


@CONTROLS
def test_jacobians_of_the_ball_are_the_derivatives(control, reference_machine):
    bearing = reference_machine.bearing.model_copy(update={"raceway_control": control})
    ball, groove = ball_of(bearing), unloaded_groove_distance(bearing) + np.array([8e-6, 1e-6])
    centre, speed = 0.41 * groove + np.array([2e-7, 1.2e-6]), 15000.0 * RPM
    found = balance(ball, groove, centre, speed)
    step = 1e-10
    for axis in range(2):
        way = np.eye(2)[axis]
        moved_ball, moved_ring = (
            lambda s, d=way: balance(ball, groove, centre + s * d, speed),
            lambda s, d=way: balance(ball, groove + s * d, centre, speed),
        )
        for slope, name, move in (
            (found.by_centre, "residual", moved_ball),
            (found.by_groove, "residual", moved_ring),
            (found.load_by_centre, "ring_load", moved_ball),
            (found.load_by_groove, "ring_load", moved_ring),
        ):
            difference = central(lambda s, n=name, m=move: getattr(m(s), n), 0.0, step)
            # Central differences over 1e-10 m: rounding of 1e-13 N over 1e-10 m against 1e7 N/m.
            assert slope[:, axis] == pytest.approx(difference, rel=2e-5, abs=200.0)


@CONTROLS
def test_derivatives_of_the_ball_inertia(control, reference_machine):
    ball = ball_of(reference_machine.bearing.model_copy(update={"raceway_control": control}))
    inner, outer, speed = np.array(0.4), np.array(0.15), 20000.0 * RPM
    _, slopes = ball_inertia(ball, inner, outer, speed)
    by_inner = central(lambda a: ball_inertia(ball, a, outer, speed)[0], inner, 1e-6)
    by_outer = central(lambda a: ball_inertia(ball, inner, a, speed)[0], outer, 1e-6)
    # Central differences over 1e-6 rad err by 1e-12 and round by 1e-10.
    assert slopes == pytest.approx(np.stack([by_inner, by_outer], axis=1), rel=1e-7)


def test_many_balls_at_once_are_each_ball_alone(reference_machine):
    bearing = reference_machine.bearing
    ball, groove = ball_of(bearing), unloaded_groove_distance(bearing) + np.array([8e-6, 1e-6])
    centres = 0.41 * groove + np.array([[2e-7, 1.2e-6], [3e-7, -1e-6], [0.0, -2e-5]])
    together = balance(ball, groove, centres, 15000.0 * RPM)
    for i, centre in enumerate(centres):
        alone = balance(ball, groove, centre, 15000.0 * RPM)
        assert np.array_equal(together.residual[i], alone.residual)
        assert np.array_equal(together.residual_slope[i], alone.residual_slope)


@pytest.mark.parametrize("rpm", [0.0, 9000.0, 24000.0])
def test_axial_stiffness_is_the_slope_of_load_over_displacement(rpm, reference_machine):
    speed = np.array([rpm * RPM])
    less, here, more = (
        axisymmetric_state(reference_machine.bearing, load, speed, "constant") for load in (99.9, 100.0, 100.1)
    )
    slope = 0.2 / (more.axial_displacement[0] - less.axial_displacement[0])
    # The solved displacements are differenced over 0.1 %: curvature leaves 1e-6, rounding less.
    assert here.axial_stiffness[0] == pytest.approx(slope, rel=1e-5)


def test_no_speed_depends_on_the_others(reference_machine):
    speeds = np.array([12000.0, 0.0, 500.0, 12000.0, 24000.0, 12130.0]) * RPM
    together = axisymmetric_state(reference_machine.bearing, 100.0, speeds, "constant")
    for i, speed in enumerate(speeds):
        alone = axisymmetric_state(reference_machine.bearing, 100.0, np.array([speed]), "constant")
        assert alone.radial_stiffness[0] == together.radial_stiffness[i]


def test_rigid_preload_is_constant_preload_at_standstill_and_grows_with_speed(reference_machine):
    speeds = np.array([0.0, 12000.0, 24000.0]) * RPM
    spring, locked = (
        axisymmetric_state(reference_machine.bearing, 100.0, speeds, kind) for kind in ("constant", "rigid")
    )
    # The same equation at standstill: rounding alone.
    assert locked.radial_stiffness[0] == pytest.approx(spring.radial_stiffness[0], rel=1e-10)
    assert locked.axial_displacement == pytest.approx(np.full(3, spring.axial_displacement[0]), rel=1e-9)
    assert locked.axial_load[0] == pytest.approx(100.0, rel=1e-9)
    assert np.all(np.diff(locked.axial_load) > 0.0)
    assert np.all(locked.radial_stiffness[1:] > spring.radial_stiffness[1:])
    assert spring.axial_load == pytest.approx(np.full(3, 100.0), rel=1e-9)


def test_standstill_is_hertz_in_closed_form(reference_machine):
    state = axisymmetric_state(reference_machine.bearing, 100.0, np.zeros(1), "constant")
    bearing, ball = reference_machine.bearing, ball_of(reference_machine.bearing)
    angle, force = state.inner_contact_angle[0], state.inner_contact_force[0]
    # One line through both contacts, in balance with the preload, at a distance that closes.
    assert state.outer_contact_angle[0] == pytest.approx(angle, rel=1e-9)
    assert bearing.ball_count * force * math.sin(angle) == pytest.approx(100.0, rel=1e-9)
    give = (force / ball.inner_factor) ** (2 / 3) + (force / ball.outer_factor) ** (2 / 3)
    reach = (ball.inner_reach + ball.outer_reach + give) * math.cos(angle)
    assert reach == pytest.approx(unloaded_groove_distance(bearing)[1], rel=1e-12)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(
    preload=st.floats(20.0, 2000.0),
    angle=st.floats(12.0, 40.0),
    inner=st.floats(0.515, 0.57),
    outer=st.floats(0.515, 0.57),
    density=st.sampled_from([3200.0, 7800.0]),
    kind=st.sampled_from(["constant", "rigid"]),
)
def test_equilibrium_holds_and_stiffness_is_positive(preload, angle, inner, outer, density, kind):
    ball_modulus = 310.0 if density < 5000.0 else 206.0
    bearing = Bearing.model_validate(
        {
            "pitch_diameter_mm": 60.0,
            "ball_diameter_mm": 8.731,
            "ball_count": 19,
            "contact_angle_deg": angle,
            "inner_groove_conformity": inner,
            "outer_groove_conformity": outer,
            "ball": {"youngs_modulus_gpa": ball_modulus, "poisson_ratio": 0.27, "density_kg_m3": density},
            "ring": {"youngs_modulus_gpa": 206.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0},
        }
    )
    state = axisymmetric_state(bearing, preload, np.array([0.0, 7000.0, 20000.0]) * RPM, kind)
    state.require_solved()
    lever = 2.0 * state.gyroscopic_moment / bearing.ball_diameter
    outwards = (
        state.inner_contact_force * np.cos(state.inner_contact_angle)
        - state.outer_contact_force * np.cos(state.outer_contact_angle)
        - lever * np.sin(state.outer_contact_angle)
        + state.centrifugal_force
    )
    along = (
        state.inner_contact_force * np.sin(state.inner_contact_angle)
        - state.outer_contact_force * np.sin(state.outer_contact_angle)
        + lever * np.cos(state.outer_contact_angle)
    )
    # The solver's own tolerance is 1e-12 of the largest force, plus rounding of distances.
    assert np.abs(np.stack([outwards, along])).max() <= 1e-9 * state.outer_contact_force.max()
    assert np.all(state.radial_stiffness > 0.0)
    assert np.all(state.axial_stiffness > 0.0)
    assert np.all(np.diff(state.centrifugal_force) > 0.0)


@pytest.mark.parametrize("preload", [0.1, 1.0, 1e5])
def test_extreme_preloads_are_solved_at_all_speeds(preload, reference_machine):
    speeds = np.array([0.0, 100.0, 300.0, 1000.0, 5000.0, 40000.0]) * RPM
    state = axisymmetric_state(reference_machine.bearing, preload, speeds, "constant")
    state.require_solved()
    assert np.all(state.radial_stiffness > 0.0)


def test_a_bearing_that_cannot_run_says_so(reference_machine):
    """Between locked rings the balls press so far into the outer race that they leave the inner one."""
    speeds = np.array([0.0, 50000.0, 200000.0]) * RPM
    state = axisymmetric_state(reference_machine.bearing, 100.0, speeds, "rigid")
    assert list(state.solved) == [True, True, False]
    assert math.isnan(state.radial_stiffness[2])
    message = r"no equilibrium at 200000 rpm with a preload of 100 N.*raise the preload"
    with pytest.raises(NoEquilibrium, match=message):
        state.require_solved()


def test_a_preload_that_no_contact_carries_is_told(reference_machine):
    soft = {"youngs_modulus": 1e6}
    bearing = reference_machine.bearing
    parts = {name: getattr(bearing, name).model_copy(update=soft) for name in ("ball", "ring")}
    with pytest.raises(NoEquilibrium, match="at standstill does not carry its preload"):
        axisymmetric_state(bearing.model_copy(update=parts), 1e6, np.zeros(1), "constant")


def test_a_path_ends_where_a_stiffness_would_go_through_infinity(reference_machine):
    """Hardly preloaded and rolling on its inner race: beyond, the ring's radial stiffness comes out negative."""
    bearing = reference_machine.bearing.model_copy(update={"raceway_control": "inner"})
    speed = np.arange(1000.0, 20001.0, 500.0) * RPM
    state = axisymmetric_state(bearing, 10.0, speed, "constant")
    end = int(state.solved.argmin())
    assert 0 < end < len(speed)
    assert not state.solved[end:].any()
    assert (state.radial_stiffness[:end] > 0.0).all()
    assert np.isnan(state.radial_stiffness[end:]).all()
    # A speed that is asked for alone lies on the same path.
    assert not axisymmetric_state(bearing, 10.0, speed[-1:], "constant").solved.any()
