"""The cuts that remove most: the largest stable removal rate of each line of lobes, with margins for what is unsure."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.lobes import OUTER, known_limit, stability_limit
from pipeline.settings import Margins, margins_of

#: Speeds that differ by less than this, relative to them, are the same: grids are rounded.
SAME = 1e-9


def removal_rate(machine: dict[str, Any], spindle_speed_rpm: Any, axial_depth_mm: Any) -> Any:
    """Return the volume that a cut removes [cm3/min]: depth times radial depth times feed speed.

    machine: its description, with tool and process; the others are of one shape.
    """
    tool, process = machine["tool"], machine["process"]
    share = 1.0 if process["direction"] == "slot" else process["radial_immersion"]
    width = share * tool["diameter_mm"]
    return axial_depth_mm * width * tool["teeth"] * process["feed_per_tooth_mm"] * spindle_speed_rpm * 1e-3


def safe_depth(limit: np.ndarray, speed: np.ndarray, margins: Margins) -> np.ndarray:
    """Return the depth that stays below the limit depths (..., speed) at each speed (speed,) and near it, less some.

    Where what is near ends between two speeds, the boundary runs straight from one to the other: a grid may be coarser
    than the margin. NaN where a limit nearby is, and at speeds so near to the ends that part of what is near was not
    computed.
    """
    margin = 0.01 * margins.speed
    # Speeds ascend: those that are near to one stand side by side.
    first = np.searchsorted(speed, speed * (1.0 - margin - SAME))
    last = np.searchsorted(speed, speed * (1.0 + margin + SAME), side="right")
    least = np.stack([limit[..., a:b].min(axis=-1) for a, b in zip(first, last, strict=True)], axis=-1)
    for share in (1.0 - margin, 1.0 + margin):
        least = np.minimum(least, _between(limit, speed, share * speed))
    inside = (speed * (1.0 - margin) >= speed[0]) & (speed * (1.0 + margin) <= speed[-1])
    return (1.0 - 0.01 * margins.depth) * np.where(inside, least, np.nan)


def _between(limit: np.ndarray, speed: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return limit depths (..., speed) interpolated over speed (speed,) to those wanted (wanted,).

    NaN where a neighbour's is; beyond the ends that of the end.
    """
    after = np.searchsorted(speed, wanted * (1.0 - SAME)).clip(max=len(speed) - 1)
    before = np.where(speed[after] > wanted * (1.0 + SAME), np.maximum(after - 1, 0), after)
    span = np.where(before < after, speed[after] - speed[before], np.inf)
    share = (wanted - speed[before]) / span
    return np.asarray(limit[..., before] + share * (limit[..., after] - limit[..., before]))


def best_cuts(lobes: xr.Dataset) -> pd.DataFrame:
    """Return the cut with the largest stable removal rate of every line of lobes, a row each."""
    known = known_limit(lobes).transpose(*OUTER, "spindle_speed")
    speed, machine = lobes["spindle_speed"].values, lobes.attrs["settings"]["machine"]
    depth = safe_depth(known.values, speed, margins_of(lobes.attrs))
    limit = stability_limit(lobes).transpose(*OUTER, "spindle_speed").values
    rows = []
    for place in np.ndindex(*depth.shape[:-1]):
        rate = removal_rate(machine, speed, depth[place])
        if np.isnan(rate).all():
            continue
        best = int(np.nanargmax(rate))
        rows.append(
            {
                **{name: known[name].values[i] for name, i in zip(OUTER, place, strict=True)},
                "spindle_speed": speed[best],
                "axial_depth": depth[place][best],
                "removal_rate_cm3_min": rate[best],
                # Deeper than the grid nothing is known: such a cut may be far from its boundary.
                "limit_above_grid": bool(np.isnan(limit[place][best])),
            }
        )
    columns = [*OUTER, "spindle_speed", "axial_depth", "removal_rate_cm3_min", "limit_above_grid"]
    return pd.DataFrame(rows, columns=columns)
