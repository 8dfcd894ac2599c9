"""Which inputs of a design the limit depth depends on: swings one at a time, or shares of its variance.

What is looked at is the lowest limit depth of a cut over all speeds, by its logarithm.
"""

from typing import Any

import numpy as np
import pandas as pd
import scipy
import xarray as xr
from SALib.analyze import sobol

from pipeline.dataset_tables import deepest_mm, inputs_table, limit_or_deepest, stable_throughout

#: Fewer cuts than this for each input say nothing of shares.
FEWEST_EACH = 8
#: Of intervals, by drawing cuts anew; classes that a known input is sorted into.
CONFIDENCE, SEED, CLASSES = 0.9, 1, 8
KEY = "key"


def sensitivity(data: xr.Dataset) -> tuple[pd.DataFrame, str]:
    """Return a table of what the limit depth depends on, the largest first, and what its numbers are, in a sentence.

    The table is empty where the design, or what was computed of it, does not tell.
    """
    limit = limit_or_deepest(data)
    known = ~np.isnan(limit).any(axis=1)
    without_boundary = known & stable_throughout(data).all(axis=1)
    told, text = _told(data, np.where(known, limit.min(axis=1), np.nan), known, bool(without_boundary[0]))
    if count := np.count_nonzero(without_boundary):
        of = f"{count} of {np.count_nonzero(known)} cuts"
        text += f" {of} are stable down to {deepest_mm(data):g} mm at all speeds, and count with that depth."
    return told, text


def _told(data: xr.Dataset, lowest: np.ndarray, known: np.ndarray, at_least: bool) -> tuple[pd.DataFrame, str]:
    """Return what ``sensitivity`` does, of lowest limit depths (row,) [mm], NaN where not known at all speeds (row,).

    at_least: whether that of the first row, which may be the machine as described, is only a bound.
    """
    sampling = data.attrs["settings"]["design"]["sampling"]
    if sampling == "one_at_a_time":
        return _swings(data, lowest, at_least)
    keys = [str(key) for key in data["input_key"].values]
    numbers = data["input"].values.reshape(-1, len(keys))
    if sampling == "grid" or known.sum() < FEWEST_EACH * len(keys) or np.ptp(lowest[known]) == 0.0:
        few = f"of {len(keys)} inputs at least {FEWEST_EACH * len(keys)} cuts are needed, not of a grid"
        return pd.DataFrame(), f"Shares of inputs are not told: {few}, with limits that differ."
    if sampling == "saltelli":
        return _indices(keys, lowest, known)
    return _of_given(keys, numbers[known], np.log(lowest[known]))


def _swings(data: xr.Dataset, lowest: np.ndarray, at_least: bool) -> tuple[pd.DataFrame, str]:
    """Return the change of the lowest limit depth with each key at its low and its high end, in per cent."""
    if np.isnan(lowest[0]):
        return pd.DataFrame(), "Changes are not told: the machine as described has no result at some speed."
    told = inputs_table(data)
    rows = []
    for place, key in enumerate(told.columns):
        low, high = (1 + 2 * place + end for end in (0, 1))
        change = 100.0 * (lowest[[low, high]] / lowest[0] - 1.0)
        rows.append(
            {
                KEY: key,
                "low": told[key][low],
                "high": told[key][high],
                "change_at_low_percent": change[0],
                "change_at_high_percent": change[1],
            }
        )
    table = pd.DataFrame(rows)
    order = np.abs(table[["change_at_low_percent", "change_at_high_percent"]]).max(axis=1).fillna(0.0)
    described = f"{'at least ' if at_least else ''}{lowest[0]:.3g} mm"
    text = f"Change of the lowest limit depth, {described} as described, with one key at its low and high end."
    return table.iloc[np.argsort(-order.values, kind="stable")].reset_index(drop=True), text


def _indices(keys: list[str], lowest: np.ndarray, known: np.ndarray) -> tuple[pd.DataFrame, str]:
    """Return Sobol's indices of first order and in total, from the blocks that were drawn for them."""
    if not known.all():
        return pd.DataFrame(), f"Sobol's indices are not told: {int((~known).sum())} cuts have no result at some speed."
    problem = {"num_vars": len(keys), "names": keys, "bounds": [[0.0, 1.0]] * len(keys)}
    found = sobol.analyze(problem, np.log(lowest), calc_second_order=False, conf_level=CONFIDENCE, seed=SEED)
    columns = {"share": "S1", "share_half_interval": "S1_conf", "total_share": "ST", "total_half_interval": "ST_conf"}
    table = _table(keys, {name: found[told] for name, told in columns.items()}, "total_share")
    return table, "Share of the variance of ln(lowest limit depth) by one input, and with all its interactions (Sobol)."


def _of_given(keys: list[str], numbers: np.ndarray, logarithm: np.ndarray) -> tuple[pd.DataFrame, str]:
    """Return how far each input moves the distribution, and to which side, of any sample."""
    varies = np.ptp(numbers, axis=0) > 0.0
    distance, correlation = np.zeros((2, len(keys)))
    distance[varies] = [_distance(column, logarithm) for column in numbers[:, varies].T]
    correlation[varies] = [scipy.stats.spearmanr(column, logarithm).statistic for column in numbers[:, varies].T]
    table = _table(keys, {"rank_correlation": correlation, "distance": distance}, "distance")
    text = "Distance between the distribution of the lowest limit depth and that with one input known (PAWN, 0 to 1)."
    return table, text


def _distance(known: np.ndarray, told: np.ndarray) -> float:
    """Return the PAWN index: the median Kolmogorov-Smirnov distance of what is told (row,) where ``known`` is known.

    Of few values each is a class; classes of many are about equally large. SALib's are half-open and leave out the
    largest value, which of a choice among two is half of what there is to know.
    """
    values = np.unique(known)
    edges = values[1:] if len(values) <= CLASSES else np.quantile(known, np.arange(1, CLASSES) / CLASSES)
    classes = np.searchsorted(edges, known, side="right")
    return float(np.median([scipy.stats.ks_2samp(told[classes == one], told).statistic for one in np.unique(classes)]))


def _table(keys: list[str], columns: dict[str, Any], by: str) -> pd.DataFrame:
    table = pd.DataFrame({KEY: keys, **{name: np.asarray(values, dtype=float) for name, values in columns.items()}})
    return table.sort_values(by, ascending=False, kind="stable").reset_index(drop=True)
