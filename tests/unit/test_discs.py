"""Rotor with discs against a published example.

M. I. Friswell, J. E. T. Penny, S. D. Garvey, A. W. Lees, Dynamics of Rotating Machines (2010),
example 5.9.1: natural frequencies at rest, to the digits printed.
"""

import numpy as np
import pytest

from chatter_core.machine import Spindle
from chatter_core.spindle import assemble, reduce_rotor, supported_modes


def test_friswell_rotor_at_rest():
    shear = 81.2e9
    modulus = 211e9
    steel = {"youngs_modulus_gpa": 211.0, "poisson_ratio": modulus / (2.0 * shear) - 1.0, "density_kg_m3": 7810.0}
    disc = {"width_mm": 70.0, "inner_diameter_mm": 50.0, "density_kg_m3": 7810.0}
    spindle = Spindle.model_validate(
        {
            "sections": [{"part": "shaft", "length_mm": 1500.0, "outer_diameter_mm": 50.0, **steel}],
            "discs": [
                {"position_mm": 500.0, "outer_diameter_mm": 280.0, **disc},
                {"position_mm": 1000.0, "outer_diameter_mm": 350.0, **disc},
            ],
            "bearings": [{"position_mm": 0.0}, {"position_mm": 1500.0}],
            "preload_n": 1.0,
            "preload_type": "constant",
            "damping": {"kind": "modal", "ratio": 0.01},
        }
    )
    rotor = reduce_rotor(assemble(spindle, elements_per_rotor=6))
    found = supported_modes(rotor, np.full((1, 2), 1e6)).natural_frequency[0, :3]
    # Six elements as in the source; its printed digits.
    assert found == pytest.approx([86.6581, 274.3129, 716.7863], rel=2e-6)
