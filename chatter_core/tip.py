"""Tool tip: modes as the tip feels them, their receptance and their state space.

Modes come from the spindle or from measurement; from here on nobody can tell which. With the
mode shape one at the tip, mode k of an axis obeys m q'' + c q' + k q = F and the tip's
displacement along the axis is the sum of its q. Where axes are turned F and q are along the mode's own direction.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import InvalidInput
from chatter_core.machine import Tip

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
AXES = ("x", "y")
#: Eigenvectors that are worse conditioned than this lose half of all digits.
WORST_CONDITION = 1e8
#: No mode is damped more than this: damped critically it would be none.
MOST_DAMPED = 0.9
#: Fields of TipModes that are (speed, mode).
OVER_SPEED = ("natural_frequency", "damping_ratio", "modal_mass", "tracking_confidence")


@dataclass(frozen=True, kw_only=True)
class TipModes:
    """Modes of both axes over speed, in one list: the x modes first.

    axis: (mode,) 0 for x, 1 for y; label: (mode,) number of the mode on its axis, from 1, which
    it keeps at every speed; natural_frequency [rad/s], damping_ratio [-], modal_mass [kg]:
    (speed, mode); tracking_confidence: (speed, mode), the least modal assurance met on the way
    from standstill; gyroscopic: (speed, mode, mode) [N s/m], the force on a mode per velocity of
    another, M q'' + (C + gyroscopic) q' + K q = F, None where no mode feels another; turn: (speed, mode) [rad], by
    which the direction of a mode is turned from its axis, from x towards y, None where none is.
    """

    axis: NDArray[np.intp]
    label: NDArray[np.intp]
    natural_frequency: Array
    damping_ratio: Array
    modal_mass: Array
    tracking_confidence: Array
    gyroscopic: Array | None = None
    turn: Array | None = None

    @property
    def direction(self) -> Array:
        """Unit vectors along which modes move, in x and y (speed, mode, 2)."""
        if self.turn is None:
            return np.broadcast_to(np.eye(2)[self.axis], (*self.natural_frequency.shape, 2))
        angle = 0.5 * np.pi * self.axis + self.turn
        return np.stack([np.cos(angle), np.sin(angle)], axis=-1)

    @property
    def modal_stiffness(self) -> Array:
        """Modal stiffness felt at the tip (speed, mode) [N/m]."""
        return self.modal_mass * self.natural_frequency**2

    def __len__(self) -> int:
        return len(self.axis)

    def at(self, speeds: NDArray[np.intp]) -> "TipModes":
        """Return the modes at some of the speeds."""
        coupling = None if self.gyroscopic is None else self.gyroscopic[speeds]
        turn = None if self.turn is None else self.turn[speeds]
        return replace(
            self, gyroscopic=coupling, turn=turn, **{name: getattr(self, name)[speeds] for name in OVER_SPEED}
        )

    def heavier(self, factor: Array) -> "TipModes":
        """Return the modes with masses, and so stiffnesses and all forces on them, larger by factors (mode,)."""
        root = np.sqrt(factor)
        coupling = None if self.gyroscopic is None else self.gyroscopic * root[:, None] * root
        return replace(self, modal_mass=self.modal_mass * factor, gyroscopic=coupling)

    def damped(self, factor: Array) -> "TipModes":
        """Return the modes with damping ratios larger by factors (speed,), at most MOST_DAMPED."""
        # A mode that was damped more is left as it was.
        most = np.maximum(MOST_DAMPED, self.damping_ratio)
        return replace(self, damping_ratio=np.minimum(self.damping_ratio * factor[:, None], most))

    def alone(self, label: int) -> "TipModes":
        """Return the one mode of each axis that bears a number."""
        kept = np.flatnonzero(self.label == label)
        return replace(
            self,
            axis=self.axis[kept],
            label=self.label[kept],
            gyroscopic=None if self.gyroscopic is None else self.gyroscopic[:, kept[:, None], kept],
            turn=None if self.turn is None else self.turn[:, kept],
            **{name: getattr(self, name)[:, kept] for name in OVER_SPEED},
        )


@dataclass(frozen=True, kw_only=True)
class Eigensystem:
    """A = eigenvectors diag(poles) inverse: poles (speed, state), matrices (speed, state, state).

    Not finite where a mode is damped critically.
    """

    poles: ComplexArray
    eigenvectors: ComplexArray
    inverse: ComplexArray


@dataclass(frozen=True, kw_only=True)
class StateSpace:
    """x' = A x + B F, w = C x of the tip over speed; the states are every q, then every q'/w_n.

    Velocities are divided by the mode's natural frequency, so that all states are lengths of like
    size and their norm is the energy's: eigenvalue solvers lose digits otherwise.

    state_matrix: (speed, state, state); input_matrix: (speed, state, 2); output_matrix:
    (speed, 2, state); eigensystem: in closed form, None where modes feel each other.
    """

    state_matrix: Array
    input_matrix: Array
    output_matrix: Array
    eigensystem: Eigensystem | None


def state_space(modes: TipModes) -> StateSpace:
    """Write the modes as a state space.

    See docs/physics.md#tool-tip.
    """
    speeds, count = modes.natural_frequency.shape
    position, velocity = np.arange(count), np.arange(count, 2 * count)
    state_matrix = np.zeros((speeds, 2 * count, 2 * count))
    state_matrix[:, position, velocity] = modes.natural_frequency
    state_matrix[:, velocity, position] = -modes.natural_frequency
    state_matrix[:, velocity, velocity] = -2.0 * modes.damping_ratio * modes.natural_frequency
    if modes.gyroscopic is not None:
        impedance = modes.modal_mass * modes.natural_frequency
        felt = modes.gyroscopic * modes.natural_frequency[:, None, :] / impedance[:, :, None]
        state_matrix[:, velocity[:, None], velocity] -= felt
    input_matrix = np.zeros((speeds, 2 * count, 2))
    direction = modes.direction
    input_matrix[:, velocity] = direction / (modes.modal_mass * modes.natural_frequency)[:, :, None]
    output_matrix = np.zeros((speeds, 2, 2 * count))
    output_matrix[:, :, position] = np.swapaxes(direction, 1, 2)
    return StateSpace(
        state_matrix=state_matrix,
        input_matrix=input_matrix,
        output_matrix=output_matrix,
        eigensystem=_eigensystem(modes) if modes.gyroscopic is None else None,
    )


def _eigensystem(modes: TipModes) -> Eigensystem:
    """Return poles, eigenvectors (1, s) of each mode's (q, q'/w_n) and their inverse, for poles w_n s.

    s^2 + 2 zeta s + 1 = 0; upper poles first, then the lower ones.
    """
    speeds, count = modes.natural_frequency.shape
    root = np.sqrt(modes.damping_ratio.astype(complex) ** 2 - 1.0)
    upper, lower = -modes.damping_ratio + root, -modes.damping_ratio - root
    poles = np.concatenate([modes.natural_frequency * upper, modes.natural_frequency * lower], axis=1)
    first, second = np.arange(count), np.arange(count, 2 * count)
    eigenvectors = np.zeros((speeds, 2 * count, 2 * count), dtype=complex)
    inverse = np.zeros_like(eigenvectors)
    eigenvectors[:, first, first] = eigenvectors[:, first, second] = 1.0
    eigenvectors[:, second, first], eigenvectors[:, second, second] = upper, lower
    with np.errstate(divide="ignore", invalid="ignore"):
        span = 1.0 / (upper - lower)
        inverse[:, first, first], inverse[:, first, second] = -lower * span, span
        inverse[:, second, first], inverse[:, second, second] = upper * span, -span
    return Eigensystem(poles=poles, eigenvectors=eigenvectors, inverse=inverse)


def receptance(modes: TipModes, frequency: Array) -> NDArray[np.complex128]:
    """Return the tip's receptance H = w / F for the time law exp(+i w t) [m/N].

    Spin speed (of ``modes``) and excitation frequency [rad/s] (frequency,) are separate axes:
    the result is (speed, frequency, output axis, input axis).

    See docs/physics.md#tool-tip.
    """
    if modes.gyroscopic is not None:
        return _coupled_receptance(modes, frequency)
    natural = modes.natural_frequency[:, None, :]
    excited = frequency[None, :, None]
    term = 1.0 / (
        modes.modal_mass[:, None, :]
        * (natural**2 - excited**2 + 2j * modes.damping_ratio[:, None, :] * natural * excited)
    )
    result = np.zeros((len(modes.natural_frequency), len(frequency), 2, 2), dtype=complex)
    if modes.turn is not None:
        along = modes.direction
        return np.einsum("sfm,smi,smj->sfij", term, along, along, out=result)
    for axis in range(2):
        result[:, :, axis, axis] = term[:, :, modes.axis == axis].sum(axis=-1)
    return result


def _coupled_receptance(modes: TipModes, frequency: Array) -> ComplexArray:
    """Return the receptance of modes that feel each other, C (i w - A)^-1 B; NaN at speeds without modes.

    By the poles of the state space, or line by line where a mode is damped critically and has no pair of them.
    """
    space = state_space(modes)
    result = np.full((len(space.state_matrix), len(frequency), 2, 2), np.nan, dtype=complex)
    for speed in np.flatnonzero(np.isfinite(space.state_matrix).all(axis=(1, 2))):
        state, driven, seen = space.state_matrix[speed], space.input_matrix[speed], space.output_matrix[speed]
        poles, vectors = np.linalg.eig(state)
        if np.linalg.cond(vectors) < WORST_CONDITION:
            residues = (seen @ vectors)[:, None, :] * np.linalg.solve(vectors, driven.astype(complex)).T
            result[speed] = np.einsum("fp,oip->foi", 1.0 / (1j * frequency[:, None] - poles), residues, optimize=True)
            continue
        for line, excited in enumerate(frequency):
            result[speed, line] = seen @ np.linalg.solve(1j * excited * np.eye(len(state)) - state, driven)
    return result


def between_axes(force: Array) -> Array:
    """Return the gyroscopic matrix (speed, mode, mode) of both axes from the force on x per velocity of y [N s/m].

    force: (speed, x mode, y mode). x is pushed as y moves and y the other way: + above the diagonal, - below. It takes
    no energy.

    See docs/physics.md#tool-tip.
    """
    nothing = np.zeros_like(force)
    return np.block([[nothing, force], [-force.swapaxes(1, 2), nothing]])


def most_modes(tip: Tip) -> int:
    """Return how many measured modes the axis has that has most.

    See docs/physics.md#tool-tip.
    """
    speed = tip.modes[0].spindle_speed
    return max(sum(m.axis == axis for m in tip.modes if m.spindle_speed == speed) for axis in AXES)


def measured_modes(tip: Tip, spindle_speed: Array, mode_count: int | None = None) -> TipModes:
    """Take the modes from measurement, interpolated linearly between the measured speeds.

    Below the lowest and above the highest measured speed the nearest values are kept. Modes of
    an axis are numbered by frequency at each measured speed. ``mode_count`` keeps the lowest of
    each axis; an axis that has fewer keeps all of its own.

    Raises InvalidInput when no axis has ``mode_count`` modes.

    See docs/physics.md#tool-tip.
    """
    speeds = sorted({mode.spindle_speed or 0.0 for mode in tip.modes})
    most = most_modes(tip)
    if mode_count is not None and mode_count > most:
        allowed = f"1 to {most}, as many as tip.modes lists of an axis"
        raise InvalidInput([f"mode_count: found {mode_count}, allowed: {allowed}"])
    tables = []
    for axis, name in enumerate(AXES):
        at_speed = [
            sorted(
                (m for m in tip.modes if m.axis == name and (m.spindle_speed or 0.0) == speed),
                key=lambda m: m.natural_frequency,
            )
            for speed in speeds
        ]
        for number in range(len(at_speed[0]))[:mode_count]:
            rows = [(m[number].natural_frequency, m[number].damping_ratio, m[number].stiffness) for m in at_speed]
            columns = [np.interp(spindle_speed, speeds, column) for column in zip(*rows, strict=True)]
            tables.append((axis, number + 1, *columns))
    frequency, damping, stiffness = (np.stack([row[i] for row in tables], axis=-1) for i in (2, 3, 4))
    return TipModes(
        axis=np.array([row[0] for row in tables]),
        label=np.array([row[1] for row in tables]),
        natural_frequency=frequency,
        damping_ratio=damping,
        modal_mass=stiffness / frequency**2,
        tracking_confidence=np.ones_like(frequency),
    )
