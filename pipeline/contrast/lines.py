"""The boundaries of a study of either kind, a line over speed each, and the reading of them."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from chatter_core.errors import InvalidInput
from chatter_core.units import SUFFIXES
from chatter_core.variables import WITH_RESULT
from pipeline import report, store
from pipeline.best_cuts import best_cuts
from pipeline.dataset_tables import RATE, inputs_table, samples_table
from pipeline.kinds import kind_of
from pipeline.lobes import OUTER, nothing_missed
from pipeline.places import LOBES, Place

#: The two studies, as options, columns and pictures name them.
STUDIES = ("first", "second")
#: What is read of a boundary, and the fields that hold it.
AT_LIMIT = {
    "limit": "limit_depth",
    "frequency": "limit_chatter_frequency",
    "mode": "limit_dominant_mode",
    "loss": "limit_bifurcation",
}
#: Columns of the best cut of a line.
BEST = ("spindle_speed_rpm", "axial_depth_mm", RATE)


@dataclass(frozen=True, kw_only=True)
class Lines:
    """Boundaries of a study, in the units of the border.

    place: as people name it; attributes: of its store; labels: (line,) parameters, preload and modes, or machine and
    cut; inputs: (line,) what varies in a data set; speed: (speed,); deepest: down to which limits were looked for;
    limit, frequency, mode, loss: (line, speed) at the first limit depth, NaN or 0 where none is; known: (line, speed)
    whether there is a result, and a boundary or none for sure; best: (line,) the cut that removes most; radius:
    (line, speed, depth) at depth (depth,), of sweeps alone, NaN without a result; step: that every so manieth speed
    was read.
    """

    place: str
    attributes: dict[str, Any]
    labels: pd.DataFrame
    speed: np.ndarray
    deepest: float
    limit: np.ndarray
    frequency: np.ndarray
    mode: np.ndarray
    loss: np.ndarray
    known: np.ndarray
    best: pd.DataFrame
    inputs: pd.DataFrame | None = None
    depth: np.ndarray | None = None
    radius: np.ndarray | None = None
    step: int = 1

    @property
    def is_sweep(self) -> bool:
        """Whether the study is a sweep, and not a data set."""
        return self.radius is not None


def read(place: Place, margins: dict[str, float]) -> Lines:
    """Return the boundaries of the study in a place; margins: of its best cuts, by their keys.

    Raises InvalidInput where it cannot be read.
    """
    group = store.check(place)
    step = report.shown_step(store.chunks(group)) if place.root == LOBES else 1
    names = [*AT_LIMIT.values(), "limits_complete", "status", "spectral_radius" if place.root == LOBES else "input"]
    names += [] if place.root == LOBES else ["split"]
    with store.readable(place) as opened:
        data = opened[names]
        _require_units(place, data)
        data = data.isel(spindle_speed=slice(None, None, step)).load()
        data.attrs = {**opened.attrs, "margins": margins}
    return _of_sweep(str(place), data, step) if place.root == LOBES else _of_dataset(str(place), data)


def _require_units(place: Place, data: xr.Dataset) -> None:
    """Raise InvalidInput where a store has other units than the program: its numbers would be taken for others."""
    kind = kind_of(place)
    wanted = {name: kind.chunked[name].unit for name in AT_LIMIT.values()}
    wanted |= {name: SUFFIXES[suffix][1] for name, (suffix, _) in kind.coordinates.items() if suffix}
    found = {name: data[name].attrs.get("units", "no unit") for name in wanted if name in data.variables}
    wrong = [f"found {name} in {unit}, allowed: {wanted[name]}" for name, unit in found.items() if unit != wanted[name]]
    if wrong:
        raise InvalidInput([f"{place.where(place.root)}: {one}" for one in wrong])


def _of_sweep(place: str, lobes: xr.Dataset, step: int) -> Lines:
    lobes = lobes.transpose(*OUTER, "spindle_speed", "axial_depth", "crossing")
    speeds, depth = lobes["spindle_speed"].values, lobes["axial_depth"].values
    axes = pd.MultiIndex.from_product([lobes[name].values for name in OUTER], names=OUTER)
    cuts = best_cuts(lobes).set_index(list(OUTER)).reindex(axes)
    known = lobes["status"].isin(WITH_RESULT).values.reshape(-1, len(speeds), len(depth))
    return Lines(
        place=place,
        attributes=lobes.attrs,
        labels=axes.to_frame(index=False),
        speed=speeds,
        deepest=float(depth[-1]),
        known=known.all(axis=-1) & _nothing_missed(lobes.isel(crossing=0), len(speeds)),
        best=pd.DataFrame(
            {
                name: cuts[column].values
                for name, column in zip(BEST, ("spindle_speed", "axial_depth", RATE), strict=True)
            }
        ),
        depth=depth,
        radius=np.where(known, lobes["spectral_radius"].values.reshape(known.shape), np.nan),
        step=step,
        **_at_limit(lobes.isel(crossing=0), len(speeds)),
    )


def _of_dataset(place: str, data: xr.Dataset) -> Lines:
    speeds, samples = data["spindle_speed"].values, samples_table(data)
    return Lines(
        place=place,
        attributes=data.attrs,
        labels=samples[["machine", "cut"]],
        inputs=inputs_table(data),
        speed=speeds,
        deepest=float(data.attrs["settings"]["design"]["deepest_mm"]),
        known=np.isin(data["status"].values, WITH_RESULT).reshape(-1, len(speeds)) & _nothing_missed(data, len(speeds)),
        best=pd.DataFrame(
            {
                name: samples[column].values
                for name, column in zip(BEST, ("with_spindle_speed_rpm", "with_axial_depth_mm", RATE), strict=True)
            }
        ),
        **_at_limit(data, len(speeds)),
    )


def _nothing_missed(data: xr.Dataset, speeds: int) -> np.ndarray:
    missed_none: np.ndarray = nothing_missed(data["limit_depth"], data["limits_complete"]).values
    return missed_none.reshape(-1, speeds)


def _at_limit(data: xr.Dataset, speeds: int) -> dict[str, Any]:
    return {field: data[name].values.reshape(-1, speeds) for field, name in AT_LIMIT.items()}
