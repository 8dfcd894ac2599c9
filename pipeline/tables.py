"""Tables of a sweep as CSV files."""

from pathlib import Path

import pandas as pd
import xarray as xr

from chatter_core.units import SUFFIXES
from chatter_core.variables import STRUCTURE
from pipeline import csv_files
from pipeline.best_cuts import best_cuts
from pipeline.lobes import crossover_speeds, dominance

#: Unit suffixes of the coordinates, for the headers.
COORDINATES = {"preload": "n", "spindle_speed": "rpm", "axial_depth": "mm"}
#: Variables of the bearing: those of the structure without modes.
BEARING = tuple(name for name, variable in STRUCTURE.items() if len(variable.dims) == 3)
#: Variables of the modes.
MODES = tuple(name for name, variable in STRUCTURE.items() if len(variable.dims) > 3)
#: Variables at the boundary.
LIMITS = ("limit_depth", "limit_chatter_frequency", "limit_dominant_mode", "limit_bifurcation")


def write(lobes: xr.Dataset, folder: Path) -> list[Path]:
    """Write every table of a sweep into a folder and return the paths."""
    tables = {
        "limit_depths": _frame(lobes, LIMITS, "limit_depth"),
        "bearing": _frame(lobes, BEARING, "radial_stiffness"),
        "modes": _frame(lobes, MODES, "natural_frequency"),
        "dominant_modes": dominance(lobes).rename(columns=_header),
        "crossover_speeds": crossover_speeds(lobes).rename(columns=_header),
        "best_cuts": best_cuts(lobes).rename(columns=_header),
    }
    return csv_files.write(tables, folder)


def _frame(lobes: xr.Dataset, names: tuple[str, ...], required: str) -> pd.DataFrame:
    """Return variables as a long table, without the rows in which ``required`` is missing."""
    frame = lobes[list(names)].to_dataframe().reset_index().dropna(subset=[required])
    units = {name: lobes[name].attrs.get("units", "1") for name in names}
    suffix = {unit: key for key, (_, unit) in SUFFIXES.items()}
    headers = {name: f"{name}_{suffix[unit]}" for name, unit in units.items() if unit in suffix}
    return frame.rename(columns=headers).rename(columns=_header)


def _header(name: str) -> str:
    return f"{name}_{COORDINATES[name]}" if name in COORDINATES else name
