"""What is known of a cut in which several motions grow."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from chatter_core import chain
from chatter_core.contact import forced_contact
from chatter_core.effects import variants
from chatter_core.evidence import base_model, boundary
from chatter_core.evidence.belief import PRIORS
from chatter_core.evidence.boundary import _Cells, _sureness, deviation, sure_field
from tests.synthetic import RPM, campaign, tip_machine, trials

#: A fast motion whose growth moves by 0.1 with a deviation of the only parameter, and a slow one that moves by 0.001.
SLOPES = np.array([0.1, 0.001])
GROWTH, FREQUENCY = np.array([[0.05, 0.02], [0.05, -0.02]]), np.array([[900.0, 1500.0], [900.0, 1500.0]])


def motions(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two cells; the slow motion grows in the first, and in both the order changes where the parameter is moved."""
    moved = GROWTH + SLOPES * values[0]
    order = np.argsort(-moved, axis=1) if values[0] == 0.0 else np.array([[1, 0], [1, 0]])
    return np.take_along_axis(moved, order, axis=1), np.take_along_axis(FREQUENCY, order, axis=1)


def test_the_surest_of_the_growing_motions_counts_whatever_their_order() -> None:
    cells = cast(_Cells, SimpleNamespace(motions=motions))
    found = _sureness(cells, np.zeros(1), [(0, np.array([0.03]), 0.03)], np.eye(1))
    # 0.02 / 0.001 of the slow motion where that one grows, 0.05 / 0.1 of the fast one where it is alone.
    np.testing.assert_allclose(found, [20.0, 0.5], rtol=1e-12)


@pytest.mark.parametrize(("widths", "fastest_rpm"), [(0.2, 5000.0), (0.05, 5000.0), (0.1, 9000.0)])
def test_bands_are_those_of_deviations_asked_everywhere(monkeypatch, widths: float, fastest_rpm: float) -> None:
    rng = np.random.default_rng(3)
    cuts = trials(rng.uniform(0.5 * fastest_rpm, fastest_rpm, 12) * RPM, rng.uniform(1e-3, 6.5e-3, 12))
    model = base_model(campaign(tip_machine(), trials=cuts))
    # As uncertain as a fit leaves parameters: with all of their priors every cell would be doubtful.
    before = PRIORS.about(model)
    known = replace(before, deviation=widths * before.deviation)
    grids = {"grid": (120, 48), "coarse_grid": (60, 24)}
    sure = sure_field(model, known, 0, grids["grid"])
    shares = [deviation(model, known, 0, **grids, share=(part, 3)) for part in range(3)]
    found = sure.with_deviation(np.concatenate(shares))
    monkeypatch.setattr(boundary, "ENOUGH", np.inf)
    everywhere = sure.with_deviation(deviation(model, known, 0, **grids))
    inside = np.abs(everywhere.growth) < 2.0 * everywhere.deviation
    assert inside.sum() > 50
    np.testing.assert_allclose(found.deviation[inside], everywhere.deviation[inside], rtol=1e-9)
    assert not (np.abs(found.growth) < 2.0 * found.deviation)[~inside].any()
    # What lies far from every band has cost nothing.
    assert (found.deviation == 0.0).mean() > (everywhere.deviation == 0.0).mean() + 0.1


def test_motions_of_unlike_teeth_are_found_from_those_of_the_model_itself(monkeypatch) -> None:
    """Those of every cell whose parameters are moved, and deviations are the same as with motions found from none."""
    cuts = trials(np.array([6000.0, 9500.0]) * RPM, np.array([5e-3, 1.2e-2]))
    model = base_model(campaign(tip_machine(), trials=cuts), variants("tool_runout"))
    before = PRIORS.about(model)
    runout = before.names.index("tool_runout.runout_um")
    estimate = np.where(np.arange(len(before.names)) == runout, 60.0, before.estimate)
    known = replace(before, estimate=estimate, deviation=0.3 * before.deviation)
    grids, asked = ((24, 12), (16, 8)), []

    def noted(*arguments):
        cut, forces = arguments[0], arguments[-1]
        asked.append(forces is not None and np.isfinite(forces.near(cut.spindle_speed, cut.axial_depth)).all())
        return forced_contact(*arguments)

    monkeypatch.setattr(chain, "forced_contact", noted)
    found = deviation(model, known, 0, *grids)
    # All but the cells where they are, those by which the largest deviation is known, and those that are noted.
    assert sum(asked) >= sum(parameter.touches != "measurement" for parameter in model.parameters)
    assert asked[-1]
    monkeypatch.setattr(_Cells, "noting_forces", lambda cells, values: cells)
    asked.clear()
    fresh = deviation(model, known, 0, *grids)
    assert not any(asked)
    assert fresh.max() > 0.1
    # Multipliers are known to 1e-7, and differences are taken over a thirtieth of a deviation.
    np.testing.assert_allclose(found, fresh, atol=1e-5)


def test_a_cell_without_a_deviation_leaves_none_of_its_neighbours_without(monkeypatch) -> None:
    cuts = trials(np.linspace(3000.0, 5000.0, 6) * RPM, np.full(6, 4e-3))
    model = base_model(campaign(tip_machine(), trials=cuts))
    known = replace(PRIORS.about(model), deviation=0.1 * PRIORS.about(model).deviation)
    whole, grids = boundary._deviation, ((48, 24), (24, 12))

    def holed(*arguments):
        found = whole(*arguments)
        found[np.unravel_index(np.argmax(found), found.shape)] = np.nan
        return found

    fresh = deviation(model, known, 0, *grids)
    monkeypatch.setattr(boundary, "_deviation", holed)
    found = deviation(model, known, 0, *grids)
    assert np.isfinite(found).all()
    # Of all cells those of the four coarse squares around the hole have changed.
    assert 0 < (found != fresh).sum() <= 4 * 3 * 3
    monkeypatch.setattr(boundary, "_deviation", lambda *arguments: np.full_like(whole(*arguments), np.nan))
    assert np.isnan(deviation(model, known, 0, *grids)).all()
