"""Figures of a sweep, each a function of the opened store."""

from collections.abc import Callable, Mapping
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from pipeline.kinds.lobes import modes_in_words
from pipeline.lobes import known_limit, main_parameters, of_main_parameters, stability_limit

matplotlib.use("Agg")

#: Colours that stay apart for colour-blind readers (Okabe and Ito), by order of use.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
STYLE = {"dynamic": "-", "static": "--"}
#: Lines of the modes of an axis, what is drawn of them, and by how little those of two axes differ that are the same.
AXIS_STYLE = {"x": "-", "y": "--"}
OF_MODES = ("natural_frequency", "modal_stiffness", "modal_mass", "damping_ratio")
ALIKE = 1e-6
STABLE = "#E8F3EC"
#: Borders of the colours of the spectral radius, narrow around one.
RADIUS_LEVELS = (0.4, 0.6, 0.8, 0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1, 1.25, 1.67, 2.5)


def write(lobes: xr.Dataset, folder: Path, preload: float) -> list[Path]:
    """Write every figure of a sweep into a folder and return the paths.

    ``preload`` [N] is the one shown where a figure holds one preload only.
    """
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name, draw in _figures(lobes).items():
        figure = draw(lobes, preload)
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=150)
        paths.append(path)
    return paths


def _figures(lobes: xr.Dataset) -> dict[str, Callable[[xr.Dataset, float], Figure]]:
    wanted: dict[str, Callable[[xr.Dataset, float], Figure]] = {
        "lobes": lobes_static_and_dynamic,
        "lobes_by_preload": lobes_by_preload,
        "lobes_by_mode_count": lobes_by_mode_count,
        "spectral_radius": map_of_spectral_radius,
        "dominant_mode": map_of_dominant_mode,
        "modes": modes_over_speed,
    }
    if bool(lobes["radial_stiffness"].notnull().any()):
        wanted["bearing"] = bearing_over_speed
    return wanted


def lobes_static_and_dynamic(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw the boundary with all modes, bearings at speed against bearings at standstill."""
    figure, axes = panel("Stability lobes: bearings at speed and at standstill")
    modes = int(lobes["mode_count"].max())
    limit = stability_limit(lobes).sel(preload=preload, mode_count=modes)
    for colour, name in zip(COLOURS, limit["modal_parameters"].values, strict=False):
        _boundary(
            axes, limit.sel(modal_parameters=name), color=colour, linestyle=STYLE[name], label=f"{name} parameters"
        )
    stable = of_main_parameters(known_limit(lobes)).sel(preload=preload, mode_count=modes)
    axes.fill_between(stable["spindle_speed"], 0.0, stable, color=STABLE)
    _finish(axes, lobes, f"{_preload_label(lobes, preload)}{modes_label(lobes, modes)}")
    return figure


def lobes_by_preload(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw the boundary with all modes for each preload."""
    figure, axes = panel("Stability lobes by preload")
    modes = int(lobes["mode_count"].max())
    limit = of_main_parameters(stability_limit(lobes)).sel(mode_count=modes)
    for colour, value in zip(cycle(COLOURS), limit["preload"].values, strict=False):
        _boundary(axes, limit.sel(preload=value), color=colour, label=f"{value:g} N")
    _finish(axes, lobes, f"{_parameters(lobes)} parameters, {modes_label(lobes, modes)}")
    return figure


def lobes_by_mode_count(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw the boundary at one preload for each number of modes."""
    figure, axes = panel("Stability lobes by number of modes")
    limit = of_main_parameters(stability_limit(lobes)).sel(preload=preload)
    for colour, value in zip(cycle(COLOURS), limit["mode_count"].values, strict=False):
        _boundary(axes, limit.sel(mode_count=value), color=colour, label=modes_label(lobes, int(value)))
    _finish(axes, lobes, f"{_preload_label(lobes, preload)}{_parameters(lobes)} parameters")
    return figure


def modes_label(lobes: xr.Dataset, number: int) -> str:
    """Return which modes a value of the dimension ``mode_count`` stands for."""
    return modes_in_words(lobes.attrs["settings"]["grid"]["mode_selection"], number)


def effects_on(attributes: Mapping[str, Any]) -> list[str]:
    """Return the names of the effects that a study was computed with, in words."""
    return [name.replace("_", " ") for name in attributes["settings"].get("effects", {})]


def most_modes(lobes: xr.Dataset) -> int:
    """Return the highest number of a mode that may dominate: effects add modes to those that are kept."""
    return int(max(lobes["mode_count"].max(), lobes["dominant_mode"].max()))


def map_of_spectral_radius(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw the spectral radius over speed and depth with its contour at one."""
    figure, axes = panel("Spectral radius of the Floquet multipliers")
    modes = int(lobes["mode_count"].max())
    radius = _map(lobes["spectral_radius"], preload, modes)
    mesh = axes.pcolormesh(
        radius["spindle_speed"],
        radius["axial_depth"],
        radius,
        norm=BoundaryNorm(RADIUS_LEVELS, 256, extend="both"),
        cmap="RdBu_r",
        shading="nearest",
        rasterized=True,
    )
    _contour(axes, radius)
    figure.colorbar(mesh, ax=axes, label="spectral radius (stable below 1)", ticks=RADIUS_LEVELS)
    _finish(axes, lobes, f"{_preload_label(lobes, preload)}{modes_label(lobes, modes)}, black: radius 1", legend=False)
    return figure


def map_of_dominant_mode(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw which mode dominates the critical motion over speed and depth."""
    figure, axes = panel("Dominant mode of the critical motion")
    modes = int(lobes["mode_count"].max())
    dominant = _map(lobes["dominant_mode"], preload, modes)
    radius = _map(lobes["spectral_radius"], preload, modes)
    most = most_modes(lobes)
    palette = ListedColormap(COLOURS[:most]) if most <= len(COLOURS) else matplotlib.colormaps["viridis"]
    mesh = axes.pcolormesh(
        dominant["spindle_speed"],
        dominant["axial_depth"],
        np.ma.masked_equal(dominant.values, 0),
        cmap=palette,
        norm=BoundaryNorm(np.arange(0.5, most + 1), palette.N),
        alpha=0.75,
        shading="nearest",
        rasterized=True,
    )
    _contour(axes, radius)
    figure.colorbar(mesh, ax=axes, label="mode", ticks=np.arange(1, most + 1))
    _finish(axes, lobes, f"{_preload_label(lobes, preload)}{modes_label(lobes, modes)}, black: radius 1", legend=False)
    return figure


def bearing_over_speed(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw stiffness, contact angles, centrifugal force and gyroscopic moment over speed for each preload."""
    figure, grid = panels("One bearing over spindle speed", 2, 2)
    bearing = of_main_parameters(lobes)
    shown = (
        ("radial stiffness [N/\N{MICRO SIGN}m]", ("radial_stiffness",)),
        ("contact angle [deg]", ("inner_contact_angle", "outer_contact_angle")),
        ("centrifugal force on a ball [N]", ("centrifugal_force",)),
        ("gyroscopic moment on a ball [N m]", ("gyroscopic_moment",)),
    )
    for axes, (label, names) in zip(grid.flat, shown, strict=True):
        for colour, value in zip(cycle(COLOURS), bearing["preload"].values, strict=False):
            for name, line in zip(names, ("-", "--"), strict=False):
                title = f"{value:g} N" if line == "-" else None
                values = bearing[name].sel(preload=value)
                draw_line(axes, bearing["spindle_speed"], values, color=colour, linestyle=line, label=title)
        axes.set_ylabel(label)
        over_speed(axes, lobes)
    grid.flat[1].set_title("solid: inner race, dashed: outer race", fontsize="small", loc="right")
    shared_legend(figure, grid.flat[0])
    return figure


def modes_over_speed(lobes: xr.Dataset, preload: float) -> Figure:
    """Draw natural frequency, modal stiffness, mass and damping of the tip modes over speed."""
    where = _preload_label(lobes, preload).removesuffix(", ")
    figure, grid = panels("Modes at the tool tip over spindle speed" + (f", {where}" if where else ""), 2, 2)
    modes = of_main_parameters(lobes).sel(preload=preload)
    drawn, same = axes_of_modes(modes)
    shown = (
        ("natural frequency [Hz]", "natural_frequency", "linear"),
        ("modal stiffness [N/\N{MICRO SIGN}m]", "modal_stiffness", "log"),
        ("modal mass [kg]", "modal_mass", "log"),
        ("damping ratio [-]", "damping_ratio", "linear"),
    )
    for axes, (label, name, scale) in zip(grid.flat, shown, strict=True):
        for axis in drawn:
            for colour, number in zip(cycle(COLOURS), modes["mode"].values, strict=False):
                values = modes[name].sel(axis=axis, mode=number)
                title = f"mode {number}" if axis == drawn[0] else None
                style = {"color": colour, "linestyle": AXIS_STYLE[axis], "label": title}
                draw_line(axes, modes["spindle_speed"], values, **style)
        axes.set_yscale(scale)
        axes.set_ylabel(label)
        over_speed(axes, lobes)
    if not same:
        told = ", ".join(f"{'solid' if AXIS_STYLE[axis] == '-' else 'dashed'}: {axis}" for axis in drawn)
        grid.flat[1].set_title(told, fontsize="small", loc="right")
    shared_legend(figure, grid.flat[0])
    return figure


def axes_of_modes(modes: xr.Dataset) -> tuple[tuple[str, ...], bool]:
    """Return the axes whose modes are drawn, and whether both have the same, of which x is drawn then."""
    x, y = (modes[list(OF_MODES)].sel(axis=axis) for axis in AXIS_STYLE)
    if all(np.allclose(x[name], y[name], rtol=ALIKE, atol=0.0, equal_nan=True) for name in OF_MODES):
        return ("x",), True
    having = tuple(axis for axis, own in (("x", x), ("y", y)) if bool(own["natural_frequency"].notnull().any()))
    return having, False


def _boundary(axes: Axes, limit: xr.DataArray, **style: Any) -> None:
    draw_line(axes, limit["spindle_speed"], limit, linewidth=1.6, **style)


def _contour(axes: Axes, radius: xr.DataArray) -> None:
    """Draw the boundary; the logarithm is nearly linear in depth, so the contour is smooth between cells."""
    if min(radius.shape) > 1:
        place = (radius["spindle_speed"], radius["axial_depth"])
        axes.contour(*place, np.log(radius), levels=[0.0], colors="black", linewidths=1.2)


def _map(array: xr.DataArray, preload: float, modes: int) -> xr.DataArray:
    chosen = of_main_parameters(array).sel(preload=preload, mode_count=modes)
    return chosen.transpose("axial_depth", "spindle_speed")


def _parameters(lobes: xr.Dataset) -> str:
    return main_parameters(lobes["modal_parameters"].values)


def _preload_label(lobes: xr.Dataset, preload: float) -> str:
    return f"preload {preload:g} N, " if bool(lobes["radial_stiffness"].notnull().any()) else ""


def draw_line(axes: Axes, speed: Any, values: Any, **style: Any) -> None:
    """Draw values (speed,) as a line, with a mark where one has no neighbour, of which a line shows nothing."""
    known = np.isfinite(np.asarray(values, dtype=float))
    beside = np.append(known[1:], False) | np.insert(known[:-1], 0, False)
    alone = np.flatnonzero(known & ~beside).tolist()
    if alone:
        style |= {"marker": "o", "markersize": 5.0, "markevery": alone}
    axes.plot(speed, values, **style)


def panel(title: str) -> tuple[Figure, Axes]:
    """Return a figure of one panel."""
    figure = Figure(figsize=(9.0, 5.0), layout="constrained")
    axes = figure.subplots()
    axes.set_title(title, loc="left", fontweight="bold")
    return figure, axes


def panels(title: str, rows: int, columns: int, height: float = 6.5) -> tuple[Figure, np.ndarray]:
    """Return a figure of several panels, as high as said [inch]."""
    figure = Figure(figsize=(10.0, height), layout="constrained")
    figure.suptitle(title, fontweight="bold", x=0.01, ha="left")
    return figure, figure.subplots(rows, columns)


def shared_legend(figure: Figure, axes: Axes) -> None:
    """Place one legend for all panels below them, where it hides no line."""
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)


def over_speed(axes: Axes, lobes: xr.Dataset | xr.DataArray) -> None:
    """Set the horizontal axis to the spindle speeds of what is drawn."""
    speed = lobes["spindle_speed"].values
    if len(speed) > 1:
        axes.set_xlim(speed[0], speed[-1])
    axes.set_xlabel("spindle speed [rpm]")
    axes.grid(alpha=0.3)


def _finish(axes: Axes, lobes: xr.Dataset, note: str, legend: bool = True) -> None:
    over_speed(axes, lobes)
    axes.set_ylim(0.0, float(lobes["axial_depth"].max()))
    axes.set_ylabel("axial depth [mm]")
    axes.set_title(", ".join([note, *effects_on(lobes.attrs)]), loc="right", fontsize="small")
    if legend:
        axes.legend(frameon=False)
