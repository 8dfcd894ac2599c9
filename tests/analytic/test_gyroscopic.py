"""Gyroscopic moments and the tip's receptance against closed forms and a second method."""

import math

import numpy as np
import pytest

from chatter_core.errors import InvalidInput
from chatter_core.machine import Spindle
from chatter_core.spindle import (
    assemble,
    damping_ratios,
    direct_receptance,
    reduce_rotor,
    supported_modes,
    whirl_frequencies,
)
from chatter_core.tip import TipModes, receptance

SEATS = np.array([1.0e8, 2.0e8])


def test_conical_whirl_of_a_rigid_rotor():
    """A disc amid a stiff light shaft tilts as I_d w^2 - I_p Omega w - 2 k a^2 = 0.

    Friswell et al., Dynamics of Rotating Machines (2010), chapter 3.
    """
    half_length, diameter, width, density, stiffness = 0.1, 0.2, 0.02, 7800.0, 1e4
    spindle = Spindle.model_validate(
        {
            "sections": [
                {"part": "shaft", "length_mm": 200.0, "outer_diameter_mm": 60.0,
                 "youngs_modulus_gpa": 2000.0, "poisson_ratio": 0.3, "density_kg_m3": 1e-3},
            ],
            "discs": [{"position_mm": 100.0, "width_mm": width * 1e3, "outer_diameter_mm": diameter * 1e3,
                       "inner_diameter_mm": 0.0, "density_kg_m3": density}],
            "bearings": [{"position_mm": 0.0}, {"position_mm": 200.0}],
            "preload_n": 1.0, "preload_type": "constant", "damping": {"kind": "modal", "ratio": 0.01},
        }
    )  # fmt: skip
    mass = density * math.pi / 4.0 * diameter**2 * width
    across, polar = mass * (diameter**2 / 16.0 + width**2 / 12.0), mass * diameter**2 / 8.0
    for spin in (0.0, 500.0, 3000.0):
        found = whirl_frequencies(reduce_rotor(assemble(spindle, 8)), np.array([stiffness, stiffness]), spin)[:4]
        spring = 2.0 * stiffness * half_length**2
        conical = np.roots([across, -polar * spin, -spring])
        translation = math.sqrt(2.0 * stiffness / mass)
        expected = np.sort([*conical, translation, -translation])
        # The shaft gives 1e-5 of what the springs give, and weighs 1e-7 of the disc.
        assert np.sort(found) == pytest.approx(expected, rel=3e-5)


def test_receptance_by_modes_is_the_direct_solution(reference_machine):
    described = reference_machine.spindle
    rotor = assemble(described)
    modes = supported_modes(reduce_rotor(rotor), SEATS[None])
    count = modes.natural_frequency.shape[1]
    both = np.concatenate([modes.natural_frequency, modes.natural_frequency], axis=1)
    tip = TipModes(
        axis=np.repeat([0, 1], count),
        label=np.tile(np.arange(1, count + 1), 2),
        natural_frequency=both,
        damping_ratio=damping_ratios(described.damping, both),
        modal_mass=np.tile(1.0 / modes.tip_deflection**2, 2),
        tracking_confidence=np.ones_like(both),
    )
    frequency = 2.0 * np.pi * np.array([0.0, *np.linspace(20.0, 4000.0, 60)])
    direct = direct_receptance(rotor, described.damping, SEATS, frequency)
    by_modes = receptance(tip, frequency)[0]
    # The modes beyond those kept give like damped springs: 2e-3 of the whole at rest, and by their
    # c = c2 k the same times 1 + i w c2 elsewhere, to the square of 4 kHz over their own 60 kHz.
    missing = (direct - by_modes)[:, 0, 0] * (1.0 + 1j * frequency * described.damping.stiffness_coefficient)
    assert abs(missing[0] / direct[0, 0, 0]) < 3e-3
    assert np.abs(missing / missing[0] - 1.0).max() < 1e-2
    assert by_modes[:, 1, 1] == pytest.approx(by_modes[:, 0, 0], rel=1e-12)
    # Planes of a rotor at rest know nothing of each other.
    assert np.abs(direct[:, 0, 1]).max() == 0.0


def test_spin_couples_the_planes_and_splits_the_resonance(reference_machine):
    rotor, spin = assemble(reference_machine.spindle), 2.0 * np.pi * 400.0
    described = reference_machine.spindle.damping
    whirl = np.abs(whirl_frequencies(reduce_rotor(rotor), SEATS, spin)[:2])
    frequency = 2.0 * np.pi * np.linspace(200.0, 1200.0, 30)
    found = direct_receptance(rotor, described, SEATS, frequency, spin)
    assert whirl[1] > whirl[0] * 1.0001
    # A gyroscopic moment turns with the spin: H_yx = -H_xy, and turns back with the opposite spin.
    assert found[:, 1, 0] == pytest.approx(-found[:, 0, 1], rel=1e-9)
    back = direct_receptance(rotor, described, SEATS, frequency, -spin)
    assert back[:, 0, 1] == pytest.approx(-found[:, 0, 1], rel=1e-9)
    assert np.abs(found[:, 0, 1]).max() > 0.0


def test_direct_receptance_needs_proportional_damping(reference_machine):
    modal = reference_machine.spindle.damping.model_copy(
        update={"kind": "modal", "ratio": 0.02, "mass_coefficient": None, "stiffness_coefficient": None}
    )
    with pytest.raises(InvalidInput, match="'modal', a direct receptance needs 'proportional'"):
        direct_receptance(assemble(reference_machine.spindle), modal, SEATS, np.array([1.0]))
