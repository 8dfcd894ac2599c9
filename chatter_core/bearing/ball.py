"""One ball between two grooves: contact forces, inertia, balance, and their derivatives.

With u = A - X from the ball's place X to the inner groove's centre of curvature and v = X to the ball
from the outer one's (component 1 axial, 2 radial), a ball is in equilibrium where

    Q_i u/|u| - Q_o v/|v| + (M_g/D) [l_i (-cos a_i, sin a_i) + l_o (cos a_o, -sin a_o)] + (0, F_c) = 0

with Q = K delta^1.5, delta the compression along u or v, F_c the centrifugal force and M_g the
gyroscopic moment of the ball. l_i + l_o = 2 share the moment between the races, see RACEWAY_CONTROL;
its sense is a choice, see GYROSCOPIC_SENSE.

Every function takes one ball (2,) or many (..., 2).

Sources: A. B. Jones, J. Basic Eng. 82 (1960) 309-320; T. A. Harris, M. N. Kotzalas, Advanced
Concepts of Bearing Technology, 5th ed. (2007), chapters 2 and 3.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chatter_core import hertz
from chatter_core.machine import Bearing

Array = NDArray[np.float64]

#: Columns of u = A - X, towards the inner race, and of v = X, towards the outer one, in a slope to (u, v).
INNER, OUTER = slice(0, 2), slice(2, 4)


@dataclass(frozen=True, kw_only=True)
class Ball:
    """Constants of one ball between its races, in SI.

    inner_reach and outer_reach are the distances of the unloaded ball's centre from the grooves'
    centres of curvature; inner_factor and outer_factor the load-deflection factors; inner_groove the
    radius of the inner groove.
    """

    inner_reach: float
    outer_reach: float
    inner_factor: float
    outer_factor: float
    inner_groove: float
    diameter: float
    mass: float
    pitch_diameter: float
    raceway_control: str
    gyroscopic_sense: float

    @property
    def diameter_ratio(self) -> float:
        """Ball diameter over pitch diameter [-]."""
        return self.diameter / self.pitch_diameter

    @property
    def inertia(self) -> float:
        """Moment of inertia of the ball [kg m2]."""
        return self.mass * self.diameter**2 / 10.0

    @property
    def series_factor(self) -> float:
        """Load-deflection factor of both contacts in line [N/m^1.5], which is how they act at standstill."""
        return float((self.inner_factor ** (-2 / 3) + self.outer_factor ** (-2 / 3)) ** -1.5)


def ball_of(bearing: Bearing) -> Ball:
    """Return the constants of a bearing's balls; load-deflection factors at the unloaded contact angle.

    See docs/physics.md#ball.
    """
    ratio = bearing.ball_diameter * math.cos(bearing.unloaded_contact_angle) / bearing.pitch_diameter
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
        inner_groove=bearing.inner_groove_conformity * bearing.ball_diameter,
        diameter=bearing.ball_diameter,
        mass=bearing.ball.density * math.pi / 6.0 * bearing.ball_diameter**3,
        pitch_diameter=bearing.pitch_diameter,
        raceway_control=bearing.raceway_control,
        gyroscopic_sense=GYROSCOPIC_SENSE[bearing.gyroscopic_moment],
    )


def unloaded_groove_distance(bearing: Bearing) -> Array:
    """Return the inner groove's centre seen from the outer one's, axial and radial (2,) [m], without load.

    With radial clearance P_d (diametral) the radial part is B D - P_d / 2, B = f_i + f_o - 1; the axial
    part is what the free contact angle leaves, or zero where the balls are pressed in (P_d < 0).
    Source: Harris and Kotzalas, Essential Concepts (2007), chapter 2.

    See docs/physics.md#ball.
    """
    distance, angle = bearing.groove_distance, bearing.unloaded_contact_angle
    radial = distance * math.cos(angle) if bearing.radial_clearance is None else distance - bearing.radial_clearance / 2
    return np.array([distance * math.sin(angle), radial])


class _Contact(NamedTuple):
    """One contact of balls (...), every slope to (u, v) on a last axis of four.

    force: along the distance (..., 2) and its slope (..., 2, 4); magnitude (...) and slope (..., 4);
    angle from the radial direction (...) and slope (..., 4); unit vector of the distance (..., 2).
    """

    force: Array
    force_slope: Array
    magnitude: Array
    magnitude_slope: Array
    angle: Array
    angle_slope: Array
    unit: Array


def _contact(reach: float, factor: float, distance: Array, columns: slice) -> _Contact:
    """Return the contact along ``distance`` (..., 2) [m], which is u or v as ``columns`` of (u, v) says."""
    length = np.hypot(distance[..., 0], distance[..., 1])
    root = np.sqrt(np.maximum(0.0, length - reach))
    magnitude, slope = factor * root**3, 1.5 * factor * root
    unit = distance / length[..., None]
    across = np.stack([unit[..., 1], -unit[..., 0]], axis=-1)  # the way of a growing angle
    magnitude_slope = _wide(slope[..., None] * unit, columns)
    angle_slope = _wide(across / length[..., None], columns)
    return _Contact(
        force=magnitude[..., None] * unit,
        force_slope=_outer(unit, magnitude_slope) + _outer(magnitude[..., None] * across, angle_slope),
        magnitude=magnitude,
        magnitude_slope=magnitude_slope,
        angle=np.arctan2(distance[..., 0], distance[..., 1]),
        angle_slope=angle_slope,
        unit=unit,
    )


def _wide(slope: Array, columns: slice) -> Array:
    """Return a slope to u or v (..., 2) as one to both (..., 4)."""
    wide = np.zeros((*slope.shape[:-1], 4))
    wide[..., columns] = slope
    return wide


def _outer(left: Array, right: Array) -> Array:
    """Return the outer products of vectors on the last axes."""
    return np.asarray(left[..., :, None] * right[..., None, :])


class _Share(NamedTuple):
    """Share l_i of the gyroscopic moment at the inner race (...), and its slopes to Q_i and Q_o (...)."""

    inner: Array
    by_inner_force: Array
    by_outer_force: Array


def _all_at_the_outer(inner_force: Array, outer_force: Array) -> _Share:
    nothing = np.zeros_like(inner_force)
    return _Share(nothing, nothing, nothing)


def _proportional_share(inner_force: Array, outer_force: Array) -> _Share:
    total = inner_force + outer_force
    total = np.where(total > 0.0, total, 1.0)  # a ball that touches nothing shares nothing
    return _Share(2.0 * inner_force / total, 2.0 * outer_force / total**2, -2.0 * inner_force / total**2)


class _Control(NamedTuple):
    """How the ball rolls: whether the outer race sets its spin axis, and how its moment is shared."""

    outer_sets_spin: bool
    share: Callable[[Array, Array], _Share]


#: By ``raceway_control``.
#: ``outer``: no spin at the outer race, which alone holds the moment (l_i = 0, l_o = 2).
#: ``inner``: no spin at the inner race, the moment shared in proportion to the contact forces, as two
#: contacts on the point of sliding would; Harris's even share (l_i = l_o = 1) is its value where the
#: forces are alike, and a contact that is lost holds nothing.
#: ``hybrid``: no spin at the outer race, the moment shared as for ``inner``.
RACEWAY_CONTROL = {
    "outer": _Control(True, _all_at_the_outer),
    "inner": _Control(False, _proportional_share),
    "hybrid": _Control(True, _proportional_share),
}

#: Sense in which M_g enters the balance, by ``gyroscopic_moment``: as published tables and programs have
#: it, as the balance of angular momentum has it, or not at all. See docs/physics.md#ball.
GYROSCOPIC_SENSE = {"published": 1.0, "rigid_body": -1.0, "none": 0.0}


def ball_inertia(ball: Ball, inner: Array, outer: Array, spindle_speed: Array | float) -> tuple[Array, Array]:
    """Return centrifugal force and gyroscopic moment of a ball, and their derivatives.

    inner, outer: contact angles (...) [rad]; result: (F_c [N], M_g [N m]) (..., 2) and the derivatives
    to inner and outer angle (..., 2, 2). With g = D / d_m, t = tan(beta) the pitch of the ball's axis,

        p = (cos a_o + t sin a_o) / (1 + g cos a_o),   q = (cos a_i + t sin a_i) / (1 - g cos a_i)
        w_m/w = p / (p + q),   w_b/w = 1 / (g cos(beta) (p + q))
        F_c = 1/2 m d_m w^2 (w_m/w)^2,   M_g = J w^2 (w_b/w) (w_m/w) sin(beta)
        t = sin a_o / (cos a_o + g) where the outer race controls, sin a_i / (cos a_i - g) the inner

    M_g is its magnitude for positive angles; in which sense it enters the balance is the bearing's
    ``gyroscopic_moment``. Valid while 1 - g cos(a_i) and cos(a_i) - g stay positive.
    Source: Harris and Kotzalas (2007), chapter 2.

    See docs/physics.md#ball.
    """
    g = ball.diameter_ratio
    sin_i, cos_i, sin_o, cos_o = np.sin(inner), np.cos(inner), np.sin(outer), np.cos(outer)
    still = np.zeros_like(cos_i)
    if RACEWAY_CONTROL[ball.raceway_control].outer_sets_spin:
        t, t_i, t_o = sin_o / (cos_o + g), still, (1.0 + g * cos_o) / (cos_o + g) ** 2
    else:
        t, t_i, t_o = sin_i / (cos_i - g), (1.0 - g * cos_i) / (cos_i - g) ** 2, still
    wide, narrow = 1.0 + g * cos_o, 1.0 - g * cos_i
    p, q = (cos_o + t * sin_o) / wide, (cos_i + t * sin_i) / narrow
    p_t, q_t = sin_o / wide, sin_i / narrow
    p_i, p_o = p_t * t_i, p_t * t_o + (t * cos_o - sin_o + p * g * sin_o) / wide
    q_i, q_o = q_t * t_i + (t * cos_i - sin_i - q * g * sin_i) / narrow, q_t * t_o
    total = p + q
    orbit = p / total
    orbit_i, orbit_o = ((dp - orbit * (dp + dq)) / total for dp, dq in ((p_i, q_i), (p_o, q_o)))
    spin = t / (g * total)
    spin_i, spin_o = ((dt / g - spin * (dp + dq)) / total for dt, dp, dq in ((t_i, p_i, q_i), (t_o, p_o, q_o)))
    centrifugal = 0.5 * ball.mass * ball.pitch_diameter * spindle_speed**2
    gyroscopic = ball.inertia * spindle_speed**2
    values = np.stack([centrifugal * orbit**2, gyroscopic * orbit * spin], axis=-1)
    slopes = [
        np.stack([2.0 * centrifugal * orbit * by, gyroscopic * (by * spin + orbit * spun)], axis=-1)
        for by, spun in ((orbit_i, spin_i), (orbit_o, spin_o))
    ]
    return values, np.stack(slopes, axis=-1)


@dataclass(frozen=True, kw_only=True)
class BallBalance:
    """Balance of balls (...): residual force, load on the ring, contacts, inertia, and derivatives.

    residual: (..., 2) [N]; ring_load: what the ring must bring to hold the ball, axial force, radial
    force and moment about the groove's centre (..., 3) [N, N, N m]; their slopes to (u, v) = (A - X, X)
    are (..., 2, 4) and (..., 3, 4); contact forces [N] and angles [rad], F_c [N] and M_g [N m]: (...).
    """

    residual: Array
    residual_slope: Array
    ring_load: Array
    ring_load_slope: Array
    inner_contact_force: Array
    outer_contact_force: Array
    inner_contact_angle: Array
    outer_contact_angle: Array
    centrifugal_force: Array
    gyroscopic_moment: Array

    @property
    def by_groove(self) -> Array:
        """Derivative of the residual to the grooves' distance A, the ball held (..., 2, 2) [N/m]."""
        return self.residual_slope[..., INNER]

    @property
    def by_centre(self) -> Array:
        """Derivative of the residual to the ball's place X, the ring held (..., 2, 2) [N/m]."""
        return self.residual_slope[..., OUTER] - self.residual_slope[..., INNER]

    @property
    def load_by_groove(self) -> Array:
        """Derivative of the ring load to A, the ball held (..., 3, 2)."""
        return self.ring_load_slope[..., INNER]

    @property
    def load_by_centre(self) -> Array:
        """Derivative of the ring load to X, the ring held (..., 3, 2)."""
        return self.ring_load_slope[..., OUTER] - self.ring_load_slope[..., INNER]

    def ring_stiffness(self) -> Array:
        """Return d(ring load)/dA with the ball following in equilibrium (..., 3, 2).

        From the implicit function theorem: dX/dA = -(dR/dX)^-1 dR/dA.
        """
        followed = -np.linalg.solve(self.by_centre, self.by_groove)
        return np.asarray(self.load_by_groove + self.load_by_centre @ followed)


def balance(ball: Ball, groove: Array, centre: Array, spindle_speed: Array | float) -> BallBalance:
    """Return the balance of balls at ``centre`` X (..., 2) between grooves ``groove`` A (..., 2) apart [m].

    See docs/physics.md#ball.
    """
    inner = _contact(ball.inner_reach, ball.inner_factor, groove - centre, INNER)
    outer = _contact(ball.outer_reach, ball.outer_factor, centre, OUTER)
    inertia, by_angle = ball_inertia(ball, inner.angle, outer.angle, spindle_speed)
    slope = _outer(by_angle[..., 0], inner.angle_slope) + _outer(by_angle[..., 1], outer.angle_slope)
    share, by_inner, by_outer = RACEWAY_CONTROL[ball.raceway_control].share(inner.magnitude, outer.magnitude)
    share_slope = by_inner[..., None] * inner.magnitude_slope + by_outer[..., None] * outer.magnitude_slope

    # The moment over the ball's diameter is a pair of friction forces across the two contacts.
    arm = ball.gyroscopic_sense / ball.diameter
    lever, lever_slope = inertia[..., 1] * arm, slope[..., 1, :] * arm
    held, held_slope = share * lever, share_slope * lever[..., None] + share[..., None] * lever_slope
    inner_friction, inner_friction_slope = _friction(inner, held, held_slope)
    outer_friction, outer_friction_slope = _friction(outer, held - 2.0 * lever, held_slope - 2.0 * lever_slope)

    residual = inner.force + inner_friction - outer.force + outer_friction
    residual_slope = inner.force_slope + inner_friction_slope - outer.force_slope + outer_friction_slope
    residual[..., 1] += inertia[..., 0]
    residual_slope[..., 1, :] += slope[..., 0, :]
    moment, moment_slope = ball.inner_groove * held, ball.inner_groove * held_slope
    return BallBalance(
        residual=residual,
        residual_slope=residual_slope,
        ring_load=np.concatenate([inner.force + inner_friction, moment[..., None]], axis=-1),
        ring_load_slope=np.concatenate([inner.force_slope + inner_friction_slope, moment_slope[..., None, :]], axis=-2),
        inner_contact_force=inner.magnitude,
        outer_contact_force=outer.magnitude,
        inner_contact_angle=inner.angle,
        outer_contact_angle=outer.angle,
        centrifugal_force=inertia[..., 0],
        gyroscopic_moment=inertia[..., 1],
    )


def _friction(contact: _Contact, size: Array, size_slope: Array) -> tuple[Array, Array]:
    """Return ``size`` times the direction (-cos, sin) across a contact (..., 2), and its slope (..., 2, 4)."""
    unit = contact.unit
    across = np.stack([-unit[..., 1], unit[..., 0]], axis=-1)
    return size[..., None] * across, _outer(across, size_slope) + _outer(size[..., None] * unit, contact.angle_slope)
