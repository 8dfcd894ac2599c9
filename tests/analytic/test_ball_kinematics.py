"""A ball that rolls between two races, from rigid-body kinematics and Newton and Euler alone.

Seen from the cage, the ball's angular velocity (axial, radial) and the cage's speed follow from three
linear equations: no slip at either contact, no spin at the race that controls. Its angular momentum
turns with the cage, so a moment w_m J W_r has to act about the direction of travel.
"""

import numpy as np
import pytest

from chatter_core.bearing.ball import balance, ball_inertia, ball_of, unloaded_groove_distance

SPEED = 1500.0


def rolling(ball, inner, outer, control):
    """Return cage speed, and axial and radial angular velocity of the ball in the cage's frame."""
    radius, middle = ball.diameter / 2.0, ball.pitch_diameter / 2.0
    at_outer, at_inner = middle + radius * np.cos(outer), middle - radius * np.cos(inner)
    # Unknowns (w_m, W_x, W_r); velocities in the direction of travel, axial x radial = travel.
    no_slip = [
        [at_outer, radius * np.cos(outer), -radius * np.sin(outer)],
        [at_inner, -radius * np.cos(inner), radius * np.sin(inner)],
    ]
    if control == "inner":
        no_spin, spun = [np.sin(inner), np.sin(inner), np.cos(inner)], SPEED * np.sin(inner)
    else:
        no_spin, spun = [np.sin(outer), np.sin(outer), np.cos(outer)], 0.0
    return np.linalg.solve(np.array([*no_slip, no_spin]), [0.0, SPEED * at_inner, spun])


@pytest.mark.parametrize("control", ["outer", "inner", "hybrid"])
def test_orbit_spin_and_moment_are_those_of_rolling(control, reference_machine):
    ball = ball_of(reference_machine.bearing.model_copy(update={"raceway_control": control}))
    random = np.random.default_rng(8)
    for inner, outer in random.uniform(-0.2, 0.9, (50, 2)):
        cage, _, radial = rolling(ball, inner, outer, control)
        (centrifugal, moment), _ = ball_inertia(ball, np.array(inner), np.array(outer), SPEED)
        assert centrifugal == pytest.approx(0.5 * ball.mass * ball.pitch_diameter * cage**2, rel=1e-12)
        assert abs(moment) == pytest.approx(abs(ball.inertia * cage * radial), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("control", ["outer", "inner", "hybrid"])
@pytest.mark.parametrize(("choice", "sense"), [("rigid_body", 1.0), ("published", -1.0)])
def test_friction_turns_the_ball_as_newton_and_euler_want_or_against_it(choice, sense, control, reference_machine):
    """With ``rigid_body`` the friction's moment is the rate of angular momentum; as published it is its opposite."""
    described = reference_machine.bearing.model_copy(update={"raceway_control": control})
    with_moment, without = (
        ball_of(described.model_copy(update={"gyroscopic_moment": name})) for name in (choice, "none")
    )
    groove = unloaded_groove_distance(described) + np.array([8e-6, 1e-6])
    centre = 0.41 * groove + np.array([2e-7, 1.2e-6])
    full, bare = (balance(ball, groove, centre, SPEED) for ball in (with_moment, without))
    at_inner = full.ring_load[:2] - bare.ring_load[:2]
    at_outer = full.residual - bare.residual - at_inner
    inner, outer = float(full.inner_contact_angle), float(full.outer_contact_angle)
    arm_inner = -0.5 * with_moment.diameter * np.array([np.sin(inner), np.cos(inner)])
    arm_outer = 0.5 * with_moment.diameter * np.array([np.sin(outer), np.cos(outer)])
    moment = sum(arm[0] * force[1] - arm[1] * force[0] for arm, force in ((arm_inner, at_inner), (arm_outer, at_outer)))
    cage, _, radial = rolling(with_moment, inner, outer, control)
    assert moment == pytest.approx(sense * with_moment.inertia * cage * radial, rel=1e-9)
