"""What a data set says of every cut in one row: what varies, its lowest limit depth, and the cut that removes most."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray as xr

from chatter_core.variables import STATUS
from pipeline.best_cuts import SAME, removal_rate, safe_depth
from pipeline.design import PARTS, Description, Design
from pipeline.design.distributions import Distribution
from pipeline.kinds import KINDS
from pipeline.kinds.dataset import descriptions
from pipeline.lobes import filled_limit
from pipeline.places import DATASET
from pipeline.progress import watched
from pipeline.settings import margins_of

#: Inputs that the name of a cut says.
MOST_NAMED = 3
#: Columns of the table behind those of what varies.
LOWEST, RATE = "lowest_limit_depth_mm", "removal_rate_cm3_min"
#: Columns that say of a lowest limit depth, and of the cut that removes most, that no boundary was found there.
LOWEST_ABOVE, BEST_ABOVE = "limit_above_deepest", "with_limit_above_deepest"


def inputs_table(data: xr.Dataset) -> pd.DataFrame:
    """Return what varies, a column for each key and a row for each cut, as a description says it."""
    numbers = data["input"].values.reshape(-1, data.sizes["input_key"])
    varied = Design.model_validate(data.attrs["settings"]["design"]).varied
    return pd.DataFrame({key: _as_said(one, numbers[:, place]) for place, (key, one) in enumerate(varied.items())})


def _as_said(varied: Distribution, numbers: np.ndarray) -> np.ndarray:
    """Return what a description says for drawn numbers, each asked for once."""
    drawn, place = np.unique(numbers, return_inverse=True)
    return np.array([varied.value(float(number)) for number in drawn])[place]


def numbered(words: Sequence[str]) -> str:
    """Return words each with the number that stands for it."""
    return ", ".join(f"{number} {word}" for number, word in enumerate(words))


def limit_or_deepest(data: xr.Dataset) -> np.ndarray:
    """Return limit depths (machine by cut, speed) [mm], the deepest depth where no boundary lies above it.

    NaN where there is no result, and where no boundary was found but one may have been missed.
    """
    limit = filled_limit(data["limit_depth"].astype(float), data["limits_complete"], deepest_mm(data))
    known = with_result(data)
    return np.where(known, limit.values.reshape(known.shape), np.nan)


def deepest_mm(data: xr.Dataset) -> float:
    """Return the depth down to which limit depths were looked for [mm]."""
    return float(data.attrs["settings"]["design"]["deepest_mm"])


def with_result(data: xr.Dataset) -> np.ndarray:
    """Return where there is a result (machine by cut, speed)."""
    found: np.ndarray = (data["status"].values == STATUS["ok"]).reshape(-1, data.sizes["spindle_speed"])
    return found


def stable_throughout(data: xr.Dataset) -> np.ndarray:
    """Return where a cut is stable down to the deepest depth, for all that is known (machine by cut, speed)."""
    known = np.isfinite(limit_or_deepest(data))
    stable: np.ndarray = known & np.isnan(data["limit_depth"].values).reshape(known.shape)
    return stable


def quantiles(limit: np.ndarray, shares: Sequence[float]) -> np.ndarray:
    """Return quantiles (share, speed) of the limit depths (cut, speed) that are known, NaN where none is."""
    found = np.full((len(shares), limit.shape[1]), np.nan)
    known = ~np.isnan(limit).all(axis=0)
    found[:, known] = np.nanquantile(limit[:, known], shares, axis=0)
    return found


def samples_table(data: xr.Dataset) -> pd.DataFrame:
    """Return a row for each cut: its numbers, part, what varies, lowest limit depth, and the cut that removes most.

    The latter keeps from its boundary as the margins of the store say. Two columns tell where the deepest depth stands
    for a boundary that lies deeper than all depths that were looked at.
    """
    machines, cuts = data.sizes["machine"], data.sizes["cut"]
    limit = limit_or_deepest(data)
    speed = data["spindle_speed"].values
    settled = np.nan_to_num(limit, nan=np.inf)
    lowest = settled.argmin(axis=1)
    rows = np.arange(len(limit))
    known = ~np.isnan(limit).all(axis=1)
    best = _best(data, limit, speed)
    return pd.DataFrame(
        {
            "machine": np.repeat(data["machine"].values, cuts),
            "cut": np.tile(data["cut"].values, machines),
            "part": np.repeat([PARTS[code] for code in data["split"].values], cuts),
            **inputs_table(data),
            LOWEST: np.where(known, settled[rows, lowest], np.nan),
            "at_spindle_speed_rpm": np.where(known, speed[lowest], np.nan),
            LOWEST_ABOVE: stable_throughout(data)[rows, lowest],
            RATE: best.rate,
            "with_spindle_speed_rpm": best.speed,
            "with_axial_depth_mm": best.depth,
            BEST_ABOVE: best.above_deepest,
            "speeds_without_result": np.isnan(limit).sum(axis=1),
        }
    )


def removal_factors(data: xr.Dataset, rows: Sequence[int]) -> np.ndarray:
    """Return what cuts remove for each mm of depth and rpm [cm3/min] (row,); rows: their places."""
    said, cuts = KINDS[DATASET].described(data.attrs, lambda name: data[name].values), data.sizes["cut"]

    @lru_cache(maxsize=1)
    def cuts_of(machine: int) -> list[Description]:
        return descriptions(said.base, said.design, said.numbers[machine])

    each = watched(rows, len(rows), "cuts reported")
    return np.array([removal_rate(cuts_of(row // cuts)[row % cuts], 1.0, 1.0) for row in each])


class _Best(NamedTuple):
    """The cut that removes most (row,): speed [rpm], depth [mm], rate [cm3/min], NaN where none is safe.

    above_deepest: whether no boundary was found at its speed and near it, so that it may be far from one.
    """

    speed: np.ndarray
    depth: np.ndarray
    rate: np.ndarray
    above_deepest: np.ndarray


def _best(data: xr.Dataset, limit: np.ndarray, speed: np.ndarray) -> _Best:
    margins = margins_of(data.attrs)
    depth = safe_depth(limit, speed, margins)
    rate = removal_factors(data, range(len(limit)))[:, None] * depth * speed
    rows, best = np.arange(len(limit)), np.nan_to_num(rate, nan=-np.inf).argmax(axis=1)
    safe = ~np.isnan(rate[rows, best])
    # The deepest depth stands for a boundary that lies deeper: nothing nearby lies above it.
    unbounded = (1.0 - 0.01 * margins.depth) * deepest_mm(data)
    return _Best(
        speed=np.where(safe, speed[best], np.nan),
        depth=depth[rows, best],
        rate=rate[rows, best],
        above_deepest=depth[rows, best] >= (1.0 - SAME) * unbounded,
    )
