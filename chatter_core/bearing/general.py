"""A ball bearing under axial force, radial force and moment: load zone, displacement, 3 x 3 stiffness.

The inner ring is displaced by (d_a, d_r, theta) in the plane of the load. A ball at azimuth psi then
sees the grooves' centres of curvature apart by

    A = A_0 + (d_a + theta R_i cos psi, d_r cos psi),   R_i = d_m / 2 + (f_i - 1/2) D cos a_0

and settles between them (ball.balance = 0). What the ring must bring sums to

    F_a = sum f_1,   F_r = sum f_2 cos psi,   M = sum (R_i f_1 + m) cos psi

with f and m the load of one ball on the ring. The stiffness follows from the implicit function theorem, ball by ball.

Sources: A. B. Jones, J. Basic Eng. 82 (1960) 309-320; T. A. Harris, M. N. Kotzalas, Advanced
Concepts of Bearing Technology, 5th ed. (2007), chapters 1 and 3.
"""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

from chatter_core.bearing.axisymmetric import axisymmetric_state
from chatter_core.bearing.ball import Ball, BallBalance, balance, ball_inertia, ball_of, unloaded_groove_distance
from chatter_core.bearing.newton import damped_newton
from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.machine import LEAST_PRELOAD, Bearing

Array = NDArray[np.float64]

#: Load that counts as reached, relative to the largest part of the load asked for.
LOAD_TOLERANCE = 1e-9
#: Options of the search for the ring's place.
SEARCH = {"xtol": 1e-14, "maxiter": 100}
#: Parts in which the load is raised where the full step fails, coarsest first.
STAGES = (1, 4, 16, 64)
#: Halvings in which the first guess of a ball's place is found; a guess needs no more digits.
BISECTIONS = 20


@dataclass(frozen=True, kw_only=True)
class LoadedBearing:
    """One bearing under general load.

    displacement: (d_a [m], d_r [m], theta [rad]); load: (F_a [N], F_r [N], M [N m]) on the inner ring;
    stiffness: d(load)/d(displacement) (3, 3) in their units. Of the balls (ball,): azimuth and contact
    angles [rad], contact forces and centrifugal force [N], gyroscopic moment [N m]. A ball without
    inner contact force is out of the load zone; its inner angle is where the ring would meet it.
    """

    spindle_speed: float
    displacement: Array
    load: Array
    stiffness: Array
    azimuth: Array
    inner_contact_angle: Array
    outer_contact_angle: Array
    inner_contact_force: Array
    outer_contact_force: Array
    centrifugal_force: Array
    gyroscopic_moment: Array

    @property
    def in_load_zone(self) -> NDArray[np.bool_]:
        """Whether a ball touches both races (ball,)."""
        return self.inner_contact_force > 0.0


def displaced_bearing(bearing: Bearing, displacement: ArrayLike, spindle_speed: float = 0.0) -> LoadedBearing:
    """Return the state of a bearing whose inner ring is held at (d_a, d_r, theta) [m, m, rad].

    spindle_speed [rad/s]. Raises InvalidInput for numbers that are not finite or a negative speed, and
    NoEquilibrium where a ball does not settle. Valid for displacements that leave the balls in their
    grooves. Source: Harris and Kotzalas (2007), chapter 3.

    See docs/physics.md#loaded-bearing.
    """
    return Ring(bearing, spindle_speed).at(three_finite("displacement", displacement))


def loaded_bearing(bearing: Bearing, load: ArrayLike, spindle_speed: float = 0.0) -> LoadedBearing:
    """Return the state of a bearing under (F_a, F_r, M) [N, N, N m] at a speed [rad/s].

    Levenberg's method on the ring with the analytic Jacobian, the balls settled within.
    Raises InvalidInput for numbers that are not finite, and NoEquilibrium where no place of the ring
    carries the load: a radial force alone pushes the rings of an angular contact bearing apart.

    See docs/physics.md#loaded-bearing.
    """
    wanted = three_finite("load", load)
    give, size = load_scale(bearing, wanted)
    ring = Ring(bearing, spindle_speed)

    def mismatch(unknowns: Array, share: float) -> tuple[Array, Array]:
        state = ring.at(unknowns * give)
        return (state.load - share * wanted) / size, state.stiffness * give / size[:, None]

    # Some play further than the load alone would press: the balls must touch for the first step.
    for start in _first_displacements(bearing, wanted, spindle_speed, 3.0 * wanted / size * give):
        for stages in STAGES:
            unknowns = start / give
            # A step too far may leave the grooves or the range of numbers: the next attempt takes smaller ones.
            with suppress(NoEquilibrium), np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                for share in np.arange(1, stages + 1) / stages:
                    unknowns = root(mismatch, unknowns, args=(share,), jac=True, method="lm", options=SEARCH).x
                reached = ring.at(unknowns * give)
                if np.all(np.abs(reached.load - wanted) <= LOAD_TOLERANCE * size):
                    return reached
    raise NoEquilibrium(
        f"the bearing does not carry an axial force of {wanted[0]:g} N with a radial force of {wanted[1]:g} N and a "
        f"moment of {wanted[2]:g} N m at {spindle_speed * 30.0 / math.pi:.6g} rpm: no place of the inner ring holds "
        "them; raise the axial force or lower the others"
    )


def _first_displacements(bearing: Bearing, load: Array, speed: float, along: Array) -> list[Array]:
    """Return first guesses of the ring's displacement: from the axial force alone, and ``along`` the load."""
    if load[0] < LEAST_PRELOAD:
        return [along]
    axial = axisymmetric_state(bearing, float(load[0]), np.array([speed]), "constant")
    if not axial.solved[0]:
        return [along]
    return [np.array([axial.axial_displacement[0], *(along[1:] / 3.0)]), along]


def load_scale(bearing: Bearing, load: Array) -> tuple[Array, Array]:
    """Return sizes of displacement (3,) and load (3,) that make a ring's equations dimensionless.

    See docs/physics.md#loaded-bearing.
    """
    arm = groove_radius(bearing)
    force = max(abs(load[0]), abs(load[1]), abs(load[2]) / arm, 1e-9)
    give = (force / (bearing.ball_count * ball_of(bearing).series_factor)) ** (2.0 / 3.0)
    return give * np.array([1.0, 1.0, 1.0 / arm]), force * np.array([1.0, 1.0, arm])


def three_finite(name: str, values: ArrayLike) -> Array:
    """Return three finite numbers as an array; raise InvalidInput for anything else.

    See docs/physics.md#loaded-bearing.
    """
    array = np.array(values, dtype=float)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InvalidInput([f"{name}: found {array.tolist()}, allowed: three finite numbers"])
    return array


def groove_radius(bearing: Bearing) -> float:
    """Return R_i, the radius on which the inner groove's centres of curvature lie [m].

    See docs/physics.md#loaded-bearing.
    """
    reach = (bearing.inner_groove_conformity - 0.5) * bearing.ball_diameter
    return 0.5 * bearing.pitch_diameter + reach * math.cos(bearing.unloaded_contact_angle)


class Ring:
    """The inner ring at a speed: what every place of it does to the balls."""

    def __init__(self, bearing: Bearing, spindle_speed: float) -> None:
        if not (math.isfinite(spindle_speed) and spindle_speed >= 0.0):
            raise InvalidInput([f"spindle_speed: found {spindle_speed:g} rad/s, allowed: a finite number, at least 0"])
        self.speed, self.ball, self.unloaded = float(spindle_speed), ball_of(bearing), unloaded_groove_distance(bearing)
        # The first ball lies in the plane of the load.
        self.azimuth = 2.0 * math.pi * np.arange(bearing.ball_count) / bearing.ball_count
        cosine, arm = np.cos(self.azimuth), groove_radius(bearing)
        self.shape = np.zeros((bearing.ball_count, 2, 3))  # dA/d(displacement)
        self.shape[:, 0, 0], self.shape[:, 0, 2], self.shape[:, 1, 1] = 1.0, arm * cosine, cosine
        self.collect = np.zeros((bearing.ball_count, 3, 3))  # what a ball's ring load adds to (F_a, F_r, M)
        self.collect[:, 0, 0], self.collect[:, 1, 1] = 1.0, cosine
        self.collect[:, 2, 0], self.collect[:, 2, 2] = arm * cosine, cosine
        self.last: Array | None = None

    def at(self, displacement: Array) -> LoadedBearing:
        """Return the state with the ring at (d_a, d_r, theta); the balls start from where they were last."""
        groove = self.unloaded + self.shape @ displacement
        if self.speed == 0.0:
            settled, stiffness = _at_rest(self.ball, groove)
        else:
            self.last = _spinning(self.ball, groove, self.speed, self.last)
            settled = balance(self.ball, groove, self.last, self.speed)
            stiffness = settled.ring_stiffness()
        return LoadedBearing(
            spindle_speed=self.speed,
            displacement=displacement,
            load=np.einsum("jkl,jl->k", self.collect, settled.ring_load),
            stiffness=np.einsum("jkl,jlm,jmn->kn", self.collect, stiffness, self.shape),
            azimuth=self.azimuth,
            inner_contact_angle=settled.inner_contact_angle,
            outer_contact_angle=settled.outer_contact_angle,
            inner_contact_force=settled.inner_contact_force,
            outer_contact_force=settled.outer_contact_force,
            centrifugal_force=settled.centrifugal_force,
            gyroscopic_moment=settled.gyroscopic_moment,
        )


def _at_rest(ball: Ball, groove: Array) -> tuple[BallBalance, Array]:
    """Return balls at standstill and d(ring load)/dA (n, 3, 2): both contacts carry one force in line.

    A ball that touches nothing has no place of its own; it carries nothing and adds no stiffness.
    """
    length = np.hypot(groove[:, 0], groove[:, 1])
    unit = groove / length[:, None]
    force = _force_in_line(ball, length)
    centre = (ball.outer_reach + (force / ball.outer_factor) ** (2.0 / 3.0))[:, None] * unit
    along = unit[:, :, None] * unit[:, None, :]
    slope = 1.5 * ball.series_factor ** (2.0 / 3.0) * np.cbrt(force)
    stiffness = np.zeros((len(groove), 3, 2))
    across = (force / length)[:, None, None]
    stiffness[:, :2] = (slope[:, None, None] - across) * along + across * np.eye(2)
    return balance(ball, groove, centre, 0.0), stiffness


def _spinning(ball: Ball, groove: Array, speed: float, guess: Array | None) -> Array:
    """Return the places of balls at speed (n, 2), first sought from ``guess`` where there is one.

    A ball that the inner race has let go rests where centrifugal force holds it on the outer one.
    Where a contact is about to be lost, Newton's step can overshoot again and again; Levenberg's does not.
    """
    centre, solved = np.zeros_like(groove), np.zeros(len(groove), dtype=bool)
    if guess is not None:
        centre, solved = _settle(ball, groove, guess, speed)
    left = np.flatnonzero(~solved)
    start = _first_place(ball, groove[left], speed)
    centre[left], solved[left] = _settle(ball, groove[left], start, speed)
    for i, first in zip(left, start, strict=True):
        for guess_of_one in (first, np.array([0.0, math.hypot(*first)])):  # slid aside, or free on the outer race
            if not solved[i]:
                found = root(_one_ball(ball, groove[i], speed), guess_of_one, jac=True, method="lm", options=SEARCH)
                centre[[i]], solved[[i]] = _settle(ball, groove[[i]], found.x[None], speed)
    if not solved.all():
        raise NoEquilibrium(
            f"{np.count_nonzero(~solved)} of the bearing's balls do not settle at {speed * 30.0 / math.pi:.6g} rpm"
        )
    return centre


def _one_ball(ball: Ball, groove: Array, speed: float) -> Callable[[Array], tuple[Array, Array]]:
    def mismatch(centre: Array) -> tuple[Array, Array]:
        found = balance(ball, groove, centre, speed)
        return found.residual, found.by_centre

    return mismatch


def _force_in_line(ball: Ball, length: Array) -> Array:
    """Return the force of both contacts in line, the grooves' centres ``length`` (n,) [m] apart."""
    return ball.series_factor * np.maximum(0.0, length - ball.inner_reach - ball.outer_reach) ** 1.5


def _first_place(ball: Ball, groove: Array, speed: float) -> Array:
    """Return a first guess of the balls' places (n, 2).

    A ball that centrifugal force holds on the bottom of the outer race, clear of the inner one, is
    there. Any other has slid from the line between the grooves towards that bottom by so much that the
    inner contact, now bent by ``bend`` against the outer one, holds it: Q_i sin(bend) = F_c sin(a).
    """
    angle, length = np.arctan2(groove[:, 0], groove[:, 1]), np.hypot(groove[:, 0], groove[:, 1])
    pushed = ball_inertia(ball, angle, np.zeros_like(angle), speed)[0][:, 0]
    bottom = ball.outer_reach + (pushed / ball.outer_factor) ** (2.0 / 3.0)
    free = np.hypot(groove[:, 0], groove[:, 1] - bottom) <= ball.inner_reach
    slack = ball.inner_reach * ball.outer_reach / (2.0 * (ball.inner_reach + ball.outer_reach))
    low, high = np.zeros_like(angle), np.ones_like(angle)
    for _ in range(BISECTIONS):
        bend = 0.5 * (low + high)
        force = _force_in_line(ball, length + slack * bend**2)  # a bent line is longer
        enough = force * np.sin(bend) >= pushed * np.abs(np.sin(angle))
        low, high = np.where(enough, low, bend), np.where(enough, bend, high)
    carried = np.maximum(force + pushed * np.cos(angle), 1e-3 * pushed)
    outer = ball.outer_reach + (carried / ball.outer_factor) ** (2.0 / 3.0)
    inner = ball.inner_reach + (force / ball.inner_factor) ** (2.0 / 3.0)
    cosine = (outer**2 + length**2 - inner**2) / (2.0 * outer * length)
    slid = angle - np.sign(angle) * np.arccos(np.clip(cosine, -1.0, 1.0))
    slid, outer = np.where(free, 0.0, slid), np.where(free, bottom, outer)
    return np.stack([outer * np.sin(slid), outer * np.cos(slid)], axis=1)


def _settle(ball: Ball, groove: Array, start: Array, speed: float) -> tuple[Array, NDArray[np.bool_]]:
    def system(centre: Array, which: NDArray[np.intp]) -> tuple[Array, Array, Array]:
        found = balance(ball, groove[which], centre, speed)
        return found.residual, found.by_centre, found.outer_contact_force

    return damped_newton(system, start, ball.inner_reach + ball.outer_reach)
