"""Angular contact ball bearing under axial preload: contact angles and stiffness over speed (Jones).

A ball finds its place X between the grooves' centres of curvature. With u = A - X towards the inner
and v = X towards the outer one (component 1 axial, 2 radial), its equilibrium is

    Q_i u/|u| - Q_o v/|v| + (2 M_g / D) (cos a_o, -sin a_o) + (0, F_c) = 0,   Q = K delta^1.5

with delta the compression along u or v, F_c the centrifugal force and M_g the gyroscopic moment of
the ball, which the outer race alone holds (outer raceway control, lambda_i = 0, lambda_o = 2).

Sources: A. B. Jones, J. Basic Eng. 82 (1960) 309-320; T. A. Harris, M. N. Kotzalas, Advanced
Concepts of Bearing Technology, 5th ed. (2007), chapters 2 and 3; equations 1-10 of "Effects of
spindle speed-dependent dynamic characteristics of ball bearing and multi-modes on the stability of
milling processes", whose equation 2 has lost the ball's mass and whose equation 6 is garbled.
"""

import math
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chatter_core import hertz
from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.machine import Bearing

Array = NDArray[np.float64]
PreloadType = Literal["constant", "rigid"]

#: Step of the path from standstill [rad/s] (250 rpm); it is halved where Newton's method fails.
PATH_STEP = 250.0 * 2.0 * math.pi / 60.0
#: Halvings of a step before the path ends.
HALVINGS = 16
#: Residual force that counts as equilibrium, relative to the largest force on the ball.
FORCE_TOLERANCE = 1e-12
#: Rounding of a distance, relative to it.
ROUNDING = 8.0 * np.finfo(float).eps
#: Newton steps from one path point to the next.
NEWTON_STEPS = 40


@dataclass(frozen=True, kw_only=True)
class BearingState:
    """State of one bearing over speed; every array is (speed,), NaN where ``solved`` is False.

    spindle_speed [rad/s]; preload, what was asked for [N]; axial_load on the bearing [N], contact
    angles [rad], contact forces, centrifugal force [N] and gyroscopic moment [N m] of one ball;
    axial_displacement of the inner ring from the unloaded bearing [m]; stiffnesses [N/m].
    """

    preload: float
    spindle_speed: Array
    axial_load: Array
    inner_contact_angle: Array
    outer_contact_angle: Array
    inner_contact_force: Array
    outer_contact_force: Array
    centrifugal_force: Array
    gyroscopic_moment: Array
    axial_displacement: Array
    radial_stiffness: Array
    axial_stiffness: Array
    solved: NDArray[np.bool_]

    def at(self, speeds: NDArray[np.intp]) -> "BearingState":
        """Return the state at some of the speeds."""
        arrays = [field.name for field in fields(self) if field.name != "preload"]
        return replace(self, **{name: getattr(self, name)[speeds] for name in arrays})

    def require_solved(self) -> None:
        """Raise NoEquilibrium when some speed has no solution."""
        if not self.solved.all():
            speed = float(self.spindle_speed[~self.solved].min()) * 60.0 / (2.0 * math.pi)
            raise NoEquilibrium(
                f"the bearing has no equilibrium at {speed:.6g} rpm with a preload of {self.preload:g} N: a ball "
                "leaves its inner race, or the balls' inertia exceeds what the contacts hold; raise the preload or "
                "lower the speed"
            )


@dataclass(frozen=True, kw_only=True)
class Ball:
    """Constants of one ball between its races, in SI.

    inner_reach and outer_reach are the distances of the unloaded ball's centre from the grooves'
    centres of curvature; inner_factor and outer_factor the load-deflection factors.
    """

    inner_reach: float
    outer_reach: float
    inner_factor: float
    outer_factor: float
    diameter: float
    mass: float
    pitch_diameter: float

    @property
    def diameter_ratio(self) -> float:
        """Ball diameter over pitch diameter [-]."""
        return self.diameter / self.pitch_diameter

    @property
    def inertia(self) -> float:
        """Moment of inertia of the ball [kg m2]."""
        return self.mass * self.diameter**2 / 10.0


def ball_of(bearing: Bearing) -> Ball:
    """Return the constants of a bearing's balls; load-deflection factors at the design contact angle."""
    ratio = bearing.ball_diameter * math.cos(bearing.contact_angle) / bearing.pitch_diameter
    inner, outer = (
        hertz.load_deflection_factor(
            hertz.race_curvature(bearing.ball_diameter, conformity, across), bearing.ball, bearing.ring
        )
        for conformity, across in (
            (bearing.inner_groove_conformity, 2.0 * ratio / (1.0 - ratio)),
            (bearing.outer_groove_conformity, -2.0 * ratio / (1.0 + ratio)),
        )
    )
    return Ball(
        inner_reach=(bearing.inner_groove_conformity - 0.5) * bearing.ball_diameter,
        outer_reach=(bearing.outer_groove_conformity - 0.5) * bearing.ball_diameter,
        inner_factor=inner,
        outer_factor=outer,
        diameter=bearing.ball_diameter,
        mass=bearing.ball.density * math.pi / 6.0 * bearing.ball_diameter**3,
        pitch_diameter=bearing.pitch_diameter,
    )


def unloaded_groove_distance(bearing: Bearing) -> Array:
    """Return the inner groove's centre seen from the outer one's, axial and radial (2,) [m], without load."""
    distance = (bearing.inner_groove_conformity + bearing.outer_groove_conformity - 1.0) * bearing.ball_diameter
    return distance * np.array([math.sin(bearing.contact_angle), math.cos(bearing.contact_angle)])


def contact_force(reach: float, factor: float, distance: Array) -> tuple[Array, Array]:
    """Return the force of one contact along ``distance`` (2,) [m] and its Jacobian (2, 2) [N/m]."""
    length = math.hypot(*distance)
    compression = max(0.0, length - reach)
    force, slope = factor * compression**1.5, 1.5 * factor * math.sqrt(compression)
    unit = distance / length
    along = np.outer(unit, unit)
    return force * unit, slope * along + force / length * (np.eye(2) - along)


def ball_inertia(ball: Ball, inner: float, outer: float, spindle_speed: float) -> tuple[Array, Array]:
    """Return centrifugal force and gyroscopic moment of a ball, and their derivatives.

    inner, outer: contact angles [rad]; result: (F_c [N], M_g [N m]) and their derivatives to the
    inner and outer angle (2, 2). With outer raceway control, g = D / d_m, t = tan(beta):

        F_c = 1/2 m d_m w^2 (w_m/w)^2,          w_m/w = (1 - g cos a_i) / (1 + cos(a_i - a_o))
        M_g = J w^2 (w_m/w) t / (g (p + q)),     t = sin a_o / (cos a_o + g)
        p = (cos a_o + t sin a_o) / (1 + g cos a_o),   q = (cos a_i + t sin a_i) / (1 - g cos a_i)

    M_g is positive as it stands in the equilibrium; the minus sign of the ball's spin is its sense
    of rotation. Source: equations 2-5 of the paper named above; Harris and Kotzalas (2007), chapter 2.
    """
    g = ball.diameter_ratio
    sin_i, cos_i, sin_o, cos_o = math.sin(inner), math.cos(inner), math.sin(outer), math.cos(outer)
    apart, apart_slope = 1.0 + math.cos(inner - outer), math.sin(inner - outer)
    orbit = (1.0 - g * cos_i) / apart
    orbit_o = -orbit * apart_slope / apart
    orbit_i = g * sin_i / apart - orbit_o
    t, t_o = sin_o / (cos_o + g), (1.0 + g * cos_o) / (cos_o + g) ** 2
    wide, narrow = 1.0 + g * cos_o, 1.0 - g * cos_i
    p, q = (cos_o + t * sin_o) / wide, (cos_i + t * sin_i) / narrow
    p_o = (-sin_o + t_o * sin_o + t * cos_o + p * g * sin_o) / wide
    q_i = (-sin_i + t * cos_i - q * g * sin_i) / narrow
    q_o = t_o * sin_i / narrow
    centrifugal = 0.5 * ball.mass * ball.pitch_diameter * spindle_speed**2
    gyroscopic = ball.inertia * spindle_speed**2 / (g * (p + q))
    values = np.array([centrifugal * orbit**2, gyroscopic * orbit * t])
    derivatives = np.array(
        [
            [2.0 * centrifugal * orbit * orbit_i, 2.0 * centrifugal * orbit * orbit_o],
            [
                gyroscopic * t * (orbit_i - orbit * q_i / (p + q)),
                gyroscopic * (orbit_o * t + orbit * t_o - orbit * t * (p_o + q_o) / (p + q)),
            ],
        ]
    )
    return values, derivatives


@dataclass(frozen=True, kw_only=True)
class BallBalance:
    """Balance of one ball: residual force (2,), inner contact force (2,), and their Jacobians (2, 2).

    by_inner: derivative of the residual to u = A - X at constant v; by_outer: to v = X at constant u;
    inner_slope: derivative of the inner force to u; inertia: F_c and M_g.
    """

    residual: Array
    inner_force: Array
    outer_force: Array
    inner_slope: Array
    by_inner: Array
    by_outer: Array
    inertia: Array

    @property
    def by_centre(self) -> Array:
        """Derivative of the residual to the ball's place X (2, 2) [N/m]."""
        return self.by_outer - self.by_inner

    def ring_stiffness(self) -> Array:
        """Return d(inner force)/dA with the ball following in equilibrium (2, 2) [N/m].

        From the implicit function theorem: dX/dA = -(dR/dX)^-1 dR/dA.
        """
        followed = -np.linalg.solve(self.by_centre, self.by_inner)
        return np.asarray(self.inner_slope @ (np.eye(2) - followed))


def balance(ball: Ball, groove: Array, centre: Array, spindle_speed: float) -> BallBalance:
    """Return the balance of a ball at ``centre`` X (2,) between grooves ``groove`` A (2,) apart [m]."""
    u, v = groove - centre, centre
    inner_force, inner_slope = contact_force(ball.inner_reach, ball.inner_factor, u)
    outer_force, outer_slope = contact_force(ball.outer_reach, ball.outer_factor, v)
    inner, outer = math.atan2(u[0], u[1]), math.atan2(v[0], v[1])
    inertia, slopes = ball_inertia(ball, inner, outer, spindle_speed)
    inner_turn = np.array([u[1], -u[0]]) / (u @ u)  # d(angle)/du
    outer_turn = np.array([v[1], -v[0]]) / (v @ v)
    across = np.array([math.cos(outer), -math.sin(outer)])
    across_slope = np.array([-math.sin(outer), -math.cos(outer)])
    lever = 2.0 / ball.diameter
    # What the inertia's dependence on the two angles does to the residual.
    by_angle = np.outer(lever * across, slopes[1]) + np.outer([0.0, 1.0], slopes[0])
    by_angle[:, 1] += lever * inertia[1] * across_slope
    return BallBalance(
        residual=inner_force - outer_force + lever * inertia[1] * across + np.array([0.0, inertia[0]]),
        inner_force=inner_force,
        outer_force=outer_force,
        inner_slope=inner_slope,
        by_inner=inner_slope + np.outer(by_angle[:, 0], inner_turn),
        by_outer=-outer_slope + np.outer(by_angle[:, 1], outer_turn),
        inertia=inertia,
    )


def axisymmetric_state(
    bearing: Bearing, preload: float, spindle_speed: Array, preload_type: PreloadType
) -> BearingState:
    """Return the state of a bearing under axial load alone, at speeds (speed,) [rad/s] in any order.

    All balls are alike, so one of them stands for all. ``constant`` preload keeps the axial force
    [N], ``rigid`` keeps the axial displacement that this force causes at standstill. The solution is
    continued from standstill along one fixed path of speeds, so that it does not depend on which
    other speeds are asked for. ``solved`` is False from the speed on where the path ends.

    Valid while every ball touches both races, for preloads from 0.1 N. Raises InvalidInput for a speed that is
    negative or not finite. Source: Jones (1960).
    """
    if not np.all(np.isfinite(spindle_speed) & (spindle_speed >= 0.0)):
        raise InvalidInput(["spindle_speed: every speed of the bearing must be a finite number, at least 0"])
    ball, unloaded = ball_of(bearing), unloaded_groove_distance(bearing)
    path = _Path(ball=ball, unloaded=unloaded, axial_force=preload / bearing.ball_count)
    rows = {}
    start = path.standstill(bearing.contact_angle)
    held = float(start[2]) if preload_type == "rigid" else None
    anchor, unknowns, alive = 0, start, True
    for speed in np.unique(spindle_speed):
        while alive and (anchor + 1) * PATH_STEP <= speed:
            following = path.advance(unknowns, anchor * PATH_STEP, (anchor + 1) * PATH_STEP, held)
            alive = following is not None
            if following is not None:
                anchor, unknowns = anchor + 1, following
        reached = path.advance(unknowns, anchor * PATH_STEP, float(speed), held) if alive else None
        rows[float(speed)] = _row(path, reached, float(speed), bearing.ball_count)
    names = [field.name for field in fields(BearingState) if field.name not in ("preload", "spindle_speed", "solved")]
    table = np.array([rows[float(speed)] for speed in spindle_speed]).reshape(len(spindle_speed), len(names))
    columns = dict(zip(names, table.T, strict=True))
    return BearingState(
        preload=preload,
        spindle_speed=np.asarray(spindle_speed, dtype=float),
        solved=np.isfinite(columns["radial_stiffness"]),
        **columns,
    )


def _row(path: "_Path", unknowns: Array | None, speed: float, ball_count: int) -> list[float]:
    """Return the fields of BearingState at one speed, in their order."""
    if unknowns is None:
        return [math.nan] * 10
    found = path.balance(unknowns, speed)
    stiffness = ball_count * found.ring_stiffness()
    inner, outer = (math.atan2(force[0], force[1]) for force in (found.inner_force, found.outer_force))
    return [
        ball_count * float(found.inner_force[0]),
        inner,
        outer,
        math.hypot(*found.inner_force),
        math.hypot(*found.outer_force),
        float(found.inertia[0]),
        float(found.inertia[1]),
        float(unknowns[2]),
        0.5 * float(stiffness[1, 1]),  # the mean of cos^2 over the balls is one half
        float(stiffness[0, 0]),
    ]


@dataclass(frozen=True, kw_only=True)
class _Path:
    """Continuation in speed of (X_1, X_2, axial displacement) of the ball that stands for all."""

    ball: Ball
    unloaded: Array
    axial_force: float

    def balance(self, unknowns: Array, speed: float) -> BallBalance:
        groove = self.unloaded + np.array([unknowns[2], 0.0])
        return balance(self.ball, groove, unknowns[:2], speed)

    def standstill(self, contact_angle: float) -> Array:
        """Return the state at standstill, from the one at the design contact angle.

        At standstill both contacts carry the same force in line, so the angle alone is unknown: the
        radial distance of the grooves is kept while the contacts give.
        """
        force = self.axial_force / math.sin(contact_angle)
        for _ in range(200):
            give = (force / self.ball.inner_factor) ** (2 / 3) + (force / self.ball.outer_factor) ** (2 / 3)
            distance = self.ball.inner_reach + self.ball.outer_reach + give
            angle = math.acos(self.unloaded[1] / distance)
            force = 0.5 * (force + self.axial_force / math.sin(angle))
        unit = np.array([math.sin(angle), math.cos(angle)])
        centre = (self.ball.outer_reach + (force / self.ball.outer_factor) ** (2 / 3)) * unit
        guess = np.array([*centre, distance * unit[0] - self.unloaded[0]])
        settled = self._newton(guess, 0.0, None)
        if settled is None:
            raise NoEquilibrium("the bearing at standstill does not settle under its preload")
        return settled

    def advance(self, unknowns: Array, start: float, end: float, held: float | None) -> Array | None:
        """Follow the solution from one speed to another; None where the path ends."""
        step, speed = end - start, start
        while True:
            following = self._newton(unknowns, min(speed + step, end), held)
            if following is not None:
                speed, unknowns, step = min(speed + step, end), following, 2.0 * step
                if speed >= end:
                    return unknowns
            else:
                step *= 0.5
                if step < PATH_STEP * 0.5**HALVINGS:
                    return None

    def _newton(self, unknowns: Array, speed: float, held: float | None) -> Array | None:
        """Solve ball and ring at one speed by damped Newton steps; None when they fail."""
        residual, jacobian, size = self._system(unknowns, speed, held)
        for _ in range(NEWTON_STEPS):
            # A force cannot be known better than the rounding of the distances that it springs from.
            rounding = ROUNDING * np.abs(jacobian).max() * math.hypot(*self.unloaded)
            allowed = FORCE_TOLERANCE * size + rounding
            if np.abs(residual).max() <= allowed:
                return unknowns
            step = np.linalg.solve(jacobian, -residual)
            for damping in 0.5 ** np.arange(10):
                trial = unknowns + damping * step
                found, found_jacobian, found_size = self._system(trial, speed, held)
                touching = found_size > 0.0 and np.all(np.isfinite(found))
                if touching and np.linalg.norm(found) <= (1.0 - 0.1 * damping) * np.linalg.norm(residual):
                    break
            else:
                return None
            unknowns, residual, jacobian, size = trial, found, found_jacobian, found_size
        return None

    def _system(self, unknowns: Array, speed: float, held: float | None) -> tuple[Array, Array, float]:
        """Return residual (3,), Jacobian (3, 3) and the largest force; the force is 0 when contact is lost."""
        found = self.balance(unknowns, speed)
        jacobian = np.zeros((3, 3))
        jacobian[:2, :2] = found.by_centre
        jacobian[:2, 2] = found.by_inner[:, 0]
        if held is None:
            last = found.inner_force[0] - self.axial_force
            jacobian[2, :2], jacobian[2, 2] = -found.inner_slope[0], found.inner_slope[0, 0]
        else:
            # A displacement in the unit of a force, so that one tolerance serves all three.
            unit = float(found.inner_slope[0, 0]) or 1.0
            last, jacobian[2, 2] = unit * (unknowns[2] - held), unit
        forces = (math.hypot(*found.inner_force), math.hypot(*found.outer_force))
        return np.array([*found.residual, last]), jacobian, max(forces) if min(forces) > 0.0 else 0.0
