"""Figures of a data set: limit depths over speed, and what they depend on."""

from collections.abc import Sequence
from pathlib import Path

import matplotlib
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from pipeline.by_value import FEW, OfValue, by_value
from pipeline.dataset_tables import limit_or_deepest, quantiles
from pipeline.figures import COLOURS, draw_line, panel
from pipeline.page import cell
from pipeline.sensitivity import KEY

matplotlib.use("Agg")

#: Shares of all cuts between which bands lie.
BANDS = ((0.1, 0.9), (0.25, 0.75))
#: Inputs that a picture holds, the largest.
MOST_INPUTS = 20
#: Columns that a bar shows, each with that of the half width of its interval if there is one.
SHOWN = {"total_share": "total_half_interval", "distance": None}


def write(data: xr.Dataset, told: pd.DataFrame, text: str, folder: Path) -> list[Path]:
    """Write every figure of a data set into a folder and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    made = {"limit_depths": limits_over_speed(data)}
    values = by_value(data)
    if values:
        made["limit_depths_by_value"] = limits_by_value(data["spindle_speed"].values, *next(iter(values.items())))
    if not told.empty:
        made["sensitivity"] = tornado(told, text)
    paths = []
    for name, figure in made.items():
        paths.append(folder / f"{name}.png")
        figure.savefig(paths[-1], dpi=150)
    return paths


def limits_over_speed(data: xr.Dataset) -> Figure:
    """Draw limit depths over speed, each cut's own where there are few, else their median and bands."""
    figure, axes = panel("Limit depths over spindle speed")
    speed, limit = data["spindle_speed"].values, limit_or_deepest(data)
    if len(limit) <= FEW:
        for row, line in enumerate(limit):
            draw_line(axes, speed, line, lw=1.2, color=COLOURS[row % len(COLOURS)])
    else:
        for low, high in BANDS:
            below, above = quantiles(limit, (low, high))
            axes.fill_between(speed, below, above, color=COLOURS[0], alpha=0.25, label=f"{low:.0%} to {high:.0%}")
        draw_line(axes, speed, quantiles(limit, (0.5,))[0], color=COLOURS[0], label="median of all cuts")
        # An axis of nothing, where no cut is computed yet, has no logarithm.
        axes.set_yscale("linear" if np.isnan(limit).all() else "log")
        axes.legend(frameon=False)
    axes.set_xlabel("spindle speed [rpm]")
    axes.set_ylabel("limit depth [mm]")
    return figure


def limits_by_value(speed: np.ndarray, key: str, values: Sequence[OfValue]) -> Figure:
    """Draw limit depths over speed [rpm], a line and a band for each value of an input."""
    figure, axes = panel(f"Limit depths over spindle speed by {key}")
    for colour, own in zip(ordered_colours(len(values)), values, strict=True):
        axes.fill_between(speed, own.low, own.high, color=colour, alpha=0.08, lw=0)
        draw_line(axes, speed, own.middle, color=colour, lw=1.6, label=own.name)
    axes.set_xlabel("spindle speed [rpm]")
    axes.set_ylabel("limit depth [mm]")
    axes.legend(frameon=False, ncols=1 + len(values) // 4, fontsize=8)
    return figure


def ordered_colours(count: int) -> list[str]:
    """Return colours in an order that is seen, readable on light and on dark."""
    return [to_hex(colour) for colour in matplotlib.colormaps["turbo"](np.linspace(0.1, 0.9, count))]


def tornado(told: pd.DataFrame, text: str) -> Figure:
    """Draw what the limit depth depends on, the largest on top."""
    shown = told.head(MOST_INPUTS).iloc[::-1]
    figure = Figure(figsize=(8.0, 1.2 + 0.32 * len(shown)), layout="constrained")
    axes = figure.add_subplot()
    place = np.arange(len(shown))
    if "change_at_low_percent" in shown:
        for end, colour in (("low", COLOURS[0]), ("high", COLOURS[1])):
            axes.barh(place, shown[f"change_at_{end}_percent"], color=colour, label=f"at the {end} end")
        labels = [f"{row.key}\n{cell(row.low)} to {cell(row.high)}" for row in shown.itertuples()]
        axes.axvline(0.0, color="black", lw=0.8)
        axes.set_xlabel("change of the lowest limit depth [%]")
        axes.legend(frameon=False)
    else:
        name = next(name for name in SHOWN if name in shown)
        axes.barh(
            place,
            shown[name],
            xerr=None if SHOWN[name] is None else shown[SHOWN[name]],
            color=COLOURS[0],
            ecolor="grey",
        )
        labels = list(shown[KEY])
        axes.set_xlabel(name.replace("_", " "))
    axes.set_yticks(place, labels, fontsize=8)
    axes.set_title(text, fontsize=9, loc="left", wrap=True)
    return figure
