"""Tip: receptance, state space and measured modes."""

import numpy as np
import pytest
import scipy.linalg

from chatter_core.chain import structure
from chatter_core.errors import InvalidInput
from chatter_core.machine import Tip
from chatter_core.spindle import assemble
from chatter_core.tip import measured_modes, receptance, state_space


def test_receptance_by_modes_is_the_direct_solution(reference_machine):
    speed = np.array([0.0, 12000.0]) * 2.0 * np.pi / 60.0
    built = structure(reference_machine, speed, mode_count=12)
    frequency = 2.0 * np.pi * np.linspace(100.0, 3000.0, 30)
    found = receptance(built.modes, frequency)
    rotor, damping = assemble(reference_machine.spindle), reference_machine.spindle.damping
    load = np.eye(len(rotor.mass))[0]
    for s in range(2):
        stiffness = rotor.stiffness.copy()
        stiffness[rotor.seats, rotor.seats] += built.bearing.radial_stiffness[s] * np.array([1.0, 2.0])
        viscous = damping.mass_coefficient * rotor.mass + damping.stiffness_coefficient * stiffness
        direct = [scipy.linalg.solve(stiffness - w**2 * rotor.mass + 1j * w * viscous, load)[0] for w in frequency]
        # Twelve modes reach to 30 kHz; what is above adds its static part, under 1 % of the peaks.
        assert found[s, :, 0, 0] == pytest.approx(np.array(direct), abs=0.01 * np.abs(direct).max())
        assert np.all(found[s, :, 0, 1] == 0.0)


def test_state_space_has_the_receptance_of_its_modes(reference_machine):
    built = structure(reference_machine, np.array([500.0]), mode_count=3)
    space = state_space(built.modes)
    frequency = np.array([2000.0, 9000.0])
    direct = [
        space.output_matrix[0] @ np.linalg.solve(1j * w * np.eye(12) - space.state_matrix[0], space.input_matrix[0])
        for w in frequency
    ]
    # The same rational function twice: rounding alone.
    assert receptance(built.modes, frequency)[0] == pytest.approx(np.array(direct), rel=1e-9, abs=1e-18)


def mode(axis, frequency, speed=None):
    return {
        "axis": axis, "natural_frequency_hz": frequency, "damping_ratio": 0.02, "stiffness_n_um": 10.0,
        **({} if speed is None else {"spindle_speed_rpm": speed}),
    }  # fmt: skip


def test_measured_modes_are_interpolated_between_speeds_and_kept_beyond():
    tip = Tip.model_validate(
        {"modes": [mode("x", 500.0, 0), mode("x", 400.0, 10000), mode("y", 700.0, 0), mode("y", 700.0, 10000)]}
    )
    modes = measured_modes(tip, np.array([0.0, 5000.0, 20000.0]) * 2.0 * np.pi / 60.0)
    hertz = modes.natural_frequency / 2.0 / np.pi
    # Linear interpolation of numbers that are given: rounding alone.
    assert hertz[:, 0] == pytest.approx([500.0, 450.0, 400.0], rel=1e-12)
    assert hertz[:, 1] == pytest.approx([700.0, 700.0, 700.0], rel=1e-12)
    assert modes.modal_stiffness == pytest.approx(np.full((3, 2), 10e6), rel=1e-12)


def test_axes_may_have_unequal_numbers_of_modes():
    tip = Tip.model_validate({"modes": [mode("x", 500.0), mode("x", 900.0), mode("y", 700.0)]})
    modes = measured_modes(tip, np.array([100.0]), 2)
    assert list(zip(modes.axis, modes.label, strict=True)) == [(0, 1), (0, 2), (1, 1)]


def test_more_modes_than_measured_are_refused():
    tip = Tip.model_validate({"modes": [mode("x", 500.0), mode("x", 900.0)]})
    with pytest.raises(InvalidInput, match=r"mode_count: found 3, allowed: 1 to 2, as many as tip\.modes lists"):
        measured_modes(tip, np.array([100.0]), 3)
