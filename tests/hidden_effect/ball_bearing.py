"""Radial stiffness of a preloaded angular contact ball bearing at speed.

Each ball lies where its contact forces, its centrifugal force and its gyroscopic moment balance; the ring lies where
the balls carry the axial preload. Roots are found by scipy, the stiffness by central differences of the force on the
ring.

Harris and Kotzalas, Advanced Concepts of Bearing Technology, 5th ed. (2007), chapter 3, with outer raceway control. The
gyroscopic moment acts with the sense of the published tables, which is what a ``machine.yaml`` means that says
nothing of it.
"""

import math

import numpy as np
from scipy.optimize import brentq, root
from scipy.special import ellipe, ellipk

from tests.hidden_effect.machine import Bearing

#: Speeds are climbed in steps no longer than this [rad/s], each from the place of the one before.
SPEED_STEP = 150.0
#: Displacement of the ring for the stiffness [m]: small beside the contacts' approach of some um.
DIFFERENCE = 2e-9
#: Unknown displacements are counted in this unit [m].
MICROMETRE = 1e-6


class NoEquilibrium(ArithmeticError):
    """The balls find no place at this speed and preload."""


def contact_factor(sum_of_curvatures: float, difference: float, compliance: float) -> float:
    """Return K of Q = K delta^1.5 [N/m^1.5] for Hertz's point contact.

    sum_of_curvatures [1/m]; difference of the principal curvatures over their sum [-]; compliance
    (1 - nu^2)/E of ball and race together [1/Pa].
    """

    def mismatch(ratio: float) -> float:
        first, second = ellipk(1.0 - ratio**-2), ellipe(1.0 - ratio**-2)
        return ((ratio**2 + 1.0) * second - 2.0 * first) / ((ratio**2 - 1.0) * second) - difference

    ratio = brentq(mismatch, 1.0 + 1e-6, 1e3, xtol=1e-12)
    first, second = ellipk(1.0 - ratio**-2), ellipe(1.0 - ratio**-2)
    approach = 2.0 * first / math.pi * (math.pi / (2.0 * ratio**2 * second)) ** (1.0 / 3.0)
    return float(2.0 * sum_of_curvatures / (3.0 * compliance) * (2.0 / (approach * sum_of_curvatures)) ** 1.5)


class Ball:
    """One ball between its grooves."""

    def __init__(self, bearing: Bearing) -> None:
        d, angle = bearing.ball_diameter_m, math.radians(bearing.contact_angle_deg)
        self.share = d / bearing.pitch_diameter_m
        self.count = bearing.ball_count
        self.free_inner = (bearing.inner_conformity - 0.5) * d
        self.free_outer = (bearing.outer_conformity - 0.5) * d
        self.groove_distance = self.free_inner + self.free_outer
        self.angle = angle
        gamma = self.share * math.cos(angle)
        compliance = sum((1.0 - part.poisson**2) / part.modulus_pa for part in (bearing.ball, bearing.ring))
        factors = []
        for conformity, along in (
            (bearing.inner_conformity, 2.0 * gamma / (1.0 - gamma)),
            (bearing.outer_conformity, -2.0 * gamma / (1.0 + gamma)),
        ):
            total = (4.0 - 1.0 / conformity + along) / d
            factors.append(contact_factor(total, (1.0 / conformity + along) / d / total, compliance))
        self.inner_factor, self.outer_factor = factors
        mass = bearing.ball.density_kg_m3 * math.pi / 6.0 * d**3
        self.orbit_inertia = 0.5 * mass * bearing.pitch_diameter_m
        self.moment_force = 2.0 * mass * d**2 / 10.0 / d

    def inner_load(self, axial: float, radial: float) -> tuple[float, float, float, float]:
        """Return size, sine, cosine of the inner contact's force, and its angle; arguments from ball to groove [m]."""
        length = math.hypot(axial, radial)
        force = self.inner_factor * max(0.0, length - self.free_inner) ** 1.5
        return force, axial / length, radial / length, math.atan2(axial, radial)

    def residual(self, place: tuple[float, float], ring: tuple[float, float], speed: float) -> tuple[float, float]:
        """Return the unbalanced force (axial, radial) [N] on the ball.

        place: ball's centre, ring: inner groove's centre, both from the outer groove's centre [m].
        """
        q_i, sin_i, cos_i, angle_i = self.inner_load(ring[0] - place[0], ring[1] - place[1])
        length = math.hypot(*place)
        q_o = self.outer_factor * max(0.0, length - self.free_outer) ** 1.5
        sin_o, cos_o = place[0] / length, place[1] / length
        g = self.share
        tilt = math.atan2(sin_o, cos_o + g)
        orbit = (1.0 - g * cos_i) / (1.0 + math.cos(angle_i - math.atan2(sin_o, cos_o)))
        rolling = (cos_o + math.tan(tilt) * sin_o) / (1.0 + g * cos_o)
        rolling += (cos_i + math.tan(tilt) * sin_i) / (1.0 - g * cos_i)
        spin = 1.0 / (rolling * g * math.cos(tilt))
        centrifugal = self.orbit_inertia * (orbit * speed) ** 2
        moment = self.moment_force * orbit * spin * math.sin(tilt) * speed**2
        return (
            q_i * sin_i - q_o * sin_o + moment * cos_o,
            q_i * cos_i - q_o * cos_o - moment * sin_o + centrifugal,
        )


def radial_stiffness(bearing: Bearing, speed: float, preload: float, growth: float = 0.0) -> float:
    """Return the radial stiffness [N/m] of one bearing that a spring preloads.

    speed [rad/s]; preload [N], axial; growth [m]: of the inner ring's radius at this speed, in proportion to speed
    squared below it. Raises NoEquilibrium where the balls find no place.
    """
    ball = Ball(bearing)
    start = ball.groove_distance
    sine, cosine = math.sin(ball.angle), math.cos(ball.angle)
    base = (start * sine, start * cosine)
    approach = (preload / (ball.count * sine)) ** (2.0 / 3.0)
    inner, outer = approach / ball.inner_factor ** (2.0 / 3.0), approach / ball.outer_factor ** (2.0 / 3.0)
    unknowns = np.array(
        [(ball.free_outer + outer) * sine, (ball.free_outer + outer) * cosine, base[0] + (inner + outer) / sine]
    )
    steps = max(1, math.ceil(speed / SPEED_STEP))
    for step in range(steps + 1):
        turning = speed * step / steps
        radial = base[1] + growth * (step / steps) ** 2

        def balance(scaled: np.ndarray, turning: float = turning, radial: float = radial) -> list[float]:
            x, y, axial = scaled * MICROMETRE
            carried, sin_i, _, _ = ball.inner_load(axial - x, radial - y)
            return [*ball.residual((x, y), (axial, radial), turning), carried * sin_i - preload / ball.count]

        unknowns = _root(balance, unknowns / MICROMETRE, preload) * MICROMETRE
    place, axial = unknowns[:2], unknowns[2]
    forces = []
    for side in (DIFFERENCE, -DIFFERENCE):

        def settle(scaled: np.ndarray, side: float = side) -> tuple[float, float]:
            x, y = scaled * MICROMETRE
            return ball.residual((x, y), (axial, radial + side), speed)

        x, y = _root(settle, place / MICROMETRE, preload) * MICROMETRE
        carried, _, cos_i, _ = ball.inner_load(axial - x, radial + side - y)
        forces.append(carried * cos_i)
    # The mean of cos^2 over the ring is one half.
    return float(ball.count / 2.0 * (forces[0] - forces[1]) / (2.0 * DIFFERENCE))


def _root(function, start, preload: float) -> np.ndarray:
    found = root(function, start, method="hybr", options={"xtol": 1e-13})
    if np.abs(function(found.x)).max() > 1e-7 * preload:
        raise NoEquilibrium("the balls find no equilibrium")
    return np.asarray(found.x)
