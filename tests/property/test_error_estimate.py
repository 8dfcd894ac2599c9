"""The stated error against a reference at several times the resolution, on random machines and cuts.

One to four modes an axis, up, down and slot milling, straight and helical, one to six teeth, slow and fast
spindles: the error that is stated must cover the error that is made, and both must keep the tolerance.
"""

import math

import numpy as np
import pytest

from chatter_core.chain import structure
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.stability import critical_multipliers
from chatter_core.variables import STATUS

RPM = 2.0 * math.pi / 60.0
FINEST = MethodSettings(name="collocation", tolerance=1e-8)
REFERENCE = 6.0


def random_machine(random: np.random.Generator) -> Machine:
    direction = str(random.choice(["up", "down", "slot"]))
    modes = [
        {
            "axis": axis,
            "natural_frequency_hz": float(random.uniform(300.0, 3000.0)),
            "damping_ratio": float(random.uniform(0.01, 0.06)),
            "stiffness_n_um": float(random.uniform(3.0, 60.0)),
        }
        for axis in ("x", "y")
        for _ in range(random.integers(1, 5))
    ]
    return Machine.model_validate(
        {
            "tip": {"modes": modes},
            "tool": {
                "teeth": int(random.integers(1, 7)),
                "diameter_mm": 16.0,
                "helix_angle_deg": float(random.choice([0.0, 30.0, 45.0])),
                "rake_angle_deg": 0.0,
            },
            "cutting": {"kt_mpa": 900.0, "kn": 0.3, "friction_coefficient": 0.2},
            "process": {
                "direction": direction,
                "radial_immersion": 1.0 if direction == "slot" else float(random.uniform(0.03, 0.9)),
                "feed_per_tooth_mm": 0.1,
            },
        }
    )


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6])
def test_the_stated_error_covers_the_error_made(tolerance):
    random = np.random.default_rng(44)
    method = MethodSettings(name="collocation", tolerance=tolerance)
    stated, made = [], []
    for _ in range(25):
        machine = random_machine(random)
        speed = random.uniform(1500.0, 20_000.0, 4) * RPM
        depth = np.linspace(0.2e-3, 6e-3, 6)
        modes = max(sum(mode.axis == axis for mode in machine.tip.modes) for axis in ("x", "y"))
        block = lobe_block(
            machine,
            spindle_speed=speed,
            axial_depth=depth,
            mode_count=modes,
            modal_parameters="dynamic",
            method=method,
        )
        assert np.all(block.status == STATUS["ok"])
        nearest = np.abs(np.log(block.spectral_radius)).argmin(axis=1)
        found = block.spectral_radius[np.arange(4), nearest]
        built = structure(machine, speed, mode_count=modes)
        exact = np.abs(
            critical_multipliers(machine, built, np.arange(4), depth[nearest], FINEST, np.full(4, REFERENCE))
        )
        stated.extend(block.error_estimate)
        made.extend(np.abs(found / exact - 1.0))
    stated, made = np.array(stated), np.array(made)
    assert np.all(stated <= tolerance)
    # Rounding and the residual of eigenvalues in the reference.
    assert np.all(made <= stated + 1e-9)
