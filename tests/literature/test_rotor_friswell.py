"""Rotor with discs against a published example.

M. I. Friswell, J. E. T. Penny, S. D. Garvey, A. W. Lees, Dynamics of Rotating Machines (2010),
example 5.9.1: a shaft of 1.5 m with two discs on isotropic supports, six Timoshenko elements. Its
natural frequencies at rest and at 4000 rpm, to the digits printed.
"""

import numpy as np
import pytest

from chatter_core.machine import Spindle
from chatter_core.spindle import assemble, reduce_rotor, supported_modes, whirl_frequencies

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
