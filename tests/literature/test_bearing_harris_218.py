"""The 218 angular contact ball bearing of Harris's examples, at rest and at 10 000 rpm.

T. A. Harris, M. N. Kotzalas, Rolling Bearing Analysis, 5th ed. (2007): 16 balls of 22.225 mm on
125.26 mm, 40 degrees, both conformities 0.5232. At rest his charts give 41.6 degrees and 0.0386 mm
under 17 800 N. At speed: an independent solve of Jones's equations with exact Hertz contact, outer
raceway control and balls of 7800 kg/m3. Steel of 207 GPa reproduces that solve to every digit given;
206 GPa misses forces by 0.3 N of 2421, 208 GPa by 0.2 N.
"""

import math

import numpy as np
import pytest

from chatter_core.bearing import axisymmetric_state
from chatter_core.machine import Bearing

STEEL = {"youngs_modulus_gpa": 207.0, "poisson_ratio": 0.3, "density_kg_m3": 7800.0}
HARRIS_218 = Bearing.model_validate(
    {
        "pitch_diameter_mm": 125.26,
        "ball_diameter_mm": 22.225,
        "ball_count": 16,
        "contact_angle_deg": 40.0,
        "inner_groove_conformity": 0.5232,
        "outer_groove_conformity": 0.5232,
        "ball": STEEL,
        "ring": STEEL,
    }
)


def test_harris_218_at_rest() -> None:
    state = axisymmetric_state(HARRIS_218, 17800.0, np.zeros(1), "constant")
    angle, displacement = math.degrees(state.inner_contact_angle[0]), state.axial_displacement[0] * 1e3
    # A chart's constant stands for the contact's stiffness there: 0.15 degrees and 8 %.
    assert angle == pytest.approx(41.6, abs=0.15)
    assert displacement == pytest.approx(0.0386, rel=0.08)
    # Exact Hertz contact, half a unit of the last digit given.
    assert angle == pytest.approx(41.50, abs=0.005)
    assert displacement == pytest.approx(0.0360, abs=0.00005)


@pytest.mark.parametrize(
    ("thrust", "outer", "inner", "outer_force", "inner_force", "centrifugal", "gyroscopic"),
    [
        (8900.0, 32.63, 48.28, 1241.1, 745.2, 621.6, 1.490),
        (22250.0, 38.46, 44.90, 2421.5, 1970.1, 592.2, 1.637),
    ],
)
def test_harris_218_at_10000_rpm(
    thrust: float,
    outer: float,
    inner: float,
    outer_force: float,
    inner_force: float,
    centrifugal: float,
    gyroscopic: float,
) -> None:
    state = axisymmetric_state(HARRIS_218, thrust, np.array([10000.0 * 2.0 * math.pi / 60.0]), "constant")
    # Half a unit of the last digit given, everywhere.
    assert math.degrees(state.outer_contact_angle[0]) == pytest.approx(outer, abs=0.005)
    assert math.degrees(state.inner_contact_angle[0]) == pytest.approx(inner, abs=0.005)
    assert state.outer_contact_force[0] == pytest.approx(outer_force, abs=0.05)
    assert state.inner_contact_force[0] == pytest.approx(inner_force, abs=0.05)
    assert state.centrifugal_force[0] == pytest.approx(centrifugal, abs=0.05)
    assert state.gyroscopic_moment[0] == pytest.approx(gyroscopic, abs=0.0005)
