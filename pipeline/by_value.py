"""Limit depths over speed by the values of one input: the median of all cuts that have a value, and a band of them."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from pipeline.dataset_tables import inputs_table, limit_or_deepest, quantiles
from pipeline.page import cell

#: Values of an input that a picture tells apart.
FEWEST, MOST = 2, 12
#: Cuts that are shown one by one, or by all their range; of more it is their middle part.
FEW = 24
#: Shares of the cuts of a value below the band's lower edge, the line, and the upper edge.
ALL, MIDDLE_HALF = (0.0, 0.5, 1.0), (0.25, 0.5, 0.75)


@dataclass(frozen=True, kw_only=True)
class OfValue:
    """What limit depths are where an input has a value.

    name: the value as people read it; cuts: how many have it and a limit depth; middle, their median, with low and
    high, the band of all of them or of their middle half: (speed,) [mm], NaN where nothing is known.
    """

    name: str
    cuts: int
    low: np.ndarray
    middle: np.ndarray
    high: np.ndarray


def by_value(data: xr.Dataset) -> dict[str, list[OfValue]]:
    """Return limit depths by the values of every input that has few, numbers in their order, words in the design's."""
    told, numbers = inputs_table(data), data["input"].values.reshape(-1, data.sizes["input_key"])
    limit = limit_or_deepest(data)
    alone = data.attrs["settings"]["design"]["sampling"] == "one_at_a_time"
    found = {}
    for place, key in enumerate(told.columns):
        # One at a time, the others are as described where this one varies: in its own two machines and the first.
        rows = np.array([0, 1 + 2 * place, 2 + 2 * place]) if alone else np.arange(len(limit))
        values = np.unique(numbers[rows, place])
        if FEWEST <= len(values) <= MOST:
            own = [rows[numbers[rows, place] == value] for value in values]
            found[str(key)] = [_of_value(cell(told[key].iloc[those[0]]), limit[those]) for those in own]
    return found


def _of_value(name: str, limit: np.ndarray) -> OfValue:
    cuts = int(np.count_nonzero(~np.isnan(limit).all(axis=1)))
    low, middle, high = quantiles(limit, ALL if cuts <= FEW else MIDDLE_HALF)
    return OfValue(name=name, cuts=cuts, low=low, middle=middle, high=high)
