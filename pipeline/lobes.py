"""From a store of a sweep to statements about lobes: crossover speeds, static against dynamic."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import pandas as pd
import xarray as xr

#: Outer dimensions of a sweep: one line of lobes for each combination.
OUTER = ("modal_parameters", "preload", "mode_count")
Labelled = TypeVar("Labelled", xr.Dataset, xr.DataArray)


@dataclass(frozen=True, kw_only=True)
class Misjudged:
    """Speed whose depth the static lobes praise most above what the dynamic ones allow.

    static_above_grid: whether the static limit is deeper than the grid, and at least what is said.
    """

    spindle_speed_rpm: float
    static_limit_mm: float
    dynamic_limit_mm: float
    static_above_grid: bool


def main_parameters(kinds: Iterable[object]) -> str:
    """Return the kind of modal parameters that is told where one alone is: dynamic where it is there, else the first.

    A cut is made by a spindle that turns, whatever order a grid names the kinds in.
    """
    named = [str(kind) for kind in kinds]
    return "dynamic" if "dynamic" in named else named[0]


def of_main_parameters(lobes: Labelled) -> Labelled:
    """Return the part of a study, or of a variable of it, that is told where one kind of parameters alone is."""
    return lobes.sel(modal_parameters=main_parameters(lobes["modal_parameters"].values))


def stability_limit(lobes: xr.Dataset) -> xr.DataArray:
    """Return the depth at which stability is first lost [mm]; NaN where the grid's last depth is stable."""
    return lobes["limit_depth"].isel(crossing=0, drop=True)


def nothing_missed(limit: xr.DataArray, complete: xr.DataArray) -> xr.DataArray:
    """Return where a limit depth was found, or there is none within the depths for sure.

    A cut that chatters from the shallowest depth on, and so has no limit depth, is not one that is stable down to the
    deepest. limit: limit depths, NaN where none was found; complete: limits_complete of a store.
    """
    return limit.notnull() | (complete == 1)


def filled_limit(limit: xr.DataArray, complete: xr.DataArray, deepest: float) -> xr.DataArray:
    """Return limit depths, the deepest depth where the boundary lies above all depths, NaN where it may be missed.

    Arguments as for ``nothing_missed``; deepest: to which depth boundaries were looked for, in the unit of the limit.
    """
    return limit.fillna(deepest).where(nothing_missed(limit, complete))


def known_limit(lobes: xr.Dataset) -> xr.DataArray:
    """Return limit depths [mm], the grid's last depth where the boundary lies above the grid.

    NaN at speeds of which a cell has no result, and where no boundary was found but one may have been missed.
    """
    deepest = float(lobes["axial_depth"].max())
    limit = filled_limit(stability_limit(lobes), lobes["limits_complete"], deepest)
    return limit.where(lobes["spectral_radius"].notnull().all("axial_depth"))


def dominance(lobes: xr.Dataset) -> pd.DataFrame:
    """Return the ranges of speed in which one mode dominates the boundary, a row each.

    Speeds whose boundary lies above the grid belong to no range.
    """
    dominant = lobes["limit_dominant_mode"].isel(crossing=0, drop=True)
    speed = lobes["spindle_speed"].values
    rows = []
    for labels, line in _lines(dominant):
        known = np.flatnonzero(line > 0)
        if not len(known):
            continue
        # A range ends where the mode changes, and where the boundary leaves the grid.
        begins = (np.diff(line[known], prepend=0) != 0) | (np.diff(known, prepend=-2) > 1)
        starts = np.flatnonzero(begins)
        ends = [*(starts[1:] - 1), len(known) - 1]
        for first, last in zip(starts, ends, strict=True):
            rows.append(
                {
                    **labels,
                    "from_rpm": speed[known[first]],
                    "to_rpm": speed[known[last]],
                    "dominant_mode": int(line[known[first]]),
                }
            )
    return pd.DataFrame(rows, columns=[*OUTER, "from_rpm", "to_rpm", "dominant_mode"])


def crossover_speeds(lobes: xr.Dataset) -> pd.DataFrame:
    """Return every speed at which one mode hands the boundary over to another, a row each.

    The crossover speed is the middle between the last speed of the one and the first of the other,
    which are neighbours: where the boundary leaves the grid between two modes, none hands over.
    """
    rows = []
    place = {speed: index for index, speed in enumerate(lobes["spindle_speed"].values)}
    for labels, ranges in dominance(lobes).groupby(list(OUTER), sort=False):
        for before, after in zip(ranges.iloc[:-1].itertuples(), ranges.iloc[1:].itertuples(), strict=True):
            if place[after.from_rpm] - place[before.to_rpm] > 1:
                continue
            rows.append(
                {
                    **dict(zip(OUTER, labels, strict=True)),
                    "crossover_rpm": 0.5 * (before.to_rpm + after.from_rpm),
                    "from_mode": before.dominant_mode,
                    "to_mode": after.dominant_mode,
                }
            )
    return pd.DataFrame(rows, columns=[*OUTER, "crossover_rpm", "from_mode", "to_mode"])


def most_misjudged(lobes: xr.Dataset, preload: float, mode_count: int) -> Misjudged | None:
    """Return the speed at which static lobes allow most beyond the dynamic ones, None without both.

    Where the static boundary lies above the grid it counts as the grid's last depth. Speeds of which
    some cell has no result do not count, nor those where a static limit depth may have been missed.
    """
    if not {"static", "dynamic"} <= set(lobes["modal_parameters"].values):
        return None
    line = lobes.sel(preload=preload, mode_count=mode_count)
    known = known_limit(line)
    limit, static = stability_limit(line), known.sel(modal_parameters="static")
    dynamic = limit.sel(modal_parameters="dynamic")
    ratio = (static / dynamic).where(known.notnull().all("modal_parameters")).values
    if np.isnan(ratio).all():
        return None
    worst = int(np.nanargmax(ratio))
    return Misjudged(
        spindle_speed_rpm=float(lobes["spindle_speed"][worst]),
        static_limit_mm=float(static[worst]),
        dynamic_limit_mm=float(dynamic[worst]),
        static_above_grid=bool(np.isnan(limit.sel(modal_parameters="static")[worst])),
    )


def _lines(array: xr.DataArray) -> list[tuple[dict[str, object], np.ndarray]]:
    """Return the labels and the values over speed of every line of lobes."""
    stacked = array.transpose(*OUTER, "spindle_speed")
    keys = [stacked[name].values for name in OUTER]
    return [
        ({name: values[i] for name, values, i in zip(OUTER, keys, place, strict=True)}, stacked.values[place])
        for place in np.ndindex(*stacked.shape[:-1])
    ]
