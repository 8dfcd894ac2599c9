"""General bearing load by second methods and by what must hold for every bearing and load.

- At standstill the balls are springs: the displacement minimises their elastic energy less the work of
  the load. The minimum is sought by a simplex, which knows neither forces nor stiffness.
- At speed all balls and the ring are solved at once by another program's root finder, from equations
  written out here after Harris and Kotzalas (2007), chapter 3, in sines and cosines of X and A.
- The stiffness is the slope of the load over the displacement.
"""

import math

import numpy as np
import pytest
from hypothesis import Phase, given, reject, settings
from hypothesis import strategies as st
from scipy.optimize import fsolve, minimize

from chatter_core.bearing.ball import ball_inertia, ball_of, unloaded_groove_distance
from chatter_core.bearing.general import displaced_bearing, groove_radius, loaded_bearing
from chatter_core.errors import NoEquilibrium
from chatter_core.machine import Bearing

RPM = 2.0 * math.pi / 60.0
#: A failing example is told as it is: making it smaller takes minutes of solving.
EXAMPLES = settings(max_examples=12, deadline=None, derandomize=True, phases=(Phase.explicit, Phase.generate))
STEEL = {"youngs_modulus_gpa": 206.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0}
BEARINGS = st.builds(
    lambda ball, count, angle, inner, outer, control: Bearing.model_validate(
        {
            "pitch_diameter_mm": 60.0,
            "ball_diameter_mm": ball,
            "ball_count": count,
            "contact_angle_deg": angle,
            "inner_groove_conformity": inner,
            "outer_groove_conformity": outer,
            "ball": STEEL,
            "ring": STEEL,
            "raceway_control": control,
        }
    ),
    ball=st.floats(5.0, 11.0),
    count=st.integers(7, 14),
    angle=st.floats(12.0, 40.0),
    inner=st.floats(0.515, 0.57),
    outer=st.floats(0.515, 0.57),
    control=st.sampled_from(["outer", "inner", "hybrid"]),
)
#: Loads that leave some balls lightly loaded or out of the load zone, and others that do not.
AXIAL, RADIAL_SHARE, MOMENT_SHARE = st.floats(100.0, 2000.0), st.floats(-1.5, 1.5), st.floats(-0.8, 0.8)


def solved_bearing(bearing, load, speed=0.0):
    """Solve a bearing. With inner raceway control at speed some loads have no solution that is found."""
    try:
        return loaded_bearing(bearing, load, speed)
    except NoEquilibrium:
        if bearing.raceway_control == "inner" and speed > 0.0:
            reject()
        raise


def load_of(axial: float, radial: float, moment: float) -> np.ndarray:
    return axial * np.array([1.0, radial, moment * 0.03])


@EXAMPLES
@given(bearing=BEARINGS, axial=AXIAL, radial=RADIAL_SHARE, moment=MOMENT_SHARE)
def test_at_rest_the_ring_lies_where_energy_is_least(bearing, axial, radial, moment):
    load = load_of(axial, radial, moment)
    found = solved_bearing(bearing, load)
    ball, arm = ball_of(bearing), groove_radius(bearing)
    distance = (bearing.inner_groove_conformity + bearing.outer_groove_conformity - 1.0) * bearing.ball_diameter
    angle, cosine = bearing.contact_angle, np.cos(found.azimuth)
    unit = 1e-5 * np.array([1.0, 1.0, 1.0 / arm])

    def energy(scaled):
        axial_move, radial_move, tilt = scaled * unit
        length = np.hypot(
            distance * math.sin(angle) + axial_move + tilt * arm * cosine,
            distance * math.cos(angle) + radial_move * cosine,
        )
        squeeze = np.maximum(0.0, length - distance)
        return float(1e3 * (0.4 * ball.series_factor * np.sum(squeeze**2.5) - load @ (scaled * unit)))

    lowest = minimize(
        energy,
        np.ones(3),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-15, "maxiter": 8000, "maxfev": 8000},
    )
    # Near the minimum energy is flat: rounding of 1e-16 of it leaves 1e-8 of the step, some more for a simplex.
    assert found.displacement / unit == pytest.approx(lowest.x, rel=2e-4, abs=2e-4)
    assert energy(found.displacement / unit) <= lowest.fun + 1e-9 * abs(lowest.fun)


def harris_equations(bearing: Bearing, load, speed, cosine):
    """Return the residual of all balls and the ring, unknowns (X_1, X_2, delta_i, delta_o) of each ball, ring."""
    ball, arm, count = ball_of(bearing), groove_radius(bearing), bearing.ball_count
    diameter, gamma = bearing.ball_diameter, bearing.ball_diameter / bearing.pitch_diameter
    distance = (bearing.inner_groove_conformity + bearing.outer_groove_conformity - 1.0) * diameter
    angle = bearing.contact_angle
    micro = 1e-6

    def residual(unknowns):
        x1, x2, inner, outer = unknowns[:-3].reshape(4, count) * np.array([[1e-4], [1e-4], [micro], [micro]])
        axial, radial, tilt = unknowns[-3:] * micro * np.array([1.0, 1.0, 1.0 / arm])
        a1 = distance * math.sin(angle) + axial + tilt * arm * cosine
        a2 = distance * math.cos(angle) + radial * cosine
        reach_o, reach_i = ball.outer_reach + outer, ball.inner_reach + inner
        cos_o, sin_o, cos_i, sin_i = x2 / reach_o, x1 / reach_o, (a2 - x2) / reach_i, (a1 - x1) / reach_i
        tangent = sin_o / (cos_o + gamma)
        if bearing.raceway_control == "inner":
            tangent = sin_i / (cos_i - gamma)
        beta = np.arctan(tangent)
        orbit = 1.0 / (
            1.0
            + (1.0 + gamma * cos_o) * (cos_i + tangent * sin_i) / ((1.0 - gamma * cos_i) * (cos_o + tangent * sin_o))
        )
        spin = 1.0 / (
            gamma
            * np.cos(beta)
            * ((cos_o + tangent * sin_o) / (1.0 + gamma * cos_o) + (cos_i + tangent * sin_i) / (1.0 - gamma * cos_i))
        )
        centrifugal = 0.5 * ball.mass * bearing.pitch_diameter * speed**2 * orbit**2
        moment = ball.mass * diameter**2 / 10.0 * spin * orbit * speed**2 * np.sin(beta)
        force_i = ball.inner_factor * np.maximum(inner, 0.0) ** 1.5
        force_o = ball.outer_factor * np.maximum(outer, 0.0) ** 1.5
        share = 0.0 if bearing.raceway_control == "outer" else 2.0 * force_i / (force_i + force_o)
        at_i, at_o = share * moment / diameter, (2.0 - share) * moment / diameter
        axial_i, radial_i = force_i * sin_i - at_i * cos_i, force_i * cos_i + at_i * sin_i
        groove = bearing.inner_groove_conformity * diameter
        return np.concatenate(
            [
                ((a1 - x1) ** 2 + (a2 - x2) ** 2 - reach_i**2) / 1e-10,
                (x1**2 + x2**2 - reach_o**2) / 1e-10,
                axial_i - force_o * sin_o + at_o * cos_o,
                radial_i - force_o * cos_o - at_o * sin_o + centrifugal,
                [
                    np.sum(axial_i) - load[0],
                    np.sum(radial_i * cosine) - load[1],
                    (np.sum((axial_i * arm + at_i * groove) * cosine) - load[2]) / arm,
                ],
            ]
        )

    return residual


def load_by_inertia(bearing: Bearing, speed: float, axial: float, radial: float, moment: float) -> np.ndarray:
    """Return a load whose axial part is a multiple of the balls' centrifugal forces, so that inertia matters."""
    ball = ball_of(bearing)
    still = np.array(bearing.unloaded_contact_angle)
    centrifugal = float(ball_inertia(ball, still, still, speed)[0][0])
    return load_of(axial * bearing.ball_count * centrifugal, radial, moment)


#: Axial load over the sum of centrifugal forces; radial and moment shares that lose some balls.
BY_INERTIA = {
    "bearing": BEARINGS,
    "axial": st.floats(0.5, 4.0),
    "radial": st.floats(-1.2, 1.2),
    "moment": st.floats(-0.4, 0.4),
    "rpm": st.floats(6000.0, 15000.0),
}


@EXAMPLES
@given(**BY_INERTIA)
def test_at_speed_all_balls_and_the_ring_at_once_agree(bearing, axial, radial, moment, rpm):
    speed = rpm * RPM
    load = load_by_inertia(bearing, speed, axial, radial, moment)
    found = solved_bearing(bearing, load, speed)
    ball, arm, cosine = ball_of(bearing), groove_radius(bearing), np.cos(found.azimuth)
    equations = harris_equations(bearing, load, speed, cosine)
    outer = (found.outer_contact_force / ball.outer_factor) ** (2 / 3)
    reach = ball.outer_reach + outer
    x1, x2 = reach * np.sin(found.outer_contact_angle), reach * np.cos(found.outer_contact_angle)
    groove = unloaded_groove_distance(bearing)
    a1 = groove[0] + found.displacement[0] + found.displacement[2] * arm * cosine
    inner = np.hypot(a1 - x1, groove[1] + found.displacement[1] * cosine - x2) - ball.inner_reach  # negative when lost
    ring = found.displacement * np.array([1.0, 1.0, arm])
    exact = np.concatenate([x1 / 1e-4, x2 / 1e-4, inner / 1e-6, outer / 1e-6, ring / 1e-6])
    # Distances squared round at 1e-9 of their unit, forces at 1e-12 of the load.
    assert np.abs(equations(exact)).max() <= 1e-6 * np.abs(load).max()
    # Started beside the solution in every unknown, so that it has to find its own way.
    solved, _, flag, _ = fsolve(equations, exact * 1.003, full_output=True, xtol=1e-13)
    if flag == 1:
        assert solved == pytest.approx(exact, rel=1e-5, abs=1e-5)


def difference_steps(bearing) -> np.ndarray:
    """Steps of a displacement: some nanometres, and the angle that is as much at the groove."""
    return 4e-9 * np.array([1.0, 1.0, 1.0 / groove_radius(bearing)])


def contacts_change(bearing, found, speed) -> bool:
    """Return whether a ball enters or leaves contact within the differences' steps: there is no slope then.

    One that hardly touches under inner control may not settle either, which is an error of its own.
    """
    touching = found.inner_contact_force > 0.0
    moves = np.concatenate([side * 2.0 * np.diag(difference_steps(bearing)) for side in (1.0, -1.0)])
    try:
        beside = [displaced_bearing(bearing, found.displacement + move, speed) for move in moves]
    except NoEquilibrium:
        if bearing.raceway_control != "inner":
            raise
        reject()
    return any(np.any((one.inner_contact_force > 0.0) != touching) for one in beside)


def stiffness_by_differences(bearing, found, speed) -> np.ndarray:
    """Return the slope of the load over the displacement by fourth-order differences over some nanometres."""
    steps = difference_steps(bearing)

    def load(step, way):
        return displaced_bearing(bearing, found.displacement + step * way, speed).load

    columns = [
        (8.0 * (load(h, way) - load(-h, way)) - load(2.0 * h, way) + load(-2.0 * h, way)) / (12.0 * h)
        for h, way in zip(steps, np.eye(3), strict=True)
    ]
    return np.array(columns).T


@EXAMPLES
@given(**BY_INERTIA)
def test_stiffness_at_speed_is_the_slope_of_the_load(bearing, axial, radial, moment, rpm):
    found = solved_bearing(bearing, load_by_inertia(bearing, rpm * RPM, axial, radial, moment), rpm * RPM)
    squeeze = (found.inner_contact_force / ball_of(bearing).inner_factor) ** (2 / 3)
    if np.any((squeeze > 0.0) & (squeeze < 1e-7)) or contacts_change(bearing, found, rpm * RPM):
        return
    sizes = np.array([1.0, 1.0, groove_radius(bearing)])
    scale = np.outer(sizes, sizes)
    differenced = stiffness_by_differences(bearing, found, rpm * RPM) / scale
    # Rounding of forces to 1e-10 N over nanometres, and the differences' own error: below 1e-6.
    assert found.stiffness / scale == pytest.approx(differenced, rel=1e-5, abs=2e-6 * np.abs(differenced).max())


@EXAMPLES
@given(bearing=BEARINGS, axial=AXIAL, radial=RADIAL_SHARE, moment=MOMENT_SHARE)
def test_stiffness_at_rest_is_the_slope_of_the_load_and_symmetric(bearing, axial, radial, moment):
    found = solved_bearing(bearing, load_of(axial, radial, moment))
    sizes = np.array([1.0, 1.0, groove_radius(bearing)])
    stiffness = found.stiffness / np.outer(sizes, sizes)
    differenced = stiffness_by_differences(bearing, found, 0.0) / np.outer(sizes, sizes)
    # A ball within nanometres of leaving its race has lost a root's worth of stiffness: 1e-4 of all.
    assert stiffness == pytest.approx(differenced, rel=1e-4, abs=1e-4 * np.abs(stiffness).max())
    # Springs: the stiffness of a potential is symmetric.
    assert stiffness == pytest.approx(stiffness.T, rel=1e-9, abs=1e-9 * np.abs(stiffness).max())


@EXAMPLES
@given(bearing=BEARINGS, axial=AXIAL, radial=RADIAL_SHARE, moment=MOMENT_SHARE)
def test_a_load_turned_by_a_ball_pitch_meets_the_same_bearing(bearing, axial, radial, moment):
    """Reversing radial force and moment turns the load by half a turn, which even ball counts do not notice."""
    even = bearing.model_copy(update={"ball_count": bearing.ball_count // 2 * 2})
    forth, back = (solved_bearing(even, load_of(axial, sign * radial, sign * moment)) for sign in (1.0, -1.0))
    assert back.displacement == pytest.approx(forth.displacement * [1.0, -1.0, -1.0], rel=1e-6, abs=1e-12)
    half = even.ball_count // 2
    expected = np.roll(forth.inner_contact_force, half)
    assert back.inner_contact_force == pytest.approx(expected, rel=1e-6, abs=1e-6 * axial)
