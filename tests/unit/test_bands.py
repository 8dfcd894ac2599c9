"""Bands of failures: few false alarms where failures are chance, and a planted band is found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from chatter_core.evidence.bands import CHANCE, SIMULATIONS, conspicuous_bands

SETS = 100


def drawn(rng, count=80):
    place = rng.choice(np.linspace(1000.0, 9000.0, 16), count)
    return place, rng.uniform(0.02, 0.4, count)


def test_chance_raises_no_more_alarms_than_stated():
    alarms = 0
    for seed in range(SETS):
        rng = np.random.default_rng(seed)
        place, probability = drawn(rng)
        alarms += bool(conspicuous_bands(place, rng.random(len(place)) < probability, probability))
    # The number of alarms is binomial: more than this happens once in a thousand series.
    assert alarms <= stats.binom.ppf(0.999, SETS, CHANCE)


def test_the_chance_of_a_band_does_not_hang_on_the_order_of_the_data():
    """Six failures of nine in a row, about one in a thousand: at the border of what counts."""
    rng = np.random.default_rng(2)
    place, probability = np.repeat(np.linspace(1000.0, 9000.0, 20), 3), np.tile([0.05, 0.08, 0.12], 20)
    failed = np.zeros(60, dtype=bool)
    failed[[9, 11, 12, 13, 14, 17]] = True
    (band,) = conspicuous_bands(place, failed, probability)
    assert 2e-4 < band.chance < CHANCE
    for _ in range(5):
        order = rng.permutation(60)
        (again,) = conspicuous_bands(place[order], failed[order], probability[order])
        # Sums of the same numbers in another order differ by rounding.
        assert again.expected == pytest.approx(band.expected, rel=1e-12)
        assert replace(again, expected=band.expected) == band


def test_a_planted_band_is_found_with_its_borders():
    rng = np.random.default_rng(7)
    place, probability = drawn(rng)
    probability[:] = 0.05
    inside = (place > 3000.0) & (place < 5000.0)
    failed = np.where(inside, rng.random(len(place)) < 0.9, rng.random(len(place)) < 0.05)
    band, *more = conspicuous_bands(place, failed, probability)
    assert not more
    # Its ends are the outermost places with a raised rate: at most a neighbouring place is added by chance.
    assert abs(band.low - place[inside].min()) < 600.0
    assert abs(band.high - place[inside].max()) < 600.0
    chosen = (place >= band.low) & (place <= band.high)
    assert (band.seen, band.failed) == (chosen.sum(), failed[chosen].sum())
    assert band.expected == pytest.approx(0.05 * chosen.sum())
    # None of the simulated sets has as conspicuous a one.
    assert band.chance < 1.0 / (1 + 6 * SIMULATIONS)


@pytest.mark.parametrize(("failures", "count"), [(9, 20), (20, 20), (30, 60), (60, 60)])
def test_the_chance_of_a_gross_band_is_bounded(failures, count):
    """Failures at one place, which is the only band: the binomial law has their chance."""
    failed = np.arange(count) < failures
    (band,) = conspicuous_bands(np.zeros(count), failed, np.full(count, 0.05))
    exact = stats.binom.sf(failures - 1, count, 0.05)
    simulated = 1.0 / (1 + SIMULATIONS)
    # The bound is that of rare failures: where all data fail it lacks a third of the logarithm.
    assert exact <= band.chance <= exact**0.6
    assert band.chance < simulated


def test_simulation_tells_what_a_bound_does_not():
    """One failure more than usual at one place of twenty."""
    place = np.repeat(np.arange(20.0), 3)
    failed = np.isin(place, [4.0]) | (np.arange(60) % 29 == 0)
    (band,) = conspicuous_bands(place, failed, np.full(60, 0.05))
    assert band.chance > 1.0 / (1 + 6 * SIMULATIONS)


def test_two_bands_do_not_overlap_and_come_by_weight():
    place = np.repeat(np.arange(12.0), 10)
    failed = np.isin(place, [1.0, 2.0, 9.0]) & (np.arange(len(place)) % 10 < 8)
    found = conspicuous_bands(place, failed, np.full(len(place), 0.05))
    assert [(band.low, band.high) for band in found] == [(1.0, 2.0), (9.0, 9.0)]


def test_names_have_no_neighbours():
    place = np.repeat(np.arange(5.0), 20)
    failed = np.isin(place, [1.0, 2.0]) & (np.arange(len(place)) % 2 == 0)
    found = conspicuous_bands(place, failed, np.full(len(place), 0.05), single=True)
    assert sorted((band.low, band.high) for band in found) == [(1.0, 1.0), (2.0, 2.0)]


def test_many_places_are_joined_to_some_of_like_population():
    rng = np.random.default_rng(3)
    place = rng.uniform(0.0, 1.0, 500)
    failed = (place > 0.4) & (place < 0.6)
    (band,) = conspicuous_bands(place, failed, np.full(500, 0.03))
    # One of sixty joined places, 0.017 wide, may hang over at either end.
    assert abs(band.low - 0.4) < 0.035
    assert abs(band.high - 0.6) < 0.035


def test_nothing_failed_is_no_band_and_one_place_can_be_one():
    assert conspicuous_bands(np.arange(9.0), np.zeros(9, dtype=bool), np.full(9, 0.1)) == []
    (band,) = conspicuous_bands(np.ones(9), np.ones(9, dtype=bool), np.full(9, 0.1))
    assert (band.low, band.high, band.seen, band.failed) == (1.0, 1.0, 9, 9)
