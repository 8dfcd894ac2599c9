"""Motion of the tool tip under force: the shaft on its bearings as complex modes.

    z_k' = lambda_k z_k + b_k . F,   tip = Re sum_k c_k z_k

holds for every linear structure, gyroscopic or not, so that the cut needs no other.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from tests.hidden_effect.ball_bearing import radial_stiffness
from tests.hidden_effect.beam import Shaft, assemble
from tests.hidden_effect.hidden import Hidden, damping_factor, has_joint, joint_compliances, ring_growth
from tests.hidden_effect.machine import Machine

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Modes of a plane that a receptance shows, and those that a cut can move.
RECEPTANCE_MODES, CUT_MODES = 14, 8
#: A joint without compliance in one direction has this stiffness instead [N/m, N m/rad].
RIGID_JOINT = 1e12, 1e9


@dataclass(frozen=True, kw_only=True)
class Tip:
    """Complex modes: eigenvalue (mode,) [rad/s], input and output (mode, 2) for x and y."""

    eigenvalue: Complex
    input: Complex
    output: Complex

    def receptance(self, frequency: Array) -> Complex:
        """Return H (line, output axis, input axis) [m/N] at frequencies [rad/s]."""
        at = 1j * frequency[:, None]
        direct = np.einsum("ki,lk,kj->lij", self.output, 1.0 / (at - self.eigenvalue), self.input)
        mirror = np.einsum("ki,lk,kj->lij", self.output.conj(), 1.0 / (at - self.eigenvalue.conj()), self.input.conj())
        return np.asarray(0.5 * (direct + mirror))

    def turned(self, angle: float) -> "Tip":
        """Return the structure turned by an angle [rad] from y towards x."""
        s, c = math.sin(angle), math.cos(angle)
        axes = np.array([[c, -s], [s, c]])
        return Tip(eigenvalue=self.eigenvalue, input=self.input @ axes, output=self.output @ axes)

    def joined(self, other: "Tip") -> "Tip":
        """Return both structures in series: their displacements add."""
        return Tip(
            eigenvalue=np.concatenate([self.eigenvalue, other.eigenvalue]),
            input=np.concatenate([self.input, other.input]),
            output=np.concatenate([self.output, other.output]),
        )


def plane_modes(frequency: Array, damping: Array, shape: Array, axis: int) -> Tip:
    """Return modes of one plane: frequency [rad/s], damping ratio < 1, shape at the tip for unit modal mass."""
    damped = frequency * np.sqrt(1.0 - damping**2)
    input_, output = np.zeros((2, len(frequency), 2), dtype=complex)
    input_[:, axis], output[:, axis] = shape / (1j * damped), shape
    return Tip(eigenvalue=-damping * frequency + 1j * damped, input=input_, output=output)


class Spindle:
    """A shaft and its bearings, to be asked for the tip at any condition; answers are kept."""

    def __init__(self, machine: Machine, hidden: Hidden) -> None:
        self.machine, self.hidden = machine, hidden
        self.shaft: Shaft = assemble(
            machine.sections,
            tuple(seat.position_m for seat in machine.seats),
            machine.discs,
            hidden.joint_border if has_joint(hidden) else None,
        )
        self._bearings: dict[tuple[float, float], float] = {}
        self._tips: dict[tuple[float, ...], Tip] = {}

    def bearing_stiffness(self, speed: float, preload: float) -> float:
        """Return the radial stiffness [N/m] of a single bearing."""
        key = (round(speed, 6), round(preload, 6))
        if key not in self._bearings:
            growth = ring_growth(self.hidden, self.machine, speed)
            self._bearings[key] = radial_stiffness(self.machine.bearing, speed, preload, growth)
        return self._bearings[key]

    def tip(self, speed: float, preload_factor: float = 1.0, order: int = 0, modes: int = CUT_MODES) -> Tip:
        """Return the tip at a speed [rad/s]; order: trials cut before."""
        joint = joint_compliances(self.hidden, speed, order)
        key = (round(speed, 6), round(preload_factor, 6), *joint, modes)
        if key not in self._tips:
            tip = self._solved(speed, preload_factor, joint, modes)
            # Shaft and bearings are alike in all directions: what gives along another than y is the same, turned.
            self._tips[key] = tip if self.hidden.y_turn_rad == 0.0 else tip.turned(self.hidden.y_turn_rad)
        return self._tips[key]

    def _solved(self, speed: float, preload_factor: float, joint: tuple[float, float], modes: int) -> Tip:
        bearing = self.bearing_stiffness(speed, self.machine.preload_n * preload_factor)
        planes = [self.plane(axis, bearing, joint, modes) for axis in (0, 1)]
        factor = damping_factor(self.hidden, speed)
        if self.hidden.gyroscopic == 0.0:
            parts = []
            for axis, (frequency, shapes) in enumerate(planes):
                damping = self.damping_ratio(frequency) * factor
                kept = damping < 0.9  # beyond, a mode no longer vibrates; it is far above every cut
                parts.append(plane_modes(frequency[kept], damping[kept], shapes[0, kept], axis))
            return parts[0].joined(parts[1])
        return self._gyroscopic(planes, speed, factor)

    def plane(self, axis: int, bearing: float, joint: tuple[float, float], modes: int) -> tuple[Array, Array]:
        """Return natural frequencies [rad/s] and shapes (freedom, mode) of unit modal mass in a plane."""
        hidden, stiffness = self.hidden, self.shaft.stiffness.copy()
        in_y = hidden.front_seat_y_m_n if axis == 1 else 0.0
        front, rear = hidden.front_seat_m_n + in_y, hidden.rear_seat_m_n + in_y * hidden.rear_seat_y_share
        seats = (front, *[rear] * (len(self.machine.seats) - 1))
        for seat, freedom, gives in zip(self.machine.seats, self.shaft.seats, seats, strict=True):
            stiffness[freedom, freedom] += 1.0 / (1.0 / (seat.count * bearing) + gives)
        if self.shaft.joint is not None:
            before, behind = self.shaft.joint[:2], self.shaft.joint[2:]
            for one, other, compliance, rigid in zip(before, behind, joint, RIGID_JOINT, strict=True):
                spring = min(rigid, 1.0 / compliance) if compliance > 0.0 else rigid
                stiffness[np.ix_([one, other], [one, other])] += spring * np.array([[1.0, -1.0], [-1.0, 1.0]])
        squared, shapes = scipy.linalg.eigh(stiffness, self.shaft.mass, subset_by_index=[0, modes - 1])
        # The sign of a shape is free; fixed here, results do not hang on the solver's mood.
        return np.sqrt(squared), shapes * np.sign(shapes[0])

    def damping_ratio(self, frequency: Array) -> Array:
        """Return the ratios of modes [rad/s] of the machine's damping law."""
        damping = self.machine.damping
        if damping.ratio is not None:
            return np.full(len(frequency), damping.ratio)
        return np.asarray(0.5 * (damping.mass_1_s / frequency + damping.stiffness_s * frequency))

    def _gyroscopic(self, planes: list[tuple[Array, Array]], speed: float, factor: float) -> Tip:
        """Both planes coupled: M x'' - W G y' + ..., M y'' + W G x' + ..., for a rotor that turns from +y to +x."""
        (f_x, s_x), (f_y, s_y) = planes
        count = len(f_x)
        frequency = np.concatenate([f_x, f_y])
        coupling = self.hidden.gyroscopic * speed * (s_x.T @ self.shaft.gyroscopic @ s_y)
        resisting = np.diag(2.0 * factor * frequency * self.damping_ratio(frequency))
        resisting[:count, count:] -= coupling
        resisting[count:, :count] += coupling.T
        state = np.zeros((4 * count, 4 * count))
        state[: 2 * count, 2 * count :] = np.eye(2 * count)
        state[2 * count :, : 2 * count] = -np.diag(frequency**2)
        state[2 * count :, 2 * count :] = -resisting
        eigenvalue, vectors = np.linalg.eig(state)
        order = np.argsort(eigenvalue.imag)
        order = order[eigenvalue.imag[order] > 1.0]
        at_tip = np.zeros((2 * count, 2))
        at_tip[:count, 0], at_tip[count:, 1] = s_x[0], s_y[0]
        force = np.concatenate([np.zeros((2 * count, 2)), at_tip]).astype(complex)
        return Tip(
            eigenvalue=eigenvalue[order],
            input=np.linalg.solve(vectors, force)[order],
            output=2.0 * (vectors[: 2 * count].T @ at_tip)[order],
        )


def workpiece(hidden: Hidden) -> Tip | None:
    """Return the workpiece's modes: pushed by the force's opposite, seen against the tool, they add to the tip's."""
    if not hidden.foreign_modes:
        return None
    parts = [
        plane_modes(
            np.array([2.0 * np.pi * mode.frequency_hz]),
            np.array([mode.damping_ratio]),
            np.array([mode.mass_kg**-0.5]),
            mode.axis,
        )
        for mode in hidden.foreign_modes
    ]
    whole = parts[0]
    for part in parts[1:]:
        whole = whole.joined(part)
    return whole
