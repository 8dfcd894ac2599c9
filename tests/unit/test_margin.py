"""Margins: the distance in ln(depth) to the nearest crossing, whatever ln|mu| does elsewhere."""

import numpy as np
import pytest

from chatter_core.evidence.margin import CROSSING_TOLERANCE, REACH, followed_margins, margins


def growth_of(*branches):
    """ln|mu| as the largest of branches, each a function of (trial, place)."""
    return lambda trial, place: np.max([branch(trial, place) for branch in branches], axis=0)


def test_a_flat_branch_below_the_limit_does_not_hide_it():
    # Limits at these ln(depth) from the cut; below, a damped mode that the cut does not drive.
    limit = np.array([0.3, 0.1, 0.003, -0.1, -0.3, 2.0, -2.0])
    growth = growth_of(lambda trial, place: 0.5 * (place - limit[trial]), lambda trial, place: -0.002 - 0.001 * place)
    margin, crossing = margins(growth, len(limit))
    assert crossing[:5] == pytest.approx(limit[:5], abs=CROSSING_TOLERANCE)
    assert margin[:5] == pytest.approx(-limit[:5], abs=CROSSING_TOLERANCE)
    assert margin[5:].tolist() == [-REACH, REACH]
    assert np.isnan(crossing[5:]).all()


def test_the_nearest_of_several_crossings_counts_whichever_way_it_leads():
    # An island of instability from 0.2 below the cut to 0.05 below: the cut is stable above it.
    margin, crossing = margins(lambda trial, place: -(place + 0.2) * (place + 0.05), 1)
    assert (margin[0], crossing[0]) == (pytest.approx(-0.05, abs=1e-5), pytest.approx(-0.05, abs=1e-5))


def test_what_is_not_known_brackets_nothing_and_an_unknown_cut_has_no_margin():
    def growth(trial, place):
        return np.where((trial == 0) & (place > 0.1), np.nan, np.where(trial == 1, np.nan, place - 0.12))

    margin, crossing = margins(growth, 3)
    assert margin[:2] == pytest.approx([-REACH, np.nan], nan_ok=True)
    assert np.isnan(crossing[:2]).all()
    assert margin[2] == pytest.approx(-0.12, abs=1e-5)
    assert [array.tolist() for array in margins(growth, 0)] == [[], []]


def test_crossings_are_followed_smoothly_through_the_cut_itself():
    limit = np.array([0.0005, -0.2, 0.1, 5.0])

    def model(shift):
        return lambda trial, place: np.sinh(place - limit[trial] - shift)

    margin, crossing = margins(model(0.0), 4)
    followed, after = followed_margins(model(-0.002), margin, crossing)
    expected, _ = margins(model(-0.002), 4)
    # A Newton step: the square of what moved, times the curvature; and the slope's step.
    assert followed == pytest.approx(expected, abs=3e-5)
    assert followed[0] > 0.0 > margin[0]
    assert after[:3] == pytest.approx(limit[:3] - 0.002, abs=3e-5)


def test_crossings_that_move_far_are_looked_for_anew():
    margin, crossing = margins(lambda trial, place: place - 0.1, 1)
    followed, _ = followed_margins(lambda trial, place: place - 0.3, margin, crossing)
    assert followed[0] == pytest.approx(-0.3, abs=1e-5)
    none = followed_margins(lambda trial, place: place, np.array([REACH]), np.array([np.nan]))
    assert none[0].tolist() == [REACH]
