"""Lobes evaluated where needed against lobes evaluated everywhere.

Cells on either side of the boundary are what a lobe diagram is for: none may change sides. Machines with
flip lobes, islands of helical edges, and the reference machine.
"""

import math

import numpy as np
import pytest

from chatter_core import lobes
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.variables import STATUS
from tests.conftest import COLLOCATION

RPM = 2.0 * math.pi / 60.0
SPEEDS, DEPTHS = 40, 100


def two_teeth(helix_deg: float, immersion: float, axes: str = "xy") -> Machine:
    stiffness = {"x": 922.0, "y": 987.0}
    return Machine.model_validate(
        {
            "tip": {
                "modes": [
                    {"axis": a, "natural_frequency_hz": stiffness[a], "damping_ratio": 0.011, "stiffness_n_um": 1.34}
                    for a in axes
                ]
            },
            "tool": {"teeth": 2, "diameter_mm": 10.0, "helix_angle_deg": helix_deg, "rake_angle_deg": 0.0},
            "cutting": {"kt_mpa": 600.0, "kn": 1.0 / 3.0, "friction_coefficient": 0.0},
            "process": {"direction": "up", "radial_immersion": immersion, "feed_per_tooth_mm": 0.1},
        }
    )


def counting(original, counted):
    """Return the function, adding the points that it is asked for to the last count."""

    def count(*arguments):
        counted[-1] += len(arguments[3])
        return original(*arguments)

    return count


def both(machine, rpm, deepest_mm, modes, monkeypatch):
    """Return the blocks of both ways and the points that each evaluated."""
    counted = []
    for name in ("evaluate", "critical_multipliers"):
        monkeypatch.setattr(lobes, name, counting(getattr(lobes, name), counted))
    blocks = []
    for cells in ("all", "adaptive"):
        counted.append(0)
        blocks.append(
            lobe_block(
                machine,
                spindle_speed=rpm * RPM,
                axial_depth=np.linspace(deepest_mm / DEPTHS, deepest_mm, DEPTHS) * 1e-3,
                mode_count=modes,
                modal_parameters="dynamic",
                method=COLLOCATION,
                cells=cells,
            )
        )
    return blocks, counted


def boundary_cells(unstable: np.ndarray) -> np.ndarray:
    changes = unstable[:, 1:] != unstable[:, :-1]
    return np.pad(changes, ((0, 0), (1, 0))) | np.pad(changes, ((0, 0), (0, 1)))


@pytest.mark.parametrize(
    ("name", "deepest_mm", "fastest"),
    [("reference", 6.0, 24_000.0), ("straight", 8.0, 25_000.0), ("slot", 4.0, 25_000.0)],
)
def test_no_boundary_cell_is_lost_at_a_fifth_of_the_evaluations(
    name, deepest_mm, fastest, reference_machine, monkeypatch
):
    machine = {"reference": reference_machine, "straight": two_teeth(0.0, 0.05), "slot": two_teeth(0.0, 0.9)}[name]
    rpm = np.linspace(3_000.0, fastest, SPEEDS)
    (dense, sparse), counted = both(machine, rpm, deepest_mm, 4 if name == "reference" else 1, monkeypatch)
    assert np.array_equal(dense.spectral_radius > 1.0, sparse.spectral_radius > 1.0)
    assert counted[1] <= 0.2 * counted[0]
    edge = boundary_cells(dense.spectral_radius > 1.0)
    assert np.all(sparse.status[edge] == STATUS["ok"])
    # Evaluated on either side, to the tolerance of both.
    assert sparse.spectral_radius[edge] == pytest.approx(dense.spectral_radius[edge], rel=2e-4)
    assert set(np.unique(sparse.status)) == {STATUS["ok"], STATUS["interpolated"]}
    # Roots to 5e-7 m each.
    assert sparse.limit_depth == pytest.approx(dense.limit_depth, abs=1e-6, nan_ok=True)


def test_islands_of_a_helical_edge_are_found_down_to_the_grid(monkeypatch):
    machine = two_teeth(30.0, 0.05, axes="x")
    rpm = np.linspace(5_000.0, 30_000.0, SPEEDS)
    (dense, sparse), counted = both(machine, rpm, 60.0, 1, monkeypatch)
    unstable = dense.spectral_radius > 1.0
    assert (np.isfinite(dense.limit_depth).sum(axis=1) >= 3).sum() >= 4  # there are islands
    lost = (unstable != (sparse.spectral_radius > 1.0)).sum()
    # Slivers one cell wide may hide in both ways of looking: at most one cell in a hundred at the boundary.
    assert lost <= 0.01 * boundary_cells(unstable).sum()
    assert counted[1] <= 0.3 * counted[0]


def test_a_cell_between_samples_says_that_it_is_interpolated_and_keeps_what_failed(reference_machine):
    depth = np.linspace(0.1e-3, 6e-3, 24)
    crawling = lobe_block(
        reference_machine,
        spindle_speed=np.array([5.0, 9000.0]) * RPM,
        axial_depth=depth,
        mode_count=4,
        modal_parameters="dynamic",
        method=COLLOCATION,
        cells="adaptive",
    )
    assert np.all(crawling.status[0] == STATUS["outside_validity"])
    assert np.isnan(crawling.spectral_radius[0]).all()
    assert np.isnan(crawling.limit_depth[0]).all()
    assert np.isfinite(crawling.spectral_radius[1]).all()
    assert (crawling.status[1] == STATUS["interpolated"]).any()


def test_a_limit_far_above_the_first_depth_is_found_both_ways(reference_machine):
    """Grids that begin deep below the boundary, whose every cell is unstable."""
    limits = []
    for cells in ("all", "adaptive"):
        block = lobe_block(
            reference_machine,
            spindle_speed=np.array([12_000.0, 14_000.0]) * RPM,
            axial_depth=np.array([5e-3, 3.0]),
            mode_count=4,
            modal_parameters="dynamic",
            method=COLLOCATION,
            cells=cells,
        )
        limits.append(block.limit_depth[:, 0])
        assert np.all(block.spectral_radius > 1.0)
    # As on the grid of the reference study, to 5e-7 m each.
    assert limits[0] == pytest.approx([2.049e-3, 0.865e-3], abs=2e-6)
    assert limits[1] == pytest.approx(limits[0], abs=1e-6)
