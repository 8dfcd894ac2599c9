"""How a diagnosis is watched: evaluations of the cuts are counted, frozen nuisances are those of the data sheets."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.blind.kept import ROOT
from benchmarks.blind.own_model import set_strength
from benchmarks.blind.program import Tally, model_of, predicted_outcomes
from benchmarks.blind.tables import read_rows
from chatter_core.effects import variants

CAMPAIGN = ROOT / "tests" / "data" / "campaigns" / "d01"


@pytest.fixture(scope="module")
def few(tmp_path_factory):
    """A campaign of six cuts."""
    folder = tmp_path_factory.mktemp("few")
    (folder / "machine.yaml").write_text((CAMPAIGN / "machine.yaml").read_text())
    lines = (CAMPAIGN / "stability.csv").read_text().splitlines(keepends=True)
    (folder / "stability.csv").write_text("".join(lines[:7]))
    return folder


def test_evaluations_are_counted_and_what_is_taken_over_is_not(few):
    tally = Tally()
    model = model_of(few, frozen=False, tally=tally)
    first = model.predict(model.nulls)
    assert tally.evaluations == 1
    model.predict(model.nulls, first)
    model.predict(model.nulls, quantities=("receptance",))
    assert tally.evaluations == 1
    aside = model.nulls + np.array([0.01 if p.touches == "structure" else 0.0 for p in model.parameters])
    model.predict(aside, first)
    assert tally.evaluations == 2
    part = replace(model, campaign=replace(model.campaign, trials=model.campaign.trials.at(np.arange(3))))
    part.predict(part.nulls)
    assert tally.evaluations == 3


def test_frozen_nuisances_are_the_data_sheets(few):
    free, frozen = (model_of(few, frozen=frozen, tally=Tally()) for frozen in (False, True))
    assert {p.touches for p in frozen.parameters} == {"measurement"}
    assert {p.name for p in free.parameters} > {p.name for p in frozen.parameters}
    expected, found = free.predict(free.nulls), frozen.predict(frozen.nulls)
    assert np.array_equal(expected.margin, found.margin)
    assert np.array_equal(expected.chatter_frequency, found.chatter_frequency, equal_nan=True)


def test_kept_back_cuts_are_told_in_their_order_and_without_their_labels(few):
    cuts = read_rows(few / "stability.csv")
    told = predicted_outcomes(few, cuts, None)
    assert len(told) == len(cuts)
    assert set(told) <= {"stable", "chatter", ""}
    denied = [{**row, "outcome": "marginal", "chatter_frequency_hz": ""} for row in cuts]
    assert predicted_outcomes(few, denied, None) == told
    assert predicted_outcomes(few, cuts[::-1], None) == told[::-1]


@pytest.mark.parametrize("name", ["chip_thickness_power_law", "workpiece_mode", "cutting_speed_coefficient"])
def test_what_the_own_model_hides_is_never_at_its_null(name):
    """Down alone, up alone, or to both sides: where it can go there."""
    effect, rng = variants(name)[0], np.random.default_rng(1)
    sides = set()
    for strength in np.linspace(0.0, 1.0, 20):
        values = np.array([p.null for p in effect.parameters])
        set_strength(values, effect.parameters, effect, strength, rng)
        sides.add(np.sign(values[0] - effect.parameters[0].null))
        assert effect.parameters[0].lower <= values[0] <= effect.parameters[0].upper
    expected = {"chip_thickness_power_law": {-1.0}, "workpiece_mode": {1.0}, "cutting_speed_coefficient": {-1.0, 1.0}}
    assert sides == expected[name]
