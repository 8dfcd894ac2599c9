"""The plots of a study's page: lobes, maps over speed and depth, modes and bearing over speed."""

from collections.abc import Callable, Iterator
from itertools import cycle
from typing import Any

import matplotlib
import numpy as np
import xarray as xr
from bokeh.models import ColorBar, ColumnDataSource, FixedTicker, LinearColorMapper, Model
from bokeh.plotting import figure
from matplotlib.colors import to_hex

from chatter_core.variables import BIFURCATION
from pipeline.best_cut_plots import KNOWN, RATE, SPEED, add_best_cut
from pipeline.best_cuts import removal_rate
from pipeline.figures import AXIS_STYLE, COLOURS, RADIUS_LEVELS, STYLE, axes_of_modes, modes_label, most_modes
from pipeline.lobes import known_limit, main_parameters, of_main_parameters, stability_limit
from pipeline.plots import Choices, Key, add_key, hover, numbers, plot
from pipeline.settings import margins_of

#: Most points of a map along speed and depth: finer ones are thinned out, the store holds all.
MAP_SIZE = (400, 160)
#: Most combinations of which maps are held; a page has to stay below some megabytes.
MOST_MAP_POINTS = 2_000_000
PRELOAD, MODES = "preload", "modes"
#: Sizes of marks on a line, and of one that stands alone.
MARK, ALONE = 3, 8
#: What the names of choices begin with.
CHOICE = "choose"
SPEED_LABEL, DEPTH_LABEL = "spindle speed [rpm]", "axial depth [mm]"
DASHES = {"-": "solid", "--": "dashed"}
HOW_LOST = {
    BIFURCATION["none"]: "",
    BIFURCATION["hopf"]: "Hopf",
    BIFURCATION["flip"]: "flip",
    BIFURCATION["fold"]: "fold",
}


def study_plots(lobes: xr.Dataset, preload: float) -> dict[str, Model]:
    """Return choices and plots by name, in the order of the page; preload [N]: the one that is shown first."""
    choices = _choices(lobes, preload)
    plotted, sliders = _lobes(lobes, choices)
    made = choices.named(CHOICE) | {f"{CHOICE}_{name}": slider for name, slider in sliders.items()}
    made["lobes"] = plotted
    if _holds_maps(lobes):
        made["dominant_mode"] = _map_of_dominant_mode(lobes, choices)
        made["spectral_radius"] = _map_of_spectral_radius(lobes, choices)
    made |= _modes(lobes, choices)
    if bool(lobes["radial_stiffness"].notnull().any()):
        made |= _bearing(lobes)
    choices.bind()
    return made


def _choices(lobes: xr.Dataset, preload: float) -> Choices:
    counts = [int(count) for count in lobes["mode_count"].values]
    return Choices(
        {
            PRELOAD: {_name(value): f"{value:g} N" for value in lobes["preload"].values},
            MODES: {str(count): modes_label(lobes, count) for count in counts},
        },
        {PRELOAD: _name(preload), MODES: str(max(counts))},
    )


def _name(preload: float) -> str:
    return f"{float(preload):g}"


def _lines(lobes: xr.Dataset) -> Iterator[tuple[Key, xr.Dataset]]:
    """Yield the part of a study that belongs to each combination of choices."""
    for preload in lobes["preload"].values:
        for count in lobes["mode_count"].values:
            yield (_name(preload), str(int(count))), lobes.sel(preload=preload, mode_count=count)


def _lobes(lobes: xr.Dataset, choices: Choices) -> tuple[figure, dict[str, Model]]:
    """Return the boundary of each kind of parameters, the best cut of the main one, and the sliders of its margins."""
    made = plot("Stability lobes: stable below the line", SPEED_LABEL, DEPTH_LABEL, height=440)
    _span(made, lobes)
    speed, machine = lobes["spindle_speed"].values, lobes.attrs["settings"]["machine"]
    renderers, entries, sources = list[Any](), dict[str, list[Any]](), dict[str, ColumnDataSource]()
    for colour, name in zip(COLOURS, lobes["modal_parameters"].values, strict=False):
        data = {}
        for key, part in _lines(lobes.sel(modal_parameters=name)):
            limit = stability_limit(part)
            first = part.isel(crossing=0)
            data[key] = {
                "limit": numbers(limit),
                "frequency": numbers(first["limit_chatter_frequency"]),
                "mode": first["limit_dominant_mode"].values.astype(np.int8),
                "how": [HOW_LOST[int(code)] for code in first["limit_bifurcation"].values],
                "rate": numbers(removal_rate(machine, speed, limit.values)),
                KNOWN: known_limit(part).values,
                RATE: removal_rate(machine, speed, 1.0),
            }
        source = choices.source(data, {SPEED: speed})
        sources[str(name)] = source
        line = made.line("speed", "limit", source=source, line_width=2, color=colour, line_dash=DASHES[STYLE[name]])
        renderers.append(
            made.scatter("speed", "limit", source=source, size=MARK if len(speed) > 1 else ALONE, color=colour)
        )
        entries[str(name)] = [line, renderers[-1]]
    made.add_tools(
        hover(
            renderers,
            [
                ("spindle speed", "@speed{0} rpm"),
                ("limit depth", "@limit{0.000} mm"),
                ("chatter frequency", "@frequency{0} Hz"),
                ("mode", "@mode, @how"),
                ("removal rate", "@rate{0.0} cm\N{SUPERSCRIPT THREE}/min"),
            ],
        )
    )
    mark, sliders = add_best_cut(made, sources[main_parameters(sources)], margins_of(lobes.attrs))
    add_key(made, {**entries, "best cut": [mark]})
    return made, sliders


def _holds_maps(lobes: xr.Dataset) -> bool:
    """Return whether the maps of all choices are few enough points for a page."""
    fine = [min(lobes.sizes[name], most) for name, most in zip(("spindle_speed", "axial_depth"), MAP_SIZE, strict=True)]
    return fine[0] * fine[1] * lobes.sizes["preload"] * lobes.sizes["mode_count"] <= MOST_MAP_POINTS and min(fine) > 1


def _map_of_dominant_mode(lobes: xr.Dataset, choices: Choices) -> figure:
    most = most_modes(lobes)
    palette = list(COLOURS[:most]) if most <= len(COLOURS) else _palette("viridis", most)
    mapper = LinearColorMapper(palette=palette, low=0.5, high=most + 0.5, low_color="#00000000")
    made = _map(
        lobes, choices, "Dominant mode of the critical motion", mapper, lambda part: part["dominant_mode"].values
    )
    made.add_layout(_bar(mapper, {float(number): str(number) for number in range(1, most + 1)}, "mode"), "right")
    return made


def _map_of_spectral_radius(lobes: xr.Dataset, choices: Choices) -> figure:
    classes = len(RADIUS_LEVELS) + 1
    mapper = LinearColorMapper(palette=_palette("RdBu_r", classes), low=0.5, high=classes + 0.5, low_color="#00000000")

    def classified(part: xr.Dataset) -> np.ndarray:
        radius = part["spectral_radius"].values
        return np.where(np.isnan(radius), 0, np.digitize(radius, RADIUS_LEVELS) + 1)

    made = _map(lobes, choices, "Spectral radius: stable below 1", mapper, classified)
    made.add_layout(_bar(mapper, {i + 1.5: f"{level:g}" for i, level in enumerate(RADIUS_LEVELS)}, ""), "right")
    return made


def _map(
    lobes: xr.Dataset,
    choices: Choices,
    title: str,
    mapper: LinearColorMapper,
    values: Callable[[xr.Dataset], np.ndarray],
) -> figure:
    """Return a map over speed and depth of whole numbers, with the boundary."""
    made = plot(title, SPEED_LABEL, DEPTH_LABEL)
    _span(made, lobes)
    speed, depth = (lobes[name].values for name in ("spindle_speed", "axial_depth"))
    # Pictures have equal steps: at each the nearest point of the grid is shown.
    across, up = (nearest(axis, most) for axis, most in zip((speed, depth), MAP_SIZE, strict=True))
    first = of_main_parameters(lobes)
    data, boundary = {}, {}
    for key, part in _lines(first):
        cells = part.transpose("axial_depth", "spindle_speed", ...)
        data[key] = {"image": [values(cells)[np.ix_(up, across)].astype(np.uint8)]}
        boundary[key] = {"limit": numbers(stability_limit(part))}
    place = {"x": [edges(speed)[0]], "y": [edges(depth)[0]], "dw": [np.ptp(edges(speed))], "dh": [np.ptp(edges(depth))]}
    made.image("image", "x", "y", "dw", "dh", source=choices.source(data, place), color_mapper=mapper, alpha=0.85)
    line = choices.source(boundary, {"speed": numbers(speed)})
    made.line("speed", "limit", source=line, color="black", line_width=2)
    return made


def nearest(axis: np.ndarray, most: int) -> np.ndarray:
    """Return which points of an axis are nearest to equal steps along it, at most so many."""
    steps = np.linspace(axis[0], axis[-1], min(len(axis), most))
    return np.asarray(np.abs(axis[None, :] - steps[:, None]).argmin(axis=1))


def edges(axis: np.ndarray) -> np.ndarray:
    """Return the ends of a picture whose first and last points lie at the ends of an axis."""
    half = 0.5 * (axis[-1] - axis[0]) / max(len(axis) - 1, 1)
    return np.array([axis[0] - half, axis[-1] + half])


def _palette(name: str, count: int) -> list[str]:
    return [to_hex(colour) for colour in matplotlib.colormaps[name](np.linspace(0.02, 0.98, count))]


def _bar(mapper: LinearColorMapper, ticks: dict[float, str], title: str) -> ColorBar:
    return ColorBar(
        color_mapper=mapper,
        title=title,
        ticker=FixedTicker(ticks=list(ticks)),
        major_label_overrides=ticks,
        background_fill_color=None,
    )


def _modes(lobes: xr.Dataset, choices: Choices) -> dict[str, Model]:
    """Return frequency, stiffness, mass and damping of the modes over speed, for the preload that is chosen."""
    shown = {
        "natural_frequency": ("natural frequency [Hz]", "linear"),
        "modal_stiffness": ("modal stiffness [N/\N{MICRO SIGN}m]", "log"),
        "modal_mass": ("modal mass [kg]", "log"),
        "damping_ratio": ("damping ratio [-]", "linear"),
    }
    modes = of_main_parameters(lobes)
    drawn, same = axes_of_modes(modes)
    titles, lines = dict[str, tuple[str, str]](), dict[str, dict[str, Any]]()
    for axis in drawn:
        for colour, number in zip(cycle(COLOURS), modes["mode"].values, strict=False):
            title = f"mode {number}" if same else f"mode {number}, {axis}"
            titles[title] = colour, DASHES[AXIS_STYLE[axis]]
            lines[title] = {"axis": axis, "mode": number}
    made: dict[str, Model] = {}
    for name, (label, scale) in shown.items():
        data = {
            key: {title: numbers(modes[name].sel(preload=own["preload"], **line)) for title, line in lines.items()}
            for key, own in _lines(lobes)
        }
        source = choices.source(data, {"speed": numbers(lobes["spindle_speed"])})
        made[name] = _over_speed(lobes, label, source, titles, y_axis_type=scale)
    return made


def _bearing(lobes: xr.Dataset) -> dict[str, Model]:
    """Return stiffness, contact angles, centrifugal force and gyroscopic moment over speed, a line for each preload."""
    shown = {
        "radial_stiffness": "radial stiffness of one bearing [N/\N{MICRO SIGN}m]",
        "inner_contact_angle": "contact angle, inner race [deg]",
        "outer_contact_angle": "contact angle, outer race [deg]",
        "centrifugal_force": "centrifugal force on a ball [N]",
        "gyroscopic_moment": "gyroscopic moment on a ball [N m]",
    }
    titles = {
        f"{value:g} N": (colour, "solid")
        for value, colour in zip(lobes["preload"].values, cycle(COLOURS), strict=False)
    }
    made: dict[str, Model] = {}
    for name, label in shown.items():
        part = of_main_parameters(lobes[name])
        columns = {f"{value:g} N": numbers(part.sel(preload=value)) for value in lobes["preload"].values}
        source = ColumnDataSource({"speed": numbers(lobes["spindle_speed"]), **columns})
        made[name] = _over_speed(lobes, label, source, titles)
    return made


def _over_speed(
    lobes: xr.Dataset, label: str, source: ColumnDataSource, titles: dict[str, tuple[str, str]], **options: Any
) -> figure:
    """Return lines over speed, one for each title with its colour and dashes; columns have the titles' names."""
    made = plot(label, SPEED_LABEL, "", height=280, **options)
    _span(made, lobes, depth=False)
    # A line of one speed is not seen.
    one = lobes.sizes["spindle_speed"] == 1
    lines = {
        title: made.scatter("speed", title, source=source, color=colour, size=ALONE)
        if one
        else made.line("speed", title, source=source, color=colour, line_dash=dashes, line_width=2)
        for title, (colour, dashes) in titles.items()
    }
    for title, line in lines.items():
        made.add_tools(
            hover([line], [("", title), ("spindle speed", "@speed{0} rpm"), (label, f"@{{{title}}}{{0.0000}}")])
        )
    add_key(made, {title: [line] for title, line in lines.items()})
    return made


def _span(made: figure, lobes: xr.Dataset, *, depth: bool = True) -> None:
    """Let a plot begin and end with the grid."""
    speed = lobes["spindle_speed"].values
    if len(speed) > 1:
        made.x_range.start, made.x_range.end = float(speed[0]), float(speed[-1])
    if depth:
        made.y_range.start, made.y_range.end = 0.0, float(lobes["axial_depth"].max())
