"""What people read of a data set: its card, tables, figures and page."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from pipeline import csv_files, dataset_card, dataset_figures, page, store, survey
from pipeline.answer_folder import PAGE
from pipeline.by_value import FEW
from pipeline.dataset_plots import dataset_plots
from pipeline.dataset_tables import (
    BEST_ABOVE,
    LOWEST,
    LOWEST_ABOVE,
    MOST_NAMED,
    RATE,
    deepest_mm,
    samples_table,
    stable_throughout,
    with_result,
)
from pipeline.page import PageTable, provenance, table_of
from pipeline.places import Place
from pipeline.plots import embed
from pipeline.sensitivity import KEY, sensitivity
from pipeline.settings import Margins, margins_of

#: What a report is made of.
READ = ("input", "split", "limit_depth", "limit_chatter_frequency", "limit_dominant_mode", "limits_complete", "status")
#: Rows of a table on the page; the CSV files hold all.
PAGE_ROWS = 24
CAPTIONS = {
    "limits": "The depth at which the chosen cut begins to chatter; the bands hold the middle part of all cuts.",
    "values": "A line for each value of the chosen input: the median of all cuts that have it; bands hold all of them, "
    f"or where they are more than {FEW} the middle half.",
    "inputs": "A cut each, by the shallowest of its limit depths over all speeds.",
}


def write(place: Place, **margins: float) -> list[Path]:
    """Write card, tables, figures and report.html of a data set; return the paths.

    margins: of the best cuts by their keys, in the place of those that the store's last run named.
    Raises InvalidInput where it cannot be read.
    """
    store.check(place)
    counts = survey.counts(place)
    with store.readable(place) as opened:
        data = opened[list(READ)].load()
        data.attrs = {**opened.attrs, "margins": {**margins_of(opened.attrs).said, **margins}}
    output = place.make_output()
    samples = samples_table(data)
    told, text = sensitivity(data)
    tables = csv_files.write({"samples": samples, **({} if told.empty else {"sensitivity": told})}, output / "tables")
    pictures = dataset_figures.write(data, told, text, output / "figures")
    card = dataset_card.write(data, counts, output)
    html = output / PAGE
    _page(html, place.opening, data, counts, samples, (told, text), tables)
    return [card, *tables, *pictures, html]


def _page(
    html: Path,
    opening: str,
    data: xr.Dataset,
    counts: Mapping[str, int],
    samples: pd.DataFrame,
    dependence: tuple[pd.DataFrame, str],
    written: list[Path],
) -> None:
    told, text = dependence
    made = dataset_plots(data, samples, told, text)
    cells = sum(counts.values())
    page.write(
        html,
        "dataset.html",
        title=data.attrs["title"],
        subtitle=f"machines: {data.sizes['machine']}, cuts of each: {data.sizes['cut']}, spindle speeds: "
        f"{data.sizes['spindle_speed']}; computed {data.attrs['created']}",
        warnings=[
            f"{count} of {cells} cuts and speeds have no result: {name.replace('_', ' ')}."
            for name, count in counts.items()
            if name not in ("ok", "interpolated")
        ],
        findings=_findings(data, samples, text if told.empty else ""),
        tables=[_best_table(samples, margins_of(data.attrs)), *([] if told.empty else [_dependence_table(told, text)])],
        plots=embed(made),
        captions=CAPTIONS,
        **page.offered(written),
        opening=opening,
        provenance=provenance(data.attrs, "dataset"),
        settings=json.dumps(data.attrs["settings"], indent=1),
    )


def _findings(data: xr.Dataset, samples: pd.DataFrame, untold: str) -> list[str]:
    found = _of_lowest(samples.dropna(subset=[LOWEST]), deepest_mm(data))
    if results := np.count_nonzero(with_result(data)):
        share = np.count_nonzero(stable_throughout(data)) / results
        found.append(f"{share:.1%} of all cuts and speeds with a result are stable down to the deepest depth.")
    if samples[RATE].notna().any():
        best = samples.loc[samples[RATE].idxmax()]
        deeper = f": no boundary was found near it down to {deepest_mm(data):g} mm" if best[BEST_ABOVE] else ""
        found.append(
            f"Most is removed by machine {best['machine']}, cut {best['cut']}: {best[RATE]:.3g} cm\N{SUPERSCRIPT THREE}"
            f"/min at {best['with_spindle_speed_rpm']:.0f} rpm and {best['with_axial_depth_mm']:.3g} mm{deeper}."
        )
    return [*found, *([untold] if untold else [])]


def _of_lowest(known: pd.DataFrame, deepest: float) -> list[str]:
    """Return what is found of the lowest limit depths that are known; deepest: depth that was looked at [mm]."""
    if known.empty:
        return []
    shares, above = [0.1, 0.5, 0.9], known[LOWEST_ABOVE].astype(float)
    # Cuts without a boundary come last in both orders: a quantile that one of them has a part in is only a bound.
    low, middle, high = (
        f"{'at least ' if bound > 0.0 else ''}{depth:.3g}"
        for depth, bound in zip(np.quantile(known[LOWEST], shares), np.quantile(above, shares), strict=True)
    )
    found = [
        f"The lowest limit depth over all speeds is {middle} mm in the median, {low} to {high} mm in four of five cuts."
    ]
    if count := np.count_nonzero(above):
        found.append(f"{count} of {len(known)} cuts have no limit depth down to {deepest:g} mm, the deepest looked at.")
    return found


def _best_table(samples: pd.DataFrame, margins: Margins) -> PageTable:
    best = samples.dropna(subset=[RATE]).nlargest(PAGE_ROWS, RATE)
    varied = list(samples.columns)[3 : samples.columns.get_loc(LOWEST)]
    names = [
        "machine",
        "cut",
        *(varied if len(varied) <= MOST_NAMED else ["part"]),
        LOWEST,
        "at_spindle_speed_rpm",
        RATE,
    ]
    names += ["with_spindle_speed_rpm", "with_axial_depth_mm"]
    told = best[names].assign(boundary=np.where(best[BEST_ABOVE], "above the deepest", "found"))
    return table_of(f"The cuts that remove most, {margins}", told)


def _dependence_table(told: pd.DataFrame, text: str) -> PageTable:
    return table_of(text, told.rename(columns={KEY: "input"}))
