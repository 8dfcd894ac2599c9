"""Draws of hidden effects by name, from weak (strength 0) to strong (1).

A name is what a diagnosis should answer; what stands in ``FOREIGN`` has no name there, and the answer is that
something is missing.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from tests.hidden_effect.ball_bearing import radial_stiffness
from tests.hidden_effect.hidden import ForeignMode
from tests.hidden_effect.machine import Disc, Machine

Generator = np.random.Generator
Fields = dict[str, Any]

#: Trials that a campaign has, about.
USUAL_TRIALS = 130.0


def between(strength: float, weak: float, strong: float) -> float:
    """Return a value between two on a logarithmic scale."""
    return weak * (strong / weak) ** strength


def tool_compliance(machine: Machine) -> float:
    """Return the compliance of the tool, clamped in its holder, at its tip [m/N]."""
    tool = machine.sections[0]
    second = math.pi / 64.0 * (tool.outer_diameter_m**4 - tool.inner_diameter_m**4)
    return tool.length_m**3 / (3.0 * tool.material.modulus_pa * second)


def lever(machine: Machine, border: int) -> float:
    """Return the distance of a border from the tip [m]."""
    return sum(section.length_m for section in machine.sections[: border + 1])


def seat_compliance(machine: Machine) -> float:
    """Return the compliance of the first seat's bearings at rest [m/N]."""
    return 1.0 / (machine.seats[0].count * radial_stiffness(machine.bearing, 0.0, machine.preload_n))


def _process_damping(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"ploughing_n_m": between(strength, 8e4, 1.5e6), "ploughing_slope": float(rng.uniform(0.03, 0.08))}


def _gyroscopic_coupling(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"gyroscopic": 1.0}


def _thermal_preload(strength: float, rng: Generator, machine: Machine) -> Fields:
    lag = float(rng.choice([0.0, 3.0]))
    return {"thermal_rise": between(strength, 0.2, 3.0), "thermal_saturation": 4.0, "thermal_lag_trials": lag}


def _ring_expansion(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"ring_growth": between(strength, 0.4, 5.0)}


def _joint(strength: float, rng: Generator, machine: Machine) -> Fields:
    border = int(rng.integers(2))
    share = between(strength, 0.03, 0.6) * tool_compliance(machine)
    return {
        "joint_border": border,
        "joint_lateral_m_n": 0.25 * share,
        "joint_rotational_rad_nm": share / lever(machine, border) ** 2,
    }


def _housing(strength: float, rng: Generator, machine: Machine) -> Fields:
    whole = between(strength, 0.08, 2.0) * seat_compliance(machine)
    return {"front_seat_m_n": whole, "rear_seat_m_n": whole * float(rng.uniform(0.2, 0.6))}


def _workpiece(strength: float, rng: Generator, machine: Machine, axis: int) -> ForeignMode:
    """Draw a mode whose resonance is so many times the tool's, taken to have a damping ratio of 0.04."""
    damping, frequency = float(rng.uniform(0.008, 0.025)), float(rng.uniform(280.0, 1100.0))
    peak = between(strength, 0.5, 8.0) * tool_compliance(machine) / (2.0 * 0.04)
    stiffness = 1.0 / (2.0 * damping * peak)
    return ForeignMode(
        axis=axis,
        frequency_hz=frequency,
        damping_ratio=damping,
        mass_kg=stiffness / (2.0 * math.pi * frequency) ** 2,
    )


def _workpiece_mode(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"foreign_modes": (_workpiece(strength, rng, machine, int(rng.integers(2))),)}


def _cutting_speed(strength: float, rng: Generator, machine: Machine) -> Fields:
    # The scale lies within the speeds that the tool is cut at.
    usual = 4000.0 * math.pi * machine.tool.diameter_m
    return {
        "speed_softening": between(strength, 0.2, 0.7),
        "softening_speed_m_min": usual * float(rng.uniform(0.8, 1.6)),
    }


def _chip_thickness(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {
        "size_effect": between(strength, 0.8, 6.0),
        "size_chip_m": machine.process.feed_per_tooth_m * float(rng.uniform(0.2, 0.5)),
    }


def _damping(strength: float, rng: Generator, machine: Machine) -> Fields:
    rise = between(strength, 0.3, 3.0)
    falls = rng.random() < 0.3
    return {
        "damping_rise": -rise / (1.0 + rise) if falls else rise,
        "damping_half_rpm": float(rng.uniform(6000.0, 11000.0)),
    }


def _asymmetry(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"front_seat_y_m_n": between(strength, 0.1, 3.0) * seat_compliance(machine)}


def _unequal_asymmetry(strength: float, rng: Generator, machine: Machine) -> Fields:
    return _asymmetry(strength, rng, machine) | {"rear_seat_y_share": float(rng.uniform(0.0, 1.0))}


def _turned_asymmetry(strength: float, rng: Generator, machine: Machine) -> Fields:
    return _unequal_asymmetry(strength, rng, machine) | {"y_turn_rad": float(rng.uniform(-0.4, 0.4))}


def _runout(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {
        "runout_m": between(strength, 0.25, 1.4) * machine.process.feed_per_tooth_m,
        "runout_phase": float(rng.uniform(0.0, 2.0 * math.pi)),
    }


def _pitch(strength: float, rng: Generator, machine: Machine) -> Fields:
    teeth, largest = machine.tool.teeth, between(strength, 3.0, 13.0)
    alternate = np.where(np.arange(teeth) % 2 == 0, 0.0, largest)
    rising = largest * np.sin(2.0 * np.pi * np.arange(teeth) / teeth)
    errors = alternate if teeth == 2 or rng.random() < 0.5 else rising
    return {"pitch_errors_deg": tuple(float(error) for error in np.round(errors, 2))}


def _immersion(strength: float, rng: Generator, machine: Machine) -> Fields:
    nominal = machine.process.radial_immersion
    size = between(strength, 0.1, 0.5) * nominal
    if rng.random() < 0.5:
        return {"immersion_per_depth_1_m": size / 2e-3}
    return {"immersion_offset": -size if rng.random() < 0.7 else size}


def _drawbar(strength: float, rng: Generator, machine: Machine) -> Fields:
    share = between(strength, 0.02, 0.35) * tool_compliance(machine)
    return {"joint_border": 1, "drawbar_rotational_rad_nm": share / lever(machine, 1) ** 2}


def _tool_wear(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"wear_per_trial": between(strength, 0.4, 2.0) / USUAL_TRIALS}


def _loosening_clamp(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {
        "joint_border": 1,
        "clamp_rad_nm": tool_compliance(machine) / lever(machine, 1) ** 2,
        "clamp_per_trial": between(strength, 0.25, 1.5) / USUAL_TRIALS,
    }


def _warm_up(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"warm_up": between(strength, 0.6, 3.0), "warm_up_trials": float(rng.uniform(25.0, 60.0))}


def _speed_ripple(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"ripple": between(strength, 0.04, 0.2), "ripple_per_revolution": float(rng.choice([0.25, 0.5]))}


def _workpiece_pair(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"foreign_modes": tuple(_workpiece(strength, rng, machine, axis) for axis in (0, 1))}


def _damping_loss(strength: float, rng: Generator, machine: Machine) -> Fields:
    return {"damping_loss": between(strength, 0.3, 0.85), "damping_loss_m": float(rng.uniform(1.5e-6, 5e-6))}


Draw = Callable[[float, Generator, Machine], Fields]

#: Effects that have a name.
NAMED: dict[str, Draw] = {
    "process_damping": _process_damping,
    "gyroscopic_coupling": _gyroscopic_coupling,
    "thermal_preload": _thermal_preload,
    "ring_expansion": _ring_expansion,
    "holder_joint": _joint,
    "housing_compliance": _housing,
    "workpiece_mode": _workpiece_mode,
    "cutting_speed_coefficient": _cutting_speed,
    "chip_thickness_power_law": _chip_thickness,
    "speed_dependent_damping": _damping,
    "directional_asymmetry": _asymmetry,
    "tool_runout": _runout,
    "variable_pitch": _pitch,
    "radial_immersion_error": _immersion,
    "drawbar_stiffness": _drawbar,
}
#: Laws of later tests where the program has meanwhile one like those before, by generation: the first is of the second
#: to the fifth test, the other of those after.
LATER: tuple[dict[str, Draw], ...] = (
    {"directional_asymmetry": _unequal_asymmetry},
    {"directional_asymmetry": _turned_asymmetry},
)
#: Effects that nobody has a name for.
FOREIGN: dict[str, Draw] = {
    "tool_wear": _tool_wear,
    "loosening_clamp": _loosening_clamp,
    "warm_up": _warm_up,
    "speed_ripple": _speed_ripple,
    "workpiece_pair": _workpiece_pair,
    "damping_loss_with_amplitude": _damping_loss,
}


def prepared(machine: Machine, name: str, strength: float) -> Machine:
    """Return the machine on which an effect can show; what is changed stands in the machine's papers.

    Gyroscopic moments need a heavy disc on the holder; a full slot has no radial depth to be wrong about.
    """
    if name == "gyroscopic_coupling":
        tool, holder = machine.sections[:2]
        disc = Disc(
            position_m=round(tool.length_m + holder.length_m / 2.0, 4),
            width_m=0.02,
            outer_diameter_m=round(between(strength, 0.09, 0.15), 3),
            inner_diameter_m=holder.outer_diameter_m,
            density_kg_m3=7800.0,
        )
        return replace(machine, discs=(disc,))
    if name == "radial_immersion_error" and machine.process.direction == "slot":
        return replace(machine, process=replace(machine.process, direction="down", radial_immersion=0.5))
    return machine
