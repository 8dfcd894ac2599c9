"""Each effect against something that was not made by it: closed forms, direct calls, other methods, other models."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from chatter_core.bearing import axisymmetric_state
from chatter_core.chain import milling_equation, structure, structure_variables
from chatter_core.cutting import ForceCoefficients, engagement
from chatter_core.effects import REFERENCE_SPEED, activate, apply_effects
from chatter_core.floquet import LinearSystem, MethodSettings, critical_motion
from chatter_core.joint import Joint
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.spindle import assemble, direct_receptance, reduce_rotor, whirl_frequencies
from chatter_core.stability import critical_multipliers
from chatter_core.tip import receptance, state_space
from tests.conftest import COLLOCATION, milling_benchmark

RPM = math.pi / 30.0
SPEEDS = np.array([0.0, 5000.0, 12000.0]) * RPM
FINEST = MethodSettings(name="collocation", tolerance=1e-8)


def model(machine: Machine, name: str, **values):
    return apply_effects(machine, [activate(name, values)])


def test_a_thermal_preload_is_the_bearing_at_the_preload_of_each_speed(reference_machine: Machine):
    found = structure(model(reference_machine, "thermal_preload", rise=0.8, exponent=1.7), SPEEDS, mode_count=1).bearing
    for index, speed in enumerate(SPEEDS):
        preload = 100.0 * (1.0 + 0.8 * (speed / REFERENCE_SPEED) ** 1.7)
        alone = axisymmetric_state(reference_machine.bearing, preload, SPEEDS[[index]], "constant")
        # Two paths of Newton's method to one equilibrium: each stops at 1e-12 of the forces.
        assert found.radial_stiffness[index] == pytest.approx(alone.radial_stiffness[0], rel=1e-8)
        assert found.axial_load[index] == pytest.approx(preload, rel=1e-9)


def test_a_rigid_thermal_preload_holds_the_displacement_of_its_force(reference_machine: Machine):
    spindle = reference_machine.spindle.model_copy(update={"preload_type": "rigid"})
    machine = reference_machine.model_copy(update={"spindle": spindle})
    found = structure(model(machine, "thermal_preload", rise=0.8, exponent=1.7), SPEEDS, mode_count=1).bearing
    preload = 100.0 * (1.0 + 0.8 * (SPEEDS[2] / REFERENCE_SPEED) ** 1.7)
    alone = axisymmetric_state(machine.bearing, preload, SPEEDS[[2]], "rigid")
    assert found.axial_load[2] == pytest.approx(alone.axial_load[0], rel=1e-8)


def test_a_grown_ring_is_a_bearing_with_less_clearance(reference_machine: Machine):
    """The inner groove's centre further out by u, at the same axial place, is a bearing of another free angle.

    With the groove distance B D kept, u less diametral clearance 2 u: cos(a) = cos(a0) + u/(B D). Its
    load-deflection factors are taken at that angle, which moves them by 1e-4 or so.
    """
    growth, bearing = 1.5, reference_machine.bearing
    found = structure(model(reference_machine, "ring_expansion", growth_um=growth), SPEEDS, mode_count=1).bearing
    for index, speed in enumerate(SPEEDS):
        grown = growth * 1e-6 * (speed / REFERENCE_SPEED) ** 2
        angle = math.acos(math.cos(bearing.contact_angle) + grown / bearing.groove_distance)
        other = bearing.model_copy(update={"contact_angle": angle})
        alone = axisymmetric_state(other, 100.0, SPEEDS[[index]], "constant")
        assert found.radial_stiffness[index] == pytest.approx(alone.radial_stiffness[0], rel=5e-4)
        assert found.inner_contact_angle[index] == pytest.approx(alone.inner_contact_angle[0], rel=5e-4)


@pytest.mark.parametrize("difference", [0.0, -0.7])
def test_a_housing_that_gives_is_a_spring_in_series(reference_machine: Machine, difference: float):
    """A seat with n bearings of k each behind a housing c: the tip's receptance with the series spring assembled."""
    stages = model(reference_machine, "housing_compliance", compliance_um_n=0.01, rear_difference=difference)
    built = structure(stages, SPEEDS[1:2], mode_count=20)
    single = built.bearing.radial_stiffness[0]
    housing = 0.01e-6 * np.exp([0.0, difference])
    seats = 1.0 / (1.0 / (np.array([1, 2]) * single) + housing)
    spindle, frequency = reference_machine.spindle, np.array([200.0, 600.0, 1500.0, 2400.0]) * 2.0 * math.pi
    expected = direct_receptance(assemble(spindle), spindle.damping, seats, frequency)[:, 0, 0]
    # Twenty modes of several hundred: what is left out is 1e-3 of the static deflection of the tip.
    assert receptance(built.modes, frequency)[0, :, 0, 0] == pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize(("border", "place_mm"), [("tool/holder", 66.0), ("holder/shaft", 104.0)])
def test_a_joint_adds_its_compliance_to_the_tip(reference_machine: Machine, border: str, place_mm: float):
    """Castigliano: under a force at the tip the cut at s carries F and F s, so the tip gives c_l + c_r s^2."""
    lateral, rotational, place = 0.02e-6, 8e-6, place_mm * 1e-3
    joint = Joint(position=place, lateral_compliance=lateral, rotational_compliance=rotational)
    spindle, seats, still = reference_machine.spindle, np.array([1e8, 2e8]), np.zeros(1)
    plain, jointed = (
        direct_receptance(assemble(spindle, joints=joints), spindle.damping, seats, still)[0, 0, 0].real
        for joints in ((), (joint,))
    )
    assert jointed - plain == pytest.approx(lateral + rotational * place**2, rel=1e-6)
    # The effect puts this joint there: all modes together give as much more at rest.
    stages = model(
        reference_machine,
        "holder_joint",
        joint=border,
        lateral_compliance_um_n=lateral * 1e6,
        rotational_compliance_urad_n_m=rotational * 1e6,
    )
    assert stages.joints(spindle) == (joint,)
    softer, before = (structure(one, still, mode_count=20).modes for one in (stages, reference_machine))
    gained = np.sum(1.0 / softer.modal_stiffness[0, :20]) - np.sum(1.0 / before.modal_stiffness[0, :20])
    assert gained == pytest.approx(lateral + rotational * place**2, rel=2e-2)  # a few modes are not kept


@pytest.mark.parametrize("effect", ["holder_joint", "drawbar_stiffness"])
@pytest.mark.parametrize("border", ["tool/holder", "holder/shaft"])
def test_a_joint_that_hardly_gives_moves_hardly_anything(reference_machine: Machine, effect: str, border: str):
    """From closed on frequencies move in proportion to compliance, and nowhere by what rounding makes of it."""
    speeds, closed = (
        np.array([0.0, SPEEDS[-1]]),
        structure(reference_machine, np.array([0.0, SPEEDS[-1]]), mode_count=4),
    )

    def moved(width: float) -> float:
        own = {"lateral_compliance_um_n": 0.01 * width} if effect == "holder_joint" else {}
        stages = model(reference_machine, effect, joint=border, rotational_compliance_urad_n_m=5.0 * width, **own)
        found = structure(stages, speeds, mode_count=4).modes.natural_frequency
        return float(np.abs(found / closed.modes.natural_frequency - 1.0).max())

    per_width = moved(1e-2) / 1e-2
    for width in 10.0 ** np.arange(-9.0, -2.0):
        # Closed it moves nothing; beyond, ten times less than what a receptance's frequency axis errs by (3e-3).
        assert moved(width) <= 1.2 * per_width * width + 2e-5


def test_a_drawbar_is_the_holder_joint_of_each_speed(reference_machine: Machine):
    """At one speed it is a joint of that compliance, which the rotor is reduced with for itself."""
    stages = model(reference_machine, "drawbar_stiffness", joint="holder/shaft", rotational_compliance_urad_n_m=4.0)
    for static in (False, True):
        bearings = "static" if static else "dynamic"
        found = structure(stages, SPEEDS, mode_count=4, modal_parameters=bearings).modes.natural_frequency
        for index, speed in enumerate(SPEEDS):
            compliance = 4.0 * (speed / REFERENCE_SPEED) ** 2
            values = {"lateral_compliance_um_n": 0.0, "rotational_compliance_urad_n_m": compliance}
            alone = model(reference_machine, "holder_joint", joint="holder/shaft", **values)
            expected = structure(alone, SPEEDS[[index]], mode_count=4, modal_parameters=bearings)
            # At rest it counts as a thousandth of its compliance; else two reductions, good to seven digits.
            rel = 1e-7 if compliance else 2e-4
            assert found[index] == pytest.approx(expected.modes.natural_frequency[0], rel=rel)


def test_joints_at_one_border_act_in_series(reference_machine: Machine):
    spindle, seats = reference_machine.spindle, np.array([1e8, 2e8])
    half = Joint(position=0.066, lateral_compliance=1e-8, rotational_compliance=2e-6)
    whole = Joint(position=0.066, lateral_compliance=2e-8, rotational_compliance=4e-6)
    one, two = (
        direct_receptance(assemble(spindle, joints=joints), spindle.damping, seats, np.array([5e3]))
        for joints in ((whole,), (half, half))
    )
    assert two == pytest.approx(one, rel=1e-12)


@pytest.mark.parametrize(("axis", "moved"), [("x", slice(0, 3)), ("y", slice(3, 6))])
def test_softness_along_an_axis_moves_its_modes_alone(reference_machine: Machine, axis: str, moved: slice):
    base = structure(reference_machine, SPEEDS, mode_count=3).modes
    softer = model(reference_machine, "directional_asymmetry", where="modes", axis=axis, stiffness_loss=math.log(1.21))
    found = structure(softer, SPEEDS, mode_count=3).modes
    expected = base.natural_frequency.copy()
    expected[:, moved] /= 1.1
    assert found.natural_frequency == pytest.approx(expected, rel=1e-12)
    assert found.modal_stiffness[:, moved] == pytest.approx(base.modal_stiffness[:, moved] / 1.21, rel=1e-12)
    others = np.delete(np.arange(6), moved)
    assert np.array_equal(found.natural_frequency[:, others], base.natural_frequency[:, others])


@pytest.mark.parametrize(("axis", "difference"), [(0, 0.0), (1, 0.0), (1, -1.2)])
def test_seats_that_give_one_way(reference_machine: Machine, axis: int, difference: float):
    """The softer plane is the rotor on springs in series, solved without modes; the other one is as it was."""
    spindle = reference_machine.spindle
    values = {
        "where": "seats",
        "axis": "xy"[axis],
        "stiffness_loss": 0.7,
        "rear_difference": difference,
        "turn_deg": 0.0,
    }
    stages = model(reference_machine, "directional_asymmetry", **values)
    built = structure(stages, SPEEDS, mode_count=20)
    base = structure(reference_machine, SPEEDS, mode_count=20)
    bearing = base.bearing.radial_stiffness[:, None] * np.array([seat.count for seat in spindle.bearings])
    seats = 1.0 / (1.0 / bearing + (math.exp(0.7) - 1.0) / bearing[0, 0] * np.exp([0.0, difference]))
    assert stages.seat_stiffness(spindle, built.bearing)[axis] == pytest.approx(seats)
    assert seats[0, 0] / bearing[0, 0] == pytest.approx(math.exp(-0.7), rel=1e-12)
    frequency = 2.0 * np.pi * np.linspace(100.0, 2000.0, 40)
    found, before = receptance(built.modes, frequency), receptance(base.modes, frequency)
    for speed in range(len(SPEEDS)):
        expected = direct_receptance(assemble(spindle), spindle.damping, seats[speed], frequency)[:, 0, 0]
        # Twenty modes leave a spring of 2e-3 of the whole.
        assert np.abs(found[speed, :, axis, axis] - expected).max() < 3e-3 * np.abs(expected).max()
    assert np.array_equal(found[:, :, 1 - axis, 1 - axis], before[:, :, 1 - axis, 1 - axis])


@pytest.mark.parametrize("turn", [0.0, 25.0])
def test_unlike_planes_of_a_rotor_that_spins(reference_machine: Machine, turn: float):
    """All four receptances against M q'' + C q' + W (0 G; -G 0) q' + K q = f of both planes, every freedom kept.

    Of seats that give along a direction turned from y towards -x the same springs stand between both planes.
    """
    spindle, speed = reference_machine.spindle, SPEEDS[-1]
    values = {"where": "seats", "axis": "y", "stiffness_loss": 1.0, "rear_difference": 0.5, "turn_deg": turn}
    asymmetry = activate("directional_asymmetry", values)
    stages = apply_effects(reference_machine, [asymmetry, activate("gyroscopic_coupling", {"share": 1.0})])
    built = structure(stages, np.array([0.0, speed]), mode_count=20)
    rotor, frequency = assemble(spindle), 2.0 * np.pi * np.linspace(100.0, 2000.0, 40)
    first, second, freedoms = spindle.damping.mass_coefficient, spindle.damping.stiffness_coefficient, len(rotor.mass)
    mass, stiffness = np.kron(np.eye(2), rotor.mass), np.kron(np.eye(2), rotor.stiffness)
    s, c = math.sin(math.radians(turn)), math.cos(math.radians(turn))
    for seat, along in zip(rotor.seats, stages.seat_stiffness(spindle, built.bearing)[:, -1].T, strict=True):
        both = [seat, freedoms + seat]
        stiffness[np.ix_(both, both)] += np.array([[c, -s], [s, c]]) * along @ np.array([[c, s], [-s, c]])
    # Teeth and rotor turn from +y to +x.
    across = np.kron(np.array([[0.0, 1.0], [-1.0, 0.0]]), -speed * rotor.gyroscopic)
    tip = [0, freedoms]
    forces = np.eye(2 * freedoms)[:, tip]
    found = receptance(built.modes, frequency)[-1]
    for number, line in enumerate(frequency):
        damping = first * mass + second * stiffness + across
        expected = np.linalg.solve(stiffness + 1j * line * damping - line**2 * mass, forces)[tip]
        # Twenty modes leave a spring of 2e-3 of the whole; cross receptances are a hundredth of the direct ones.
        assert found[number] == pytest.approx(expected, abs=3e-3 * np.abs(found).max())
    assert np.abs(found[:, 0, 1]).max() > 9e-3 * np.abs(found).max()


def test_axes_that_are_turned_by_an_eighth_meet(reference_machine: Machine):
    """What gives along x, turned towards y, gives along y, turned towards x: multipliers and receptances are alike."""
    values = {"where": "seats", "stiffness_loss": 0.7, "rear_difference": -0.5}
    found = []
    for axis, turn in (("x", 45.0), ("y", -45.0), ("y", 0.0)):
        stages = model(reference_machine, "directional_asymmetry", axis=axis, turn_deg=turn, **values)
        built = structure(stages, SPEEDS[1:], mode_count=2)
        cut = critical_multipliers(stages, built, np.array([0, 1]), np.full(2, 1e-3), COLLOCATION, np.ones(2))
        found.append((cut, receptance(built.modes, 2.0 * np.pi * np.linspace(100.0, 2000.0, 40))))
    for one, other in zip(*found[:2], strict=True):
        assert one == pytest.approx(other, rel=1e-6, abs=1e-9 * np.abs(other).max())
    assert np.abs(found[0][0] - found[2][0]).max() > 1e-3
    assert found[0][1] == pytest.approx(np.swapaxes(found[0][1], -1, -2), rel=1e-12)
    assert np.abs(found[0][1][..., 0, 1]).max() > 0.01 * np.abs(found[0][1]).max()


@pytest.mark.parametrize("spin", [0.0, 1.0])
def test_the_axes_of_what_is_alike_all_around_are_no_matter(reference_machine: Machine, spin: float):
    """A rotor on seats that are alike is the same from everywhere, and so are its receptances."""
    gyroscopic = activate("gyroscopic_coupling", {"share": spin})
    plain = apply_effects(reference_machine, [gyroscopic] if spin else [])
    turned = replace(plain, seat_turn=lambda spindle, state: np.full(len(state.radial_stiffness), 0.6))
    straight, other = (structure(stages, SPEEDS, mode_count=4).modes for stages in (plain, turned))
    assert other.turn is not None
    frequency = 2.0 * np.pi * np.linspace(100.0, 2000.0, 40)
    expected = receptance(straight, frequency)
    assert receptance(other, frequency) == pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max())


def test_a_workpiece_does_not_turn_with_the_seats(reference_machine: Machine):
    values = {"where": "seats", "axis": "y", "stiffness_loss": 0.7, "rear_difference": 0.0, "turn_deg": 30.0}
    workpiece = {"axis": "x", "compliance_um_n": 0.2, "natural_frequency_hz": 700.0, "damping_ratio": 0.02}
    effects = [activate("directional_asymmetry", values), activate("workpiece_mode", workpiece)]
    modes = structure(apply_effects(reference_machine, effects), SPEEDS, mode_count=2).cut_modes
    of_x, of_y = [math.cos(math.pi / 6.0), 0.5], [-0.5, math.cos(math.pi / 6.0)]
    expected = np.broadcast_to([of_x, of_x, of_y, of_y, [1.0, 0.0]], (len(SPEEDS), 5, 2))
    assert modes.direction == pytest.approx(expected, abs=1e-12)
    assert modes.at(np.array([2])).direction == pytest.approx(expected[:1], abs=1e-12)
    assert modes.alone(2).direction == pytest.approx(expected[:, [1, 3]], abs=1e-12)


def test_seats_of_two_effects_act_in_series(reference_machine: Machine):
    """A housing that gives, and more so in y: compliances add, and x knows nothing of what is softer in y."""
    spindle, state = reference_machine.spindle, structure(reference_machine, SPEEDS, mode_count=1).bearing
    housing = activate("housing_compliance", {"compliance_um_n": 0.004, "rear_difference": 0.0})
    softer = {"where": "seats", "axis": "y", "stiffness_loss": 0.4, "rear_difference": 0.0, "turn_deg": 0.0}
    asymmetry = activate("directional_asymmetry", softer)
    both, one = (apply_effects(reference_machine, effects) for effects in ([housing, asymmetry], [housing]))
    alone = apply_effects(reference_machine, [asymmetry])
    plain = apply_effects(reference_machine, []).seat_stiffness(spindle, state)
    x, y = both.seat_stiffness(spindle, state)
    assert x == pytest.approx(one.seat_stiffness(spindle, state)[0], rel=1e-12)
    assert 1.0 / y == pytest.approx(1.0 / alone.seat_stiffness(spindle, state)[1] + 4e-9, rel=1e-12)
    assert 1.0 / x == pytest.approx(1.0 / plain[0] + 4e-9, rel=1e-12)


def test_what_holds_the_seats_knows_no_preload(reference_machine: Machine):
    """One spring beside bearings of any preload; under 100 N it takes the stated share from the front seat at rest."""
    softer = {"where": "seats", "axis": "y", "stiffness_loss": 0.7, "rear_difference": 0.0, "turn_deg": 0.0}
    springs = []
    for preload in (50.0, 100.0, 600.0):
        machine = reference_machine.with_preload(preload)
        stages = model(machine, "directional_asymmetry", **softer)
        x, y = stages.seat_stiffness(machine.spindle, structure(machine, SPEEDS, mode_count=1).bearing)
        springs.append(1.0 / y - 1.0 / x)
        if preload == 100.0:
            assert x[0, 0] / y[0, 0] == pytest.approx(math.exp(0.7), rel=1e-12)
    assert np.array(springs) == pytest.approx(np.full((3, len(SPEEDS), 2), springs[1][0, 0]), rel=1e-12)


def test_a_table_has_the_less_sure_of_unlike_axes(reference_machine: Machine):
    values = {"where": "seats", "axis": "y", "stiffness_loss": 1.5, "rear_difference": 0.0, "turn_deg": 0.0}
    stages = model(reference_machine, "directional_asymmetry", **values)
    found = structure(stages, SPEEDS, mode_count=6).modes.tracking_confidence
    table = structure_variables(stages, SPEEDS, mode_count=6)["tracking_confidence"]
    assert not np.array_equal(found[:, :6], found[:, 6:])
    assert np.array_equal(table, np.minimum(found[:, :6], found[:, 6:]))


def test_damping_changes_with_speed_and_not_at_rest(reference_machine: Machine):
    base = structure(reference_machine, SPEEDS, mode_count=3).modes
    found = structure(model(reference_machine, "speed_dependent_damping", change=math.log(2.0)), SPEEDS, mode_count=3)
    factor = 2.0 ** (SPEEDS / REFERENCE_SPEED)
    assert found.modes.damping_ratio == pytest.approx(base.damping_ratio * factor[:, None], rel=1e-12)


def test_a_workpiece_mode_is_a_further_mode_of_the_tool(reference_machine: Machine):
    """In the cut alone: a machine of measured modes that lists it has the same multipliers."""
    tip = [
        {"axis": axis, "natural_frequency_hz": 900.0, "damping_ratio": 0.03, "stiffness_n_um": 20.0} for axis in "xy"
    ]
    own = {"axis": "y", "natural_frequency_hz": 1300.0, "damping_ratio": 0.02, "stiffness_n_um": 25.0}
    parts = {key: reference_machine.described()[key] for key in ("tool", "cutting", "process")}
    machine, listed = (Machine.model_validate({**parts, "tip": {"modes": modes}}) for modes in (tip, [*tip, own]))
    stages = model(
        machine, "workpiece_mode", axis="y", compliance_um_n=1 / 25, natural_frequency_hz=1300.0, damping_ratio=0.02
    )
    speed, depth, index = SPEEDS[1:], np.array([1e-3, 2e-3]), np.array([0, 1])
    found, expected = (
        critical_multipliers(one, structure(one, speed, mode_count=count), index, depth, FINEST, np.ones(2))
        for one, count in ((stages, 1), (listed, 2))
    )
    assert np.abs(found) == pytest.approx(np.abs(expected), rel=1e-7)
    assert len(structure(stages, speed, mode_count=1).modes) == 2


def test_gyroscopic_poles_are_the_rotors_whirl_frequencies(reference_machine: Machine):
    """Of the spinning rotor solved as one, both planes in r = x + i y: forward and backward whirl, mode by mode."""
    light = {"mass_coefficient": 0.0, "stiffness_coefficient": 0.0}
    spindle = reference_machine.spindle
    spindle = spindle.model_copy(update={"damping": spindle.damping.model_copy(update=light)})
    machine, speed = reference_machine.model_copy(update={"spindle": spindle}), np.array([24000.0]) * RPM
    built = structure(model(machine, "gyroscopic_coupling", share=1.0), speed, mode_count=16)
    poles = np.linalg.eigvals(state_space(built.modes).state_matrix[0]).imag
    found = np.sort(poles[poles > 0.0])[:8]
    seats = built.bearing.radial_stiffness[0] * np.array([1.0, 2.0])
    expected = np.sort(np.abs(whirl_frequencies(reduce_rotor(assemble(spindle)), seats, speed[0])))[:8]
    # Sixteen modes of each plane stand for all: what the others add is a millionth.
    assert found == pytest.approx(expected, rel=1e-5)
    assert expected[1] > 1.0001 * expected[0]


@pytest.mark.parametrize("rpm", [8000.0, 24000.0])
def test_gyroscopic_receptance_is_the_direct_solution(reference_machine: Machine, rpm: float):
    """All freedoms of both planes at once, spinning from y towards x: direct and cross receptances, with their sign."""
    speed, frequency = np.array([rpm]) * RPM, 2.0 * math.pi * np.linspace(200.0, 3000.0, 57)
    stages = model(reference_machine, "gyroscopic_coupling", share=1.0)
    built = structure(stages, speed, mode_count=20)
    seats, spindle = built.bearing.radial_stiffness[0] * np.array([1.0, 2.0]), reference_machine.spindle
    expected = direct_receptance(assemble(spindle), spindle.damping, seats, frequency, -speed[0])
    found = stages.receptance(built.modes, frequency)[0]
    # Twenty modes of several hundred: 1e-3 of the static deflection is left out of the direct ones.
    assert found[:, 0, 0] == pytest.approx(expected[:, 0, 0], abs=3e-3 * np.abs(expected[:, 0, 0]).max())
    assert found[:, 0, 1] == pytest.approx(expected[:, 0, 1], abs=3e-3 * np.abs(expected[:, 0, 1]).max())
    assert np.abs(found[:, 0, 1]).max() > 0.01 * np.abs(found[:, 0, 0]).max()
    space = state_space(built.modes)
    states = space.state_matrix.shape[-1]
    by_states = [
        space.output_matrix[0] @ np.linalg.solve(1j * w * np.eye(states) - space.state_matrix[0], space.input_matrix[0])
        for w in frequency[::19]
    ]
    # The same rational function twice: rounding alone.
    assert found[::19] == pytest.approx(np.array(by_states), rel=1e-9, abs=1e-17)


def test_a_workpiece_feels_no_gyroscopic_moment(reference_machine: Machine):
    values = {"axis": "y", "compliance_um_n": 0.05, "natural_frequency_hz": 800.0, "damping_ratio": 0.02}
    both = [activate("gyroscopic_coupling", {"share": 1.0}), activate("workpiece_mode", values)]
    built = structure(apply_effects(reference_machine, both), SPEEDS[1:], mode_count=2)
    assert not built.cut_modes.gyroscopic[:, 4].any()
    assert not built.cut_modes.gyroscopic[:, :, 4].any()
    assert built.cut_modes.gyroscopic[:, :4, :4] == pytest.approx(built.modes.gyroscopic, rel=1e-15)
    alone = built.modes.alone(2)
    assert alone.gyroscopic == pytest.approx(built.modes.gyroscopic[:, 1::2, 1::2], rel=1e-15)


@pytest.mark.parametrize("name", ["collocation", "semi_discretization"])
def test_a_constant_gain_on_velocity_is_a_damper(name: str):
    """With D(t) = -c on the diagonal the equation is that of a tip with c more damping, in closed form."""
    damper = 3.0  # N s/m; the benchmark's own 2 zeta m w is 5.1
    problem = milling_benchmark(direction="down", immersion=0.5, rpm=[5000.0, 9000.0], depth_mm=[0.5, 1.0], axes=(0, 1))
    w, ratio, mass = 922.0 * 2.0 * math.pi, 0.011, 0.03993
    more = ratio + damper / (2.0 * mass * w)
    damped = problem.system.state_matrix.copy()
    damped[:, [2, 3], [2, 3]] = -2.0 * more * w
    matrices = {"input_matrix": problem.system.input_matrix, "output_matrix": problem.system.output_matrix}

    def constant(time):
        return np.broadcast_to(-damper * np.eye(2), (*time.shape, 2, 2)).copy()

    method, rel = (FINEST, 1e-6) if name == "collocation" else (
        MethodSettings(name="semi_discretization", order=1, intervals=60), 1e-9,
    )  # fmt: skip
    # Collocation integrates the damper in one case and has it exactly in the other.
    one = critical_motion(replace(problem, velocity_gain=(constant,)), method, 3.0).multiplier
    other = critical_motion(
        replace(problem, system=LinearSystem(state_matrix=damped, **matrices)), method, 3.0
    ).multiplier
    assert np.abs(one) == pytest.approx(np.abs(other), rel=rel)


def test_process_damping_by_another_method(reference_machine: Machine):
    """Semi-discretization of order one converges to the multiplier of collocation."""
    stages = model(reference_machine, "process_damping", coefficient_n_m=1e5)
    built = structure(stages, np.array([8000.0]) * RPM, mode_count=2)
    problem = milling_equation(stages, built, np.array([0]), np.array([1.5e-3]))
    exact = np.abs(critical_motion(problem, FINEST, 2.0).multiplier)
    rough, fine = (
        np.abs(critical_motion(problem, MethodSettings(name="semi_discretization", order=1, intervals=n)).multiplier)
        for n in (60, 120)
    )
    # Second order: half the interval, a quarter of the error, and little is left.
    assert abs(fine / exact - 1.0) < 0.35 * abs(rough / exact - 1.0)
    assert fine == pytest.approx(exact, rel=2e-3)


def test_process_damping_is_power_out_of_the_cut(reference_machine: Machine):
    """F . v = -C b/v_c sum (h')^2 for the radial part: the gain on velocity takes energy at every instant."""
    stages = model(reference_machine, "process_damping", coefficient_n_m=1e5)
    built = structure(stages, np.array([4000.0]) * RPM, mode_count=1)
    problem = milling_equation(stages, built, np.array([0]), np.array([2e-3]))
    (gain,) = problem.velocity_gain
    time = np.linspace(0.0, float(problem.period[0]), 200)[None]
    radial = replace(gain, coefficients=ForceCoefficients(tangential=0.0, radial=gain.coefficients.radial))
    matrix = radial(time)[0]
    assert np.allclose(matrix, matrix.swapaxes(1, 2), atol=1e-9 * np.abs(matrix).max())
    assert np.linalg.eigvalsh(matrix).max() <= 1e-12 * np.abs(matrix).max()
    # A single edge at the angle theta: -C b/v_c along its own direction.
    speed = 0.5 * 0.016 * 4000.0 * RPM
    assert -np.trace(matrix, axis1=1, axis2=2).max() <= 4 * 1e5 * 2e-3 / speed
    assert gain.coefficients.tangential == pytest.approx(0.3 * gain.coefficients.radial)


def test_process_damping_raises_the_boundary_at_low_speed_most(reference_machine: Machine):
    speeds = np.array([3000.0, 16000.0]) * RPM
    depth = np.linspace(0.3e-3, 8e-3, 12)
    base, damped = (
        lobe_block(
            one, spindle_speed=speeds, axial_depth=depth, mode_count=4, modal_parameters="dynamic", method=COLLOCATION,
            cells="adaptive",
        ).limit_depth[:, 0]
        for one in (reference_machine, model(reference_machine, "process_damping", coefficient_n_m=1e5))
    )  # fmt: skip
    gain = damped / base
    assert gain[0] > gain[1] > 1.0
    assert gain[0] > 1.3


def test_coefficients_fall_with_speed_as_if_the_sheet_said_so(reference_machine: Machine):
    stages = model(reference_machine, "cutting_speed_coefficient", exponent=0.2)
    speed, depth, index = SPEEDS[1:], np.full(2, 1.2e-3), np.array([0, 1])
    built = structure(stages, speed, mode_count=2)
    found = critical_multipliers(stages, built, index, depth, FINEST, np.ones(2))
    for place, at in enumerate(speed):
        energy = reference_machine.cutting.specific_cutting_energy * (at / REFERENCE_SPEED) ** -0.2
        cutting = reference_machine.cutting.model_copy(update={"specific_cutting_energy": energy})
        other = reference_machine.model_copy(update={"cutting": cutting})
        expected = critical_multipliers(other, built, index[[place]], depth[:1], FINEST, np.ones(1))
        assert abs(found[place]) == pytest.approx(abs(expected[0]), rel=1e-9)


@pytest.mark.parametrize("runout", [0.0, 400.0])
def test_a_power_law_is_the_slope_of_the_force_slice_by_slice(runout: float, reference_machine: Machine):
    """F = K h_ref (h/h_ref)^x itself, on thin slices of all edges, moved a little to either side in x and in y."""
    process = reference_machine.process.model_copy(update={"feed_per_tooth": 8e-4})
    effects = [activate("chip_thickness_power_law", {"exponent": 0.8})]
    if runout:
        effects.append(activate("tool_runout", {"runout_um": runout, "phase_deg": 20.0}))
    stages = apply_effects(reference_machine.model_copy(update={"process": process}), effects)
    speed, depth, step = np.array([9000.0]) * RPM, 4e-3, 1e-8
    problem = milling_equation(stages, structure(stages, speed, mode_count=1), np.array([0]), np.array([depth]))
    who, K, count = stages.passages, stages.force_coefficients(reference_machine, speed), 4000
    lag = 2.0 * (np.arange(count) + 0.5) / count * depth * math.tan(math.radians(30.0)) / 0.016

    def force(time: float, x: float, y: float) -> np.ndarray:
        total = np.zeros(2)
        for q in range(len(who)):
            for turn in range(-1, 5):
                theta = speed[0] * time + who.ahead[q] + 0.5 * math.pi * who.repeat * turn - lag
                theta = theta[(theta > who.entry[q]) & (theta < who.exit[q])]
                sine, cosine = np.sin(theta), np.cos(theta)
                chip = 8e-4 * who.pitches[q] * sine + who.longer[q] + x * sine + y * cosine
                law = depth / count * 1e-4 * (np.maximum(chip, 0.0) / 1e-4) ** 0.8
                along, inwards = K.tangential * law, K.radial * law
                total += [-(along @ cosine) - inwards @ sine, along @ sine - inwards @ cosine]
        return total

    largest = max(np.abs(term.gain(np.linspace(0.0, problem.period, 200).T)).max() for term in problem.feedback)
    for share in (0.07, 0.31, 0.55, 0.83):
        time = share * float(problem.period[0])
        found = sum(term.gain(np.array([[time]]))[0, 0] for term in problem.feedback)
        columns = [(force(time, *d) - force(time, -d[0], -d[1])) / (2.0 * step) for d in ((step, 0.0), (0.0, step))]
        # The edge's radius, a 250th of the feed, takes some per cent of the slope where an edge enters or leaves.
        assert found == pytest.approx(np.array(columns).T, abs=0.02 * largest)


@pytest.mark.parametrize("exponent", [0.4, 0.6, 0.9])
def test_an_edge_of_a_radius_cuts_as_its_slices_do(exponent: float, reference_machine: Machine):
    """It has x (h/h_ref)^(x - 1) K, sqrt(h^2 + (3 um)^2) being h, on thin slices of unlike teeth at operating points.

    Slices miss 1e-4 at the ends of an edge, the 16 Gauss points of the program far less. Of the times some have teeth
    that cut behind the second or third before them, and chips that vanish.
    """
    effects = [activate("tool_runout", {"runout_um": 60.0, "phase_deg": 20.0})]
    effects += [activate("cutting_speed_coefficient", {"exponent": 0.3})]
    effects += [activate("chip_thickness_power_law", {"exponent": exponent})]
    stages = apply_effects(reference_machine, effects)
    speed, depths, count = np.array([9000.0, 12000.0]) * RPM, np.array([4e-3, 1e-3]), 4000
    problem = milling_equation(stages, structure(stages, speed, mode_count=1), np.arange(2), depths)
    feed, share = reference_machine.process.feed_per_tooth, (np.arange(count) + 0.5) / count

    def gain(point: int, time: float) -> np.ndarray:
        total = np.zeros((2, 2))
        lag = 2.0 * share * depths[point] * math.tan(math.radians(30.0)) / 0.016
        for cut in (term.gain.cut for term in problem.feedback):
            who, K = cut.passages, cut.coefficients
            for q, turn in itertools.product(range(len(who)), range(-1, 5)):
                theta = speed[point] * time + who.ahead[q] + 0.5 * math.pi * who.repeat * turn - lag
                on = (theta > who.entry[point, q]) & (theta < who.exit[point, q])
                theta = theta[on & (share > who.lower[q]) & (share < who.upper[q])]
                sine, cosine = np.sin(theta), np.cos(theta)
                chip = np.hypot(np.maximum(feed * who.pitches[q] * sine + who.longer[q], 0.0), 3e-6)
                slope = depths[point] / count * exponent * (chip / 1e-4) ** (exponent - 1.0)
                along, inwards = K.tangential[point] * slope, K.radial[point] * slope
                pushes = np.array([-along * cosine - inwards * sine, along * sine - inwards * cosine])
                total += pushes @ np.array([sine, cosine]).T
        return total

    time = np.array([0.07, 0.2, 0.25, 0.5, 0.83]) * problem.period[:, None]
    found = sum(term.gain(time) for term in problem.feedback)
    expected = np.array([[gain(point, one) for one in time[point]] for point in range(2)])
    assert found == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


def test_half_the_feed_is_another_coefficient(reference_machine: Machine):
    """Away from its ends an edge has the coefficient x (h_0/h_ref)^(x - 1) K: half the feed, 2^(1 - x) of it."""
    gains = []
    for feed in (4e-4, 2e-4):
        process = reference_machine.process.model_copy(update={"feed_per_tooth": feed, "direction": "up"})
        straight = reference_machine.tool.model_copy(update={"helix_angle": 0.0})
        machine = reference_machine.model_copy(update={"process": process, "tool": straight})
        stages = model(machine, "chip_thickness_power_law", exponent=0.7)
        built = structure(stages, np.array([1000.0]) * RPM, mode_count=1)
        problem = milling_equation(stages, built, np.array([0]), np.array([1e-3]))
        (term,), inside = problem.feedback, 0.5 * math.acos(1.0 - 2.0 * 0.4) / (1000.0 * RPM)
        gains.append(term.gain(np.array([[inside]])))
    # The edge's radius is a hundredth of these chips: its square.
    assert gains[1] == pytest.approx(2.0**0.3 * gains[0], rel=2e-4)


@pytest.mark.parametrize(("direction", "immersion", "offset", "seen"), [
    ("down", 0.4, -0.1, 0.3), ("down", 0.2, -0.1, 0.1), ("up", 0.4, 0.1, 0.5), ("up", 0.9, 0.2, 1.0),
    ("down", 0.1, -0.2, 0.01), ("slot", 1.0, -0.2, 1.0),
])  # fmt: skip
def test_an_immersion_is_off_by_one_distance(reference_machine: Machine, direction, immersion, offset, seen):
    update = {"direction": direction, "radial_immersion": immersion}
    process = reference_machine.process.model_copy(update=update)
    stages = model(reference_machine, "radial_immersion_error", offset=offset)
    expected = engagement(process.model_copy(update={"radial_immersion": seen}))
    assert stages.engagement(process).entry == pytest.approx(expected.entry, abs=1e-12)
    assert stages.engagement(process).exit == pytest.approx(expected.exit, abs=1e-12)


def test_higher_modes_restored_in_full_are_the_wider_model(reference_machine: Machine):
    found = structure(model(reference_machine, "higher_modes", modes=4, share=1.0), SPEEDS, mode_count=1)
    wider = structure(reference_machine, SPEEDS, mode_count=4)
    assert np.array_equal(found.modes.natural_frequency, wider.modes.natural_frequency)
    assert np.array_equal(found.cut_modes.modal_mass, wider.cut_modes.modal_mass)


def test_turning_bearings_restored_in_full_are_the_dynamic_model(reference_machine: Machine):
    stages = model(reference_machine, "speed_dependent_bearing", share=1.0)
    found = structure(stages, SPEEDS, mode_count=4, modal_parameters="static")
    dynamic = structure(reference_machine, SPEEDS, mode_count=4)
    assert np.array_equal(found.modes.natural_frequency, dynamic.modes.natural_frequency)
    assert np.array_equal(structure(stages, SPEEDS, mode_count=4).modes.modal_mass, dynamic.modes.modal_mass)


def test_preload_rises_on_bearings_that_stand_still(reference_machine: Machine):
    """Each effect acts on its own: heat needs no ball inertia."""
    stages = model(reference_machine, "thermal_preload", rise=1.0, exponent=1.0)
    found = structure(stages, SPEEDS, mode_count=1, modal_parameters="static").bearing
    expected = [
        axisymmetric_state(reference_machine.bearing, 100.0 * (1 + s / REFERENCE_SPEED), np.zeros(1), "constant")
        for s in SPEEDS
    ]
    assert found.radial_stiffness == pytest.approx([one.radial_stiffness[0] for one in expected], rel=1e-8)
