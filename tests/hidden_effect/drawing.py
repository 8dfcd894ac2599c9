"""Machines drawn at random: what a shop's papers say of them, and what they truly are."""

from dataclasses import replace

import numpy as np

from tests.hidden_effect.machine import (
    CARBIDE,
    NITRIDE,
    STEEL,
    Bearing,
    Cutting,
    Damping,
    Machine,
    Process,
    Seat,
    Section,
    Tool,
)

Generator = np.random.Generator

#: Bearing for a shaft of this diameter [mm]: pitch and ball diameter [mm], balls, conformities, highest speed [rpm].
BEARINGS = (
    (35.0, 48.5, 7.938, 16, 0.53, 0.52, 20000.0),
    (40.0, 55.0, 7.938, 20, 0.54, 0.53, 19000.0),
    (45.0, 60.0, 8.731, 19, 0.57, 0.54, 18000.0),
    (50.0, 65.0, 8.731, 20, 0.55, 0.53, 16000.0),
    (55.0, 72.5, 9.525, 20, 0.54, 0.53, 14500.0),
)
#: Workpiece materials: specific energy [MPa], normal share, friction, feed per tooth over tool diameter.
MATERIALS = (
    (750.0, 0.25, 0.15, 0.0065),  # aluminium
    (900.0, 0.30, 0.20, 0.0050),
    (1100.0, 0.30, 0.20, 0.0050),
    (1500.0, 0.35, 0.25, 0.0045),
)
#: Errors of a data sheet: standard deviations of the logarithm, cut off at CUT_OFF of them.
KT, KN, DAMPING, PRELOAD, MODULUS, SECTION_MODULUS = 0.10, 0.15, 0.20, 0.12, 0.03, 0.01
CUT_OFF = 2.2


def draw_machine(rng: Generator) -> tuple[Machine, float]:
    """Draw a machine as its papers have it; return it and its highest speed [rpm]."""
    shaft, pitch, ball, count, inner, outer, highest = BEARINGS[rng.integers(len(BEARINGS))]
    hybrid = rng.random() < 0.4
    bearing = Bearing(
        pitch_diameter_m=pitch * 1e-3,
        ball_diameter_m=ball * 1e-3,
        ball_count=count,
        contact_angle_deg=float(rng.choice([15.0, 15.0, 18.0, 25.0])),
        inner_conformity=inner,
        outer_conformity=outer,
        ball=NITRIDE if hybrid else STEEL,
    )
    tool = Tool(
        teeth=int(rng.choice([2, 3, 4, 4, 5])),
        diameter_m=float(rng.choice([10.0, 12.0, 16.0, 16.0, 20.0])) * 1e-3,
        helix_deg=float(rng.choice([0.0, 30.0, 30.0, 35.0, 45.0])),
        rake_deg=float(rng.choice([6.0, 10.0, 12.0])),
    )
    sections, seats = _shaft(rng, shaft, tool)
    ratio = rng.random() < 0.3
    machine = Machine(
        bearing=bearing,
        sections=sections,
        seats=seats,
        discs=(),
        preload_n=float(10.0 * rng.integers(10, 31)),
        damping=Damping(ratio=float(0.005 * rng.integers(4, 9))) if ratio else Damping(mass_1_s=2e-5, stiffness_s=6e-6),
        tool=tool,
        cutting=Cutting(kt_pa=0.0, kn=0.0, friction=0.0),
        process=Process(direction="slot", radial_immersion=1.0, feed_per_tooth_m=0.0),
    )
    return _with_cut(rng, machine), highest


def _shaft(rng: Generator, shaft_mm: float, tool: Tool) -> tuple[tuple[Section, ...], tuple[Seat, ...]]:
    """Draw tool, holder and shaft with bearings at both ends of it; whole millimetres."""
    overhang = round(float(tool.diameter_m * 1e3 * rng.uniform(3.3, 5.0)))
    holder = int(rng.integers(40, 81))
    between, tail = int(rng.integers(200, 321)), int(rng.integers(40, 91))
    bore = float(rng.choice([0.0, 0.0, 12.0, 16.0]))
    nose = int(rng.choice([0, 15, 25]))
    core = 0.9 * tool.diameter_m  # flutes take their share of an end mill's stiffness

    def section(part: str, length: float, outer: float, inner: float = 0.0, material=STEEL) -> Section:
        return Section(
            part=part,
            length_m=length * 1e-3,
            outer_diameter_m=round(outer, 6),
            inner_diameter_m=inner * 1e-3,
            material=material,
        )

    diameter = (shaft_mm + 5.0) * 1e-3
    sections = (
        section("tool", overhang, core, material=CARBIDE if rng.random() < 0.5 else STEEL),
        section("holder", holder, float(rng.uniform(0.85, 1.0)) * diameter),
        section("shaft", nose + between + tail, diameter, bore),
    )
    first = overhang + holder + nose
    front, rear = ((1, 2), (2, 1), (2, 2))[rng.integers(3)]
    seats = (
        Seat(position_m=first * 1e-3, count=front),
        Seat(position_m=(first + between) * 1e-3, count=rear),
    )
    return sections, seats


def _with_cut(rng: Generator, machine: Machine) -> Machine:
    kt, kn, friction, feed = MATERIALS[rng.integers(len(MATERIALS))]
    direction = str(rng.choice(["down", "down", "up", "up", "slot"]))
    immersion = 1.0 if direction == "slot" else float(0.05 * rng.integers(3, 14))
    return replace(
        machine,
        cutting=Cutting(kt_pa=kt * 1e6, kn=kn, friction=friction),
        process=Process(
            direction=direction,
            radial_immersion=round(immersion, 2),
            feed_per_tooth_m=round(feed * machine.tool.diameter_m, 5),
        ),
    )


def true_machine(rng: Generator, machine: Machine, scale: float = 1.0) -> Machine:
    """Return what the machine truly is; ``scale`` times the errors that papers have."""

    def off(deviation: float) -> float:
        return float(np.exp(scale * deviation * np.clip(rng.standard_normal(), -CUT_OFF, CUT_OFF)))

    whole, damped = off(MODULUS), off(DAMPING)
    damping = machine.damping
    return replace(
        machine,
        sections=tuple(
            replace(
                section,
                material=replace(
                    section.material, modulus_pa=section.material.modulus_pa * whole * off(SECTION_MODULUS)
                ),
            )
            for section in machine.sections
        ),
        preload_n=machine.preload_n * off(PRELOAD),
        damping=Damping(
            mass_1_s=damping.mass_1_s * damped,
            stiffness_s=damping.stiffness_s * damped,
            ratio=None if damping.ratio is None else damping.ratio * damped,
        ),
        cutting=replace(machine.cutting, kt_pa=machine.cutting.kt_pa * off(KT), kn=machine.cutting.kn * off(KN)),
    )
