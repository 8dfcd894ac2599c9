"""Angular contact ball bearing under axial preload: contact angles and stiffness over speed (Jones).

Under axial load alone every ball is alike, so one ball and the ring's axial place are the whole
bearing: three unknowns, followed from standstill through speed.

Sources: A. B. Jones, J. Basic Eng. 82 (1960) 309-320; T. A. Harris, M. N. Kotzalas, Advanced
Concepts of Bearing Technology, 5th ed. (2007), chapter 3; equations 1-10 of "Effects of spindle
speed-dependent dynamic characteristics of ball bearing and multi-modes on the stability of milling
processes", whose equation 2 has lost the ball's mass and whose equation 6 is garbled.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from chatter_core.bearing.ball import BallBalance, balance, ball_of, unloaded_groove_distance
from chatter_core.bearing.newton import damped_newton
from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.machine import Bearing

Array = NDArray[np.float64]
PreloadType = Literal["constant", "rigid"]

#: Step of the path from standstill [rad/s] (2000 rpm); it is halved where Newton's method fails.
PATH_STEP = 2000.0 * 2.0 * math.pi / 60.0
#: Halvings of a step before the path ends.
HALVINGS = 18
#: Steps from station to station that are remembered.
STEPS_KEPT = 512
#: States along a path that are remembered.
PATHS_KEPT = 64
#: Contact angle that no load reaches [rad]: there the balls would leave their grooves.
STEEPEST = math.radians(89.9)


@dataclass(frozen=True, kw_only=True)
class SpeedLaw:
    """What a bearing sees as the spindle turns: functions of spindle speed (speed,) [rad/s], each (speed,).

    ball_speed: at which the balls' inertia acts [rad/s]; preload: axial force that is asked for [N];
    ring_growth: what the inner ring's groove has moved outwards by [m].
    """

    ball_speed: Callable[[Array], Array]
    preload: Callable[[Array], Array]
    ring_growth: Callable[[Array], Array]

    @property
    def _laws(self) -> tuple[Callable[[Array], Array], ...]:
        return self.ball_speed, self.preload, self.ring_growth

    def sampled(self, spindle_speed: Array) -> bytes:
        """Return the law at speeds (speed,), to tell whether it is another."""
        return np.concatenate([law(spindle_speed) for law in self._laws]).tobytes()

    def felt(self, spindle_speed: Array) -> Array:
        """Return the speeds (speed,), standstill in the place of those at which nothing differs from it."""
        differs = [law(spindle_speed) != law(np.zeros(1)) for law in self._laws]
        return np.where(np.any(differs, axis=0), spindle_speed, 0.0)


@dataclass(frozen=True, kw_only=True)
class BearingState:
    """State of one bearing over speed; every array is (speed,), NaN where ``solved`` is False.

    spindle_speed [rad/s]; preload, what was asked for at standstill [N]; axial_load on the bearing [N], contact
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

    See docs/physics.md#preloaded-bearing.
    """
    law = SpeedLaw(
        ball_speed=lambda speed: speed,
        preload=lambda speed: np.full_like(speed, preload),
        ring_growth=np.zeros_like,
    )
    return state_along(bearing, law, spindle_speed, preload_type)


def state_along(bearing: Bearing, law: SpeedLaw, spindle_speed: Array, preload_type: PreloadType) -> BearingState:
    """Return the state of a bearing whose preload and fits follow a law, at speeds (speed,) [rad/s] in any order.

    ``rigid`` preload keeps, at each speed, the axial displacement that the law's force causes at
    standstill. Otherwise as ``axisymmetric_state``.

    Raises InvalidInput for a speed that is negative or not finite, and for a law that leaves no preload.

    See docs/physics.md#preloaded-bearing.
    """
    if not np.all(np.isfinite(spindle_speed) & (spindle_speed >= 0.0)):
        raise InvalidInput(["spindle_speed: every speed of the bearing must be a finite number, at least 0"])
    speeds, place = np.unique(np.asarray(spindle_speed, dtype=float), return_inverse=True)
    # Between half steps and speeds a law matters to the way there alone, not to the state at a speed.
    stations = 0.5 * PATH_STEP * np.arange(2.0 * speeds.max(initial=0.0) // PATH_STEP + 1.0)
    asked = _Asked(
        bearing=bearing,
        preload_type=preload_type,
        speeds=speeds.tobytes(),
        sampled=law.sampled(np.concatenate([stations, speeds])),
        law=law,
    )
    return _state(asked).at(place)


class _Path:
    """Continuation in speed of (X_1, X_2, axial displacement) of the ball that stands for all."""

    def __init__(self, bearing: Bearing, law: SpeedLaw, preload_type: PreloadType) -> None:
        self.bearing = bearing
        self.ball, self.unloaded = ball_of(bearing), unloaded_groove_distance(bearing)
        self.law, self.count, self.rigid = law, bearing.ball_count, preload_type == "rigid"
        self.start = self._standstill(float(self.axial_force(np.zeros(1))[0]))

    def axial_force(self, speeds: Array) -> Array:
        """Return the share of one ball in the preload (n,) [N]."""
        preload = self.law.preload(speeds)
        if not np.all(preload > 0.0):
            raise InvalidInput([f"preload: found {preload.min():g} N at some speed, allowed: more than 0"])
        return preload / self.count

    def at(self, speeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return the unknowns (speed, 3) at ascending speeds, and which were reached (speed,).

        The path's own stations alone are the starting points, whatever speeds are asked for.
        """
        stations = self._stations(float(speeds.max(initial=0.0)))
        behind = np.minimum(speeds // PATH_STEP, len(stations) - 1).astype(int)
        unknowns, solved = self._settle(stations[behind], speeds)
        for i in np.flatnonzero(~solved & (speeds < len(stations) * PATH_STEP)):
            reached = self._advance(stations[behind[i]], behind[i] * PATH_STEP, float(speeds[i]))
            solved[i] = reached is not None
            unknowns[i] = unknowns[i] if reached is None else reached
        # Where the path has ended, whatever Newton's method finds beyond is another path's.
        holding = np.append(self._holds(stations, PATH_STEP * np.arange(len(stations), dtype=float)), False)
        solved &= self._holds(unknowns, speeds) & (speeds < int(holding.argmin()) * PATH_STEP)
        return unknowns, np.logical_and.accumulate(solved)

    def _holds(self, unknowns: Array, speeds: Array) -> NDArray[np.bool_]:
        """Return whether the ring is held at unknowns (n, 3) and speeds (n,): none of its stiffnesses is negative."""
        stiffness = self.balance(unknowns, speeds).ring_stiffness()
        return np.asarray((stiffness[:, 0, 0] > 0.0) & (stiffness[:, 1, 1] > 0.0))

    def balance(self, unknowns: Array, speeds: Array) -> BallBalance:
        """Return the balance at unknowns (n, 3) and speeds (n,)."""
        radial = self.unloaded[1] + self.law.ring_growth(speeds)
        groove = np.stack([self.unloaded[0] + unknowns[:, 2], radial], axis=1)
        return balance(self.ball, groove, unknowns[:, :2], self.law.ball_speed(speeds))

    def _stations(self, highest: float) -> Array:
        """Return the unknowns (station, 3) at multiples of PATH_STEP, as far as the path goes."""
        stations = [self.start]
        while len(stations) * PATH_STEP <= highest:
            following = _next_station(self._leaving(len(stations) - 1, stations[-1]))
            if following is None:
                break
            stations.append(following)
        return np.array(stations)

    def _leaving(self, number: int, unknowns: Array) -> "_Leaving":
        """Return the step from a station to the next."""
        felt = np.array([0.0, number, number + 0.5, number + 1.0]) * PATH_STEP
        return _Leaving(
            bearing=self.bearing,
            rigid=self.rigid,
            number=number,
            law=self.law.sampled(felt),
            unknowns=unknowns.tobytes(),
            path=self,
        )

    def next_station(self, number: int, unknowns: Array) -> Array | None:
        """Return the unknowns (3,) at the station after one; None where the path ends."""
        return self._advance(unknowns, number * PATH_STEP, (number + 1) * PATH_STEP)

    def _standstill(self, axial_force: float) -> Array:
        """Return the state at standstill, where both contacts carry one force in line.

        The contact angle alone is unknown: the ring moves axially, so the grooves keep their radial
        distance. The axial force rises with the angle, from a free ball on.
        """
        ball, radial = self.ball, float(self.unloaded[1])
        reach = ball.inner_reach + ball.outer_reach

        def force(angle: float) -> float:
            return float(ball.series_factor * max(0.0, radial / math.cos(angle) - reach) ** 1.5)

        free = math.acos(min(1.0, radial / reach))
        if force(STEEPEST) * math.sin(STEEPEST) < axial_force:
            raise NoEquilibrium("the bearing at standstill does not carry its preload, however steep its contacts")
        angle = brentq(lambda a: force(a) * math.sin(a) - axial_force, free, STEEPEST, xtol=1e-15)
        centre = (ball.outer_reach + (force(angle) / ball.outer_factor) ** (2 / 3)) * np.array(
            [math.sin(angle), math.cos(angle)]
        )
        guess = np.array([[*centre, radial * math.tan(angle) - self.unloaded[0]]])
        settled, solved = damped_newton(
            lambda unknowns, which: self._system(unknowns, np.zeros(1)[which], np.array([axial_force])[which], None),
            guess,
            math.hypot(*self.unloaded),
        )
        if not solved[0]:
            raise NoEquilibrium("the bearing at standstill does not settle under its preload")
        return np.asarray(settled[0])

    def _advance(self, unknowns: Array, start: float, end: float) -> Array | None:
        """Follow the solution from one speed to another; None where the path ends."""
        step, speed = end - start, start
        while True:
            following, solved = self._settle(unknowns[None], np.array([min(speed + step, end)]))
            if solved[0]:
                speed, unknowns, step = min(speed + step, end), following[0], 2.0 * step
                if speed >= end:
                    return unknowns
            else:
                step *= 0.5
                if step < PATH_STEP * 0.5**HALVINGS:
                    return None

    def _settle(self, start: Array, speeds: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Solve ball and ring at speeds (n,) from the unknowns ``start`` (n, 3)."""
        force = self.axial_force(speeds)
        held = self._held(force) if self.rigid else None
        return damped_newton(
            lambda unknowns, which: self._system(
                unknowns, speeds[which], force[which], None if held is None else held[which]
            ),
            start,
            math.hypot(*self.unloaded),
        )

    def _held(self, force: Array) -> Array:
        """Return the axial displacements (n,) that forces (n,) cause at standstill."""
        distinct, place = np.unique(force, return_inverse=True)
        known = float(self.axial_force(np.zeros(1))[0])
        held = [self.start[2] if one == known else self._standstill(float(one))[2] for one in distinct]
        return np.array(held)[place]

    def _system(self, unknowns: Array, speeds: Array, force: Array, held: Array | None) -> tuple[Array, Array, Array]:
        """Return residuals (n, 3), Jacobians (n, 3, 3) and the largest force; it is 0 when contact is lost."""
        found = self.balance(unknowns, speeds)
        jacobian = np.zeros((len(unknowns), 3, 3))
        jacobian[:, :2, :2] = found.by_centre
        jacobian[:, :2, 2] = found.by_groove[:, :, 0]
        if held is None:
            last = found.ring_load[:, 0] - force
            jacobian[:, 2, :2], jacobian[:, 2, 2] = found.load_by_centre[:, 0], found.load_by_groove[:, 0, 0]
        else:
            # A displacement in the unit of a force, so that one tolerance serves all three.
            unit = np.where(found.load_by_groove[:, 0, 0] == 0.0, 1.0, found.load_by_groove[:, 0, 0])
            last, jacobian[:, 2, 2] = unit * (unknowns[:, 2] - held), unit
        touching = (found.inner_contact_force > 0.0) & (found.outer_contact_force > 0.0)
        size = np.where(touching, np.maximum(found.inner_contact_force, found.outer_contact_force), 0.0)
        return np.concatenate([found.residual, last[:, None]], axis=1), jacobian, size


@dataclass(frozen=True, kw_only=True)
class _Asked:
    """Ascending speeds of a path: everything that the states there depend on, and the law that was sampled."""

    bearing: Bearing
    preload_type: PreloadType
    speeds: bytes
    sampled: bytes
    law: SpeedLaw = field(compare=False, repr=False)


@lru_cache(maxsize=PATHS_KEPT)
def _state(asked: _Asked) -> BearingState:
    """Return the state at every speed of a path."""
    path, speeds = _Path(asked.bearing, asked.law, asked.preload_type), np.frombuffer(asked.speeds)
    unknowns, solved = path.at(speeds)
    found = path.balance(unknowns, speeds)
    count, stiffness = asked.bearing.ball_count, asked.bearing.ball_count * found.ring_stiffness()
    columns = {
        "axial_load": count * found.ring_load[:, 0],
        "inner_contact_angle": found.inner_contact_angle,
        "outer_contact_angle": found.outer_contact_angle,
        "inner_contact_force": found.inner_contact_force,
        "outer_contact_force": found.outer_contact_force,
        "centrifugal_force": found.centrifugal_force,
        "gyroscopic_moment": found.gyroscopic_moment,
        "axial_displacement": unknowns[:, 2],
        "radial_stiffness": 0.5 * stiffness[:, 1, 1],  # the mean of cos^2 over the balls is one half
        "axial_stiffness": stiffness[:, 0, 0],
    }
    return BearingState(
        preload=float(asked.law.preload(np.zeros(1))[0]),
        spindle_speed=speeds,
        solved=solved,
        **{name: np.where(solved, values, np.nan) for name, values in columns.items()},
    )


@dataclass(frozen=True, kw_only=True)
class _Leaving:
    """A step from one station to the next: everything that its end depends on, and the path that can take it."""

    bearing: Bearing
    rigid: bool
    number: int
    law: bytes
    unknowns: bytes
    path: _Path = field(compare=False, repr=False)


@lru_cache(maxsize=STEPS_KEPT)
def _next_station(step: _Leaving) -> Array | None:
    """Return the unknowns at the next station; fits of damping, shaft or sensors ask for the same ones again."""
    return step.path.next_station(step.number, np.frombuffer(step.unknowns))
