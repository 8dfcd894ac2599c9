"""Where failures gather: the band of a quantity that holds more of them than chance explains.

Every datum fails with a known probability when the model is right. Over all bands (ranges of neighbouring values)
the likelihood ratio of a raised rate inside is largest in one; how large it gets by chance in any of
them is simulated, so that looking at many bands at once costs no false alarms. How improbable the grossest are is
bounded instead.

Sources: M. Kulldorff, "A spatial scan statistic", Commun. Stat. Theory Methods 26 (1997) 1481-1496; H. Chernoff, Ann.
Math. Stat. 23 (1952) 493-507.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.parameters import Array

#: Simulated sets of data at a time, and how often more are drawn where the chance of the best band is not told by them:
#: a verdict that hangs on it must not hang on the draw.
SIMULATIONS, MORE = 999, 20
SEED = 1
#: No smaller chance is told apart by simulation.
LEAST_CHANCE = 2e-4
#: More places than this are joined to this many of like population.
MOST_PLACES = 60
#: Bands with a smaller chance are told, at most so many of a quantity.
CHANCE, MOST_BANDS = 0.01, 3


@dataclass(frozen=True, kw_only=True)
class Band:
    """A band that holds too many failures.

    low, high: first and last value in it; seen: data in it; failed: those that failed, and expected: how many do
    by chance; chance: that data of a right model have as conspicuous a band anywhere, that at
    most where it is smaller than LEAST_CHANCE.
    """

    low: float
    high: float
    seen: int
    failed: int
    expected: float
    chance: float


def conspicuous_bands(
    place: Array, failed: NDArray[np.bool_], probability: Array, *, single: bool = False
) -> list[Band]:
    """Return the bands in which too many data fail, the most conspicuous first; they do not overlap.

    place, failed, probability: (datum,), where each datum lies, whether it failed, and how probably it
    does when the model is right, strictly between 0 and 1. ``single``: bands hold one place each, for places
    that are names and have no order.

    See docs/physics.md#comparison.
    """
    if not failed.any():
        return []
    value, index = _places(place)
    first, last = np.triu_indices(len(value))
    if single:
        first = last = np.arange(len(value))
    expected = _within(np.array(np.bincount(index, probability, len(value)), dtype=float), first, last)

    def ratios(drawn: NDArray[np.bool_]) -> Array:
        counts = np.array([np.bincount(index, one, len(value)) for one in drawn], dtype=float)
        return _ratios(_within(counts, first, last), expected)

    found = ratios(failed[None])[0]
    # In the order of places, so that the same data in another order are the same.
    by_chance = _largest_by_chance(ratios, probability, np.lexsort((probability, place)), found.max())
    bands: list[Band] = []
    free = np.ones(len(first), dtype=bool)
    while len(bands) < MOST_BANDS:
        best = int(np.where(free, found, -1.0).argmax())
        chance = min(_share_as_large(by_chance, found[best]), _bound(found[best], len(first)))
        if not free.any() or chance > CHANCE:
            break
        inside = (index >= first[best]) & (index <= last[best])
        bands.append(
            Band(
                low=float(place[inside].min()),
                high=float(place[inside].max()),
                seen=int(inside.sum()),
                failed=int(failed[inside].sum()),
                expected=float(probability[inside].sum()),
                chance=chance,
            )
        )
        free &= (last < first[best]) | (first > last[best])
    return bands


def _largest_by_chance(
    ratios: Callable[[NDArray[np.bool_]], Array], probability: Array, order: NDArray[np.intp], best: float
) -> Array:
    """Return the largest ratio of any band in simulated sets of data (set,); best: what it is to be held against.

    ratios: (set, datum) -> (set, band); order: (datum,) in which they are drawn.
    """
    rng, largest, place = np.random.default_rng(SEED), np.empty(0), np.argsort(order)
    for _ in range(1 + MORE):
        drawn = rng.random((SIMULATIONS, len(order))) < probability[order]
        largest = np.append(largest, ratios(drawn[:, place]).max(axis=1))
        if not LEAST_CHANCE < _share_as_large(largest, best) < CHANCE:
            break
    return largest


def _share_as_large(by_chance: Array, ratio: float) -> float:
    """Return the chance of a ratio as large, among simulated ones and itself."""
    # Sums of the same numbers in another order differ by rounding.
    return (1 + int((by_chance >= ratio * (1.0 - 1e-9)).sum())) / (1 + len(by_chance))


def _bound(ratio: float, bands: int) -> float:
    """Return what the chance of a ratio as large in any of so many bands does not exceed, whatever was simulated.

    By Chernoff's bound for independent failures that is exp(-ratio) in each.
    """
    return float(bands * np.exp(-ratio))


def _places(place: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the distinct places ascending, and which one each datum (datum,) lies at; many are joined to some."""
    value, index = np.unique(place, return_inverse=True)
    if len(value) > MOST_PLACES:
        rank = np.cumsum(np.bincount(index)) / len(place)
        joined = np.minimum((rank * MOST_PLACES).astype(np.intp), MOST_PLACES - 1)
        value, again = np.unique(joined, return_inverse=True)
        index = again[index]
    return value.astype(float), index


def _within(counts: Array, first: NDArray[np.intp], last: NDArray[np.intp]) -> Array:
    """Return sums of counts (..., place) from first to last place (band,): (..., band)."""
    total = np.concatenate([np.zeros((*counts.shape[:-1], 1)), np.cumsum(counts, axis=-1)], axis=-1)
    return np.asarray(total[..., last + 1] - total[..., first])


def _ratios(failed: Array, expected: Array) -> Array:
    """Return the log-likelihood ratio of a raised rate of failures, that of rare ones; 0 where it is not raised."""
    ratio = np.maximum(failed, 1e-300) / expected
    return np.where(ratio > 1.0, failed * np.log(ratio) - (failed - expected), 0.0)
