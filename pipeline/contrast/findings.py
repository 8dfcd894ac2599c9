"""What two studies held against each other say, in sentences."""

import numpy as np

from pipeline.contrast.contrasted import TOLD, Contrast, changed_share_of_all
from pipeline.contrast.lines import BEST, STUDIES
from pipeline.contrast.pairs import SAME
from pipeline.contrast.tables import MOST_ROWS, settings_table

#: Keys that a sentence names.
NAMED = 5
#: Ratios that differ by less are all the same.
EQUAL = 1e-6


def findings(found: Contrast) -> list[str]:
    """Return what became of the boundary, in sentences."""
    keys = settings_table(found)
    told = [f"{row.key} ({row.first or 'none'} and {row.second or 'none'})" for row in keys.head(NAMED).itertuples()]
    more = f", and {len(keys) - NAMED} more" if len(keys) > NAMED else ""
    differ = f"Settings differ in {', '.join(told)}{more}." if told else "All settings are the same."
    return [differ, *_of_depths(found), *_of_cells(found), *_of_modes(found), *_of_best(found)]


def _of_depths(found: Contrast) -> list[str]:
    ratio = found.ratio[~np.isnan(found.ratio)]
    where = f"at {len(ratio)} of {found.told.size} speeds of all lines"
    if not len(ratio):
        return ["No speed has a limit depth in both studies."]
    if np.ptp(ratio) < EQUAL * ratio.max():
        same = "are the same" if abs(ratio[0] - 1.0) < EQUAL else f"are {ratio[0]:.4g} times those of the first"
        return [f"Limit depths of the second study {same}, {where}."]
    low, middle, high = np.quantile(ratio, [0.0, 0.5, 1.0])
    spread = f"{middle:.3g} times those of the first in the median, {low:.3g} to {high:.3g} times"
    return [f"Limit depths of the second study are {spread}, {where}."]


def _of_cells(found: Contrast) -> list[str]:
    shares = changed_share_of_all(found)
    if shares.isna().any():
        return ["No cell is in both studies: which cells change is not told."]
    what = "cells" if found.studies[0].is_sweep else "speeds and depths"
    lost, won = shares["becomes_unstable_percent"], shares["becomes_stable_percent"]
    return [
        f"Of all {what} that both have {lost:.3g} % are stable in the first alone, {won:.3g} % in the second alone."
    ]


def _of_modes(found: Contrast) -> list[str]:
    both = found.told == 0
    other = (both & (found.mode[0] != found.mode[1])).sum()
    return [f"Another mode dominates the boundary at {other / both.sum():.1%} of these speeds."] if both.any() else []


def _of_best(found: Contrast) -> list[str]:
    told, main = [], found.main_lines
    for name, table in zip(STUDIES, found.best, strict=True):
        rate = table[BEST[2]].where(main)
        if rate.notna().any():
            row = int(rate.argmax())
            speed, depth, rate = (table[column][row] for column in BEST)
            where = f"{found.name_of(row)}; {speed:.0f} rpm, {depth:.3g} mm"
            told.append(f"{rate:.3g} cm\N{SUPERSCRIPT THREE}/min in the {name} ({where})")
    return [f"Most is removed with {' and '.join(told)}."] if told else []


def warnings(found: Contrast) -> list[str]:
    """Return what of the studies is not told."""
    counts = np.bincount(found.told.ravel(), minlength=len(TOLD))
    between, without = (int(counts[TOLD.index(name)]) for name in ("between lobes", "no result"))
    told = []
    if between:
        why = "one study lacks them, and its neighbours there are not of one lobe, or none is known"
        told.append(f"At {between} of {found.told.size} speeds of all lines nothing is told: {why}.")
    if without:
        told.append(f"At {without} of {found.told.size} speeds of all lines one of the studies has no result.")
    first, second = ((one.speed[0], one.speed[-1], one.deepest) for one in found.studies)
    if not np.allclose(first, second, rtol=SAME, atol=0.0):
        told.append(
            "The cuts that remove most are of all speeds and depths that each study looked at, and these differ."
        )
    for name, one in zip(STUDIES, found.studies, strict=True):
        if one.step > 1:
            told.append(f"Of the {name} study one speed of {one.step} was read: it is too large for a page.")
    if found.told.size > MOST_ROWS:
        told.append("limit_depths.csv holds some of the lines; the stores have all.")
    return told
