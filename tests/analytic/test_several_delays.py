"""Several delays in one equation: teeth one by one over a revolution.

With equal pitches a revolution of Z teeth is Z tooth periods, so its multiplier is the tooth period's to
the power Z: exact, and known from the equation with one delay. With unequal pitches a second method,
semi-discretization of order one, converges to the same multiplier.
"""

import math

import numpy as np
import pytest

from chatter_core.cutting import CuttingGain, ForceCoefficients, engagement
from chatter_core.errors import UnsupportedEquation
from chatter_core.floquet import DelayedFeedback, DelayEquation, LinearSystem, MethodSettings, critical_motion
from chatter_core.machine import Process, Tool
from chatter_core.teeth import equal_teeth, passages
from chatter_core.tip import TipModes, state_space
from tests.conftest import milling_benchmark

EXACT = MethodSettings(name="collocation", tolerance=1e-8)
TURN = 2.0 * math.pi


def tooth_by_tooth(
    *, pitches: list[float], rpm: float, depth_mm: float, immersion: float, helix_deg: float, direction: str = "down"
) -> DelayEquation:
    """The benchmark's two modes cut by teeth with these pitches [turn] before them, period a revolution."""
    modes = TipModes(
        axis=np.array([0, 1]),
        label=np.ones(2, dtype=int),
        natural_frequency=922.0 * TURN * np.ones((1, 2)),
        damping_ratio=0.011 * np.ones((1, 2)),
        modal_mass=0.03993 * np.ones((1, 2)),
        tracking_confidence=np.ones((1, 2)),
    )
    space = state_space(modes)
    speed = np.array([rpm / 60.0 * TURN])
    one_tooth = CuttingGain(
        axial_depth=np.array([depth_mm * 1e-3]),
        spindle_speed=speed,
        tool=Tool.model_validate(
            {"teeth": 1, "diameter_mm": 10.0, "helix_angle_deg": helix_deg, "rake_angle_deg": 0.0}
        ),
        coefficients=ForceCoefficients(tangential=600e6, radial=200e6),
        passages=passages(
            equal_teeth(1),
            engagement(
                Process.model_validate(
                    {"direction": direction, "radial_immersion": immersion, "feed_per_tooth_mm": 0.1}
                )
            ),
            1e-4,
        ),
    )
    revolution = TURN / speed
    feedback, breakpoints = [], []
    for tooth in range(len(pitches)):
        ahead = sum(pitches[: tooth + 1]) * revolution  # the tooth cuts what others cut later

        def gain(time, ahead=ahead):
            return one_tooth(time + ahead.reshape(-1, *(1,) * (time.ndim - 1)))

        feedback.append(DelayedFeedback(gain=gain, delay=pitches[(tooth + 1) % len(pitches)] * revolution))
        breakpoints.append(np.mod(one_tooth.breakpoints() - ahead[:, None], revolution[:, None]))
    return DelayEquation(
        system=LinearSystem(
            state_matrix=space.state_matrix, input_matrix=space.input_matrix, output_matrix=space.output_matrix
        ),
        system_index=np.zeros(1, dtype=int),
        feedback=tuple(feedback),
        period=revolution,
        breakpoints=np.concatenate(breakpoints, axis=1),
    )


def multiplier(problem: DelayEquation, method: MethodSettings = EXACT, refinement: float = 1.0) -> complex:
    found = critical_motion(problem, method, refinement)
    assert found.converged.all()
    return complex(found.multiplier[0])


@pytest.mark.parametrize(
    ("rpm", "depth_mm", "immersion"), [(5000.0, 0.5, 0.5), (9000.0, 1.5, 0.2), (14000.0, 0.8, 1.0)]
)
def test_equal_pitches_are_powers_of_the_tooth_period(rpm, depth_mm, immersion):
    direction = "slot" if immersion == 1.0 else "down"
    alone = milling_benchmark(direction=direction, immersion=immersion, rpm=[rpm], depth_mm=[depth_mm], axes=(0, 1))
    turn = tooth_by_tooth(
        pitches=[0.5, 0.5], rpm=rpm, depth_mm=depth_mm, immersion=immersion, helix_deg=0.0, direction=direction
    )
    # Delayed nodes lie on nodes: no more than the methods' own errors at twice the resolution.
    assert abs(multiplier(turn, refinement=2.0)) == pytest.approx(abs(multiplier(alone, refinement=2.0)) ** 2, rel=1e-7)


@pytest.mark.parametrize("helix_deg", [0.0, 30.0])
@pytest.mark.parametrize("pitches", [[0.45, 0.55], [0.3, 0.3, 0.4]])
def test_unequal_pitches_agree_with_semi_discretization(pitches, helix_deg):
    problem = tooth_by_tooth(pitches=pitches, rpm=6000.0, depth_mm=0.8, immersion=0.5, helix_deg=helix_deg)
    found = multiplier(problem, refinement=2.0)
    coarse, fine = (
        multiplier(problem, MethodSettings(name="semi_discretization", intervals=n, order=1)) for n in (600, 1200)
    )
    # Of second order: a third of what doubling changes is what is left of the error, and as much again is allowed.
    assert abs(found - fine) <= max(abs(fine - coarse) * 2.0 / 3.0, 1e-5)


def test_refinement_converges_to_one_value():
    problem = tooth_by_tooth(
        pitches=[0.27, 0.4, 0.33], rpm=4000.0, depth_mm=1.0, immersion=1.0, helix_deg=20.0, direction="slot"
    )
    values = [multiplier(problem, refinement=r) for r in (1.0, 2.0, 4.0, 8.0)]
    errors = [abs(value - values[-1]) for value in values[:-1]]
    # Delayed outputs are interpolated to sixth order: four times the elements, a fiftieth of the error twice over;
    # pieces take whole numbers of elements, so a single doubling may give less.
    assert errors[2] < errors[0] / 20.0**2 or errors[2] < 1e-8
    assert errors[0] < 1e-3 * abs(values[-1])


def test_a_delay_longer_than_the_period_is_refused():
    problem = tooth_by_tooth(pitches=[0.5, 0.6], rpm=6000.0, depth_mm=0.8, immersion=0.5, helix_deg=0.0)
    longer = DelayEquation(
        system=problem.system,
        system_index=problem.system_index,
        feedback=(DelayedFeedback(gain=problem.feedback[0].gain, delay=1.1 * problem.period), problem.feedback[1]),
        period=problem.period,
        breakpoints=problem.breakpoints,
    )
    with pytest.raises(UnsupportedEquation, match="delays must be positive and at most the period"):
        critical_motion(longer, EXACT)


@pytest.mark.parametrize("delays", [(0.41, 0.5), (0.3, 0.45), (0.35, 0.5), (0.35, 0.5, 0.55), (0.02, 0.9), (1.0, 0.13)])
def test_delays_that_look_back_into_free_flight(delays):
    """One oscillator, gains for a fifth of the period: delayed outputs lie where no gain acts, across other breaks."""
    frequency = 9.0
    system = LinearSystem(
        state_matrix=np.array([[[0.0, 1.0], [-(frequency**2), -0.1 * frequency]]]),
        input_matrix=np.array([[[0.0], [1.0]]]),
        output_matrix=np.array([[[1.0, 0.0]]]),
    )

    def gain(time):
        return np.where(np.mod(time, 1.0) < 0.2, -25.0, 0.0)[..., None, None]

    problem = DelayEquation(
        system=system,
        system_index=np.zeros(1, dtype=int),
        feedback=tuple(DelayedFeedback(gain=gain, delay=np.array([delay])) for delay in delays),
        period=np.array([1.0]),
        breakpoints=np.array([[0.0, 0.2]]),
    )
    coarse, fine = (
        multiplier(problem, MethodSettings(name="semi_discretization", intervals=n, order=1)) for n in (500, 1000)
    )
    # As above; of two multipliers of one modulus either may be told, so moduli are compared.
    limit = max(abs(fine - coarse) * 2.0 / 3.0, 1e-5)
    assert abs(abs(multiplier(problem, refinement=2.0)) - abs(fine)) <= limit
