"""What a milling machine is to the simulation, in SI, and the same as a campaign's ``machine.yaml`` has it."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Material:
    """Linear elastic, isotropic."""

    modulus_pa: float
    poisson: float
    density_kg_m3: float


STEEL = Material(modulus_pa=206e9, poisson=0.3, density_kg_m3=7800.0)
CARBIDE = Material(modulus_pa=580e9, poisson=0.22, density_kg_m3=14400.0)
NITRIDE = Material(modulus_pa=310e9, poisson=0.27, density_kg_m3=3200.0)


@dataclass(frozen=True, kw_only=True)
class Section:
    """Cylinder, counted from the tool tip."""

    part: str
    length_m: float
    outer_diameter_m: float
    inner_diameter_m: float
    material: Material


@dataclass(frozen=True, kw_only=True)
class Disc:
    """Rigid disc on the shaft."""

    position_m: float
    width_m: float
    outer_diameter_m: float
    inner_diameter_m: float
    density_kg_m3: float


@dataclass(frozen=True, kw_only=True)
class Bearing:
    """Angular contact ball bearing; the outer race holds the balls' gyroscopic moment."""

    pitch_diameter_m: float
    ball_diameter_m: float
    ball_count: int
    contact_angle_deg: float
    inner_conformity: float
    outer_conformity: float
    ball: Material
    ring: Material = STEEL


@dataclass(frozen=True, kw_only=True)
class Seat:
    """Place on the shaft with ``count`` equal bearings."""

    position_m: float
    count: int


@dataclass(frozen=True, kw_only=True)
class Damping:
    """C = mass_1_s M + stiffness_s K, or where ``ratio`` is given one ratio for every mode."""

    mass_1_s: float = 0.0
    stiffness_s: float = 0.0
    ratio: float | None = None


@dataclass(frozen=True, kw_only=True)
class Tool:
    """Cylindrical end mill."""

    teeth: int
    diameter_m: float
    helix_deg: float
    rake_deg: float


@dataclass(frozen=True, kw_only=True)
class Cutting:
    """Specific energy, normal over friction-free tangential force, friction on the rake."""

    kt_pa: float
    kn: float
    friction: float


@dataclass(frozen=True, kw_only=True)
class Process:
    """How the cutter meets the workpiece."""

    direction: str
    radial_immersion: float
    feed_per_tooth_m: float


@dataclass(frozen=True, kw_only=True)
class Machine:
    """A machine and its usual cut."""

    bearing: Bearing
    sections: tuple[Section, ...]
    seats: tuple[Seat, ...]
    discs: tuple[Disc, ...]
    preload_n: float
    damping: Damping
    tool: Tool
    cutting: Cutting
    process: Process


def _material(material: Material) -> dict[str, float]:
    return {
        "youngs_modulus_gpa": _tidy(material.modulus_pa / 1e9),
        "poisson_ratio": material.poisson,
        "density_kg_m3": material.density_kg_m3,
    }


def _tidy(value: float) -> float:
    """Drop the last binary digits, which a change of unit leaves."""
    return float(f"{value:.10g}")


def _mm(value: float) -> float:
    return _tidy(value * 1e3)


def _spindle(machine: Machine) -> dict[str, Any]:
    damping = machine.damping
    spindle: dict[str, Any] = {
        "sections": [
            {
                "part": section.part,
                "length_mm": _mm(section.length_m),
                "outer_diameter_mm": _mm(section.outer_diameter_m),
                "inner_diameter_mm": _mm(section.inner_diameter_m),
                **_material(section.material),
            }
            for section in machine.sections
        ],
        "bearings": [{"position_mm": _mm(seat.position_m), "count": seat.count} for seat in machine.seats],
        "preload_n": _tidy(machine.preload_n),
        "preload_type": "constant",
        "damping": {"kind": "modal", "ratio": _tidy(damping.ratio)}
        if damping.ratio is not None
        else {
            "kind": "proportional",
            "mass_coefficient_1_s": _tidy(damping.mass_1_s),
            "stiffness_coefficient_s": _tidy(damping.stiffness_s),
        },
    }
    if machine.discs:
        spindle["discs"] = [
            {
                "position_mm": _mm(disc.position_m),
                "width_mm": _mm(disc.width_m),
                "outer_diameter_mm": _mm(disc.outer_diameter_m),
                "inner_diameter_mm": _mm(disc.inner_diameter_m),
                "density_kg_m3": disc.density_kg_m3,
            }
            for disc in machine.discs
        ]
    return spindle


def described(machine: Machine) -> dict[str, Any]:
    """Return the machine as ``machine.yaml`` has it: keys and units of the campaign's files."""
    bearing, tool, cutting, process = machine.bearing, machine.tool, machine.cutting, machine.process
    return {
        "bearing": {
            "pitch_diameter_mm": _mm(bearing.pitch_diameter_m),
            "ball_diameter_mm": _mm(bearing.ball_diameter_m),
            "ball_count": bearing.ball_count,
            "contact_angle_deg": bearing.contact_angle_deg,
            "inner_groove_conformity": bearing.inner_conformity,
            "outer_groove_conformity": bearing.outer_conformity,
            "ball": _material(bearing.ball),
            "ring": _material(bearing.ring),
        },
        "spindle": _spindle(machine),
        "tool": {
            "teeth": tool.teeth,
            "diameter_mm": _mm(tool.diameter_m),
            "helix_angle_deg": tool.helix_deg,
            "rake_angle_deg": tool.rake_deg,
        },
        "cutting": {
            "kt_mpa": _tidy(cutting.kt_pa / 1e6),
            "kn": _tidy(cutting.kn),
            "friction_coefficient": cutting.friction,
        },
        "process": {
            "direction": process.direction,
            "radial_immersion": _tidy(process.radial_immersion),
            "feed_per_tooth_mm": _mm(process.feed_per_tooth_m),
        },
    }
