"""Who cuts what on the motion that uneven chips force, against Fourier series, brute force and cutting in time."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import lagrange
from scipy.optimize import brentq

from chatter_core import chain, contact, forced_motion
from chatter_core.chain import milling_equation, structure
from chatter_core.contact import SAMPLES, KnownForces, forced_contact, slices_of
from chatter_core.cutting import CuttingGain
from chatter_core.effects import activate, apply_effects
from chatter_core.evidence.prediction import FITTING_METHOD
from chatter_core.floquet import LinearSystem
from chatter_core.forced_motion import Cut, Modes, at, move, steps_of
from chatter_core.machine import Machine
from chatter_core.stability import branches, critical_multipliers, evaluate
from chatter_core.teeth import Engagement, Teeth, passages
from chatter_core.tip import receptance
from chatter_core.variables import STATUS
from tests.conftest import COLLOCATION
from tests.nonlinear.simulation import simulate
from tests.nonlinear.test_time_domain import cutter, energy, modal

RPM = math.pi / 30.0


def model(machine: Machine, runout_um: float, phase_deg: float = 20.0):
    return apply_effects(machine, [activate("tool_runout", {"runout_um": runout_um, "phase_deg": phase_deg})])


def modes_of(system: LinearSystem, number: int) -> Modes:
    half = system.half_spectrum
    return Modes(half.poles[number], half.seen[number], half.driven[number])


def test_a_force_that_repeats_moves_the_tip_as_its_fourier_series_says(reference_machine: Machine):
    """A triangle of force over two samples has the coefficients sinc^2, sharpened it has more of what it lacks.

    40 000 of them leave 1e-9 of the largest.
    """
    speed, samples = np.array([3000.0, 20000.0]) * RPM, 96
    built = structure(reference_machine, speed, mode_count=3)
    system = milling_equation(reference_machine, built, np.arange(2), np.full(2, 1e-3)).system
    period = 2.0 * math.pi / speed
    force, motion, harmonic = np.zeros((2, samples)), np.empty((2, samples)), np.arange(0, 40001)
    turned = harmonic / samples
    sharpened = 1.0 + (1.0 - np.cos(2.0 * math.pi * turned)) / 6.0
    weights = np.sinc(turned) ** 2 * sharpened / samples * np.where(harmonic > 0, 2.0, 1.0)
    for number in range(2):
        answers = receptance(built.cut_modes.at(np.array([number])), harmonic * speed[number])[0]
        steps = steps_of(modes_of(system, number), period[number], samples)
        for axis in range(2):
            force[:] = 0.0
            force[axis, 3] = 1.0
            move(steps, force, motion)
            for lag in (0, 1, 2, 50, samples - 1):
                turn = np.exp(2j * math.pi * turned * lag)
                expected = np.einsum("n,no->o", weights * turn, answers[..., axis]).real
                found = motion[:, (3 + lag) % samples]
                assert found == pytest.approx(expected, abs=1e-9 * np.abs(motion).max())


def test_waves_of_force_move_the_tip_as_they_would_without_samples(reference_machine: Machine):
    """Of six samples to a wave straight lines alone would take an eleventh off the force, sharpened a hundredth."""
    speed, samples = np.array([9000.0]) * RPM, 96
    built = structure(reference_machine, speed, mode_count=3)
    system = milling_equation(reference_machine, built, np.array([0]), np.array([1e-3])).system
    steps, motion = steps_of(modes_of(system, 0), 2.0 * math.pi / speed[0], samples), np.empty((2, samples))
    angle = 2.0 * math.pi * np.arange(samples) / samples
    for waves, off in ((4, 1e-4), (8, 1e-3), (16, 1.2e-2)):
        answer = receptance(built.cut_modes.at(np.array([0])), np.array([waves * speed[0]]))[0, 0, 0, 0]
        move(steps, np.stack([np.cos(waves * angle), np.zeros(samples)]), motion)
        assert motion[0] == pytest.approx((answer * np.exp(1j * waves * angle)).real, abs=off * abs(answer))


@pytest.mark.parametrize("turned", [1e-9, 1e-3, 0.499, 0.501, 2.0])
def test_what_a_step_adds_is_told_however_short_it_is(turned: float):
    """Against integrals by Gauss's rule, of steps that are nothing to a mode and of such that turn it around."""
    pole = (-0.05 + 1j) * turned
    nodes, weights = np.polynomial.legendre.leggauss(40)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    acted = np.exp(pole * (1.0 - nodes))
    steps = steps_of(Modes(np.array([pole]), np.ones((2, 1), complex), np.ones((1, 2), complex)), 1.0, 1)
    late, early = np.sum(weights * acted * nodes), np.sum(weights * acted * (1.0 - nodes))
    assert steps.at_once == pytest.approx(np.full((2, 2), late.real), rel=1e-14)
    assert steps.driven[0, :, 0] @ [1.0, 1j] == pytest.approx(early + np.exp(pole) * late, rel=1e-14)


@pytest.mark.parametrize(("count", "slices"), [(2, 1), (3, 1), (3, 2), (5, 2)])
def test_forces_that_repeat_while_who_cuts_what_is_held_are_those_of_the_motion_that_they_force(
    count, slices, reference_machine: Machine
):
    """Edges take turns or cut together, whom they follow is drawn: some chips are negative, and that is held, too."""
    rng, samples, speed = np.random.default_rng(count), 12 * count, np.array([9000.0]) * RPM
    pitch = 1.0 + 0.2 * rng.uniform(-0.5, 0.5, count)
    passed = np.array([np.cumsum(np.roll(pitch * count / pitch.sum(), -tooth)) for tooth in range(count)])
    built = structure(reference_machine, speed, mode_count=3)
    system = milling_equation(reference_machine, built, np.array([0]), np.array([1e-3])).system
    steps = steps_of(modes_of(system, 0), 2.0 * math.pi / speed[0], samples)
    offset = np.sort(rng.uniform(0.0, 2.0 * math.pi, count * slices))
    longer = 1e-5 * rng.standard_normal((count, count))
    cut = Cut(offset, 0.2, 2.8, passed, longer, 8e-5, 2e6, 5e5)
    sampled = forced_motion._sampled(cut, samples)
    who = np.where(sampled.weight > 0.0, rng.integers(-1, count, sampled.weight.shape), -1)
    assert {1, slices} <= set((who >= 0).sum(axis=0))
    force, motion, expected = np.zeros((3, 2, samples))
    for _ in range(2):
        force += forced_motion._corrected(sampled, 0.7, steps, force, motion, who)
        move(steps, force, motion)
    for e, j in np.argwhere(who >= 0):
        tooth, k, s, c = e // slices, who[e, j], sampled.sine[e, j], sampled.cosine[e, j]
        then = at(motion, j - passed[tooth, k] * samples / count)
        moved = s * (motion[0, j] - then[0]) + c * (motion[1, j] - then[1])
        chip = cut.feed * passed[tooth, k] * s + longer[tooth, k] + moved
        both = np.array([-2e6 * c - 5e5 * s, 2e6 * s - 5e5 * c])
        expected[:, j] += 0.7 * sampled.weight[e, j] * chip * both
    # Equations solved to 1e-8, twice, enlarged by their condition.
    assert force == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())


def test_the_motion_repeats_however_far_a_place_is():
    """Between samples it is the cubic through the two before and the two behind."""
    motion = np.random.default_rng(1).standard_normal((2, 8))
    for place in (-0.0, -1e-17, 0.25, 7.5, -0.5, -8.0, 8.0, -77.75, 1e6 + 0.5):
        around = math.floor(place) + np.arange(-1, 3)
        expected = [lagrange(np.arange(-1.0, 3.0), one[around % 8])(place - math.floor(place)) for one in motion]
        assert at(motion, place) == pytest.approx(expected, abs=1e-12)
    assert np.isnan(at(motion, math.nan)).all()


@pytest.mark.parametrize("seed", range(6))
def test_where_nothing_moves_the_radii_decide(seed: int, reference_machine: Machine):
    """A cut so shallow that its force moves nothing, against who cuts what by radii alone; slots, helix or none."""
    rng = np.random.default_rng(seed)
    count, feed = int(rng.integers(2, 6)), 8e-5
    pitch = 1.0 + 0.2 * rng.uniform(-0.5, 0.5, count)
    teeth = Teeth(pitch=pitch * count / pitch.sum(), radius=rng.uniform(0.0, 2.0, count) * feed)
    arc = Engagement(entry=0.2, exit=2.8)
    tool = reference_machine.tool.model_copy(update={"teeth": count, "helix_angle": 0.5 * (seed % 2)})
    built = structure(reference_machine, np.array([9000.0]) * RPM, mode_count=2)
    plain = milling_equation(reference_machine, built, np.array([0]), np.array([1e-9]))
    nominal = passages(teeth, arc, feed)
    (term,) = plain.feedback
    assert isinstance(term.gain, CuttingGain)
    cut = replace(term.gain, tool=tool, passages=nominal)
    met = forced_contact(cut, teeth, arc, feed, plain.system, np.array([0]))
    assert met.found.all()
    found = met.passages
    assert found.repeat == nominal.repeat
    for angle in rng.uniform(arc.entry, arc.exit, 200):
        by_radii = (nominal.entry < angle) & (angle < nominal.exit)
        expected = sorted(zip(nominal.ahead[by_radii], nominal.pitches[by_radii], strict=True))
        for lower in np.unique(found.lower):
            on = (found.entry[0] < angle) & (angle < found.exit[0]) & (found.lower == lower)
            got = sorted(zip(found.ahead[on], found.pitches[on], strict=True))
            assert np.array(got) == pytest.approx(np.array(expected), abs=1e-9)


#: Runout [um], speed [rpm], depth [mm] at which who would cut what if nothing moved says the opposite, or half.
CASES = [(200.0, 8000.0, 2.763), (120.0, 6000.0, 1.908)]


def simulated(machine: Machine, runout_um: float, rpm: float, depth_mm: float, periods: int):
    """Cut in the time domain, from rest; return the states at the end of every tooth period, and the modes."""
    speed = np.array([rpm]) * RPM
    built = structure(machine, speed, mode_count=4)
    place = np.arange(machine.tool.teeth) * 2.0 * math.pi / machine.tool.teeth + math.radians(20.0)
    radius = tuple(0.5e-6 * runout_um * np.cos(place))
    depth = np.array([depth_mm * 1e-3])
    ends = simulate(
        cutter(machine, radius), modes=modal(built), spindle_speed=speed, axial_depth=depth,
        periods=periods, steps=160, slices=6,
    )  # fmt: skip
    return ends, built.modes


def growth(stages, built, depth_mm: float) -> float:
    """Logarithm of the spectral radius per tooth period."""
    depth = np.array([depth_mm * 1e-3])
    return float(np.log(evaluate(stages, built, np.array([0]), depth, COLLOCATION, np.ones(1)).spectral_radius[0]))


def growth_in_time(modes, ends) -> float:
    """What a tooth period changes in the logarithm of how far a cut of four teeth is from repeating."""
    left = 0.5 * np.log(energy(modes, ends[4:] - ends[:-4]))[80:140, 0]
    return float(np.polynomial.polynomial.polyfit(np.arange(len(left)), left, 1)[1])


@pytest.fixture
def unmoved(monkeypatch):
    """Have the tip carry no tooth along, once it is called."""

    def still(cut, *arguments):
        return replace(forced_contact(cut, *arguments), passages=cut.passages)

    return lambda: monkeypatch.setattr(chain, "forced_contact", still)


@pytest.mark.parametrize(("runout_um", "rpm", "depth_mm"), CASES)
def test_growth_is_that_about_the_forced_motion(runout_um, rpm, depth_mm, reference_machine: Machine, unmoved):
    stages = model(reference_machine, runout_um)
    built = structure(stages, np.array([rpm]) * RPM, mode_count=4)
    about_the_motion = growth(stages, built, depth_mm)
    ends, modes = simulated(reference_machine, runout_um, rpm, depth_mm, 180)
    seen = growth_in_time(modes, ends)
    # Steps of the simulation, and samples of the motion, change either by some per cent.
    assert about_the_motion == pytest.approx(seen, rel=0.15)
    unmoved()
    assert abs(growth(stages, built, depth_mm) - seen) > 0.045


#: Speed [rpm] and depth [mm] at which teeth of unlike pitch would chatter, or all but, if nothing moved.
PITCHED = [(6000.0, 2.2), (9000.0, 2.2)]


@pytest.mark.parametrize(("rpm", "depth_mm"), PITCHED)
def test_pitches_alone_force_a_motion_that_counts(rpm, depth_mm, reference_machine: Machine, unmoved):
    """Unlike pitches take unlike chips, and what those move parts teeth from the work where chips are thin."""
    values = {"pattern": "linear", "variation": 0.12}
    stages = apply_effects(reference_machine, [activate("variable_pitch", values)])
    built = structure(stages, np.array([rpm]) * RPM, mode_count=4)
    about_the_motion = growth(stages, built, depth_mm)
    pitch = 1.0 + 0.12 * np.linspace(-0.5, 0.5, 4)
    ends = simulate(
        cutter(reference_machine, pitch=pitch), modes=modal(built), spindle_speed=np.array([rpm]) * RPM,
        axial_depth=np.array([depth_mm * 1e-3]), periods=180, steps=200, slices=6,
    )  # fmt: skip
    seen = growth_in_time(built.modes, ends)
    assert seen < -0.05
    # Two parts of an edge, samples of the motion and steps of the simulation: see docs/physics.md#forced-motion.
    assert about_the_motion == pytest.approx(seen, abs=0.03)
    unmoved()
    assert growth(stages, built, depth_mm) - seen > 0.08


@pytest.fixture
def finishing(reference_machine: Machine) -> Machine:
    """A long edge of much helix in a thin cut: it lags over its depth by several times the arc in the work."""
    update = {"diameter": 0.016, "helix_angle": math.radians(40.0)}
    process = reference_machine.process.model_copy(update={"radial_immersion": 0.05, "feed_per_tooth": 5e-5})
    tool = reference_machine.tool.model_copy(update=update)
    return reference_machine.model_copy(update={"tool": tool, "process": process})


#: Cuts of it with a runout of 40 um, speed [rpm] and depth [mm], that two slices told as the opposite of what they are.
LONG_EDGES = [(9000.0, 24.0), (13000.0, 16.0)]


def test_long_edges_in_thin_cuts_are_parted_into_enough_slices(finishing: Machine):
    stages, place = model(finishing, 40.0), np.arange(4) * 0.5 * math.pi + math.radians(20.0)
    speed, depth = np.array(LONG_EDGES).T * np.array([[RPM], [1e-3]])
    built, point = structure(stages, speed, mode_count=4), np.arange(2)
    told = np.log(evaluate(stages, built, point, depth, COLLOCATION, np.ones(2)).spectral_radius)
    ends = simulate(
        cutter(finishing, tuple(20e-6 * np.cos(place))), modes=modal(built), spindle_speed=speed, axial_depth=depth,
        periods=200, steps=200, slices=24,
    )  # fmt: skip
    left = 0.5 * np.log(energy(built.modes, ends[4:] - ends[:-4]))
    # One dies out as it is told to; the other goes on for good, as large as teeth that miss let it be.
    assert told[0] == pytest.approx(growth_in_time(built.modes, ends[:, :1]), abs=0.02)
    assert told[0] < 0.0 < told[1]
    assert left[180, 1] == pytest.approx(left[100, 1], abs=0.1)


def test_what_is_found_for_a_cut_hangs_on_no_other(finishing: Machine):
    """Of cuts with unlike numbers of slices each has what it has alone."""
    stages, depth = model(finishing, 40.0), np.array([2e-3, 5e-3, 12e-3, 24e-3])
    built, first = structure(stages, np.array([9000.0]) * RPM, mode_count=4), np.zeros(4, dtype=np.intp)
    slices = slices_of(2.0 * depth * math.tan(math.radians(40.0)) / 0.016, stages.engagement(finishing.process))
    assert list(slices) == [2, 4, 8, 16]
    together = evaluate(stages, built, first, depth, COLLOCATION, np.ones(4)).spectral_radius
    alone = [
        evaluate(stages, built, first[:1], depth[[i]], COLLOCATION, np.ones(1)).spectral_radius[0] for i in range(4)
    ]
    # Rounding of sums in another order.
    assert together == pytest.approx(np.array(alone), rel=1e-9)


def met_by(machine: Machine, runout_um: float, speed, depth, known: KnownForces | None = None):
    """Return the contact of cuts (point,) of a machine with runout; known: forces of one that hardly differs."""
    stages, point, process = model(machine, runout_um), np.arange(len(speed)), machine.process
    built = structure(stages, speed, mode_count=4)
    equation = milling_equation(stages, built, point, depth)
    (gain, *_) = (term.gain for term in equation.feedback)
    assert isinstance(gain, CuttingGain)
    teeth, engagement = stages.teeth(machine.tool), stages.engagement(process)
    return forced_contact(gain, teeth, engagement, process.feed_per_tooth, equation.system, point, known)


#: What misses a motion, how often Newton's method is tried at the full depth before something else is, and how near
#: what is found then comes. Newton's method ends at 1e-9 of the largest force; a start from rest where a revolution
#: changes a motion by 1e-4, half of what is left dies within one, and forces are straight lines that nothing sharpens.
MISSED = {"Newton once": (2, 1e-7), "Newton": (2, 5e-4), "rest": (1, 1e-7), "Newton and rest": (1, 1e-7)}


@pytest.mark.parametrize("missed", MISSED)
def test_a_motion_that_one_way_misses_another_finds(missed: str, reference_machine: Machine, monkeypatch):
    """Of a stable cut there is one motion, whichever way leads to it."""
    speed, depth = np.array([9000.0]) * RPM, np.array([3e-4])
    usual = met_by(reference_machine, 20.0, speed, depth)
    real_followed, real_rest, directly = forced_motion._followed, forced_motion._from_rest, forced_motion.DIRECTLY
    asked = []

    def followed(sampled, steps, force, way):
        asked.append(way)
        misses = way == directly and "Newton" in missed and not (missed == "Newton once" and asked.count(directly) == 2)
        return not misses and real_followed(sampled, steps, force, way)

    def from_rest(sampled, steps):
        """A start from rest stands still, and says that it moves."""
        force, change = real_rest(sampled, steps)
        return (np.zeros_like(force), 1.0) if "rest" in missed else (force, change)

    def found(cut, modes, revolution, samples):
        asked.clear()
        force, arrived = forced_motion.repeating_force.py_func(cut, modes, revolution, samples)
        ways.append(asked.count(directly))
        return force, arrived

    ways: list[int] = []
    monkeypatch.setattr(forced_motion, "_followed", followed)
    monkeypatch.setattr(forced_motion, "_from_rest", from_rest)
    monkeypatch.setattr(contact, "repeating_force", found)
    monkeypatch.setattr(contact, "_meet", contact._meet.py_func)
    other = met_by(reference_machine, 20.0, speed, depth)
    assert usual.found.all()
    assert other.found.all()
    tries, near = MISSED[missed]
    assert other.motion == pytest.approx(usual.motion, abs=near * np.abs(usual.motion).max())
    assert set(ways) == {tries}


@pytest.mark.parametrize("leads_on", [True, False])
def test_forces_of_a_machine_that_hardly_differs_lead_to_the_same_motion(
    leads_on: bool, reference_machine: Machine, monkeypatch
):
    """Nothing is followed from none then; where they lead nowhere everything is, as without them."""
    speed, depth = np.array([8000.0, 9000.0]) * RPM, np.array([2.8e-3, 3e-4])
    fresh, near = (met_by(reference_machine, runout_um, speed, depth) for runout_um in (200.0, 200.4))
    force = near.force.copy()
    if not leads_on:
        force[:, :, 5] = np.inf
    known, real, asked = KnownForces(spindle_speed=speed, axial_depth=depth, force=force), contact.repeating_force, []

    def followed_from_none(cut, modes, revolution, samples):
        asked.append(cut)
        return real(cut, modes, revolution, samples)

    monkeypatch.setattr(forced_motion, "repeating_force", followed_from_none)
    monkeypatch.setattr(contact, "nearby_force", contact.nearby_force.py_func)
    monkeypatch.setattr(contact, "_meet", contact._meet.py_func)
    found = met_by(reference_machine, 200.0, speed, depth, known)
    assert found.found.all()
    assert len(asked) == (0 if leads_on else 2)
    # Forces arrive at 1e-9 of the largest, and a cut near the boundary answers them a hundredfold.
    for name in ("force", "motion"):
        expected = getattr(fresh, name)
        assert getattr(found, name) == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
    assert not np.allclose(near.motion, fresh.motion, rtol=0.0, atol=1e-4 * np.abs(fresh.motion).max())


def test_known_forces_are_those_at_the_same_speed_and_the_nearest_depth():
    force = np.arange(3.0)[:, None, None] * np.ones((3, 2, 4))
    known = KnownForces(
        spindle_speed=np.array([100.0, 100.0, 200.0]), axial_depth=np.array([1.0, 1.04, 2.0]), force=force
    )
    near = known.near(np.array([100.0, 100.0, 100.0, 200.0, 300.0]), np.array([1.01, 1.03, 2.0, 1.95, 1.0]))
    assert near.shape == (5, 2, 4)
    np.testing.assert_array_equal(near[:, 0, 0], [0.0, 1.0, np.nan, 2.0, np.nan])


@pytest.mark.parametrize("depth_mm", [1.5, 1.75, 2.0])
def test_chatter_that_repeats_with_the_revolution_is_not_taken_for_the_forced_motion(
    depth_mm: float, reference_machine: Machine
):
    """From rest these unstable cuts come to a large motion that stays: the tool chatters, locked to the revolution."""
    speed, depth, ones = np.array([10500.0]) * RPM, np.array([depth_mm * 1e-3]), np.ones(1)
    built = structure(reference_machine, speed, mode_count=4)
    alike = evaluate(reference_machine, built, np.array([0]), depth, COLLOCATION, ones)
    hardly = evaluate(model(reference_machine, 1e-2), built, np.array([0]), depth, COLLOCATION, ones)
    assert alike.spectral_radius[0] > 1.3
    # Ten nanometres take out of the cut next to nothing.
    assert hardly.spectral_radius == pytest.approx(alike.spectral_radius, rel=1e-3)


def test_the_forced_motion_is_the_one_that_a_cut_settles_on(reference_machine: Machine):
    runout_um, rpm, depth_mm = CASES[1]
    ends, modes = simulated(reference_machine, runout_um, rpm, depth_mm, 200)
    met = met_by(reference_machine, runout_um, np.array([rpm]) * RPM, np.array([depth_mm * 1e-3]))
    count = reference_machine.tool.teeth
    for period in range(200 - count, 200):
        tip = np.array([ends[period, 0, modes.axis == axis, 0].sum() for axis in range(2)])
        # At the end of a tooth period the first tooth is where another was at its beginning.
        found = met.motion[0, ((period + 1) % count) * SAMPLES]
        # Edges of the simulation enter at whole steps, 160 a tooth period: of first order.
        assert found == pytest.approx(tip, abs=0.02 * np.abs(met.motion).max())


def drawn(count: int):
    """Return speeds [rad/s] and depths [m] of cuts on both sides of the boundary, (cut,) each."""
    rng = np.random.default_rng(1)
    return rng.uniform(3000.0, 14000.0, count) * RPM, rng.uniform(1e-3, 3.5e-3, count)


def test_growth_hardly_hangs_on_the_samples_of_the_motion(reference_machine: Machine, monkeypatch):
    count = 48
    speed, depth = drawn(count)
    stages, point = model(reference_machine, 200.0), np.arange(count)
    built = structure(stages, speed, mode_count=4)

    def growth(samples: int):
        monkeypatch.setattr(contact, "SAMPLES", samples)
        return np.log(np.abs(critical_multipliers(stages, built, point, depth, FITTING_METHOD, np.ones(count))))

    few, many = growth(SAMPLES), growth(4 * SAMPLES)
    near = np.abs(many) < 0.15
    assert near.sum() > 30
    # A hundredth is the growth between depths that differ by less than a hundredth; nine points in ten lie far nearer.
    assert few[near] == pytest.approx(many[near], abs=0.01)
    assert np.quantile(np.abs(few - many)[near], 0.9) < 2e-3


@pytest.fixture
def up_milling(reference_machine: Machine) -> Machine:
    """Chips begin with nothing."""
    process = reference_machine.process.model_copy(update={"direction": "up"})
    return reference_machine.model_copy(update={"process": process})


def test_an_edge_follows_whom_it_meets_just_inside_the_work():
    """Two teeth on a motion that lets the later surface vanish within a fifth of a degree, between two looks.

    Of the surface that the tooth itself left nothing but the feed is left, which is nothing where the work begins:
    there, rounding would say that the edge cuts nothing.
    """
    feed, samples, meets = 1e-4, 2 * SAMPLES, math.radians(0.1)
    angle = 2.0 * math.pi * np.arange(samples) / samples
    motion = np.stack([np.zeros(samples), feed * np.sin(meets - angle)])
    passed, zero = np.array([[1.0, 2.0], [1.0, 2.0]]), np.zeros((2, 2))
    cut = Cut(np.array([0.0, math.pi]), 0.0, math.radians(50.0), passed, zero, feed, 1.0, 1.0)
    begin, end = np.zeros((2, 2, contact.STRETCHES))
    assert contact._follow(cut, motion, 0, begin, end)
    last = brentq(lambda at: math.sin(at) + 2.0 * math.cos(at) * math.sin(meets - at), 0.5 * meets, 4.0 * meets)
    handed = brentq(lambda at: -math.sin(at) + 2.0 * math.cos(at) * math.sin(meets - at), 0.1 * meets, 4.0 * meets)
    # Of the tooth before it the edge follows what it left after it has followed itself. The cubic is off by 4e-7.
    assert [begin[1, 0], end[1, 0]] == pytest.approx([0.0, handed], abs=1e-6)
    assert [begin[0, 0], end[0, 0]] == pytest.approx([handed, last], abs=1e-6)
    assert not end[:, 1:].any()


def test_an_edge_follows_one_tooth_at_a_time(up_milling: Machine):
    """Also where the motion parts whom it follows into many stretches."""
    speed, depth = np.array([6000.0, 5588.0, 9000.0]) * RPM, np.array([2.27e-3, 2.6e-3, 3e-3])
    stages = apply_effects(up_milling, [activate("variable_pitch", {"pattern": "linear", "variation": 0.12})])
    equation = milling_equation(stages, structure(stages, speed, mode_count=4), np.arange(3), depth)
    (gain, *_) = (term.gain for term in equation.feedback)
    together = gain.passages
    edges = {(ahead, lower) for ahead, lower in zip(together.ahead, together.lower, strict=True)}
    most = 0
    for point, (ahead, lower) in itertools.product(range(3), edges):
        own = (together.ahead == ahead) & (together.lower == lower) & (together.exit[point] > together.entry[point])
        order = np.argsort(together.entry[point, own])
        begins, ends = together.entry[point, own][order], together.exit[point, own][order]
        assert (begins[1:] >= ends[:-1] - 1e-6).all()
        most = max(most, len(begins))
    assert most > 4


#: Teeth that are unlike, and the speed of a cut of theirs [rpm].
UNLIKE = [
    ("tool_runout", {"runout_um": 60.0, "phase_deg": 20.0}, 4000.0),
    ("variable_pitch", {"pattern": "linear", "variation": 0.12}, 9000.0),
]


@pytest.mark.parametrize(("effect", "values", "rpm"), UNLIKE)
def test_growth_does_not_leap_between_depths(effect, values, rpm, up_milling: Machine):
    stages = apply_effects(up_milling, [activate(effect, values)])
    built, depth = structure(stages, np.array([rpm]) * RPM, mode_count=4), 2.2e-3 * np.exp(np.linspace(-0.03, 0.03, 61))
    point = np.zeros(len(depth), dtype=np.intp)
    found = np.log(np.abs(critical_multipliers(stages, built, point, depth, FITTING_METHOD, np.ones(len(depth)))))
    # Smooth curves bend by 1e-4 between steps of a thousandth; with 32 samples, joined by lines, they leap by 2e-3.
    assert np.abs(np.diff(found, 2)).max() < 1e-3


def test_cuts_settle_where_they_are_predicted_to(reference_machine: Machine):
    """Cut in the time domain from rest, shallow and deep, where Newton's method alone finds no motion for some."""
    runout_um, count, revolutions, teeth = 200.0, 48, 150, reference_machine.tool.teeth
    speed, depth = drawn(count)
    stages, point = model(reference_machine, runout_um), np.arange(count)
    built = structure(stages, speed, mode_count=4)
    growth = np.log(np.abs(critical_multipliers(stages, built, point, depth, FITTING_METHOD, np.ones(count))))
    # Two parts of an edge, samples of the motion and steps of the simulation move ln|mu| by 0.04 at worst here.
    told = np.abs(growth) > 0.04
    place = np.arange(teeth) * 2.0 * math.pi / teeth + math.radians(20.0)
    ends = simulate(
        cutter(reference_machine, tuple(0.5e-6 * runout_um * np.cos(place))), modes=modal(built), spindle_speed=speed,
        axial_depth=depth, periods=revolutions * teeth, steps=100, slices=4,
    )  # fmt: skip
    left = np.abs(ends[-10 * teeth :] - ends[-11 * teeth : -teeth])[..., 0].max(axis=(0, 2))
    settles = left < 0.02 * np.abs(ends[-10 * teeth :])[..., 0].max(axis=(0, 2))
    assert np.isfinite(growth).all()
    steady = growth < 0.0
    assert told.sum() >= 32
    assert 10 <= steady[told].sum() <= told.sum() - 10
    assert np.array_equal(settles[told], steady[told])


def test_where_no_motion_was_found_there_is_no_result(reference_machine: Machine, monkeypatch):
    stages = model(reference_machine, 60.0)
    built = structure(stages, np.array([9000.0]) * RPM, mode_count=2)
    point, depth = np.zeros(2, dtype=np.intp), np.array([5e-4, 1e-3])

    def half(*arguments):
        return replace(forced_contact(*arguments), found=np.array([True, False]))

    monkeypatch.setattr(chain, "forced_contact", half)
    assert list(evaluate(stages, built, point, depth, FITTING_METHOD, np.ones(2)).status) == [
        STATUS["ok"], STATUS["not_converged"],
    ]  # fmt: skip
    found = critical_multipliers(stages, built, point, depth, FITTING_METHOD, np.ones(2))
    assert list(np.isfinite(found)) == [True, False]
    growth, _ = branches(stages, built, point, depth, FITTING_METHOD, 2)
    assert list(np.isfinite(growth).any(axis=1)) == [True, False]
