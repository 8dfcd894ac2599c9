"""Tables of two studies held against each other."""

from pathlib import Path

import numpy as np
import pandas as pd

from pipeline import csv_files
from pipeline.contrast.contrasted import TOLD, Contrast, changed_shares
from pipeline.contrast.lines import BEST, STUDIES
from pipeline.settings import differences

#: Rows of a table with limit depths; of more lines every so manieth is in it.
MOST_ROWS = 1_000_000


def settings_table(found: Contrast) -> pd.DataFrame:
    """Return what was asked otherwise, a row for each key, empty where a study has none."""
    first, second = (one.attributes["settings"] for one in found.studies)
    rows = [
        # A machine's parts stand at the root where people write them.
        (key.removeprefix("machine."), *("" if value is None else str(value) for value in both))
        for key, both in differences(first, second).items()
    ]
    return pd.DataFrame(rows, columns=["key", *STUDIES])


def lines_table(found: Contrast) -> pd.DataFrame:
    """Return a row for each line: how limit depths changed over its speeds, and which share of depths did."""
    ratio, rows = found.ratio, np.arange(len(found.pairs.labels))
    told = ~np.isnan(ratio).all(axis=1)
    least, most = (np.where(np.isnan(ratio), fill, ratio) for fill in (np.inf, -np.inf))
    at = [one[rows, places] for one, places in ((least, least.argmin(axis=1)), (most, most.argmax(axis=1)))]
    speeds = [found.pairs.speed[places] for places in (least.argmin(axis=1), most.argmax(axis=1))]
    middle = np.full(len(rows), np.nan)
    middle[told] = np.nanmedian(ratio[told], axis=1)
    return found.pairs.labels.assign(
        median_ratio=middle,
        least_ratio=np.where(told, at[0], np.nan),
        at_rpm=np.where(told, speeds[0], np.nan),
        largest_ratio=np.where(told, at[1], np.nan),
        there_rpm=np.where(told, speeds[1], np.nan),
        speeds_with_both=(found.told == 0).sum(axis=1),
        **changed_shares(found),
    )


def limits_table(found: Contrast) -> pd.DataFrame:
    """Return limit depths of both studies at every speed of a line, a row each."""
    speeds = len(found.pairs.speed)
    step = max(1, -(-found.told.size // MOST_ROWS))
    shown = slice(None, None, step)
    limit, mode = (one[:, shown].reshape(2, -1) for one in (found.limit, found.mode))
    labels = found.pairs.labels.iloc[shown]
    return labels.loc[labels.index.repeat(speeds)].assign(
        spindle_speed_rpm=np.tile(found.pairs.speed, len(labels)),
        first_limit_depth_mm=limit[0],
        second_limit_depth_mm=limit[1],
        ratio=limit[1] / limit[0],
        difference_mm=limit[1] - limit[0],
        first_dominant_mode=mode[0],
        second_dominant_mode=mode[1],
        told=np.array(TOLD)[found.told[shown].ravel()],
    )


def modes_table(found: Contrast) -> pd.DataFrame:
    """Return the ranges of speed in which another mode dominates the boundary than did before, a row each."""
    both = (found.told == 0) & (found.mode[0] != found.mode[1])
    rows = []
    for line in np.flatnonzero(both.any(axis=1)):
        pairs = np.where(both[line], 1000 * found.mode[0, line].astype(int) + found.mode[1, line], -1)
        starts = np.flatnonzero(np.diff(pairs, prepend=-2))
        for start, end in zip(starts, [*starts[1:], len(pairs)], strict=True):
            if pairs[start] >= 0:
                modes = divmod(int(pairs[start]), 1000)
                rows.append((line, found.pairs.speed[start], found.pairs.speed[end - 1], *modes))
    table = pd.DataFrame(rows, columns=["line", "from_rpm", "to_rpm", "first_mode", "second_mode"])
    return found.pairs.labels.iloc[table.pop("line").astype(int)].reset_index(drop=True).join(table)


def best_table(found: Contrast) -> pd.DataFrame:
    """Return the cuts that remove most of both studies, a row for each line."""
    columns = {
        f"{name}_{column}": table[column] for name, table in zip(STUDIES, found.best, strict=True) for column in BEST
    }
    table = found.pairs.labels.reset_index(drop=True).assign(**columns)
    rate = BEST[2]
    return table.assign(ratio_of_rates=table[f"second_{rate}"] / table[f"first_{rate}"])


def write(found: Contrast, folder: Path) -> list[Path]:
    """Write every table into a folder and return the paths."""
    named = {name: table(found).rename(columns={"preload": "preload_n"}) for name, table in TABLES.items()}
    return csv_files.write(named, folder)


#: Every table by its name, and what makes it.
TABLES = {
    "settings": settings_table,
    "lines": lines_table,
    "limit_depths": limits_table,
    "dominant_modes": modes_table,
    "best_cuts": best_table,
}
