"""Rotor on bearings: beam finite elements, and its modes as the tool tip feels them.

Equation: M q'' + C q' + (K + sum_s k_s e_s e_s^T) q = e_tip F, one plane of an axisymmetric rotor
at a time. Only the stiffnesses k_s of the bearing seats change with speed and preload, so the
model is reduced once and a small eigenproblem is left at each speed. The gyroscopic matrix, which
couples the planes of a spinning rotor, is assembled beside M and K and is used where it is asked for.

Sources: H. D. Nelson, "A finite rotating shaft element using Timoshenko beam theory", J. Mech.
Design 102 (1980) 793-803 (element matrices, rotary inertia); G. R. Cowper, "The shear coefficient
in Timoshenko's beam theory", J. Appl. Mech. 33 (1966) 335-340; R. H. MacNeal, Computers &
Structures 1 (1971) 581-601 (free modes completed by static attachment shapes).
"""

import itertools
import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from chatter_core.errors import InvalidInput
from chatter_core.joint import CLOSED, Joint, OpenFreedom
from chatter_core.machine import Damping, Section, Spindle
from chatter_core.threads import one_thread

Array = NDArray[np.float64]

#: The rotor is cut into elements no longer than this share of its length.
ELEMENTS_PER_ROTOR = 96
#: Borders, seats and discs that are nearer than this share one node [m]: a shorter element is stiffer than
#: the rest of the rotor by more than double precision holds.
SHORTEST_ELEMENT = 1e-5
#: Modes kept by the reduction, beside one attachment shape for each seat.
KEPT_MODES = 20
#: Stiffness of every seat for which the modes of the reduction are exact [N/m].
REFERENCE_SEAT_STIFFNESS = 1e8
#: Reduced rotors that are remembered.
ROTORS_KEPT = 64


@dataclass(frozen=True, kw_only=True)
class Rotor:
    """Assembled rotor without its bearings, one plane; freedoms alternate deflection and slope.

    mass, stiffness, gyroscopic: (freedom, freedom) [SI], see ``whirl_frequencies``; seats: freedom
    of each bearing seat (seat,); the tool tip is freedom 0; joints: where it gives.
    """

    mass: Array
    stiffness: Array
    gyroscopic: Array
    seats: NDArray[np.intp]
    joints: tuple[OpenFreedom, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ReducedRotor:
    """Rotor in the mass-orthonormal basis of its reference modes and attachment shapes.

    stiffness [N/m], without the seats, and gyroscopic: (shape, shape); seat: (seat, shape) and tip:
    (shape,), the deflections of the shapes there; joint: (joint, shape), how far they open each of ``joints``.
    """

    stiffness: Array
    gyroscopic: Array
    seat: Array
    tip: Array
    joint: Array
    joints: tuple[OpenFreedom, ...]

    @property
    def mode_count(self) -> int:
        """Number of modes: as many shapes as there are seats and joints carry the rest of the rotor and are none."""
        return len(self.tip) - len(self.seat) - len(self.joint)

    def supported(self, seat_stiffness: Array, spindle_speed: Array | None = None) -> Array:
        """Return the stiffness on seats (..., seat) [N/m], as (..., shape, shape).

        With joints that loosen at spindle speeds (...) [rad/s]; without speeds, as they are stated.
        """
        on_seats = np.einsum("...s,si,sj->...ij", seat_stiffness, self.seat, self.seat)
        if spindle_speed is None or not self.joints:
            return np.asarray(self.stiffness + on_seats)
        change = np.stack([joint.change(spindle_speed) for joint in self.joints], axis=-1)
        on_joints = np.einsum("...s,si,sj->...ij", change, self.joint, self.joint)
        return np.asarray(self.stiffness + on_seats + on_joints)


@dataclass(frozen=True, kw_only=True)
class RotorModes:
    """Undamped modes of the supported rotor at several supports.

    natural_frequency [rad/s] and tip_deflection [1/sqrt(kg)]: (support, mode), ascending;
    shape: (support, shape, mode), mass-orthonormal, so that the modal assurance of two modes at
    different supports is the square of their scalar product.
    """

    natural_frequency: Array
    tip_deflection: Array
    shape: Array

    def taken(self, index: NDArray[np.intp]) -> "RotorModes":
        """Return some of the modes, by index (support, kept) into those of each support."""
        return RotorModes(
            natural_frequency=np.take_along_axis(self.natural_frequency, index, axis=1),
            tip_deflection=np.take_along_axis(self.tip_deflection, index, axis=1),
            shape=np.take_along_axis(self.shape, index[:, None, :], axis=2),
        )


def shear_coefficient(section: Section) -> float:
    """Return Cowper's shear coefficient of a hollow circle [-].

    See docs/physics.md#rotor.
    """
    nu, ratio = section.poisson_ratio, section.inner_diameter / section.outer_diameter
    squared = (1.0 + ratio**2) ** 2
    return 6.0 * (1.0 + nu) * squared / ((7.0 + 6.0 * nu) * squared + (20.0 + 12.0 * nu) * ratio**2)


def beam_element(section: Section, length: float, beam: str) -> tuple[Array, Array, Array]:
    """Return mass, stiffness and gyroscopic matrix (4, 4) of one element of a section [SI].

    ``beam`` is ``timoshenko`` (shear and rotary inertia) or ``euler_bernoulli`` (neither, and so no
    gyroscopic moment). Freedoms: deflection and slope at both ends. Source: Nelson (1980).

    See docs/physics.md#rotor.
    """
    area = math.pi / 4.0 * (section.outer_diameter**2 - section.inner_diameter**2)
    inertia = math.pi / 64.0 * (section.outer_diameter**4 - section.inner_diameter**4)
    bending = section.youngs_modulus * inertia
    shear_modulus = section.youngs_modulus / (2.0 * (1.0 + section.poisson_ratio))
    thick = beam == "timoshenko"
    phi = 12.0 * bending / (shear_coefficient(section) * shear_modulus * area * length**2) if thick else 0.0
    stiffness = bending / ((1.0 + phi) * length**3) * _stiffness_shape(phi, length)
    mass = section.density * area * length / (1.0 + phi) ** 2 * _translation_shape(phi, length)
    turning = np.zeros((4, 4))
    if thick:
        turning = section.density * inertia / (length * (1.0 + phi) ** 2) * _rotation_shape(phi, length)
    # About its own axis a circle has twice the second moment that it has about a diameter.
    return mass + turning, stiffness, 2.0 * turning


def _stiffness_shape(phi: float, length: float) -> Array:
    a, b = 6.0 * length, length**2
    return np.array(
        [
            [12.0, a, -12.0, a],
            [a, (4.0 + phi) * b, -a, (2.0 - phi) * b],
            [-12.0, -a, 12.0, -a],
            [a, (2.0 - phi) * b, -a, (4.0 + phi) * b],
        ]
    )


def _translation_shape(phi: float, length: float) -> Array:
    near = 13.0 / 35.0 + 7.0 * phi / 10.0 + phi**2 / 3.0
    far = 9.0 / 70.0 + 3.0 * phi / 10.0 + phi**2 / 6.0
    near_slope = (11.0 / 210.0 + 11.0 * phi / 120.0 + phi**2 / 24.0) * length
    far_slope = -(13.0 / 420.0 + 3.0 * phi / 40.0 + phi**2 / 24.0) * length
    slope = (1.0 / 105.0 + phi / 60.0 + phi**2 / 120.0) * length**2
    cross = -(1.0 / 140.0 + phi / 60.0 + phi**2 / 120.0) * length**2
    return np.array(
        [
            [near, near_slope, far, far_slope],
            [near_slope, slope, -far_slope, cross],
            [far, -far_slope, near, -near_slope],
            [far_slope, cross, -near_slope, slope],
        ]
    )


def _rotation_shape(phi: float, length: float) -> Array:
    a = 6.0 / 5.0
    b = (1.0 / 10.0 - phi / 2.0) * length
    c = (2.0 / 15.0 + phi / 6.0 + phi**2 / 3.0) * length**2
    d = (-1.0 / 30.0 - phi / 6.0 + phi**2 / 6.0) * length**2
    return np.array([[a, b, -a, b], [b, c, -b, d], [-a, -b, a, -b], [b, d, -b, c]])


def assemble(spindle: Spindle, elements_per_rotor: int = ELEMENTS_PER_ROTOR, joints: tuple[Joint, ...] = ()) -> Rotor:
    """Assemble the rotor with a node at every section border, bearing seat and disc.

    joints: at section borders; what sits on such a border sits behind the joint. Joints at one border act in
    series.

    See docs/physics.md#rotor.
    """
    nodes, owner = _mesh(spindle, elements_per_rotor)
    # Freedoms of every node as the element in front of it and as everything behind it sees them.
    front, behind, opened = _open_joints(nodes, joints)
    freedoms = 2 * len(nodes) + len(opened)
    mass = np.zeros((freedoms, freedoms))
    stiffness, gyroscopic = np.zeros_like(mass), np.zeros_like(mass)
    elements = [
        beam_element(section, length, spindle.beam) for section, length in zip(owner, np.diff(nodes), strict=True)
    ]
    place = np.concatenate([behind[:-1], front[1:]], axis=1)
    for matrix, parts in zip((mass, stiffness, gyroscopic), zip(*elements, strict=True), strict=True):
        np.add.at(matrix, (place[:, :, None], place[:, None, :]), np.array(parts))
    for joint in opened:
        faces = [joint.front, joint.behind]
        stiffness[faces, faces] += joint.stiffness
        stiffness[faces, faces[::-1]] -= joint.stiffness
    for disc in spindle.discs:
        across_freedom, slope = behind[_node_at(nodes, disc.position)]
        weight = disc.density * math.pi / 4.0 * (disc.outer_diameter**2 - disc.inner_diameter**2) * disc.width
        mass[across_freedom, across_freedom] += weight
        # A thin-beam rotor has no rotary inertia anywhere else, but a disc's is its own property.
        across = weight * (disc.outer_diameter**2 + disc.inner_diameter**2) / 16.0
        mass[slope, slope] += across + weight * disc.width**2 / 12.0
        gyroscopic[slope, slope] += 2.0 * across
    seats = np.array([behind[_node_at(nodes, seat.position), 0] for seat in spindle.bearings])
    return Rotor(mass=mass, stiffness=stiffness, gyroscopic=gyroscopic, seats=seats, joints=opened)


def _open_joints(
    nodes: Array, joints: tuple[Joint, ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp], tuple[OpenFreedom, ...]]:
    """Return the freedoms (node, 2) in front of every node and behind it, and those in which the rotor gives."""
    front = np.arange(2 * len(nodes)).reshape(-1, 2)
    behind, opened = front.copy(), list[OpenFreedom]()
    for node in sorted({_node_at(nodes, joint.position) for joint in joints}):
        own = [joint for joint in joints if _node_at(nodes, joint.position) == node]
        for way in range(2):
            compliances = [(joint.lateral_compliance, joint.rotational_compliance)[way] for joint in own]
            parts = tuple((c, joint.loosening) for c, joint in zip(compliances, own, strict=True) if c > CLOSED[way])
            if parts:
                behind[node, way] = front.size + len(opened)
                opened.append(OpenFreedom(front=int(front[node, way]), behind=int(behind[node, way]), parts=parts))
    return front, behind, tuple(opened)


def _mesh(spindle: Spindle, elements_per_rotor: int) -> tuple[Array, list[Section]]:
    """Return the node positions [m], tip first, and the section that owns each element."""
    borders = np.concatenate(([0.0], np.cumsum([section.length for section in spindle.sections])))
    places = [*borders, *(s.position for s in spindle.bearings), *(d.position for d in spindle.discs)]
    fixed = np.unique(np.clip(places, 0.0, borders[-1]))
    fixed = fixed[np.concatenate(([True], np.diff(fixed) > SHORTEST_ELEMENT))]
    longest = borders[-1] / elements_per_rotor
    nodes, owner = [0.0], []
    for start, end in itertools.pairwise(fixed):
        pieces = max(1, math.ceil((end - start) / longest - 1e-9))
        section = spindle.sections[int(np.searchsorted(borders, 0.5 * (start + end)) - 1)]
        nodes.extend(start + (end - start) * np.arange(1, pieces + 1) / pieces)
        owner.extend([section] * pieces)
    return np.array(nodes), owner


def _node_at(nodes: Array, position: float) -> int:
    return int(np.argmin(np.abs(nodes - position)))


def reduce_rotor(rotor: Rotor, kept_modes: int = KEPT_MODES) -> ReducedRotor:
    """Project the rotor on its modes at reference supports and the static shapes of its seats.

    The attachment shapes make the reduced model exact for static loads at the seats whatever
    their stiffness, so the lower frequencies come out to seven digits or more near the reference
    stiffness and to four for seats from very soft to rigid. Method: MacNeal (1971); here with
    supported instead of free reference modes.

    Raises InvalidInput for a rotor whose stiffness is singular in double precision.

    See docs/physics.md#rotor.
    """
    supported = rotor.stiffness.copy()
    supported[rotor.seats, rotor.seats] += REFERENCE_SEAT_STIFFNESS
    kept = min(kept_modes, len(supported) - len(rotor.seats))
    try:
        factor = scipy.linalg.cho_factor(supported)
        _, modes = scipy.linalg.eigh(supported, rotor.mass, subset_by_index=(0, kept - 1))
    except (np.linalg.LinAlgError, ValueError):
        raise InvalidInput(
            ["spindle: its stiffness or mass is lost in rounding; is a section far more slender or softer than others?"]
        ) from None
    seats, faces = len(rotor.seats), np.array([(joint.front, joint.behind) for joint in rotor.joints], dtype=int)
    front, behind = faces.reshape(-1, 2).T
    unit = np.zeros((len(supported), seats + len(front)))
    unit[rotor.seats, np.arange(seats)] = 1.0
    unit[front, seats + np.arange(len(front))] = 1.0
    unit[behind, seats + np.arange(len(front))] = -1.0
    attached = scipy.linalg.cho_solve(factor, unit)
    attached -= modes @ (modes.T @ rotor.mass @ attached)
    weights, turn = np.linalg.eigh(attached.T @ rotor.mass @ attached)
    useful = weights > 1e-12 * weights.max()
    basis = np.hstack([modes, attached @ (turn[:, useful] / np.sqrt(weights[useful]))])
    return ReducedRotor(
        stiffness=basis.T @ rotor.stiffness @ basis,
        gyroscopic=basis.T @ rotor.gyroscopic @ basis,
        seat=basis[rotor.seats],
        tip=basis[0],
        joint=basis[front] - basis[behind],
        joints=rotor.joints,
    )


def reduced(spindle: Spindle, joints: tuple[Joint, ...] = ()) -> ReducedRotor:
    """Assemble and reduce the rotor of a spindle; fits of bearings, damping or cuts ask for the same one again.

    joints: as for ``assemble``. Its arrays are read-only: everybody who asks for this rotor has the same ones.

    Raises InvalidInput for a rotor whose stiffness is singular in double precision.

    See docs/physics.md#rotor.
    """
    # What no rotor depends on is taken away: all that is left tells it from others. How joints loosen is put back.
    shaft = spindle.model_copy(update=dict.fromkeys(("preload", "preload_type", "damping")))
    rotor = _reduced(shaft, tuple(replace(one, loosening=np.ones_like) for one in joints))
    return replace(rotor, joints=_open_joints(_mesh(spindle, ELEMENTS_PER_ROTOR)[0], joints)[2]) if joints else rotor


@lru_cache(maxsize=ROTORS_KEPT)
def _reduced(shaft: Spindle, joints: tuple[Joint, ...]) -> ReducedRotor:
    # Last digits of sums hang on the number of threads, and what is remembered must not hang on who asked first.
    with one_thread():
        rotor = reduce_rotor(assemble(shaft, joints=joints))
    for array in (rotor.stiffness, rotor.gyroscopic, rotor.seat, rotor.tip, rotor.joint):
        array.flags.writeable = False
    return rotor


def supported_modes(rotor: ReducedRotor, seat_stiffness: Array, spindle_speed: Array | None = None) -> RotorModes:
    """Solve the supported rotor for several supports at once.

    seat_stiffness: (support, seat) [N/m], every entry positive; spindle_speed: (support,) [rad/s], at which
    joints loosen; without it they are as stated.

    See docs/physics.md#rotor.
    """
    squared, shape = np.linalg.eigh(rotor.supported(seat_stiffness, spindle_speed))
    return RotorModes(
        natural_frequency=np.sqrt(squared), tip_deflection=np.einsum("i,pim->pm", rotor.tip, shape), shape=shape
    )


def modal_gyroscopic(rotor: ReducedRotor, x: RotorModes, y: RotorModes) -> Array:
    """Return the gyroscopic matrix phi_x^T G phi_y of modes with shapes one at the tip (support, x mode, y mode) [kg].

    x, y: the modes of each plane. Times the spin speed it is the force on a mode in x per velocity of one in y, and
    its transpose with the other sign that on a mode in y. Source: Nelson (1980).

    See docs/physics.md#rotor.
    """
    in_x, in_y = (modes.shape / modes.tip_deflection[:, None, :] for modes in (x, y))
    return np.asarray(in_x.swapaxes(1, 2) @ rotor.gyroscopic @ in_y)


def whirl_frequencies(rotor: ReducedRotor, seat_stiffness: Array, spin_speed: float) -> Array:
    """Return the undamped whirl frequencies of the spinning rotor, ascending by modulus [rad/s].

    With r = x + i y the two planes obey M r'' - i Omega G r' + K r = 0. A positive frequency whirls
    with the spin, a negative one against it; at standstill they come in pairs.

    seat_stiffness: (seat,) [N/m], every entry positive; spin_speed Omega [rad/s]. Frequencies are
    those of the reduced rotor, of which the lower half is accurate. Source: Nelson (1980).

    See docs/physics.md#rotor.
    """
    shapes = len(rotor.tip)
    stiffness = rotor.supported(seat_stiffness)
    # omega^2 r = omega Omega G r + K r with mass-orthonormal shapes, as a problem of first order.
    first_order = np.block([[spin_speed * rotor.gyroscopic, stiffness], [np.eye(shapes), np.zeros((shapes, shapes))]])
    frequency = np.linalg.eigvals(first_order).real
    return np.asarray(frequency[np.argsort(np.abs(frequency))])


def direct_receptance(
    rotor: Rotor, damping: Damping, seat_stiffness: Array, frequency: Array, spin_speed: float = 0.0
) -> NDArray[np.complex128]:
    """Solve for the tip's receptance without modes (frequency, output axis, input axis) [m/N].

    Both planes with proportional damping C = c1 M + c2 K and the gyroscopic moments between them:
    (K + i w C - w^2 M) x + i w Omega G y = F_x and the same with -G for y. Spin is positive from x
    towards y: the cutting convention, whose teeth turn from +y towards +x, has a negative one.
    seat_stiffness: (seat,) [N/m]; frequency w: (frequency,) [rad/s], for exp(+i w t).

    Raises InvalidInput for damping that is not proportional: it needs modes.

    See docs/physics.md#rotor.
    """
    if damping.mass_coefficient is None or damping.stiffness_coefficient is None:
        raise InvalidInput([f"damping.kind: found {damping.kind!r}, a direct receptance needs 'proportional'"])
    stiffness = rotor.stiffness.copy()
    stiffness[rotor.seats, rotor.seats] += seat_stiffness
    damped = damping.mass_coefficient * rotor.mass + damping.stiffness_coefficient * stiffness
    freedoms = len(stiffness)
    force = np.zeros((2 * freedoms, 2))
    force[[0, freedoms], [0, 1]] = 1.0
    result = np.empty((len(frequency), 2, 2), dtype=complex)
    for index, w in enumerate(frequency):
        plane = stiffness + 1j * w * damped - w**2 * rotor.mass
        across = 1j * w * spin_speed * rotor.gyroscopic
        response = scipy.linalg.solve(np.block([[plane, across], [-across, plane]]), force)
        result[index] = response[[0, freedoms]]
    return result


def damping_ratios(damping: Damping, natural_frequency: Array) -> Array:
    """Return the damping ratio of each mode [-]: 2 zeta w = c1 + c2 w^2, or one ratio for all.

    See docs/physics.md#rotor.
    """
    if damping.ratio is not None:
        return np.full_like(natural_frequency, damping.ratio)
    assert damping.mass_coefficient is not None
    assert damping.stiffness_coefficient is not None
    return 0.5 * (damping.mass_coefficient / natural_frequency + damping.stiffness_coefficient * natural_frequency)
