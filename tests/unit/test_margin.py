"""Margins: the distance in ln(depth) to the nearest crossing, whatever ln|mu| does elsewhere."""

import numpy as np
import pytest

from chatter_core.evidence.margin import (
    CROSSING_TOLERANCE,
    LEAP_TOLERANCE,
    LIMIT_REACH,
    REACH,
    WIDEST_GAP,
    crossing_lines,
    followed_margins,
    margins,
)


def growth_of(*branches):
    """ln|mu| as the largest of branches, each a function of (curve, place)."""
    return lambda curve, place: np.max([branch(curve, place) for branch in branches], axis=0)


def each_alone(growth, place):
    """Margins of cuts of which each lies on a curve of its own, at these places."""
    return margins(growth, np.arange(len(place)), np.asarray(place, dtype=float))


def test_a_flat_branch_below_the_limit_does_not_hide_it():
    # Limits at these ln(depth) from the cut; below, a damped mode that the cut does not drive.
    limit = np.array([0.3, 0.1, 0.003, -0.1, -0.3, 2.0, -2.0])
    growth = growth_of(lambda curve, place: 0.5 * (place - limit[curve]), lambda curve, place: -0.002 - 0.001 * place)
    margin, crossing = each_alone(growth, np.zeros(len(limit)))
    assert crossing[:5] == pytest.approx(limit[:5], abs=CROSSING_TOLERANCE)
    assert margin[:5] == pytest.approx(-limit[:5], abs=1e-5)
    assert margin[5:].tolist() == [-REACH, REACH]
    assert np.isnan(crossing[5:]).all()


def test_a_crossing_is_found_where_growth_is_small_however_wide_its_bracket_is():
    asked = []

    def growth(curve, place):
        asked.append(place)
        return np.expm1(place - 0.13)

    margin, crossing = each_alone(growth, [0.0])
    # A straight line to the other end of the bracket is off by its curvature: half of what is small over the slope.
    assert (margin, crossing) == (pytest.approx([-0.13], abs=5e-5), pytest.approx([0.13], abs=5e-5))
    # The cut with what lies beyond, and three to where the line through them leads: a bracket of 0.001 takes one more.
    assert len(asked) == 4


def test_the_nearest_of_several_crossings_counts_whichever_way_it_leads():
    # An island of instability from 0.4 below a cut to 0.05 below: both cuts are stable, above and below it.
    margin, crossing = margins(
        lambda curve, place: -(place + 0.4) * (place + 0.05), np.array([0, 0]), np.array([0.0, -0.6])
    )
    assert (margin[1], crossing[1]) == (pytest.approx(-0.2, abs=1e-5), pytest.approx(0.2, abs=1e-5))
    assert (margin[0], crossing[0]) == (pytest.approx(-0.05, abs=1e-5), pytest.approx(-0.05, abs=1e-5))


def test_cuts_of_one_curve_share_its_crossings():
    asked = []

    def growth(curve, place):
        asked.append(len(place))
        return place - 0.1 - 2.0 * curve

    place = np.array([0.0, 0.3, 2.0, -3.0, 0.1])
    margin, crossing = margins(growth, np.array([0, 0, 1, 0, 0]), place)
    expected = np.array([-0.1, 0.2, -0.1, -REACH, 0.0])
    assert margin == pytest.approx(expected, abs=CROSSING_TOLERANCE)
    assert crossing == pytest.approx([0.1, -0.2, 0.1, np.nan, 0.0], abs=CROSSING_TOLERANCE, nan_ok=True)
    # Cuts and ends first, then halves of gaps that may hide a crossing, and at last one crossing sought on each curve.
    spans = 2.0 * REACH + np.ptp(place[[0, 1, 3, 4]]), 2.0 * REACH
    assert asked[0] == 6 + 3
    assert sum(asked) <= sum(2.0 * span / WIDEST_GAP for span in spans) + 2 * 5
    assert asked[-1] <= 2


def test_what_may_be_looked_for_farther_is_where_nothing_is_in_reach():
    asked = []

    def growth(curve, place):
        asked.append(place)
        return place - np.array([2.0, 0.1, -1.5, 9.0])[curve]

    curve, place, reach = np.array([0, 1, 2, 3, 0]), np.zeros(5), np.full(5, LIMIT_REACH)
    reach[-1] = REACH
    margin, crossing = margins(growth, curve, place, reach)
    assert margin == pytest.approx([-2.0, -0.1, 1.5, -LIMIT_REACH, -REACH], abs=CROSSING_TOLERANCE)
    assert crossing == pytest.approx([2.0, 0.1, -1.5, np.nan, np.nan], abs=CROSSING_TOLERANCE, nan_ok=True)
    moved = followed_margins(growth, curve, place, margin + 0.2, crossing - 0.2, np.ones(5), np.zeros(5), reach)
    # Far ones that move far are looked for as far again.
    assert moved[0] == pytest.approx([-2.0, -0.1, 1.5, 0.2 - LIMIT_REACH, -REACH], abs=CROSSING_TOLERANCE)
    asked.clear()
    margins(growth, curve[1:2], place[1:2], reach[1:2])
    assert np.abs(np.concatenate(asked)).max() == REACH


def test_a_limit_is_where_stability_is_lost():
    def growth(curve, place):
        # Unstable from 2.0 below the first measured limit to 0.7 above it; from 0.6 to 0.1 below the second.
        return np.where(curve == 0, np.minimum(place + 2.0, 0.7 - place), -10.0 * (place + 0.6) * (place + 0.1))

    curve, place = np.arange(2), np.zeros(2)
    margin, crossing = margins(growth, curve, place, np.full(2, LIMIT_REACH))
    # Measured over predicted, though the second cut is stable in the model.
    assert margin == pytest.approx([2.0, 0.6], abs=CROSSING_TOLERANCE)
    assert crossing == pytest.approx([-2.0, -0.6], abs=CROSSING_TOLERANCE)
    assert margins(growth, curve, place)[0] == pytest.approx([REACH, -0.1], abs=CROSSING_TOLERANCE)


def test_gaps_that_no_curve_is_steep_enough_to_hide_crossings_in_are_not_looked_into():
    asked = []

    def growth(curve, place):
        asked.extend(place)
        return np.where(curve == 0, 1.0, 0.1) * np.sign(place - 1.1) + 0.0 * place

    place = np.array([0.0, 0.6])
    margins(growth, np.array([0, 0]), place)
    assert set(asked) >= {-REACH, 0.0, 0.6, 0.6 + REACH}
    assert not any(-REACH < one < 0.0 or 0.0 < one < 0.6 for one in asked)
    asked.clear()
    # Just where a curve of that slope comes to the boundary, halfway between, it is.
    margins(lambda curve, place: growth(curve + 1, place), np.array([0, 0]), place)
    assert 0.3 in asked


def test_where_a_curve_has_no_answer_any_longer_its_cuts_are_not_stable():
    def growth(curve, place):
        return np.where((curve == 0) & (place > 0.1), np.nan, np.where(curve == 1, np.nan, place - 0.12))

    margin, crossing = margins(growth, np.array([0, 0, 1, 2]), np.array([0.0, 0.3, 0.0, 0.0]))
    # The first curve ends at 0.1 though it would lose stability at 0.12; nothing is known of the second.
    assert margin == pytest.approx([-0.1, 0.2, np.nan, -0.12], abs=CROSSING_TOLERANCE, nan_ok=True)
    assert crossing == pytest.approx([0.1, -0.2, np.nan, 0.12], abs=CROSSING_TOLERANCE, nan_ok=True)
    # The last one is no leap.
    assert (margin[3], crossing[3]) == (pytest.approx(-0.12, abs=1e-5), pytest.approx(0.12, abs=1e-5))
    assert [array.tolist() for array in each_alone(growth, [])] == [[], []]


def test_crossings_are_followed_smoothly_through_the_cut_itself():
    limit, place = np.array([0.0005, -0.2, 0.1, 5.0]), np.zeros(4)

    def model(shift):
        return lambda curve, place: np.sinh(place - limit[curve] - shift)

    margin, crossing = each_alone(model(0.0), place)
    lines = crossing_lines(model(0.0), np.arange(4), place, crossing)
    followed, after = followed_margins(model(-0.002), np.arange(4), place, margin, crossing, *lines)
    expected, _ = each_alone(model(-0.002), place)
    # A Newton step: the square of what moved, times the curvature; and the slope's step.
    assert followed == pytest.approx(expected, abs=3e-5)
    assert followed[0] > 0.0 > margin[0]
    assert after[:3] == pytest.approx(limit[:3] - 0.002, abs=3e-5)


def test_the_same_model_is_followed_to_where_it_was():
    """Differences over down to 2e-5 of a prior's width are taken of this: 1e-7 would be a slope of 0.005 a width."""
    limit = np.linspace(-0.4, 0.4, 41)

    def growth(curve, place):
        return np.expm1(3.0 * (place - limit[curve])) * (1.0 + place**2)

    margin, crossing = each_alone(growth, np.zeros(len(limit)))
    curve, place = np.arange(len(limit)), np.zeros(len(limit))
    lines = crossing_lines(growth, curve, place, crossing)
    followed, _ = followed_margins(growth, curve, place, margin, crossing, *lines)
    assert followed == pytest.approx(margin, abs=1e-7)
    # Though the curves bend by twice a slope of 3 within the gaps, straight lines within brackets miss by little.
    assert margin == pytest.approx(-limit, abs=1e-4)


def test_a_crossing_that_is_not_quite_found_moves_as_the_true_one_does():
    limit, place, curve = np.array([0.1, -0.2]), np.zeros(2), np.arange(2)

    def model(shift):
        return lambda curve, place: np.expm1(3.0 * (place - limit[curve] - shift))

    missed, shift = limit + 1e-4, 1e-5
    lines = crossing_lines(model(0.0), curve, place, missed)
    followed, after = followed_margins(model(shift), curve, place, -missed, missed, *lines)
    # The slope is a difference over 1e-3, which a curvature of 9 to a slope of 3 makes off by 0.0015 of it.
    assert after - missed == pytest.approx(shift, rel=3e-3)
    assert followed + missed == pytest.approx(-shift, rel=3e-3)


def test_cuts_that_share_a_crossing_follow_it_together():
    curve, place = np.zeros(3, dtype=int), np.array([0.0, 0.3, -0.2])
    asked = []

    def model(limit):
        def growth(curve, place):
            asked.append(len(place))
            return place - limit

        return growth

    margin, crossing = margins(model(0.1), curve, place)
    asked.clear()
    lines = crossing_lines(model(0.1), curve, place, crossing)
    followed, _ = followed_margins(model(0.104), curve, place, margin, crossing, *lines)
    assert followed == pytest.approx(place - 0.104, abs=3e-5)
    # The slope once, from both of its ends, and each model that hardly differs at the crossing alone.
    assert asked == [2, 1]


def leaping(limit):
    """Growth that leaps at a limit, where edges lose contact say."""
    return lambda curve, place: np.where(place > limit, 0.3, -0.3) + 0.5 * (place - limit)


@pytest.mark.parametrize("limit", 0.1 + 1e-4 * np.arange(7))
def test_a_leap_is_bracketed_closely_and_followed_where_it_moves(limit):
    alone, place = np.zeros(1, dtype=int), np.zeros(1)
    known = margins(leaping(limit), alone, place)
    assert known[1] == pytest.approx(limit, abs=LEAP_TOLERANCE)
    lines = crossing_lines(leaping(limit), alone, place, known[1])
    assert lines[0].tolist() == [np.inf]

    def shifted(by):
        return followed_margins(leaping(limit + by), alone, place, *known, *lines)

    # A shift that leaves it within a thousandth is not seen; of any other nothing is lost.
    for by in (0.0, 1e-5, -1e-5):
        assert shifted(by)[1].tolist() == known[1].tolist()
    for by in (2e-3, -2e-3, -0.02):
        assert shifted(by)[1] == pytest.approx(limit + by, abs=LEAP_TOLERANCE)
        assert shifted(by)[0] == pytest.approx(-limit - by, abs=LEAP_TOLERANCE)


def test_where_answers_end_a_crossing_stays_as_a_leap_does():
    alone, place = np.zeros(1, dtype=int), np.zeros(1)

    def ending(limit):
        return lambda curve, place: np.where(place > limit, np.nan, -0.1 + 0.0 * place)

    known = margins(ending(0.1), alone, place)
    lines = crossing_lines(ending(0.1), alone, place, known[1])
    assert np.isinf(lines[0]).all()
    assert followed_margins(ending(0.1), alone, place, *known, *lines)[1].tolist() == known[1].tolist()
    moved = followed_margins(ending(0.13), alone, place, *known, *lines)
    assert moved[1] == pytest.approx([0.13], abs=LEAP_TOLERANCE)


def test_crossings_that_move_far_are_looked_for_anew():
    alone, place = np.zeros(1, dtype=int), np.zeros(1)
    margin, crossing = margins(lambda curve, place: place - 0.1, alone, place)
    one = np.ones(1)
    followed, _ = followed_margins(lambda curve, place: place - 0.3, alone, place, margin, crossing, one, 0.0 * one)
    assert followed[0] == pytest.approx(-0.3, abs=1e-5)
    none = followed_margins(lambda curve, place: place, alone, place, np.array([REACH]), np.array([np.nan]), one, one)
    assert none[0].tolist() == [REACH]
