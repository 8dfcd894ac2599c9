"""Sets of bearings on one rigid shaft: back-to-back, face-to-face, tandem, and any mixture.

A bearing at axial place z that faces direction s = +1 or -1 sees the shaft's displacement
(d_a, d_r, theta) as

    (s d_a + preload displacement, d_r - z theta, s theta),

and its load comes back by the transpose. Preload is set at standstill by the rings' widths, so that
the displacement between the two directions is locked: at speed the balls' inertia adds to it.

Source: T. A. Harris, M. N. Kotzalas, Essential Concepts of Bearing Technology, 5th ed. (2007),
chapter 8 (preload and axial deflection of duplex sets), and Advanced Concepts, chapter 1 (statically
loaded shaft on several bearings).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import root

from chatter_core.bearing.axisymmetric import axisymmetric_state
from chatter_core.bearing.general import LOAD_TOLERANCE, LoadedBearing, Ring, load_scale, three_finite
from chatter_core.errors import InvalidInput, NoEquilibrium
from chatter_core.machine import Bearing

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Arrangement:
    """Equal bearings on one shaft.

    position: axial places (bearing,) [m], ascending; direction: (bearing,) +1 where an inner ring
    pushed towards +z presses its balls, -1 the other way; preload: axial force between the two
    directions at standstill [N], shared evenly among the bearings of a direction.
    """

    bearing: Bearing
    position: tuple[float, ...]
    direction: tuple[int, ...]
    preload: float

    def __post_init__(self) -> None:
        problems = []
        if not 1 <= len(self.position) == len(self.direction):
            problems.append("arrangement: position and direction need one entry for every bearing")
        if not set(self.direction) <= {1, -1}:
            problems.append(f"arrangement: direction: found {list(self.direction)}, allowed: 1 or -1 for every bearing")
        if list(self.position) != sorted(set(self.position)):
            problems.append(f"arrangement: position: found {list(self.position)} m, allowed: ascending")
        if not (np.isfinite(self.preload) and self.preload >= 0.0):
            problems.append(f"arrangement: preload: found {self.preload:g} N, allowed: a finite number, at least 0")
        if self.preload > 0.0 and len(set(self.direction)) == 1:
            problems.append("arrangement: bearings that all face one way hold no preload; load them axially instead")
        if problems:
            raise InvalidInput(problems)


def back_to_back(bearing: Bearing, distance: float, preload: float) -> Arrangement:
    """Return a pair ``distance`` [m] apart whose contact lines spread towards the shaft (DB, O): stiff in tilt.

    See docs/physics.md#sets-of-bearings.
    """
    return Arrangement(bearing=bearing, position=(-distance / 2, distance / 2), direction=(1, -1), preload=preload)


def face_to_face(bearing: Bearing, distance: float, preload: float) -> Arrangement:
    """Return a pair ``distance`` [m] apart whose contact lines meet at the shaft (DF, X): soft in tilt.

    See docs/physics.md#sets-of-bearings.
    """
    return Arrangement(bearing=bearing, position=(-distance / 2, distance / 2), direction=(-1, 1), preload=preload)


def tandem(bearing: Bearing, distance: float, count: int = 2) -> Arrangement:
    """Return bearings ``distance`` [m] apart that share an axial force in +z (DT).

    See docs/physics.md#sets-of-bearings.
    """
    place = (np.arange(count) - (count - 1) / 2) * distance
    return Arrangement(bearing=bearing, position=tuple(place.tolist()), direction=(1,) * count, preload=0.0)


@dataclass(frozen=True, kw_only=True)
class LoadedArrangement:
    """Shaft and bearings under load: as LoadedBearing, for the shaft at z = 0, and every bearing of the set."""

    displacement: Array
    load: Array
    stiffness: Array
    bearings: tuple[LoadedBearing, ...]


def displaced_arrangement(
    arrangement: Arrangement, displacement: ArrayLike, spindle_speed: float = 0.0
) -> LoadedArrangement:
    """Return the set with its shaft held at (d_a, d_r, theta) [m, m, rad] at z = 0.

    Raises as ``displaced_bearing`` does.

    See docs/physics.md#sets-of-bearings.
    """
    return _Shaft(arrangement, spindle_speed).at(three_finite("displacement", displacement))


def loaded_arrangement(arrangement: Arrangement, load: ArrayLike, spindle_speed: float = 0.0) -> LoadedArrangement:
    """Return the set under (F_a, F_r, M) [N, N, N m] on its shaft at z = 0, at a speed [rad/s].

    Raises InvalidInput for numbers that are not finite, and NoEquilibrium where the set does not carry
    the load.

    See docs/physics.md#sets-of-bearings.
    """
    wanted = three_finite("load", load)
    total = wanted + np.array([arrangement.preload, 0.0, 0.0])
    give, size = load_scale(arrangement.bearing, total)
    shaft = _Shaft(arrangement, spindle_speed)

    def mismatch(unknowns: Array) -> tuple[Array, Array]:
        state = shaft.at(unknowns * give)
        return (state.load - wanted) / size, state.stiffness * give / size[:, None]

    # A preloaded set carries small loads where it stands; bearings without preload must first be touched.
    start = np.zeros(3) if arrangement.preload > 0.0 else 3.0 * wanted / size
    found = root(mismatch, start, jac=True, method="lm", options={"xtol": 1e-14, "maxiter": 200})
    reached = shaft.at(found.x * give)
    if np.all(np.abs(reached.load - wanted) <= LOAD_TOLERANCE * size):
        return reached
    raise NoEquilibrium(
        f"the set of bearings does not carry {wanted[0]:g} N axially, {wanted[1]:g} N radially and {wanted[2]:g} N m"
    )


class _Shaft:
    """The shaft at a speed: what every place of it does to the bearings of a set."""

    def __init__(self, arrangement: Arrangement, spindle_speed: float) -> None:
        self.rings = [Ring(arrangement.bearing, spindle_speed) for _ in arrangement.position]
        self.local = [
            np.array([[way, 0.0, 0.0], [0.0, 1.0, -place], [0.0, 0.0, way]])
            for place, way in zip(arrangement.position, arrangement.direction, strict=True)
        ]
        self.drawn = preload_displacement(arrangement)

    def at(self, displacement: Array) -> LoadedArrangement:
        """Return the state with the shaft at (d_a, d_r, theta)."""
        states = tuple(
            ring.at(local @ displacement + [drawn, 0.0, 0.0])
            for ring, local, drawn in zip(self.rings, self.local, self.drawn, strict=True)
        )
        pairs = list(zip(self.local, states, strict=True))
        return LoadedArrangement(
            displacement=displacement,
            load=np.sum([local.T @ state.load for local, state in pairs], axis=0),
            stiffness=np.sum([local.T @ state.stiffness @ local for local, state in pairs], axis=0),
            bearings=states,
        )


def preload_displacement(arrangement: Arrangement) -> Array:
    """Return how far each inner ring is drawn in by the preload at standstill (bearing,) [m].

    See docs/physics.md#sets-of-bearings.
    """
    if arrangement.preload == 0.0:
        return np.zeros(len(arrangement.position))
    drawn = {
        way: axisymmetric_state(
            arrangement.bearing, arrangement.preload / arrangement.direction.count(way), np.zeros(1), "constant"
        ).axial_displacement[0]
        for way in (1, -1)
    }
    return np.array([drawn[way] for way in arrangement.direction])


def lift_off_force(arrangement: Arrangement) -> float:
    """Return the axial force in +z [N] that unloads the bearings facing -z, at standstill.

    Over the displacement at which it does so it is the axial rigidity that catalogues print. Zero for
    a set without preload. Raises InvalidInput when no bearing faces -z.

    See docs/physics.md#sets-of-bearings.
    """
    facing = [i for i, way in enumerate(arrangement.direction) if way == -1]
    if not facing:
        raise InvalidInput(["arrangement: no bearing faces -z, none can lift off"])
    drawn = preload_displacement(arrangement)[facing[0]]
    return float(displaced_arrangement(arrangement, [drawn, 0.0, 0.0]).load[0])
