"""Shaft as Timoshenko beam elements of three nodes, deflection and slope interpolated apart.

Slope and deflection are parabolas over an element, and two Gauss points for both strains keep it from locking (T. J. R.
Hughes, The Finite Element Method (1987), chapter 5). Cowper's shear coefficient. One plane; freedoms of node j are
2 j (deflection) and 2 j + 1 (slope).
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.hidden_effect.machine import Disc, Section

Array = NDArray[np.float64]

#: Elements are no longer than this share of the section's diameter.
LONGEST_ELEMENT = 0.4
_PLACES, _WEIGHTS = np.polynomial.legendre.leggauss(2)
_MASS_PLACES, _MASS_WEIGHTS = np.polynomial.legendre.leggauss(3)


@dataclass(frozen=True, kw_only=True)
class Shaft:
    """Assembled shaft: matrices (freedom, freedom) [SI]; freedoms of the seats' deflections; the tip is freedom 0.

    gyroscopic: polar inertia on the slopes. joint: freedoms (deflection and slope before, the same behind) of the
    border that was parted for a joint, or None.
    """

    mass: Array
    stiffness: Array
    gyroscopic: Array
    seats: tuple[int, ...]
    joint: tuple[int, int, int, int] | None


def shear_coefficient(poisson: float, bore: float) -> float:
    """Return Cowper's coefficient of a ring with this inner over outer diameter."""
    hollow, m = (1.0 + bore**2) ** 2, bore**2
    return 6.0 * (1.0 + poisson) * hollow / ((7.0 + 6.0 * poisson) * hollow + (20.0 + 12.0 * poisson) * m)


def _shapes(place: float) -> tuple[Array, Array]:
    return (
        np.array([0.5 * place * (place - 1.0), 1.0 - place**2, 0.5 * place * (place + 1.0)]),
        np.array([place - 0.5, -2.0 * place, place + 0.5]),
    )


def element(section: Section, length: float) -> tuple[Array, Array, Array]:
    """Return mass, stiffness and polar inertia (6, 6) of an element of this length [m]."""
    outer, inner, material = section.outer_diameter_m, section.inner_diameter_m, section.material
    area = np.pi / 4.0 * (outer**2 - inner**2)
    second = np.pi / 64.0 * (outer**4 - inner**4)
    shear = material.modulus_pa / (2.0 * (1.0 + material.poisson)) * area
    shear *= shear_coefficient(material.poisson, inner / outer)
    mass, stiffness, polar = np.zeros((3, 6, 6))
    for place, weight in zip(_PLACES, _WEIGHTS, strict=True):
        value, slope = _shapes(place)
        bending, sliding = np.zeros((2, 6))
        bending[1::2] = slope * 2.0 / length
        sliding[0::2], sliding[1::2] = slope * 2.0 / length, -value
        strain = material.modulus_pa * second * np.outer(bending, bending) + shear * np.outer(sliding, sliding)
        stiffness += weight * length / 2.0 * strain
    for place, weight in zip(_MASS_PLACES, _MASS_WEIGHTS, strict=True):
        value, _ = _shapes(place)
        product = material.density_kg_m3 * weight * length / 2.0 * np.outer(value, value)
        mass[0::2, 0::2] += area * product
        mass[1::2, 1::2] += second * product
        polar[1::2, 1::2] += 2.0 * second * product
    return mass, stiffness, polar


def assemble(
    sections: tuple[Section, ...], seats: tuple[float, ...], discs: tuple[Disc, ...] = (), border: int | None = None
) -> Shaft:
    """Assemble the shaft; seats at positions [m]; parted behind section number ``border`` where one is given."""
    ends = np.cumsum([section.length_m for section in sections])
    wanted = np.array([*seats, *(disc.position_m for disc in discs)])
    size = 2 * (1 + 2 * sum(len(_cuts(s, e, wanted)) - 1 for s, e in zip(sections, ends, strict=True)))
    size += 2 * (border is not None)
    mass, stiffness, polar = np.zeros((3, size, size))
    node, nodes, joint = 0, {0.0: 0}, None
    for number, (section, end) in enumerate(zip(sections, ends, strict=True)):
        cuts = _cuts(section, end, wanted)
        for start, stop in itertools.pairwise(cuts):
            span = slice(2 * node, 2 * node + 6)
            for whole, part in zip((mass, stiffness, polar), element(section, stop - start), strict=True):
                whole[span, span] += part
            node += 2
            nodes[round(float(stop), 9)] = node
        if number == border:
            joint = (2 * node, 2 * node + 1, 2 * node + 2, 2 * node + 3)
            node += 1
            nodes[round(float(end), 9)] = node
    for disc in discs:
        _add_disc(mass, polar, 2 * nodes[round(disc.position_m, 9)], disc)
    at = tuple(2 * nodes[round(seat, 9)] for seat in seats)
    return Shaft(mass=mass, stiffness=stiffness, gyroscopic=polar, seats=at, joint=joint)


def _cuts(section: Section, end: float, wanted: Array) -> Array:
    """Return the borders of a section's elements [m]."""
    start = end - section.length_m
    fixed = np.unique(np.round([start, end, *wanted[(wanted > start + 1e-6) & (wanted < end - 1e-6)]], 9))
    longest = LONGEST_ELEMENT * section.outer_diameter_m
    pieces = [np.linspace(a, b, int(np.ceil((b - a) / longest)) + 1)[1:] for a, b in itertools.pairwise(fixed)]
    return np.concatenate([fixed[:1], *pieces])


def _add_disc(mass: Array, polar: Array, freedom: int, disc: Disc) -> None:
    outer, inner = disc.outer_diameter_m**2 / 4.0, disc.inner_diameter_m**2 / 4.0
    weight = disc.density_kg_m3 * np.pi * (outer - inner) * disc.width_m
    mass[freedom, freedom] += weight
    mass[freedom + 1, freedom + 1] += weight * (3.0 * (outer + inner) + disc.width_m**2) / 12.0
    polar[freedom + 1, freedom + 1] += weight * (outer + inner) / 2.0
