"""Milling in the time domain: teeth, edges and the surface that they leave, nothing linearised.

Written apart from the stability analysis: it knows neither delays nor Floquet theory and imports none
of it. Each slice of each tooth looks at the surface that was left at its angle, removes what lies in
its way, and misses it where the tool has moved off (loss of contact); the surface remembers the last
cut however many teeth ago that was. Angles, forces and feed as in B. Balachandran, Phil. Trans. R.
Soc. A 359 (2001) 793-819; surface memory as in J. Tlusty, F. Ismail, CIRP Ann. 30 (1981) 299-304.

The modes take a force that is linear over a step exactly; the force at a step's end is predicted with
the force at its beginning. Edges enter and leave at whole steps, so the method is of first order in the
step: halving it halves the error.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Cutter:
    """Tool and process of one simulation, in SI and radians.

    radius: what each tooth is longer by, none if empty; pitch: from each tooth to the one ahead, over the mean, all one
    if empty.
    """

    teeth: int
    diameter: float
    helix_angle: float
    entry: float
    exit: float
    feed_per_tooth: float
    tangential: float
    radial: float
    radius: tuple[float, ...] = ()
    pitch: tuple[float, ...] = ()


class ModalSteps:
    """Modes (case, mode) on axis 0 or 1 (mode,), stepped through time by a force that is linear over a step."""

    def __init__(self, frequency: Array, damping: Array, mass: Array, axis: NDArray[np.intp], step: Array) -> None:
        damped = frequency * np.sqrt(1.0 - damping**2)
        h = step[:, None]
        decay, cosine, sine = np.exp(-damping * frequency * h), np.cos(damped * h), np.sin(damped * h)
        ratio = damping / np.sqrt(1.0 - damping**2)
        # Free motion over a step of (q, q').
        self.free = np.empty((*frequency.shape, 2, 2))
        self.free[..., 0, 0] = decay * (cosine + ratio * sine)
        self.free[..., 0, 1] = decay * sine / damped
        self.free[..., 1, 0] = -decay * sine * frequency**2 / damped
        self.free[..., 1, 1] = decay * (cosine - ratio * sine)
        # Response to a force that starts at f and ends at f + rise: quasi-static motion plus free motion.
        stiffness = mass * frequency**2
        lag = 2.0 * damping / frequency
        self.constant, self.rising = np.empty((*frequency.shape, 2)), np.empty((*frequency.shape, 2))
        self.constant[..., 0] = (1.0 - self.free[..., 0, 0]) / stiffness
        self.constant[..., 1] = -self.free[..., 1, 0] / stiffness
        self.rising[..., 0] = ((h - lag) + self.free[..., 0, 0] * lag - self.free[..., 0, 1]) / (stiffness * h)
        self.rising[..., 1] = (1.0 + self.free[..., 1, 0] * lag - self.free[..., 1, 1]) / (stiffness * h)
        self.spread = np.zeros((2, len(axis)))
        self.spread[axis, np.arange(len(axis))] = 1.0

    def advance(self, state: Array, force: Array, rise: Array) -> Array:
        """Return the states (case, mode, 2) after a step under forces (case, 2) that rise by ``rise``."""
        moved = np.einsum("cmij,cmj->cmi", self.free, state)
        return moved + self.constant * (force @ self.spread)[..., None] + self.rising * (rise @ self.spread)[..., None]

    def tip(self, state: Array) -> Array:
        """Return the tip's displacement (case, 2)."""
        return np.asarray(state[..., 0] @ self.spread.T)


def simulate(
    cutter: Cutter,
    *,
    modes: tuple[Array, Array, Array, NDArray[np.intp]],
    spindle_speed: Array,
    axial_depth: Array,
    periods: int,
    steps: int,
    slices: int = 12,
) -> Array:
    """Cut from rest; return the modal states at the end of each tooth period (period, case, mode, 2).

    modes: natural frequency [rad/s], damping ratio, mass [kg] (case, mode), axis (mode,); spindle_speed
    [rad/s] and axial_depth [m]: (case,); ``steps`` a tooth period, the same for all cases.
    """
    frequency, damping, mass, axis = modes
    cases, teeth = len(spindle_speed), cutter.teeth
    pitch = 2.0 * np.pi / teeth
    modal = ModalSteps(frequency, damping, mass, axis, pitch / spindle_speed / steps)
    height = axial_depth[:, None] * (np.arange(slices) + 0.5) / slices
    lag = (2.0 * height * np.tan(cutter.helix_angle) / cutter.diameter)[:, :, None]
    width = (axial_depth / slices)[:, None, None]
    # The surface at every angle that an edge visits, at first as a tooth without vibration left it a
    # tooth period before the first one comes there.
    places = np.arange(steps * teeth) * pitch / steps
    angles = np.mod(places[None, None, :] - lag, 2.0 * np.pi)
    sine, cosine = np.sin(angles), np.cos(angles)
    inside = (angles >= cutter.entry) & (angles <= cutter.exit)
    feed = cutter.feed_per_tooth * sine
    first_visit = (np.arange(steps * teeth) - 1) % steps + 1
    surface = np.broadcast_to((first_visit / steps - 1.0) * feed, angles.shape).copy()
    state, force = np.zeros((cases, frequency.shape[1], 2)), np.zeros((cases, 2))
    ahead = steps * np.cumsum([0.0, *(cutter.pitch or np.ones(teeth))])[:-1]
    offsets = np.rint(ahead).astype(np.intp)
    assert np.allclose(offsets, ahead), "teeth stand at whole steps"
    longer = np.array(cutter.radius or np.zeros(teeth))

    def look(at: NDArray[np.intp], tip: Array, passed: float) -> tuple[Array, Array, Array]:
        """Return the force, what stands in the way, and the place of the edges, ``passed`` tooth periods in."""
        s, c = sine[:, :, at], cosine[:, :, at]
        edge = longer + passed * feed[:, :, at] + tip[:, 0, None, None] * s + tip[:, 1, None, None] * c
        chip = np.where(inside[:, :, at], np.maximum(edge - surface[:, :, at], 0.0), 0.0)
        tangential, radial = cutter.tangential * width * chip, cutter.radial * width * chip
        along = (-tangential * c - radial * s).sum(axis=(1, 2))
        across = (tangential * s - radial * c).sum(axis=(1, 2))
        return np.stack([along, across], axis=-1), chip, edge

    ends = np.empty((periods, *state.shape))
    for period in range(periods):
        for step in range(steps):
            # A tooth is at place (count + its offset); each returns to the place of the one before it.
            count = period * steps + step + 1
            at = (count + offsets) % (steps * teeth)
            passed = count / steps
            guess = modal.tip(modal.advance(state, force, np.zeros_like(force)))
            predicted, _, _ = look(at, guess, passed)
            state = modal.advance(state, force, predicted - force)
            force, chip, edge = look(at, modal.tip(state), passed)
            surface[:, :, at] = np.where(chip > 0.0, edge, surface[:, :, at])
        ends[period] = state
    return ends
