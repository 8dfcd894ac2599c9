"""What the shop measures beside its cuts, with the errors of its instruments."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tests.hidden_effect.hidden import thermal_target
from tests.hidden_effect.structure import RECEPTANCE_MODES, Spindle

Generator = np.random.Generator
Row = dict[str, object]

FREQUENCIES_HZ = np.arange(100.0, 4500.1, 5.0)
#: Errors of a receptance: gain, phase [rad], noise of a line over |H| and over the largest |H|.
GAIN, PHASE, LINE_SHARE, FLOOR = 0.03, 0.015, 0.02, 0.01
#: Relative errors of natural frequencies, damping ratios and bearing stiffnesses.
FREQUENCY, DAMPING_RATIO, STIFFNESS = 0.004, 0.15, 0.05


@dataclass(frozen=True, kw_only=True)
class Scheme:
    """Which measurements exist; speeds in rpm, empty where there are none; ``cross``: cross receptances as well."""

    receptance_rpm: tuple[float, ...]
    cross: bool
    modes_rpm: tuple[float, ...]
    bearing_rpm: tuple[float, ...]
    feeds: bool
    immersions: bool


def draw_scheme(rng: Generator, highest_rpm: float, effects: tuple[str, ...]) -> Scheme:
    """Draw which measurements are made; chip laws and immersions are more often looked into where they matter."""
    way = rng.random()
    rotating = [round(highest_rpm * share, -3) for share in (0.3, 0.6, 0.9)]
    if way < 0.4:
        receptance: tuple[float, ...] = (0.0,)
    elif way < 0.62:
        receptance = (0.0, *rotating[1:])
    elif way < 0.77:
        receptance = (0.0, *rotating)
    else:
        receptance = ()
    return Scheme(
        receptance_rpm=receptance,
        cross=len(receptance) > 1 and rng.random() < 0.4,
        modes_rpm=(0.0, *rotating) if rng.random() < 0.15 and "gyroscopic_coupling" not in effects else (),
        bearing_rpm=(0.0, *rotating) if rng.random() < 0.12 else (),
        feeds=rng.random() < (0.7 if "chip_thickness_power_law" in effects else 0.2),
        immersions=rng.random() < (0.5 if "radial_immersion_error" in effects else 0.15),
    )


def receptance(spindle: Spindle, rpm: float) -> NDArray[np.complex128]:
    """Return the tip's receptance (line, output, input) [m/N] at a speed, warm if it runs, without errors."""
    speed = rpm * math.pi / 30.0
    tip = spindle.tip(speed, thermal_target(spindle.hidden, speed), modes=RECEPTANCE_MODES)
    return tip.receptance(2.0 * np.pi * FREQUENCIES_HZ)


def receptance_rows(spindle: Spindle, scheme: Scheme, rng: Generator) -> list[Row]:
    """Measure the receptances."""
    rows: list[Row] = []
    pairs = ((0, 0), (1, 1), (0, 1), (1, 0)) if scheme.cross else ((0, 0), (1, 1))
    for rpm in scheme.receptance_rpm:
        exact = receptance(spindle, rpm)
        floor = FLOOR * np.abs(exact).max()
        for output, input_ in pairs:
            value = exact[:, output, input_]
            value = value * (1.0 + GAIN * rng.standard_normal()) * np.exp(1j * PHASE * rng.standard_normal())
            noise = rng.standard_normal((2, len(value))) * np.hypot(LINE_SHARE * np.abs(value), floor)
            value = (value + noise[0] + 1j * noise[1]) * 1e6
            rows.extend(
                {
                    "spindle_speed_rpm": f"{rpm:g}",
                    "frequency_hz": f"{frequency:.1f}",
                    "output_axis": "xy"[output],
                    "input_axis": "xy"[input_],
                    "real_um_n": f"{line.real:.6g}",
                    "imag_um_n": f"{line.imag:.6g}",
                }
                for frequency, line in zip(FREQUENCIES_HZ, value, strict=True)
            )
    return rows


def mode_rows(spindle: Spindle, scheme: Scheme, rng: Generator) -> list[Row]:
    """Measure the natural frequencies of the first four modes in x; of a turned structure, of those mostly along x."""
    rows: list[Row] = []
    for rpm in scheme.modes_rpm:
        speed = rpm * math.pi / 30.0
        tip = spindle.tip(speed, thermal_target(spindle.hidden, speed))
        along, across = np.abs(tip.output).T
        of_x = tip.eigenvalue[along > (across if spindle.hidden.y_turn_rad else 0.0)]
        for number, value in enumerate(of_x[np.argsort(np.abs(of_x))][:4], start=1):
            frequency = abs(value) / (2.0 * math.pi) * (1.0 + FREQUENCY * rng.standard_normal())
            ratio = -value.real / abs(value) * math.exp(DAMPING_RATIO * rng.standard_normal())
            rows.append(
                {
                    "spindle_speed_rpm": f"{rpm:g}",
                    "mode": number,
                    "natural_frequency_hz": f"{frequency:.1f}",
                    "damping_ratio": f"{ratio:.4f}",
                }
            )
    return rows


def bearing_rows(spindle: Spindle, nominal_preload: float, scheme: Scheme, rng: Generator) -> list[Row]:
    """Measure a single bearing in its spindle, warm if it runs, at the preload that the papers state."""
    rows: list[Row] = []
    for rpm in scheme.bearing_rpm:
        speed = rpm * math.pi / 30.0
        preload = spindle.machine.preload_n * thermal_target(spindle.hidden, speed)
        stiffness = spindle.bearing_stiffness(speed, preload) * math.exp(STIFFNESS * rng.standard_normal())
        rows.append(
            {
                "spindle_speed_rpm": f"{rpm:g}",
                "preload_n": f"{nominal_preload:g}",
                "radial_stiffness_n_um": f"{stiffness / 1e6:.2f}",
            }
        )
    return rows
