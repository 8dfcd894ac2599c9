"""The predicted boundary against cutting in the time domain, on the reference machine.

Four modes on each axis, helix 30 degrees, four teeth, down-milling: see ``simulation`` for what is
simulated and whose model it is. The tool cuts from rest. What a tooth period changes of the modes'
states tells: it dies out where the cut is stable and settles on the motion that every tooth repeats;
where it chatters it grows until teeth lose contact, and goes on.

At 0.93 of the predicted limit depth the cut has to be stable, at 1.07 it has to chatter. More than
that: while nothing loses contact, the decay per tooth period is the logarithm of the spectral radius.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lsim

from chatter_core.chain import structure
from chatter_core.cutting import engagement, force_coefficients
from chatter_core.effects import activate, apply_effects
from chatter_core.lobes import lobe_block
from chatter_core.stability import evaluate
from tests.conftest import COLLOCATION
from tests.nonlinear.simulation import Cutter, ModalSteps, simulate

#: Successive teeth that differ by more than this [m] have lost contact: an eighth of the feed.
LOST_CONTACT = 10e-6


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Of every case (case,): logarithm of the predicted radius, of the simulated growth, and the end [m]."""

    predicted: NDArray[np.float64]
    growth: NDArray[np.float64]
    amplitude: NDArray[np.float64]


def cutter(machine, radius=(), pitch=()) -> Cutter:
    """Return tool and process of a machine, its teeth longer by ``radius`` [m] and ``pitch`` mean pitches apart."""
    force, arc = force_coefficients(machine.cutting, machine.tool), engagement(machine.process)
    return Cutter(
        teeth=machine.tool.teeth,
        diameter=machine.tool.diameter,
        helix_angle=machine.tool.helix_angle,
        entry=arc.entry,
        exit=arc.exit,
        feed_per_tooth=machine.process.feed_per_tooth,
        tangential=force.tangential,
        radial=force.radial,
        radius=tuple(radius),
        pitch=tuple(pitch),
    )


def modal(built):
    """Return the modes as the simulation takes them."""
    modes = built.modes
    return modes.natural_frequency, modes.damping_ratio, modes.modal_mass, modes.axis


def energy(modes, change):
    """Return the energy (period, case) of modal states (period, case, mode, 2)."""
    squares = change[..., 1] ** 2 + modes.natural_frequency**2 * change[..., 0] ** 2
    return (modes.modal_mass * squares).sum(axis=-1)


def cut(machine, rpm, share, *, periods, steps, slices=8) -> Outcome:
    """Predict the limit depth at every speed and cut at a share of it (speed,)."""
    speed = np.array(rpm) * 2.0 * math.pi / 60.0
    depths = np.linspace(0.2e-3, 6.0e-3, 30)
    distinct, which = np.unique(speed, return_inverse=True)
    limit = lobe_block(
        machine,
        spindle_speed=distinct,
        axial_depth=depths,
        mode_count=4,
        modal_parameters="dynamic",
        method=COLLOCATION,
    ).limit_depth[which, 0]
    built = structure(machine, speed, mode_count=4)
    depth, every = share * limit, np.arange(len(speed))
    stability = evaluate(machine, built, every, depth, COLLOCATION, np.full(len(speed), 1.5))
    ends = simulate(
        cutter(machine),
        modes=modal(built),
        spindle_speed=speed,
        axial_depth=depth,
        periods=periods,
        steps=steps,
        slices=slices,
    )
    change = np.diff(ends, axis=0)
    last = slice(int(0.6 * periods), None)
    logarithm = 0.5 * np.log(energy(built.modes, change))[last]
    growth = np.polynomial.polynomial.polyfit(np.arange(len(logarithm)), logarithm, 1)[1]
    amplitude = np.abs(change[-20:, :, :, 0]).sum(axis=-1).max(axis=0)
    return Outcome(predicted=np.log(stability.spectral_radius), growth=growth, amplitude=amplitude)


#: Slow spindles take many steps to a tooth period and forget in few; fast ones the other way round.
RANGES = {
    "slow": ([4000.0, 6000.0, 8000.0, 10000.0], {"periods": 160, "steps": 250}),
    "fast": ([12000.0, 14500.0, 18000.0, 20000.0, 23000.0], {"periods": 600, "steps": 120}),
}


@pytest.fixture(scope="module", params=RANGES)
def below_and_above(request, reference_machine) -> tuple[Outcome, Outcome]:
    """What becomes of cuts at 0.93 of the predicted limit depths and at 1.07: together they take as long as either."""
    rpm, how = RANGES[request.param]
    found = cut(reference_machine, np.tile(rpm, 2), np.repeat([0.93, 1.07], len(rpm)), **how)
    below, above = (
        Outcome(**{name: array[half] for name, array in vars(found).items()})
        for half in (slice(None, len(rpm)), slice(len(rpm), None))
    )
    return below, above


def test_cuts_are_stable_below_the_predicted_limit(below_and_above):
    found, _ = below_and_above
    assert np.all(found.growth < 0.0)
    assert np.all(found.amplitude < LOST_CONTACT)
    # Steps and slices change the decay: by 7 % with 250 steps at 4000 rpm, 2 % with 500, 1 % with 1000.
    assert found.growth == pytest.approx(found.predicted, rel=0.1, abs=1e-4)


def test_cuts_chatter_above_the_predicted_limit(below_and_above):
    _, found = below_and_above
    assert np.all(found.predicted > 0.0)
    still_growing = found.growth > 0.5 * found.predicted
    assert np.all(still_growing | (found.amplitude > LOST_CONTACT))


@pytest.mark.parametrize("runout_um", [60.0, 500.0])
def test_teeth_that_miss_change_the_decay_as_predicted(runout_um, reference_machine):
    """Teeth of four radii over their own surface, 80 um of feed: some miss at some angles, or all but one at all."""
    speed, depth = np.array([14500.0]) * 2.0 * math.pi / 60.0, np.array([0.5e-3])
    values = {"runout_um": runout_um, "phase_deg": 20.0}
    stages = apply_effects(reference_machine, [activate("tool_runout", values)])
    built = structure(stages, speed, mode_count=4)
    equal, uneven = (
        np.log(evaluate(one, built, np.array([0]), depth, COLLOCATION, np.full(1, 1.5)).spectral_radius)
        for one in (reference_machine, stages)
    )
    place = np.arange(4) * 0.5 * math.pi + math.radians(20.0)
    radius = tuple(0.5e-6 * runout_um * np.cos(place))
    ends = simulate(
        cutter(reference_machine, radius), modes=modal(built), spindle_speed=speed, axial_depth=depth,
        periods=150, steps=120, slices=6,
    )  # fmt: skip
    # What a revolution changes: teeth that differ repeat no motion sooner.
    logarithm = 0.5 * np.log(energy(built.modes, ends[4:] - ends[:-4]))[60:]
    growth = np.polynomial.polynomial.polyfit(np.arange(len(logarithm)), logarithm, 1)[1]
    # Steps and slices change the decay by some per cent, and so does the forced vibration, which moves the misses.
    assert growth == pytest.approx(uneven, rel=0.1)
    assert uneven < 1.4 * equal


def test_the_simulated_modes_answer_a_force_as_another_program_says():
    """scipy.signal.lsim holds forces linear between its samples too: rounding alone is left."""
    frequency, damping, mass, step = 2.0 * math.pi * 500.0, 0.03, 0.4, 1e-4
    modal = ModalSteps(
        np.array([[frequency]]), np.array([[damping]]), np.array([[mass]]), np.array([1]), np.array([step])
    )
    force = np.random.default_rng(4).normal(size=40)
    state, found = np.zeros((1, 1, 2)), [0.0]
    for now, following in itertools.pairwise(force):
        state = modal.advance(state, np.array([[9.9, now]]), np.array([[-3.0, following - now]]))
        found.append(float(modal.tip(state)[0, 1]))
    system = ([1.0 / mass], [1.0, 2.0 * damping * frequency, frequency**2])
    _, expected, _ = lsim(system, force, step * np.arange(40), interp=True)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())
