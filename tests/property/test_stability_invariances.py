"""What must hold for every cut: symmetries, similarities and limits of the milling equation.

None of it needs a published number: each follows from the equation of motion.
"""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter_core.cutting import CuttingGain, ForceCoefficients, engagement
from chatter_core.floquet import DelayedFeedback, DelayEquation, LinearSystem, MethodSettings, analyse
from chatter_core.machine import Process, Tool
from chatter_core.teeth import Engagement, equal_teeth, passages
from chatter_core.tip import TipModes, state_space
from tests.conftest import milling_benchmark

EXAMPLES = settings(max_examples=12, deadline=None, derandomize=True)
#: Collocation at twice its default resolution errs by less than this near and below the boundary.
CONVERGED = 1e-6
#: Equations that are the same but for a change of names are to agree to rounding: eigenvalues well settled.
STRICT = MethodSettings(name="collocation", tolerance=1e-8)

CUTS = st.fixed_dictionaries(
    {
        "teeth": st.integers(1, 6),
        "helix_deg": st.floats(0.0, 50.0),
        "immersion": st.floats(0.05, 0.95),
        "depth_mm": st.floats(0.5, 6.0),
        "rpm": st.floats(4000.0, 20000.0),
    }
)
MODES = st.lists(
    st.tuples(st.floats(300.0, 2000.0), st.floats(0.01, 0.04), st.floats(3.0, 20.0)), min_size=1, max_size=3
)


def tip_modes(x, y) -> TipModes:
    """Return modes (frequency in Hz, damping ratio, stiffness in N/um) of both axes."""
    rows = [(0, *mode) for mode in x] + [(1, *mode) for mode in y]
    axis, hertz, damping, stiffness = (np.array(column) for column in zip(*rows, strict=True))
    natural = 2.0 * math.pi * hertz[None, :]
    return TipModes(
        axis=axis,
        label=np.array([*range(1, len(x) + 1), *range(1, len(y) + 1)]),
        natural_frequency=natural,
        damping_ratio=damping[None, :],
        modal_mass=stiffness[None, :] * 1e6 / natural**2,
        tracking_confidence=np.ones_like(natural),
    )


def equation(modes, cut, direction, *, speed=1.0, force=1.0, depth=1.0) -> DelayEquation:
    """Return the milling equation of a cut; speed, force coefficients and depth are multiplied."""
    gain = CuttingGain(
        axial_depth=np.array([cut["depth_mm"] * 1e-3 * depth]),
        spindle_speed=np.array([cut["rpm"] * 2.0 * math.pi / 60.0 * speed]),
        tool=Tool(teeth=cut["teeth"], diameter_mm=12.0, helix_angle_deg=cut["helix_deg"], rake_angle_deg=5.0),
        coefficients=ForceCoefficients(tangential=800e6 * force, radial=250e6 * force),
        passages=passages(
            equal_teeth(cut["teeth"]),
            engagement(Process(direction=direction, radial_immersion=cut["immersion"], feed_per_tooth_mm=0.05)),
            5e-5,
        ),
    )
    space = state_space(modes)
    return DelayEquation(
        system=LinearSystem(
            state_matrix=space.state_matrix, input_matrix=space.input_matrix, output_matrix=space.output_matrix
        ),
        system_index=np.zeros(1, dtype=int),
        feedback=(DelayedFeedback(gain=gain, delay=gain.tooth_period),),
        period=gain.tooth_period,
        breakpoints=gain.breakpoints(),
    )


def radius(problem: DelayEquation, method: MethodSettings = STRICT) -> float:
    return float(np.abs(analyse(problem, method, 2.0).multiplier[0]))


@EXAMPLES
@given(cut=CUTS, modes=MODES)
def test_equal_modes_in_x_and_y_know_no_difference_between_up_and_down_milling(cut, modes):
    """The two cuts are one, seen from directions turned about the spindle's axis."""
    both = tip_modes(modes, modes)
    up, down = (radius(equation(both, cut, direction)) for direction in ("up", "down"))
    assert up == pytest.approx(down, rel=CONVERGED)


@EXAMPLES
@given(cut=CUTS, x=MODES, y=MODES)
def test_without_cutting_the_structure_decays_alone(cut, x, y):
    modes = tip_modes(x, y)
    problem = equation(modes, cut, "up", force=1e-9)
    slowest = np.min(modes.damping_ratio * modes.natural_frequency)
    # A billionth of the force moves the multipliers by about as much.
    assert radius(problem) == pytest.approx(math.exp(-slowest * float(problem.period[0])), rel=1e-6)


@EXAMPLES
@given(cut=CUTS, x=MODES, y=MODES)
def test_a_vanishing_helix_is_the_straight_edge(cut, x, y):
    modes = tip_modes(x, y)
    straight, tiny = (radius(equation(modes, {**cut, "helix_deg": angle}, "down")) for angle in (0.0, 1e-6))
    assert tiny == pytest.approx(straight, rel=CONVERGED)


@EXAMPLES
@given(cut=CUTS, x=MODES, y=MODES, factor=st.floats(0.3, 3.0))
def test_force_and_stiffness_may_grow_together(cut, x, y, factor):
    stiffer = [[(hertz, damping, stiffness * factor) for hertz, damping, stiffness in axis] for axis in (x, y)]
    base, scaled = (
        radius(equation(tip_modes(x, y), cut, "up")),
        radius(equation(tip_modes(*stiffer), cut, "up", force=factor)),
    )
    assert scaled == pytest.approx(base, rel=1e-9)  # the same numbers but for rounding


@EXAMPLES
@given(cut=CUTS, x=MODES, y=MODES, factor=st.floats(0.3, 3.0))
def test_time_may_pass_faster(cut, x, y, factor):
    """Frequencies and spindle speed times a factor, stiffness kept: the same motion in less time."""
    faster = [[(hertz * factor, damping, stiffness) for hertz, damping, stiffness in axis] for axis in (x, y)]
    base, scaled = (
        radius(equation(tip_modes(x, y), cut, "up")),
        radius(equation(tip_modes(*faster), cut, "up", speed=factor)),
    )
    assert scaled == pytest.approx(base, rel=1e-9)


@EXAMPLES
@given(cut=CUTS, x=MODES, y=MODES, factor=st.floats(0.5, 2.0))
def test_a_straight_edge_knows_the_product_of_depth_and_force_alone(cut, x, y, factor):
    straight, modes = {**cut, "helix_deg": 0.0}, tip_modes(x, y)
    deeper, harder = (
        radius(equation(modes, straight, "up", depth=factor)),
        radius(equation(modes, straight, "up", force=factor)),
    )
    assert deeper == pytest.approx(harder, rel=1e-9)


@EXAMPLES
@given(cut=CUTS, x=MODES, y=MODES)
def test_a_mode_that_nothing_moves_changes_nothing(cut, x, y):
    rigid = (700.0, 0.5, 1e12)  # well damped, so that its own free decay is not the slowest
    base, more = (
        radius(equation(tip_modes(x, y), cut, "down")),
        radius(equation(tip_modes([*x, rigid], y), cut, "down")),
    )
    assert more == pytest.approx(base, rel=CONVERGED)


@settings(max_examples=6, deadline=None, derandomize=True)
@given(cut=CUTS, x=MODES, y=MODES)
def test_two_periods_square_the_multipliers(cut, x, y):
    """Nothing but the name changes when two tooth periods are called one; the delay stays one tooth's."""
    once = equation(tip_modes(x, y), cut, "up")
    start = once.breakpoints
    twice = replace(once, period=2.0 * once.period, breakpoints=np.hstack([start, start + once.period[:, None]]))
    fine, finer = (MethodSettings(name="semi_discretization", intervals=n, order=1) for n in (60, 120))
    # The same intervals in both: the same products of the same matrices.
    assert radius(twice, finer) == pytest.approx(radius(once, fine) ** 2, rel=1e-7)


def test_halving_the_pitch_of_a_full_circle_of_teeth_doubles_a_steady_force():
    """In a full slot an even number of straight teeth, four or more, cut with a constant total force."""
    speed = 2.0 * math.pi * 90.0

    def gain(teeth):
        cut = CuttingGain(
            axial_depth=np.array([1e-3]),
            spindle_speed=np.array([speed]),
            tool=Tool(teeth=teeth, diameter_mm=12.0, helix_angle_deg=0.0, rake_angle_deg=5.0),
            coefficients=ForceCoefficients(tangential=800e6, radial=250e6),
            passages=passages(equal_teeth(teeth), Engagement(entry=0.0, exit=math.pi), 5e-5),
        )
        return cut(np.linspace(0.0, 0.9, 7)[None, :] * cut.tooth_period[:, None])

    four, eight = gain(4), gain(8)
    assert np.ptp(four, axis=1) == pytest.approx(np.zeros((1, 2, 2)), abs=1e-6 * np.abs(four).max())
    assert eight == pytest.approx(2.0 * four, rel=1e-12)


def test_benchmark_with_equal_modes_is_the_same_up_and_down():
    up, down = (
        milling_benchmark(direction=way, immersion=0.5, rpm=[5000.0], depth_mm=[1.0], axes=(0, 1))
        for way in ("up", "down")
    )
    assert radius(up) == pytest.approx(radius(down), rel=CONVERGED)
