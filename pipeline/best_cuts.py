"""The cuts that remove most: the largest stable removal rate of each line of lobes, with margins for what is unsure."""

from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from pipeline.lobes import OUTER, stability_limit

#: Share of the limit depth that is kept free, and share by which the spindle may miss its speed to both sides.
DEPTH_MARGIN, SPEED_MARGIN = 0.1, 0.02


def removal_rate(machine: dict[str, Any], spindle_speed_rpm: Any, axial_depth_mm: Any) -> Any:
    """Return the volume that a cut removes [cm3/min]: depth times radial depth times feed speed.

    machine: its description, with tool and process; the others are of one shape.
    """
    tool, process = machine["tool"], machine["process"]
    share = 1.0 if process["direction"] == "slot" else process["radial_immersion"]
    width = share * tool["diameter_mm"]
    return axial_depth_mm * width * tool["teeth"] * process["feed_per_tooth_mm"] * spindle_speed_rpm * 1e-3


def safe_depth(
    lobes: xr.Dataset, depth_margin: float = DEPTH_MARGIN, speed_margin: float = SPEED_MARGIN
) -> xr.DataArray:
    """Return the depth that stays below the boundary at each speed and near it, less the margin [mm].

    Where the boundary lies above the grid, it is taken to be the grid's last depth. NaN at speeds so near to the ends
    of the grid that part of what is near was not computed, and at those near which a cell has no result.
    """
    limit = stability_limit(lobes).fillna(float(lobes["axial_depth"].max()))
    known = lobes["spectral_radius"].notnull().all("axial_depth")
    least = least_near(np.where(known, limit, np.nan), lobes["spindle_speed"].values, speed_margin)
    return limit.copy(data=(1.0 - depth_margin) * least).rename("safe_depth")


def least_near(limit: np.ndarray, speed: np.ndarray, margin: float = SPEED_MARGIN) -> np.ndarray:
    """Return the least of the limit depths (..., speed) at each speed (speed,) and at those within a margin.

    NaN where one of them is, and where speeds that are near were not computed.
    """
    # Speeds ascend: those that are near to one stand side by side.
    first = np.searchsorted(speed, speed * (1.0 - margin - 1e-9))
    last = np.searchsorted(speed, speed * (1.0 + margin + 1e-9), side="right")
    least = np.stack([limit[..., a:b].min(axis=-1) for a, b in zip(first, last, strict=True)], axis=-1)
    inside = (speed * (1.0 - margin) >= speed[0]) & (speed * (1.0 + margin) <= speed[-1])
    return np.where(inside, least, np.nan)


def best_cuts(lobes: xr.Dataset) -> pd.DataFrame:
    """Return the cut with the largest stable removal rate of every line of lobes, a row each."""
    depth = safe_depth(lobes).transpose(*OUTER, "spindle_speed")
    speed, machine = lobes["spindle_speed"].values, lobes.attrs["settings"]["machine"]
    limit = stability_limit(lobes).transpose(*OUTER, "spindle_speed").values
    rows = []
    for place in np.ndindex(*depth.shape[:-1]):
        rate = removal_rate(machine, speed, depth.values[place])
        if np.isnan(rate).all():
            continue
        best = int(np.nanargmax(rate))
        rows.append(
            {
                **{name: depth[name].values[i] for name, i in zip(OUTER, place, strict=True)},
                "spindle_speed": speed[best],
                "axial_depth": depth.values[place][best],
                "removal_rate_cm3_min": rate[best],
                # Deeper than the grid nothing is known: such a cut may be far from its boundary.
                "limit_above_grid": bool(np.isnan(limit[place][best])),
            }
        )
    columns = [*OUTER, "spindle_speed", "axial_depth", "removal_rate_cm3_min", "limit_above_grid"]
    return pd.DataFrame(rows, columns=columns)
