"""The cut in time: slices of helical edges, the surface that they leave, loss of contact.

The workpiece is known by the radius to which it was last cut, at every angle that an edge visits; a tooth removes what
stands above that surface and leaves its own. Chips are thus the least over all teeth that came before. As in J.
Tlusty, F. Ismail, CIRP Ann. 30 (1981) 299-304, with force and feed as in B. Balachandran, Phil. Trans. R. Soc. A 359
(2001) 793-819. Time advances by equal angles; complex modes take a force that is linear over a step exactly,
predicted and corrected once.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from tests.hidden_effect.structure import Tip

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Cut:
    """Everything that a simulation needs, in SI and radians.

    steps: of angle in a revolution, a multiple of the teeth; teeth: step at which each tooth stands at first; radius:
    of each tooth beyond the nominal; entry, exit: of the engagement; tangential, radial: force over chip's area; lag:
    of the edge over the axial depth; ploughing: force slope over depth and relative penetration, with friction share
    and half slope; size_effect: rise at vanishing chip, its chip and the factor that keeps the described force at the
    mean chip; stock: radial depth, no chip is thicker; ripple: of the speed and periods of it in a revolution;
    damping_loss: share and amplitude.
    """

    speed: float
    depth: float
    steps: int
    teeth: NDArray[np.int64]
    radius: Array
    entry: float
    exit: float
    feed_per_revolution: float
    tangential: float
    radial: float
    lag: float
    cutting_speed: float
    slices: int
    stock: float
    ploughing: tuple[float, float] = (0.0, 1.0)
    size_effect: tuple[float, float, float] = (0.0, 1.0, 1.0)
    ripple: tuple[float, float] = (0.0, 1.0)
    damping_loss: tuple[float, float] = (0.0, 1.0)


#: Tangential share of the ploughing force.
PLOUGHING_FRICTION = 0.3


def simulate(cut: Cut, tip: Tip, *, revolutions: int, observed: int, settled: float) -> tuple[Array, Array]:
    """Cut from rest; return the tip's motion (step, 2) [m] over the last revolutions and their time steps [s].

    At most ``revolutions`` are cut, of which ``observed`` are returned. The cut ends early once no step of ``observed``
    revolutions differs from the step a revolution before by more than ``settled`` [m].
    """
    places = np.arange(cut.steps) * 2.0 * np.pi / cut.steps
    lags = cut.lag * (np.arange(cut.slices) + 0.5) / cut.slices
    angle = np.mod(places[None, :] - lags[:, None], 2.0 * np.pi)
    # An angle stands for a step's width; at entry and exit the share that lies in the cut counts.
    width = 2.0 * np.pi / cut.steps
    engaged = np.clip(
        (np.minimum(angle + width / 2, cut.exit) - np.maximum(angle - width / 2, cut.entry)) / width, 0, 1
    )
    sine, cosine = np.sin(angle), np.cos(angle)
    surface = _first_surface(cut, sine)
    step_time = _step_times(cut)
    history = np.zeros((observed * cut.steps, 2))
    used = _run(
        tip.eigenvalue,
        tip.input,
        tip.output,
        step_time,
        cut.steps,
        cut.teeth,
        cut.radius,
        engaged,
        sine,
        cosine,
        surface,
        cut.feed_per_revolution,
        cut.depth / cut.slices,
        cut.tangential,
        cut.radial,
        cut.stock,
        np.array([*cut.ploughing, cut.cutting_speed]),
        np.array(cut.size_effect),
        np.array(cut.damping_loss),
        revolutions,
        settled,
        history,
    )
    first = (used * cut.steps) % len(history)
    return np.roll(history, -first, axis=0), step_time


def _first_surface(cut: Cut, sine: Array) -> Array:
    """Return the surface (slice, place) that the same teeth without vibration would have left."""
    place = np.arange(cut.steps)
    left = np.full(sine.shape, -np.inf)
    for turn in (1, 2, 3):
        for tooth, radius in zip(cut.teeth, cut.radius, strict=True):
            ago = np.mod(place - tooth, cut.steps) / cut.steps - turn
            left = np.maximum(left, radius + cut.feed_per_revolution * ago * sine)
    return left


def _step_times(cut: Cut) -> Array:
    """Return the time of every step over a period of the speed's ripple [s]; one number where there is none."""
    even = 2.0 * np.pi / cut.speed / cut.steps
    amplitude, per_revolution = cut.ripple
    if amplitude == 0.0:
        return np.array([even])
    count = round(cut.steps / per_revolution)
    return np.asarray(even / (1.0 + amplitude * np.sin(2.0 * np.pi * np.arange(count) / count)))


@numba.njit(cache=True, nogil=True)
def _tables(eigenvalue, input_, step_time, factor):
    """Return decay, and response to a constant and to a rising force, of every mode for every step time."""
    count, modes = len(step_time), len(eigenvalue)
    decay = np.empty((count, modes), np.complex128)
    constant = np.empty((count, modes, 2), np.complex128)
    rising = np.empty((count, modes, 2), np.complex128)
    for i in range(count):
        h = step_time[i]
        for k in range(modes):
            value = complex(eigenvalue[k].real * factor, eigenvalue[k].imag)
            e = np.exp(value * h)
            decay[i, k] = e
            for axis in range(2):
                constant[i, k, axis] = (e - 1.0) / value * input_[k, axis]
                rising[i, k, axis] = (e - 1.0 - value * h) / (value * value * h) * input_[k, axis]
    return decay, constant, rising


@numba.njit(cache=True, nogil=True)
def _force(
    count,
    steps,
    teeth,
    radius,
    engaged,
    sine,
    cosine,
    surface,
    feed,
    slice_depth,
    tangential,
    radial,
    stock,
    ploughing,
    size,
    tip,
    velocity,
    leave,
):
    """Return the force on the tip (x, y); with ``leave`` the edges leave their surface behind."""
    force_x, force_y = 0.0, 0.0
    for tooth in range(len(teeth)):
        at = (count + teeth[tooth]) % steps
        for s in range(engaged.shape[0]):
            share = engaged[s, at]
            if share <= 0.0:
                continue
            sin, cos = sine[s, at], cosine[s, at]
            edge = radius[tooth] + feed * count / steps * sin + tip[0] * sin + tip[1] * cos
            chip = min(edge - surface[s, at], stock)
            if chip <= 0.0:
                continue
            factor = 1.0
            if size[0] > 0.0:
                factor = (1.0 + size[0] * size[1] / (size[1] + chip)) * size[2]
            f_t, f_r = tangential * factor * chip, radial * factor * chip
            if ploughing[0] > 0.0:
                slope = (velocity[0] * sin + velocity[1] * cos) / ploughing[2]
                if slope > 0.0:
                    pressed = ploughing[0] * slope / (1.0 + slope / ploughing[1])
                    f_r += pressed
                    f_t += PLOUGHING_FRICTION * pressed
            force_x += share * slice_depth * (-f_t * cos - f_r * sin)
            force_y += share * slice_depth * (f_t * sin - f_r * cos)
            if leave:
                surface[s, at] = edge
    return force_x, force_y


@numba.njit(cache=True, nogil=True)
def _tip(placing, moving, state, tip, velocity):
    """Fill in the tip's displacement and velocity (x, y)."""
    tip[:], velocity[:] = 0.0, 0.0
    for k in range(len(state)):
        for axis in range(2):
            tip[axis] += (placing[axis, k] * state[k]).real
            velocity[axis] += (moving[axis, k] * state[k]).real


@numba.njit(cache=True, nogil=True)
def _run(
    eigenvalue,
    input_,
    output,
    step_time,
    steps,
    teeth,
    radius,
    engaged,
    sine,
    cosine,
    surface,
    feed,
    slice_depth,
    tangential,
    radial,
    stock,
    ploughing,
    size,
    loss,
    revolutions,
    settled,
    history,
):
    """Cut; return the revolutions that were cut. ``history`` is filled as a ring."""
    modes, cycle, kept = len(eigenvalue), len(step_time), history.shape[0]
    moving = np.ascontiguousarray(output.T * eigenvalue)
    placing = np.ascontiguousarray(output.T)
    decay, constant, rising = _tables(eigenvalue, input_, step_time, 1.0)
    state, free = np.zeros(modes, np.complex128), np.zeros(modes, np.complex128)
    tip, velocity, mean, before = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros((steps, 2))
    f_x, f_y, quiet = 0.0, 0.0, 0
    for revolution in range(revolutions):
        largest, squares, mean[:] = 0.0, 0.0, 0.0
        for step in range(steps):
            count = revolution * steps + step
            now = count % cycle
            for k in range(modes):
                free[k] = decay[now, k] * state[k] + constant[now, k, 0] * f_x + constant[now, k, 1] * f_y
            _tip(placing, moving, free, tip, velocity)
            p_x, p_y = _force(
                count + 1,
                steps,
                teeth,
                radius,
                engaged,
                sine,
                cosine,
                surface,
                feed,
                slice_depth,
                tangential,
                radial,
                stock,
                ploughing,
                size,
                tip,
                velocity,
                False,
            )
            for k in range(modes):
                state[k] = free[k] + rising[now, k, 0] * (p_x - f_x) + rising[now, k, 1] * (p_y - f_y)
            _tip(placing, moving, state, tip, velocity)
            f_x, f_y = _force(
                count + 1,
                steps,
                teeth,
                radius,
                engaged,
                sine,
                cosine,
                surface,
                feed,
                slice_depth,
                tangential,
                radial,
                stock,
                ploughing,
                size,
                tip,
                velocity,
                True,
            )
            for axis in range(2):
                largest = max(largest, abs(tip[axis] - before[step, axis]))
                mean[axis] += tip[axis] / steps
                squares += tip[axis] ** 2 / steps
                before[step, axis] = tip[axis]
                history[count % kept, axis] = tip[axis]
        if loss[0] > 0.0:
            amplitude = np.sqrt(max(0.0, squares - mean[0] ** 2 - mean[1] ** 2))
            factor = 1.0 - loss[0] * amplitude / (amplitude + loss[1])
            decay, constant, rising = _tables(eigenvalue, input_, step_time, factor)
        quiet = quiet + 1 if largest < settled else 0
        if quiet * steps >= kept:
            return revolution + 1
    return revolutions
