"""Lobes: limit depths, statuses, shares, and the modes behind them."""

import math

import numpy as np
import pytest

from chatter_core.chain import structure, structure_variables
from chatter_core.errors import InvalidInput
from chatter_core.floquet import MethodSettings
from chatter_core.following import PATH_STEP, follow_modes, path_to
from chatter_core.lobes import _between, evaluate_to_tolerance, lobe_block
from chatter_core.machine import Machine, Tip
from chatter_core.stability import evaluate, without_result
from chatter_core.variables import BIFURCATION, STATUS
from tests.conftest import COLLOCATION

RPM = 2.0 * math.pi / 60.0


def lobes(machine, rpm, depth_mm, **choices):
    usual = {"mode_count": 4, "modal_parameters": "dynamic", "method": COLLOCATION}
    return lobe_block(
        machine, spindle_speed=np.array(rpm) * RPM, axial_depth=np.array(depth_mm) * 1e-3, **{**usual, **choices}
    )


def test_the_spectral_radius_is_one_at_every_limit_depth(reference_machine):
    rpm = [5000.0, 9000.0, 14000.0, 18000.0]
    block = lobes(reference_machine, rpm, np.linspace(0.1, 6.0, 30))
    built = structure(reference_machine, np.array(rpm) * RPM, mode_count=4)
    index = np.arange(4)
    radius, _ = evaluate_to_tolerance(reference_machine, built, block.limit_depth[:, 0], COLLOCATION)
    # The root is known to 5e-7 m of about 1e-3 m, and the radius to 1e-4.
    assert radius.spectral_radius == pytest.approx(np.ones(4), abs=2e-4)
    for factor, stable in ((0.99, True), (1.01, False)):
        near = evaluate(reference_machine, built, index, factor * block.limit_depth[:, 0], COLLOCATION, np.ones(4))
        assert np.all((near.spectral_radius < 1.0) == stable)


def test_limit_depths_do_not_depend_on_the_grid(reference_machine):
    coarse, fine = (lobes(reference_machine, [8000.0, 16000.0], np.linspace(0.2, 3.0, n)) for n in (5, 41))
    # Both are roots to 5e-7 m.
    assert coarse.limit_depth[:, 0] == pytest.approx(fine.limit_depth[:, 0], abs=1e-6)


def test_stability_lost_below_the_first_depth_is_found(reference_machine):
    deep = lobes(reference_machine, [14000.0], [2.0, 3.0])
    shallow = lobes(reference_machine, [14000.0], [0.5, 1.0, 2.0])
    assert deep.limit_depth[0, 0] == pytest.approx(shallow.limit_depth[0, 0], abs=1e-6)


def test_both_crossings_of_an_unstable_island_are_found(reference_machine):
    """At the tooth passing frequency twice the first mode's, mode 1 alone flips in a narrow range."""
    rpm = np.linspace(14100.0, 14300.0, 21)
    block = lobes(reference_machine, rpm, np.linspace(0.3, 1.2, 46), mode_count=1)
    flips = block.limit_bifurcation[:, 0] == BIFURCATION["flip"]
    assert flips.any()
    assert not flips.all()
    # In the middle of the flip lobe the limit is clearly below that of its neighbours.
    assert block.limit_depth[flips, 0].min() < 0.9 * block.limit_depth[~flips, 0].min()


def test_shares_are_shares_and_the_dominant_mode_has_the_largest(reference_machine):
    built = structure(reference_machine, np.array([5000.0, 17000.0]) * RPM, mode_count=4)
    found = evaluate(reference_machine, built, np.array([0, 1]), np.full(2, 1.2e-3), COLLOCATION, np.ones(2))
    assert found.mode_share.sum(axis=1) == pytest.approx(np.ones(2), rel=1e-12)
    assert list(found.dominant_mode) == list(found.mode_share.argmax(axis=1) + 1)
    # Low speed: the tool's bending mode; high speed: the first rigid mode of the spindle.
    assert list(found.dominant_mode) == [4, 1]


def test_chatter_frequency_lies_near_the_dominant_mode(reference_machine):
    rpm = [6500.0, 17000.0]
    block = lobes(reference_machine, rpm, np.linspace(0.1, 3.0, 20))
    built = structure(reference_machine, np.array(rpm) * RPM, mode_count=4)
    dominant = built.modes.natural_frequency[np.arange(2), block.limit_dominant_mode[:, 0] - 1]
    # Chatter is heard within a few half-widths (2 zeta, up to 9 % here) of the mode that it rides on.
    assert block.limit_chatter_frequency[:, 0] == pytest.approx(dominant, rel=0.1)


def test_a_speed_without_equilibrium_is_marked_and_the_others_are_not(reference_machine):
    rigid = reference_machine.spindle.model_copy(update={"preload_type": "rigid"})
    machine = reference_machine.model_copy(update={"spindle": rigid})
    block = lobes(machine, [9000.0, 200000.0], [0.5, 1.0])
    assert np.all(block.status[0] == STATUS["ok"])
    assert np.all(block.status[1] == STATUS["outside_validity"])
    assert np.all(np.isnan(block.spectral_radius[1]))
    assert np.all(np.isnan(block.limit_depth[1]))
    assert np.all(block.dominant_mode[1] == 0)


def test_a_crawling_spindle_is_marked_before_memory_is_taken(reference_machine):
    block = lobes(reference_machine, [0.05, 9000.0], [0.5, 1.0])
    assert np.all(block.status == [[STATUS["outside_validity"]] * 2, [STATUS["ok"]] * 2])


def test_a_tolerance_that_cannot_be_met_is_said(reference_machine):
    unreachable = MethodSettings.model_construct(name="collocation", tolerance=1e-16, intervals=None, order=None)
    block = lobes(reference_machine, [9000.0], [1.0], method=unreachable)
    assert block.error_estimate[0] > 1e-16
    assert np.all(block.status == STATUS["not_converged"])


def test_a_motion_beyond_floating_point_is_marked_and_its_neighbours_are_not(reference_machine):
    depths_mm = [1e-4, 1.0, 1e3, 1e4]
    block = lobes(reference_machine, [120.0], depths_mm)
    # |mu| grows by hundreds of decades with depth at a crawl; shallow cuts are ordinary.
    assert list(block.status[0]) == [STATUS["ok"], STATUS["ok"], STATUS["not_converged"], STATUS["not_converged"]]


@pytest.mark.parametrize("cells", ["all", "adaptive"])
def test_the_only_cell_of_a_speed_with_a_result_keeps_it(reference_machine, cells):
    # As above; adaptive cells between the only depth with a result and one without have none.
    block = lobes(reference_machine, [120.0], [1e-4, 1e3, 1e4], cells=cells)
    first = STATUS["ok"] if cells == "all" else STATUS["not_converged"]
    assert list(block.status[0]) == [first, STATUS["not_converged"], STATUS["not_converged"]]
    assert block.error_estimate[0] <= COLLOCATION.tolerance


def test_the_error_of_semi_discretization_is_told_where_it_follows_the_wrong_branch(reference_machine):
    built = structure(reference_machine, np.array([12000.0]) * RPM, mode_count=4)
    method = MethodSettings(name="semi_discretization", intervals=40, order=0)
    stability, error = evaluate_to_tolerance(reference_machine, built, np.array([2.134e-3]), method)
    exact = evaluate(reference_machine, built, np.array([0]), np.array([2.134e-3]), COLLOCATION, np.array([3.0]))
    true = abs(stability.spectral_radius[0] / exact.spectral_radius[0] - 1.0)
    # Doubling the intervals changes it by 1e-4 only, its error is 3e-2; known by collocation to 1e-4.
    assert true > 0.02
    assert error[0] == pytest.approx(true, abs=2e-4)


def test_an_error_of_zero_is_never_claimed_on_short_cuts(reference_machine):
    tool = reference_machine.tool.model_copy(update={"teeth": 2, "helix_angle": 0.0})
    process = reference_machine.process.model_copy(update={"radial_immersion": 0.05})
    machine = reference_machine.model_copy(update={"tool": tool, "process": process})
    block = lobes(machine, [15000.0, 30000.0], [0.5, 1.0], mode_count=1)
    assert np.all(block.error_estimate > 0.0)


def test_shares_of_a_point_do_not_depend_on_its_batch(reference_machine):
    built = structure(reference_machine, np.array([300.0, 30000.0]) * RPM, mode_count=4)
    depth = np.array([1e-3, 1e-3])
    together = evaluate(reference_machine, built, np.array([0, 1]), depth, COLLOCATION, np.ones(2))
    alone = evaluate(reference_machine, built, np.array([1]), depth[:1], COLLOCATION, np.ones(1))
    # The Krylov space of a batch differs in its starting vector: its residual of 1e-9 is left.
    assert together.mode_share[1] == pytest.approx(alone.mode_share[0], rel=1e-6)


def test_chatter_far_above_the_fastest_mode_is_found(reference_machine):
    tool = reference_machine.tool.model_copy(update={"teeth": 10, "helix_angle": math.radians(60.0)})
    process = reference_machine.process.model_copy(update={"radial_immersion": 1.0})
    machine = reference_machine.model_copy(update={"tool": tool, "process": process})
    built = structure(machine, np.array([3389.0]) * RPM, mode_count=4)
    found = evaluate(machine, built, np.array([0]), np.array([8e-3]), COLLOCATION, np.array([3.0]))
    # An independent first-order method says 4858.1 Hz; the fourth mode lies at 2.4 kHz.
    assert found.chatter_frequency[0] / (2.0 * math.pi) == pytest.approx(4858.1, abs=0.5)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5, 1e-7])
def test_the_error_estimate_covers_the_error_and_meets_the_tolerance(tolerance, reference_machine):
    rpm = [2500.0, 7000.0, 12000.0]
    depth = np.array([1.0e-3])
    method = MethodSettings(name="collocation", tolerance=tolerance)
    block = lobes(reference_machine, rpm, depth * 1e3, method=method)
    built = structure(reference_machine, np.array(rpm) * RPM, mode_count=4)
    finest = MethodSettings(name="collocation", tolerance=1e-8)
    exact = evaluate(reference_machine, built, np.arange(3), np.repeat(depth, 3), finest, np.full(3, 8.0))
    error = np.abs(block.spectral_radius[:, 0] / exact.spectral_radius - 1.0)
    assert np.all(block.error_estimate <= tolerance)
    # Rounding and the residual of eigenvalues in the reference.
    assert np.all(error <= block.error_estimate + 1e-9)


def test_frequencies_and_modal_stiffness_of_the_reference_machine(reference_machine):
    """Euler-Bernoulli tip modes by an independent beam program, to the digits it printed."""
    spindle = reference_machine.spindle.model_copy(update={"beam": "euler_bernoulli"})
    machine = reference_machine.model_copy(update={"spindle": spindle})
    found = structure_variables(machine, np.array([0.0, 8000.0, 12000.0, 20000.0]) * RPM, mode_count=4)
    hertz = found["natural_frequency"][:, 0] / (2.0 * math.pi)
    expected = [[871, 1355, 1607, 2482], [704, 1008, 1480, 2457], [528, 723, 1418, 2445], [428, 578, 1398, 2442]]
    assert hertz == pytest.approx(np.array(expected, dtype=float), abs=0.6)
    stiffness = found["modal_stiffness"][:, 0] * 1e-6
    expected = [[1336, 67.4, 14.8, 6.7], [110, 66.7, 16.9, 6.2], [34.6, 47.7, 18.5, 6.0], [19.5, 34.6, 19.3, 5.9]]
    # Printed to three digits; the first mode's node lies near the tip at standstill, which makes its
    # stiffness sensitive: 0.3 %.
    assert stiffness == pytest.approx(np.array(expected), rel=3e-3, abs=0.06)


def test_more_modes_than_the_model_has_are_refused(reference_machine):
    with pytest.raises(InvalidInput, match=r"mode_count: found 60, allowed at most 2\d"):
        structure(reference_machine, np.array([100.0]), mode_count=60)


def test_static_parameters_are_those_of_standstill(reference_machine):
    speeds = np.array([0.0, 10000.0, 20000.0]) * RPM
    static = structure(reference_machine, speeds, mode_count=3, modal_parameters="static")
    rest = structure(reference_machine, np.zeros(3), mode_count=3)
    np.testing.assert_array_equal(static.modes.natural_frequency, rest.modes.natural_frequency)


def test_modes_are_followed_alike_from_any_grid(reference_machine):
    speeds = np.linspace(500.0, 23777.0, 40) * RPM
    together = structure(reference_machine, speeds, mode_count=4)
    for i in (0, 17, 39):
        alone = structure(reference_machine, speeds[[i]], mode_count=4)
        # The batched eigensolver sees the same matrices: rounding alone.
        assert alone.modes.natural_frequency[0] == pytest.approx(together.modes.natural_frequency[i], rel=1e-12)
        assert alone.modes.tracking_confidence[0] == pytest.approx(together.modes.tracking_confidence[i], rel=1e-9)


def test_modes_that_exchange_their_order_keep_their_number():
    """Two uncoupled modes cross: told by shape, the first stays the first although it comes second."""
    path, _ = path_to(np.array([4.0 * PATH_STEP]))
    shapes = np.stack([np.eye(3) if speed < 2.5 * PATH_STEP else np.eye(3)[:, [1, 0, 2]] for speed in path])
    index, confidence = follow_modes(path, shapes, 2)
    assert [list(row) for row in index] == [[0, 1], [0, 1], [0, 1], [1, 0], [1, 0]]
    assert np.all(confidence == 1.0)


def test_a_mode_alone_is_the_machine_of_that_mode(reference_machine):
    """Mode 3 alone gives the lobes of a machine whose tip was measured to have that mode and no other."""
    speed, depth = np.array([9000.0, 15000.0]) * RPM, np.linspace(0.5e-3, 8e-3, 6)
    modes = structure(reference_machine, np.zeros(1), mode_count=4).modes
    measured = [
        {
            "axis": axis,
            "natural_frequency_hz": modes.natural_frequency[0, 2] / (2.0 * np.pi),
            "damping_ratio": modes.damping_ratio[0, 2],
            "stiffness_n_um": modes.modal_stiffness[0, 2] * 1e-6,
        }
        for axis in "xy"
    ]
    alone = Machine(
        tip=Tip.model_validate({"modes": measured}),
        tool=reference_machine.tool,
        cutting=reference_machine.cutting,
        process=reference_machine.process,
    )
    kept = {"modal_parameters": "static", "method": COLLOCATION, "spindle_speed": speed, "axial_depth": depth}
    found = lobe_block(reference_machine, mode_count=3, mode_selection="only", **kept)
    expected = lobe_block(alone, mode_count=1, **kept)
    assert found.spectral_radius == pytest.approx(expected.spectral_radius, rel=1e-9)
    assert np.all(found.dominant_mode == 3)
    assert np.all(expected.dominant_mode == 1)


def test_a_cell_that_was_computed_keeps_its_result_beside_one_that_was_not():
    found = without_result(3, 1, STATUS["not_converged"])
    found.spectral_radius[1], found.multiplier[1], found.status[1] = 0.9, 0.9j, STATUS["ok"]
    depth = np.array([1e-3, 2e-3, 3e-3])
    cells = _between(depth, depth, found)
    assert cells.status.tolist() == [STATUS["not_converged"], STATUS["ok"], STATUS["not_converged"]]
    assert cells.spectral_radius[1] == pytest.approx(0.9)
    assert cells.multiplier[1] == pytest.approx(0.9j)
