"""Tables, figures and the page of a computed study."""

import json
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS, WITH_RESULT
from pipeline import figures, page, store, survey, tables
from pipeline.answer_folder import PAGE
from pipeline.best_cuts import best_cuts
from pipeline.chunks import Chunks
from pipeline.kinds import kind_of
from pipeline.lobes import (
    crossover_speeds,
    dominance,
    known_limit,
    main_parameters,
    most_misjudged,
    of_main_parameters,
    stability_limit,
)
from pipeline.page import PageTable, provenance
from pipeline.places import LOBES, Place
from pipeline.plots import embed
from pipeline.settings import margins_of
from pipeline.study_place import study_place
from pipeline.study_plots import CHOICE, study_plots
from pipeline.telling import fact, wrote
from pipeline.verbs.stores import ReportOptions

#: Rows of a table on the page; the CSV files hold all.
PAGE_ROWS = 24
#: Ranges of one dominant mode that a sentence holds; the CSV file holds all.
SENTENCE_RANGES = 6
#: Limits of the standing spindle that are less than so many times those of the running one are not worth a sentence.
TELLING_RATIO = 1.01
CAPTIONS = {
    "lobes": "A click on a line's name hides or shows it. The star: the cut that removes most with the chosen margins.",
    "dominant_mode": "The mode that holds the largest share of the critical motion's energy; the line is the boundary.",
    "spectral_radius": "Bearings at the spindle's speed, as in the map above, where the study has both kinds.",
}
#: Groups of plots below the lobes.
GROUPS = {
    "Modes at the tool tip": ("natural_frequency", "modal_stiffness", "modal_mass", "damping_ratio"),
    "One bearing": (
        "radial_stiffness",
        "inner_contact_angle",
        "outer_contact_angle",
        "centrifugal_force",
        "gyroscopic_moment",
    ),
}
#: Speeds of all lines of lobes together, and cells, that a report shows: of larger studies every so manieth speed.
MOST_LINES, MOST_CELLS = 50_000, 4_000_000


def run(words: list[str]) -> int:
    """Write the report of a folder again; return the exit code."""
    place, options = study_place(words, ReportOptions)
    fact(store=place.where(place.root))
    wrote(kind_of(place).report(place, **options.margins))
    return 0


def write(place: Place, **margins: float) -> list[Path]:
    """Write tables, figures and report.html of the store in a place; return the paths.

    margins: of the best cuts by their keys, in the place of those that the store's last run named.
    """
    group, counts = store.check(place), survey.counts(place)
    step = shown_step(store.chunks(group))
    with store.readable(place) as opened:
        lobes = opened.isel(spindle_speed=slice(None, None, step)).load()
    lobes.attrs["margins"] = {**margins_of(lobes.attrs).said, **margins}
    hollow = int((lobes["status"].isin(WITH_RESULT) & lobes["spectral_radius"].isnull()).sum())
    if hollow:
        where = place.where(LOBES)
        raise InvalidInput([f"{where}: {hollow} cells count as computed but hold no result; the same sweep heals them"])
    preload = _shown_preload(lobes)
    output = place.make_output()
    written = [*tables.write(lobes, output / "tables"), *figures.write(lobes, output / "figures", preload)]
    html = output / PAGE
    warnings = [*_left_out(lobes, step), *_warnings(counts, lobes)]
    csv = [path for path in written if path.suffix == ".csv"]
    _page(html, place.opening, lobes, preload, counts.total(), warnings, csv)
    return [*written, html]


def shown_step(every: Chunks) -> int:
    """Return that every so manieth speed is shown, 1 for all: what a report holds is limited, however large a study."""
    lines, cells = every.all_cells // every.each, every.all_cells
    return max(1, -(-lines // MOST_LINES), -(-cells // MOST_CELLS))


def _left_out(lobes: xr.Dataset, step: int) -> list[str]:
    """Return what a report says that does not show all, nothing where it does."""
    shown = f"One speed of {step} is shown, {lobes.sizes['spindle_speed']} in all"
    return [f"{shown}: findings, tables and figures are of these; the store has all."] if step > 1 else []


def _shown_preload(lobes: xr.Dataset) -> float:
    """Return the preload that is shown alone: the machine's own where the grid has it, else the first."""
    own = lobes.attrs["settings"]["machine"].get("spindle", {}).get("preload_n")
    values = lobes["preload"].values
    return float(own) if own in values else float(values[0])


def _page(
    html: Path, opening: str, lobes: xr.Dataset, preload: float, points: int, warnings: list[str], written: list[Path]
) -> None:
    attributes = lobes.attrs
    made = study_plots(lobes, preload)
    page.write(
        html,
        "report.html",
        title=attributes["title"],
        subtitle=f"{points} operating points{_with_effects(attributes)}, computed {attributes['created']}",
        warnings=warnings,
        findings=_findings(lobes, preload),
        tables=[_best_table(lobes), _limits_table(lobes, preload), _crossover_table(lobes)],
        plots=embed(made),
        choices=[name for name in made if name.startswith(CHOICE)],
        captions=CAPTIONS,
        groups=[(heading, names) for heading, names in GROUPS.items() if any(name in made for name in names)],
        **page.offered(written),
        opening=opening,
        provenance=provenance(attributes, "sweep"),
        settings=json.dumps(attributes["settings"], indent=1),
    )


def _with_effects(attributes: Mapping[str, Any]) -> str:
    on = figures.effects_on(attributes)
    return f", with {', '.join(on)}" if on else ""


def _warnings(counts: Counter[str], lobes: xr.Dataset) -> list[str]:
    told = [
        f"{counts[name]} of {counts.total()} points have no result: {name.replace('_', ' ')}."
        for name, code in STATUS.items()
        if code not in WITH_RESULT and counts[name]
    ]
    # Where a cell has no result that is told above: nothing was searched to its end there.
    searched = lobes["status"].isin(WITH_RESULT).all("axial_depth")
    doubtful = int(((lobes["limits_complete"] == 0) & searched).sum())
    if doubtful:
        told.append(
            f"At {doubtful} of {searched.size} speeds the search for limit depths left an interval of depth "
            "suspicious: a narrow island or gap may be missing there."
        )
    return told


def _findings(lobes: xr.Dataset, preload: float) -> list[str]:
    """Return what the study says, in sentences."""
    modes = int(lobes["mode_count"].max())
    limit = of_main_parameters(stability_limit(lobes)).sel(preload=preload, mode_count=modes)
    known = of_main_parameters(known_limit(lobes)).sel(preload=preload, mode_count=modes)
    found = _depths(limit, known, figures.modes_label(lobes, modes))
    ranges = dominance(lobes)
    shown = ranges[
        (ranges["modal_parameters"] == limit["modal_parameters"].item())
        & (ranges["preload"] == preload)
        & (ranges["mode_count"] == modes)
    ]
    if len(shown) > 1:
        found.append(_who_sets_the_boundary(shown))
    misjudged = most_misjudged(lobes, preload, modes)
    if misjudged and misjudged.static_limit_mm > TELLING_RATIO * misjudged.dynamic_limit_mm:
        at_least = "at least " if misjudged.static_above_grid else ""
        found.append(
            f"At {misjudged.spindle_speed_rpm:.0f} rpm lobes from the standing spindle promise "
            f"{at_least}{misjudged.static_limit_mm:.3g} mm where the running one allows "
            f"{misjudged.dynamic_limit_mm:.3g} mm."
        )
    error = float(np.nanmax(lobes["error_estimate"].values)) if lobes["error_estimate"].notnull().any() else np.nan
    found.append(f"Estimated error of the spectral radius near the boundary: at most {error:.1e}.")
    return found


def _depths(limit: xr.DataArray, known: xr.DataArray, modes: str) -> list[str]:
    """Return where limits (speed,) with some modes are shallowest and best.

    known: the same, the deepest depth where there is none for sure.
    """
    told, speed = [], limit["spindle_speed"].values
    if bool(limit.notnull().any()):
        least = int(limit.argmin("spindle_speed"))
        told.append(f"the shallowest limit is {float(limit[least]):.3g} mm at {speed[least]:.0f} rpm")
    if bool(known.notnull().any()):
        best = int((known * speed).argmax("spindle_speed"))
        at_least = "at least " if np.isnan(limit[best]) else ""
        told.append(f"depth times speed is largest at {speed[best]:.0f} rpm with {at_least}{float(known[best]):.3g} mm")
    return [f"With {modes} {'; '.join(told)}."] if told else []


def _who_sets_the_boundary(ranges: pd.DataFrame) -> str:
    told = [f"mode {row.dominant_mode} ({row.from_rpm:.0f} to {row.to_rpm:.0f} rpm)" for row in ranges.itertuples()]
    more = f", and {len(told) - SENTENCE_RANGES} more" if len(told) > SENTENCE_RANGES else ""
    return f"Crossover: the boundary is set by {', '.join(told[:SENTENCE_RANGES])}{more}."


def _best_table(lobes: xr.Dataset) -> PageTable:
    """Return the cuts that remove most with all modes, and bearings at the spindle's speed where there are both."""
    main = main_parameters(lobes["modal_parameters"].values)
    cuts = best_cuts(lobes.sel(modal_parameters=[main]))
    cuts = cuts[cuts["mode_count"] == cuts["mode_count"].max()]
    modes = figures.modes_label(lobes, int(lobes["mode_count"].max()))
    title = f"Cuts that remove most, {main} parameters, {modes}, {margins_of(lobes.attrs)}"
    columns = ["preload, N", "speed, rpm", "depth, mm", "removal rate, cm\N{SUPERSCRIPT THREE}/min", "boundary"]
    rows = [
        [
            *(_cell(value) for value in (cut.preload, cut.spindle_speed, cut.axial_depth, cut.removal_rate_cm3_min)),
            "above the grid" if cut.limit_above_grid else "within the grid",
        ]
        for cut in cuts.itertuples()
    ]
    return PageTable(title=title, columns=columns, rows=rows)


def _limits_table(lobes: xr.Dataset, preload: float) -> PageTable:
    """Return limit depths at some speeds, a column for each kind of parameters and number of modes."""
    limit = stability_limit(lobes).sel(preload=preload)
    columns = [
        f"{parameters}, {figures.modes_label(lobes, int(number))}"
        for parameters in limit["modal_parameters"].values
        for number in limit["mode_count"].values
    ]
    step = max(1, -(-limit.sizes["spindle_speed"] // PAGE_ROWS))
    order = ("spindle_speed", "modal_parameters", "mode_count")
    chosen, known = (
        one.isel(spindle_speed=slice(None, None, step)).transpose(*order).values.reshape(-1, len(columns))
        for one in (limit, known_limit(lobes).sel(preload=preload))
    )
    rows = [
        [f"{speed:.0f}", *map(_limit_cell, *values)]
        for speed, *values in zip(limit["spindle_speed"].values[::step], chosen, known, strict=True)
    ]
    return PageTable(title="Limit depth in mm", columns=["spindle speed, rpm", *columns], rows=rows)


def _crossover_table(lobes: xr.Dataset) -> PageTable:
    frame: pd.DataFrame = crossover_speeds(lobes)
    frame = frame[frame["mode_count"] == int(lobes["mode_count"].max())].head(PAGE_ROWS)
    columns = ["parameters", "preload, N", "modes", "speed, rpm", "from mode", "to mode"]
    rows = [[_cell(v) for v in row] for row in frame.itertuples(index=False)]
    return PageTable(title="Where one mode hands the boundary over to another", columns=columns, rows=rows)


def _limit_cell(limit: float, known: float) -> str:
    """Return a limit depth as people read it; known: the deepest depth where there is none for sure, else NaN."""
    if np.isnan(limit):
        return "no result" if np.isnan(known) else "above the grid"
    return _cell(limit)


def _cell(value: Any) -> str:
    return value if isinstance(value, str) else f"{float(value):.5g}"
