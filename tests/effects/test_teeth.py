"""Teeth that differ: who cuts what against brute force, delays against another method, limits against other cutters.

Literature: Y. Altintas, S. Engin, E. Budak, J. Manuf. Sci. Eng. 121 (1999) 173-178, and E. Budak, J. Manuf. Sci. Eng.
125 (2003) 29-34: with an even number of teeth whose pitch grows by dP from tooth to tooth, the limit is largest
where the waves of successive teeth are half a wave apart, dP = pi Omega/w_c, w_c the chatter frequency.
"""

import math

import numpy as np
import pytest

from chatter_core.chain import milling_equation, structure
from chatter_core.effects import activate, apply_effects
from chatter_core.errors import InvalidInput
from chatter_core.evidence.prediction import FITTING_METHOD
from chatter_core.floquet import MethodSettings, critical_motion
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.stability import critical_multipliers, evaluate
from chatter_core.teeth import Engagement, Teeth, equal_teeth, passages
from tests.synthetic import tip_machine

RPM = math.pi / 30.0
FINEST = MethodSettings(name="collocation", tolerance=1e-8)
SLOT = Engagement(entry=0.0, exit=math.pi)


def model(machine: Machine, name: str, **values):
    return apply_effects(machine, [activate(name, values)])


def tool(machine: Machine, **update) -> Machine:
    return machine.model_copy(update={"tool": machine.tool.model_copy(update=update)})


def radii(stages, rpm, depth_mm, mode_count: int = 2, refinement: float = 2.0):
    """Spectral radius of cuts, per tooth period."""
    built = structure(stages, np.atleast_1d(rpm) * RPM, mode_count=mode_count)
    depth = np.atleast_1d(depth_mm) * 1e-3
    count = np.arange(len(depth))
    return np.abs(critical_multipliers(stages, built, count, depth, FINEST, np.full(len(depth), refinement)))


@pytest.mark.parametrize("seed", range(6))
def test_a_tooth_removes_what_the_lowest_path_before_it_left(seed: int):
    """Brute force at random angles: of every tooth before, for three revolutions, the deepest left the surface."""
    rng = np.random.default_rng(seed)
    count, feed = int(rng.integers(1, 7)), 5e-5
    pitch = 1.0 + 0.3 * rng.uniform(-0.5, 0.5, count)
    teeth = Teeth(pitch=pitch * count / pitch.sum(), radius=rng.uniform(0.0, 2.0, count) * feed)
    arc = Engagement(entry=0.3, exit=2.9)
    found = passages(teeth, arc, feed)
    ahead = 2.0 * math.pi / count * np.concatenate([[0.0], np.cumsum(teeth.pitch)[:-1]])
    for angle in rng.uniform(arc.entry, arc.exit, 200):
        for tooth in range(count):
            before = np.arange(1, 3 * count + 1)
            passed = np.array([np.resize(np.roll(teeth.pitch, -tooth), k).sum() for k in before])
            chip = feed * passed * math.sin(angle) + teeth.radius[tooth] - teeth.radius[(tooth + before) % count]
            inside = (found.entry <= angle) & (angle < found.exit) & (np.abs(found.ahead - ahead[tooth]) < 1e-12)
            assert inside.sum() == (chip.min() > 0.0)
            if chip.min() > 0.0:
                (passage,) = np.flatnonzero(inside)
                assert found.pitches[passage] == pytest.approx(passed[chip.argmin()], rel=1e-12)
                thickness = found.select(np.array([passage])).chip_thickness(np.array([angle]), feed)
                assert thickness == pytest.approx(chip.min(), rel=1e-9)


def test_equal_teeth_cut_all_along_after_the_one_before():
    found = passages(equal_teeth(49), SLOT, 1e-4)
    assert (found.entry, found.exit, found.pitches, found.ahead) == (0.0, math.pi, 1.0, 0.0)
    assert found.repeat == 1


def test_teeth_repeat_where_their_pattern_does():
    alternating = Teeth(pitch=np.resize([0.9, 1.1], 6), radius=np.zeros(6))
    assert alternating.repeat == 2
    assert Teeth(pitch=np.ones(6), radius=np.resize([0.0, 1e-6, 2e-6], 6)).repeat == 3


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("variable_pitch", {"pattern": "linear", "variation": 0.3}),
        ("variable_pitch", {"pattern": "alternating", "variation": 0.2}),
        ("variable_pitch", {"pattern": "sinusoidal", "variation": 0.2, "phase_deg": 30.0}),
        ("tool_runout", {"runout_um": 60.0, "phase_deg": 20.0}),
        ("tool_runout", {"runout_um": 250.0, "phase_deg": 0.0}),
    ],
)
@pytest.mark.parametrize("damped", [False, True])
def test_teeth_that_differ_by_another_method(name: str, values: dict, damped: bool, reference_machine: Machine):
    """Semi-discretization of order one, which rounds no delay, converges to the multiplier of collocation."""
    ploughing = activate("process_damping", {"coefficient_n_m": 1e5})
    stages = apply_effects(reference_machine, [activate(name, values), *([ploughing] if damped else [])])
    built = structure(stages, np.array([9000.0]) * RPM, mode_count=1)
    problem = milling_equation(stages, built, np.array([0]), np.array([1.5e-3]))
    exact = np.abs(critical_motion(problem, FINEST, 2.0).multiplier)
    coarse, fine = (
        np.abs(critical_motion(problem, MethodSettings(name="semi_discretization", order=1, intervals=n)).multiplier)
        for n in (300, 600)
    )
    # Of second order: a third of what doubling changes is what is left, and as much again is allowed.
    assert abs(fine - exact) <= np.maximum(np.abs(fine - coarse) * 2.0 / 3.0, 1e-5)


@pytest.mark.parametrize("phase", [0.0, 35.0])
def test_a_cutter_far_off_its_axis_has_one_tooth(phase: float, reference_machine: Machine):
    """Runout of many feeds: the longest tooth alone cuts, at the feed of all; its multiplier is the Z-th power."""
    process = reference_machine.process.model_copy(update={"feed_per_tooth": 1e-5})
    machine = reference_machine.model_copy(update={"process": process})
    stages = model(machine, "tool_runout", runout_um=500.0, phase_deg=phase)
    assert np.unique(stages.passages.pitches) == 4.0
    rpm, depth = [5000.0, 14000.0], [1.0, 3.0]
    alone = radii(tool(reference_machine, teeth=1), rpm, depth)
    assert radii(stages, rpm, depth) ** 4 == pytest.approx(alone, rel=1e-9)


def test_which_tooth_is_called_the_first_does_not_matter(reference_machine: Machine):
    one, other = (
        radii(model(reference_machine, "tool_runout", runout_um=80.0, phase_deg=phase), 9000.0, 1.5)
        for phase in (15.0, 105.0)
    )
    assert one == pytest.approx(other, rel=1e-7)  # both methods' own error


def test_runout_below_the_feed_alters_chips_and_no_stability(reference_machine: Machine):
    """Where every tooth cuts at every angle of the cut, a linear force knows nothing of the radii."""
    up = reference_machine.process.model_copy(update={"direction": "up", "radial_immersion": 0.4})
    arc = {"process": up}
    machine = reference_machine.model_copy(update=arc)
    stages = model(machine, "tool_runout", runout_um=1e-3, phase_deg=10.0)
    # A nanometre is missed within 1e-5 rad of the entry alone.
    assert radii(stages, 9000.0, 1.0) == pytest.approx(radii(machine, 9000.0, 1.0), rel=1e-5)


def test_runout_lets_teeth_miss_and_needs_more_feed_to_let_them_cut(reference_machine: Machine):
    def cutting(feed_mm: float, runout_um: float) -> int:
        process = reference_machine.process.model_copy(update={"feed_per_tooth": feed_mm * 1e-3})
        stages = model(
            reference_machine.model_copy(update={"process": process}),
            "tool_runout",
            runout_um=runout_um,
            phase_deg=20.0,
        )
        return len(np.unique(stages.passages.ahead))

    assert [cutting(0.08, runout) for runout in (20.0, 150.0, 500.0)] == [4, 3, 1]
    assert cutting(0.8, 150.0) == 4


@pytest.mark.parametrize(("rpm", "direction"), [(3000.0, "down"), (3600.0, "slot"), (3300.0, "slot")])
def test_pitches_half_a_wave_apart_are_the_best(rpm: float, direction: str):
    """Two teeth, five to six waves between: limit depths over the pitches' difference against dP = pi Omega/w_c."""
    machine = tip_machine(direction=direction, radial_immersion=1.0 if direction == "slot" else 0.5)
    speed = np.array([rpm]) * RPM

    def limit(variation: float) -> float:
        stages = model(machine, "variable_pitch", pattern="linear", variation=variation)
        return float(
            lobe_block(
                stages, spindle_speed=speed, axial_depth=np.linspace(5e-4, 2e-2, 20), mode_count=1,
                modal_parameters="dynamic", method=FITTING_METHOD, cells="adaptive",
            ).limit_depth[0, 0]
        )  # fmt: skip

    equal, built = limit(0.0), structure(machine, speed, mode_count=1)
    found = evaluate(machine, built, np.array([0]), np.array([equal]), FITTING_METHOD, np.ones(1))
    best = float(speed[0] / found.chatter_frequency[0])  # of the mean pitch, which is pi
    shares = np.array([0.2, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4, 1.6, 2.0])
    limits = np.array([limit(best * share) for share in shares])
    # The rule takes the chatter frequency of equal pitches, and the mean of the directions: one step to either side.
    assert abs(shares[limits.argmax()] - 1.0) <= 0.2 + 1e-9
    assert limits.max() > 1.4 * equal
    # A whole wave apart the teeth regenerate together again.
    assert limits[-1] == pytest.approx(equal, rel=0.15)


@pytest.mark.parametrize("count", [2, 3, 4, 5])
def test_an_index_off_centre_makes_sinusoidal_pitches(count: int, reference_machine: Machine):
    """Angles of teeth that are displaced by a sine once around, and what pitches are between them."""
    machine, phase, variation = tool(reference_machine, teeth=count), 25.0, 0.3
    found = model(machine, "variable_pitch", pattern="sinusoidal", variation=variation, phase_deg=phase).teeth(
        machine.tool
    )
    around = 2.0 * math.pi / count * np.arange(count + 1)
    apart = math.pi / count
    moved = 0.5 * variation * apart / math.sin(apart) * np.sin(around - apart + math.radians(phase))
    assert found.pitch == pytest.approx(np.diff(around + moved) / (2.0 * apart), rel=1e-12)


@pytest.mark.parametrize("pitch", [(1.1, 0.8, 1.1), (0.9, 1.2, 0.9), (0.8, 1.0, 1.2), (1.07, 0.98, 0.95)])
def test_sinusoidal_pitches_are_any_of_three_teeth(pitch: tuple[float, ...], reference_machine: Machine):
    """By the discrete Fourier transform: of three numbers it has a mean and one harmonic."""
    machine = tool(reference_machine, teeth=3)
    harmonic = np.fft.fft(pitch)[1] / 3.0
    values = {"variation": 4.0 * abs(harmonic), "phase_deg": math.degrees(np.angle(harmonic))}
    stages = model(machine, "variable_pitch", pattern="sinusoidal", **values)
    assert stages.teeth(machine.tool).pitch == pytest.approx(np.array(pitch), rel=1e-12)


def test_teeth_that_cannot_differ_get_one_sentence(reference_machine: Machine):
    single, three = tool(reference_machine, teeth=1), tool(reference_machine, teeth=3)
    with pytest.raises(InvalidInput, match=r"effects.tool_runout: tool.teeth is 1, and runout needs two"):
        model(single, "tool_runout", runout_um=5.0, phase_deg=0.0)
    with pytest.raises(InvalidInput, match=r"effects.variable_pitch: tool.teeth is 1, and pitches need two"):
        model(single, "variable_pitch", pattern="linear", variation=0.1)
    with pytest.raises(InvalidInput, match=r"effects.variable_pitch.pattern: alternating needs an even .* not 3"):
        model(three, "variable_pitch", pattern="alternating", variation=0.1)
