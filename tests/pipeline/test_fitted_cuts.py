"""What a model was fitted to is known again, whatever else a campaign holds by then."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.evidence import read_campaign
from chatter_core.evidence.measured import BearingStiffness, NaturalFrequencies
from pipeline.fitted_cuts import marks, other_marks, seen
from tests.documentation.commands import ROOT
from tests.synthetic import campaign, receptance, tip_machine

CAMPAIGN = ROOT / "tests" / "data" / "campaigns" / "r02"
HEAD, *ROWS = (CAMPAIGN / "stability.csv").read_text().splitlines()


@pytest.fixture(scope="module")
def fitted():
    return marks(read_campaign(CAMPAIGN))


def said(folder, fitted, rows, limits=()):
    """What is said of a campaign with these rows of stability.csv and of limits.csv."""
    (folder / "machine.yaml").write_text((CAMPAIGN / "machine.yaml").read_text())
    (folder / "stability.csv").write_text("\n".join([HEAD, *rows]) + "\n")
    if limits:
        head = "spindle_speed_rpm,limit_depth_mm,uncertainty_mm"
        (folder / "limits.csv").write_text("\n".join([head, *limits]) + "\n")
    return seen(read_campaign(folder), fitted, [])


def test_a_mark_is_of_one_cut(fitted):
    assert len(set(fitted)) == len(fitted) == len(ROWS)


def test_cuts_are_known_by_what_was_done_and_found_not_by_their_numbers(tmp_path, fitted):
    renumbered = [f"{1000 + i},{row.partition(',')[2]}" for i, row in enumerate(ROWS[::-1])]
    assert said(tmp_path, fitted, renumbered).startswith("the model was fitted to all of these cuts already")


def test_new_cuts_are_counted_apart(tmp_path, fitted):
    told = said(tmp_path, fitted, [*ROWS, "900,3600,1.234,stable,"], limits=["3600,1.5,0.1"])
    assert told.startswith(f"the model was fitted to {len(ROWS)} of these {len(ROWS) + 2} cuts already")


def test_other_cuts_and_another_outcome_are_no_cuts_of_the_fit(tmp_path, fitted):
    number, speed, depth, outcome, _ = ROWS[0].split(",")
    other = "stable" if outcome == "chatter" else "chatter"
    assert said(tmp_path, fitted, [f"{number},{speed},{depth},{other},", "2,3600,1.234,stable,"]) == ""


def test_a_model_without_cuts_was_fitted_to_none(tmp_path):
    assert said(tmp_path, [], ROWS) == ""


def measured():
    """A campaign of two responses, two modes and two stiffnesses."""
    two, lines = np.ones(2), np.linspace(1000.0, 2000.0, 9)
    return campaign(
        tip_machine(),
        receptances=(receptance(lines), receptance(lines, axis=1)),
        natural_frequencies=NaturalFrequencies(
            spindle_speed=0.0 * two, mode=np.array([1, 2]), natural_frequency=3000.0 * two, damping_ratio=np.nan * two
        ),
        stiffness=BearingStiffness(
            spindle_speed=np.arange(2.0), preload=two, radial_stiffness=two, axial_stiffness=np.nan * two
        ),
    )


def test_what_was_measured_without_cutting_is_known_again():
    fitted = measured()
    known = other_marks(fitted)
    assert len(set(known)) == 6
    assert seen(measured(), [], known).startswith("the model was fitted to all of these measurements without cutting")
    # A response by its values, and rows of a table one by one.
    other = replace(fitted.receptances[0], value=1.001 * fitted.receptances[0].value)
    modes = replace(fitted.natural_frequencies, natural_frequency=np.array([3000.0, 3001.0]))
    grown = replace(fitted, receptances=(other, fitted.receptances[1]), natural_frequencies=modes)
    assert seen(grown, [], known).startswith("the model was fitted to 4 of these 6 measurements without cutting")


def test_cuts_and_all_else_are_told_together(fitted):
    both = replace(measured(), trials=read_campaign(CAMPAIGN).trials)
    words = "the model was fitted to all of these cuts and all of these measurements without cutting already"
    assert seen(both, fitted, other_marks(both)).startswith(words)
