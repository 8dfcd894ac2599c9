"""One trial cut on the true machine: from its condition to its outcome."""

import math
from dataclasses import dataclass

import numpy as np

from tests.hidden_effect.cutting import Cut, simulate
from tests.hidden_effect.hidden import Hidden, force_factor, true_immersion
from tests.hidden_effect.judgement import chatter_frequency, outcome
from tests.hidden_effect.machine import Machine, Tool
from tests.hidden_effect.structure import Spindle, Tip, workpiece

#: A step is this share of the period of the highest mode below HIGHEST_HZ, and of a tooth's period, at most.
STEPS_A_WAVE, STEPS_A_TOOTH = 20, 48
HIGHEST_HZ = 5500.0
#: An edge is cut into slices that lag by this angle at most [rad].
SLICE_LAG = 0.12
#: A cut lasts so long, and at least so many revolutions; the end of it is observed [s], [revolutions].
DURATION, LEAST_REVOLUTIONS = 0.8, 50
OBSERVED, LEAST_OBSERVED = 0.16, 12
#: Change between revolutions, over the feed per tooth, at which a cut has settled: so small that what still grows is
#: seen.
SETTLED = 3e-4


@dataclass(frozen=True, kw_only=True)
class Condition:
    """A planned cut; order: number of cuts before it."""

    order: int
    speed_rpm: float
    depth_m: float
    feed_per_tooth_m: float
    radial_immersion: float
    direction: str


@dataclass(frozen=True, kw_only=True)
class Result:
    """Outcome, and the chatter frequency [Hz], NaN unless the cut chatters."""

    outcome: str
    chatter_frequency_hz: float


def arc(direction: str, radial_immersion: float) -> tuple[float, float]:
    """Return entry and exit angle [rad], clockwise from +y with the feed along +x."""
    if direction == "slot":
        return 0.0, math.pi
    if direction == "up":
        return 0.0, math.acos(1.0 - 2.0 * radial_immersion)
    return math.acos(2.0 * radial_immersion - 1.0), math.pi


def force_coefficients(machine: Machine) -> tuple[float, float]:
    """Return tangential and radial coefficient [Pa] of an oblique edge with friction on its rake."""
    cutting, helix, rake = machine.cutting, math.radians(machine.tool.helix_deg), math.radians(machine.tool.rake_deg)
    tilt = math.tan(helix) * cutting.friction * (math.cos(rake) - cutting.kn * math.sin(rake))
    return cutting.kt_pa * (1.0 + tilt), cutting.kt_pa * cutting.kn / math.cos(helix)


def tooth_steps(hidden: Hidden, teeth: int, steps: int) -> np.ndarray:
    """Return the step at which each tooth stands; pitch errors are those of the teeth's own places."""
    even = np.arange(teeth) * (steps // teeth)
    if not hidden.pitch_errors_deg:
        return even
    return even + np.round(np.array(hidden.pitch_errors_deg) / 360.0 * steps).astype(np.int64)


def steps_of(tool: Tool, speed: float, tip: Tip) -> int:
    """Return the steps of a revolution: fine enough for the highest mode that a cut can wake."""
    waves = tip.eigenvalue.imag / (2.0 * math.pi)
    highest = max(float(waves[waves <= HIGHEST_HZ].max(initial=0.0)), 1500.0)
    a_tooth = 2.0 * math.pi / (speed * tool.teeth)
    return tool.teeth * max(STEPS_A_TOOTH, math.ceil(a_tooth * highest * STEPS_A_WAVE))


def cut_of(machine: Machine, hidden: Hidden, condition: Condition, tip: Tip) -> Cut:
    """Return what is cut under a condition."""
    tool, speed = machine.tool, condition.speed_rpm * math.pi / 30.0
    steps = steps_of(tool, speed, tip)
    immersion = true_immersion(hidden, condition.radial_immersion, condition.depth_m)
    entry, leaving = arc(condition.direction, immersion)
    lag = 2.0 * condition.depth_m * math.tan(math.radians(tool.helix_deg)) / tool.diameter_m
    tangential, radial = force_coefficients(machine)
    factor = force_factor(hidden, machine, speed, condition.order)
    turns = 2.0 * math.pi * np.arange(tool.teeth) / tool.teeth + hidden.runout_phase
    return Cut(
        speed=speed,
        depth=condition.depth_m,
        steps=steps,
        teeth=tooth_steps(hidden, tool.teeth, steps),
        radius=hidden.runout_m * np.cos(turns),
        entry=entry,
        exit=leaving,
        feed_per_revolution=condition.feed_per_tooth_m * tool.teeth,
        tangential=tangential * factor,
        radial=radial * factor,
        lag=lag,
        cutting_speed=speed * tool.diameter_m / 2.0,
        slices=max(1, math.ceil(lag / SLICE_LAG)),
        stock=immersion * tool.diameter_m,
        ploughing=(hidden.ploughing_n_m, hidden.ploughing_slope),
        size_effect=(hidden.size_effect, hidden.size_chip_m, _size_norm(machine, hidden)),
        ripple=(hidden.ripple, hidden.ripple_per_revolution),
        damping_loss=(hidden.damping_loss, hidden.damping_loss_m),
    )


def _size_norm(machine: Machine, hidden: Hidden) -> float:
    """Return the factor that leaves the force at the usual cut's mean chip as described."""
    entry, leaving = arc(machine.process.direction, machine.process.radial_immersion)
    mean = machine.process.feed_per_tooth_m * (math.cos(entry) - math.cos(leaving)) / (leaving - entry)
    return 1.0 / (1.0 + hidden.size_effect * hidden.size_chip_m / (hidden.size_chip_m + mean))


def repeating_steps(cut: Cut, hidden: Hidden, teeth: int) -> int:
    """Return the steps after which an undisturbed cut repeats: those of a tooth, a revolution or a ripple."""
    if hidden.ripple != 0.0:
        return round(cut.steps / hidden.ripple_per_revolution)
    unequal = hidden.runout_m != 0.0 or bool(hidden.pitch_errors_deg)
    return cut.steps if unequal else cut.steps // teeth


def cut_trial(spindle: Spindle, condition: Condition, preload_factor: float = 1.0) -> Result:
    """Cut, observe and judge."""
    machine, hidden = spindle.machine, spindle.hidden
    tip = spindle.tip(condition.speed_rpm * math.pi / 30.0, preload_factor, condition.order)
    fixture = workpiece(hidden)
    if fixture is not None:
        tip = tip.joined(fixture)
    cut = cut_of(machine, hidden, condition, tip)
    a_second = condition.speed_rpm / 60.0
    motion, _ = simulate(
        cut,
        tip,
        revolutions=max(LEAST_REVOLUTIONS, math.ceil(DURATION * a_second)),
        observed=max(LEAST_OBSERVED, math.ceil(OBSERVED * a_second)),
        settled=SETTLED * condition.feed_per_tooth_m,
    )
    period = repeating_steps(cut, hidden, machine.tool.teeth)
    judged = outcome(motion, period, condition.feed_per_tooth_m)
    if judged != "chatter":
        return Result(outcome=judged, chatter_frequency_hz=math.nan)
    return Result(
        outcome=judged, chatter_frequency_hz=chatter_frequency(motion, period, 60.0 / condition.speed_rpm / cut.steps)
    )
