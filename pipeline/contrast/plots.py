"""The plots of a page on two studies: lines of both, their ratio, and which cells change."""

from typing import Any

import numpy as np
from bokeh.models import LinearColorMapper, Model, Span
from bokeh.plotting import figure

from pipeline.contrast.contrasted import CHANGES, TOLD, Contrast, changes
from pipeline.contrast.lines import BEST, STUDIES
from pipeline.dataset_plots import MOST_CHOSEN
from pipeline.figures import COLOURS
from pipeline.plots import WIDE, Choices, Key, add_key, hover, numbers, plot
from pipeline.study_plots import DEPTH_LABEL, MAP_SIZE, MOST_MAP_POINTS, SPEED_LABEL, edges, nearest

DASHES = ("solid", "dashed")
#: Colours of what becomes of a cell, in the order of CHANGES.
PALETTE = ("#00000000", "#CFE8DA", "#B8B8B8", "#D55E00", "#0072B2")
#: Shares of all lines between which the band of their ratios lies.
BAND = (0.1, 0.9)


def contrast_plots(found: Contrast) -> dict[str, Model]:
    """Return the choice and the plots by name, in the order of the page."""
    shown = shown_lines(found)
    choices = Choices({"line": {str(line): found.name_of(line) for line in shown}}, {"line": str(shown[0])}, width=WIDE)
    made: dict[str, Model] = choices.named("limits")
    made["limits"] = _limits(found, choices, shown)
    made["ratio"] = _ratio(found, choices, shown)
    if found.studies[0].is_sweep:
        made |= _changes(found, choices, shown)
    choices.bind()
    return made


def shown_lines(found: Contrast) -> list[int]:
    """Return the lines that a page holds; the first of them is shown first: of sweeps one with all modes."""
    count = len(found.pairs.labels)
    shown = [int(line) for line in np.unique(np.linspace(0, count - 1, min(MOST_CHOSEN, count)).astype(int))]
    return sorted(shown, key=lambda line: not found.main_lines[line])


def _limits(found: Contrast, choices: Choices, shown: list[int]) -> figure:
    """Return limit depths of both studies over speed, and their best cuts."""
    made = plot("Limit depths: stable below the lines", SPEED_LABEL, "limit depth [mm]", height=440)
    made.y_range.start = 0.0
    data: dict[Key, dict[str, Any]] = {
        (str(line),): {
            **{name: numbers(found.limit[which, line]) for which, name in enumerate(STUDIES)},
            **{f"mode_{name}": found.mode[which, line] for which, name in enumerate(STUDIES)},
            "ratio": numbers(found.ratio[line]),
            "told": [TOLD[code] for code in found.told[line]],
        }
        for line in shown
    }
    source = choices.source(data, {"speed": numbers(found.pairs.speed)})
    entries, points = dict[str, list[Any]](), list[Any]()
    for which, name in enumerate(STUDIES):
        line = made.line("speed", name, source=source, line_width=2, color=COLOURS[which], line_dash=DASHES[which])
        points.append(made.scatter("speed", name, source=source, size=3, color=COLOURS[which]))
        entries[name] = [line, points[-1], _best(made, found, choices, shown, which)]
    rows = [
        ("spindle speed", "@speed{0} rpm"),
        ("first", "@first{0.000} mm, mode @mode_first"),
        ("second", "@second{0.000} mm, mode @mode_second"),
        ("ratio", "@ratio{0.000}"),
        ("told", "@told"),
    ]
    made.add_tools(hover(points, rows))
    add_key(made, entries)
    return made


def _best(made: figure, found: Contrast, choices: Choices, shown: list[int], which: int) -> Any:
    """Add the best cut of each line of a study; return its mark."""
    best = found.best[which]
    data: dict[Key, dict[str, Any]] = {
        (str(line),): {column: [float(best[column].iloc[line])] for column in BEST} for line in shown
    }
    source = choices.source(data, {})
    mark = made.scatter(BEST[0], BEST[1], source=source, marker="star", size=18, color=COLOURS[which])
    rows = [
        (f"most is removed, {STUDIES[which]}", f"@{BEST[2]}{{0.0}} cm\N{SUPERSCRIPT THREE}/min"),
        ("cut", f"@{BEST[0]}{{0}} rpm, @{BEST[1]}{{0.000}} mm"),
    ]
    made.add_tools(hover([mark], rows))
    return mark


def _ratio(found: Contrast, choices: Choices, shown: list[int]) -> figure:
    """Return limit depths of the second study over those of the first, of the chosen line and of all."""
    made = plot("Limit depth of the second over the first", SPEED_LABEL, "ratio")
    made.add_layout(Span(location=1.0, dimension="width", line_color="#8c8c8c", line_dash="dotted"))
    speed, entries = numbers(found.pairs.speed), dict[str, list[Any]]()
    told = ~np.isnan(found.ratio).all(axis=0)
    if len(found.ratio) > 2 and told.any():
        below, above = np.full((2, len(speed)), np.nan)
        below[told], above[told] = np.nanquantile(found.ratio[:, told], BAND, axis=0)
        band = made.varea(speed, numbers(below), numbers(above), fill_color=COLOURS[2], fill_alpha=0.2)
        entries[f"{BAND[0]:.0%} to {BAND[1]:.0%} of all lines"] = [band]
    source = choices.source({(str(line),): {"ratio": numbers(found.ratio[line])} for line in shown}, {"speed": speed})
    line = made.line("speed", "ratio", source=source, line_width=2, color=COLOURS[2])
    points = made.scatter("speed", "ratio", source=source, size=3, color=COLOURS[2])
    made.add_tools(hover([points], [("spindle speed", "@speed{0} rpm"), ("ratio", "@ratio{0.0000}")]))
    add_key(made, {"chosen line": [line, points], **entries})
    return made


def _changes(found: Contrast, choices: Choices, shown: list[int]) -> dict[str, Model]:
    """Return the map of cells that change, nothing where it would hold too few points or too many for a page."""
    speed, depth, _ = changes(found, shown[0])
    if min(len(speed), len(depth)) < 2:
        return {}
    across, up = (nearest(axis, most) for axis, most in zip((speed, depth), MAP_SIZE, strict=True))
    if len(across) * len(up) * len(shown) > MOST_MAP_POINTS:
        return {}
    made = plot("Cells that change", SPEED_LABEL, DEPTH_LABEL)
    images: dict[Key, dict[str, Any]] = {
        (str(line),): {"image": [changes(found, line)[2].T[np.ix_(up, across)]]} for line in shown
    }
    ends = [edges(axis) for axis in (speed, depth)]
    place = {"x": [ends[0][0]], "y": [ends[1][0]], "dw": [np.ptp(ends[0])], "dh": [np.ptp(ends[1])]}
    mapper = LinearColorMapper(palette=list(PALETTE), low=-0.5, high=len(CHANGES) - 0.5)
    made.image("image", "x", "y", "dw", "dh", source=choices.source(images, place), color_mapper=mapper)
    # A key of its own: squares beside the picture, outside of what is shown.
    squares = {
        name: [made.scatter([np.nan], [np.nan], marker="square", size=12, color=PALETTE[code])]
        for code, name in enumerate(CHANGES)
        if code
    }
    add_key(made, squares)
    return {"changes": made}
