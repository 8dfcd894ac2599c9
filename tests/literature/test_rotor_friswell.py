"""Rotor with discs against a published example.

M. I. Friswell, J. E. T. Penny, S. D. Garvey, A. W. Lees, Dynamics of Rotating Machines (2010),
example 5.9.1: a shaft of 1.5 m with two discs on isotropic supports, six Timoshenko elements. Its
natural frequencies at rest and at 4000 rpm, to the digits printed. Example 5.9.2: the same on supports that are softer
in y, with the digits that the documentation of ROSS (R. Timbo et al., J. Open Source Softw. 5 (2020) 2120) prints.
"""

import numpy as np
import pytest

from chatter_core.machine import Spindle
from chatter_core.spindle import assemble, modal_gyroscopic, reduce_rotor, supported_modes, whirl_frequencies
from chatter_core.tip import TipModes, between_axes, state_space

SHEAR, MODULUS = 81.2e9, 211e9
STEEL = {
    "youngs_modulus_gpa": MODULUS * 1e-9,
    "poisson_ratio": MODULUS / (2.0 * SHEAR) - 1.0,
    "density_kg_m3": 7810.0,
}
DISC = {"width_mm": 70.0, "inner_diameter_mm": 50.0, "density_kg_m3": 7810.0}
FRISWELL = Spindle.model_validate(
    {
        "sections": [{"part": "shaft", "length_mm": 1500.0, "outer_diameter_mm": 50.0, **STEEL}],
        "discs": [
            {"position_mm": 500.0, "outer_diameter_mm": 280.0, **DISC},
            {"position_mm": 1000.0, "outer_diameter_mm": 350.0, **DISC},
        ],
        "bearings": [{"position_mm": 0.0}, {"position_mm": 1500.0}],
        "preload_n": 1.0,
        "preload_type": "constant",
        "damping": {"kind": "modal", "ratio": 0.01},
    }
)
SEATS = np.array([1e6, 1e6])


def test_friswell_rotor_at_rest():
    rotor = reduce_rotor(assemble(FRISWELL, elements_per_rotor=6))
    at_rest = [86.6581, 274.3129, 716.7863]
    found = supported_modes(rotor, SEATS[None]).natural_frequency[0, :3]
    assert found == pytest.approx(at_rest, abs=5.1e-5)
    # Without spin the whirl problem is the same, every frequency twice.
    whirl = np.abs(whirl_frequencies(rotor, SEATS, 0.0)[:6])
    assert whirl == pytest.approx(np.repeat(at_rest, 2), abs=5.1e-5)


def test_friswell_rotor_at_4000_rpm():
    rotor = reduce_rotor(assemble(FRISWELL, elements_per_rotor=6))
    found = whirl_frequencies(rotor, SEATS, 4000.0 * 2.0 * np.pi / 60.0)[:6]
    assert np.abs(found) == pytest.approx([85.3895, 87.7959, 251.7846, 294.7133, 600.1794, 827.0754], abs=5.1e-5)
    # Of each pair the gyroscopic moment lowers the whirl against the spin and raises the one with it.
    assert np.all(found[::2] < 0.0)
    assert np.all(found[1::2] > 0.0)


@pytest.mark.parametrize(
    ("rpm", "printed"),
    [
        (0.0, [82.65303734, 86.65811435, 254.52047828, 274.31285391, 679.48903239, 716.78631221]),
        (4000.0, [82.32547398, 86.86369902, 239.64228361, 287.24958074, 583.48782916, 806.88728430]),
    ],
)
def test_friswell_rotor_on_supports_softer_in_y(rpm, printed):
    """By the modes of each plane and what couples them, as the chain has them at the tip."""
    rotor = reduce_rotor(assemble(FRISWELL, elements_per_rotor=6))
    in_x, in_y = (supported_modes(rotor, seats[None]) for seats in (SEATS, 0.8 * SEATS))
    count = in_x.natural_frequency.shape[1]
    modes = TipModes(
        axis=np.repeat([0, 1], count),
        label=np.tile(np.arange(1, count + 1), 2),
        natural_frequency=np.hstack([in_x.natural_frequency, in_y.natural_frequency]),
        damping_ratio=np.zeros((1, 2 * count)),
        modal_mass=1.0 / np.hstack([in_x.tip_deflection, in_y.tip_deflection]) ** 2,
        tracking_confidence=np.ones((1, 2 * count)),
        gyroscopic=between_axes(rpm * 2.0 * np.pi / 60.0 * modal_gyroscopic(rotor, in_x, in_y)),
    )
    poles = np.linalg.eigvals(state_space(modes).state_matrix[0]).imag
    # All shapes are kept, so nothing is left out but digits.
    assert np.sort(poles[poles > 0.0])[:6] == pytest.approx(printed, rel=1e-7)
