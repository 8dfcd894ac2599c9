"""What became of the boundary of stability from one study to another."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from pipeline.contrast.lines import Lines
from pipeline.contrast.pairs import SAME, Pairs, at_pairs, pair, value_in_words
from pipeline.dataset_tables import MOST_NAMED
from pipeline.kinds.lobes import modes_in_words
from pipeline.lobes import main_parameters
from pipeline.page import cell

#: What is told of a speed of a line: both limit depths, in which study there is none as deep as it looked, or why
#: nothing is. Of two studies that looked to different depths that says not which limit is the deeper one.
TOLD = ("both", "none in first", "none in second", "none in either", "between lobes", "no result")
#: What becomes of a cell.
CHANGES = ("unknown", "stable in both", "unstable in both", "becomes unstable", "becomes stable")
#: Columns of the shares that change.
CHANGED = ["becomes_unstable_percent", "becomes_stable_percent"]


@dataclass(frozen=True, kw_only=True)
class Contrast:
    """Two studies, and their boundaries where they can be held against each other; arrays begin with (2,) or a line.

    studies: first and second; pairs: what belongs together; limit: (2, line, speed) [mm], NaN where it is deeper than
    was looked for, or not told; mode: (2, line, speed); told: (line, speed) places in TOLD; best: (2,) tables of the
    best cut of each line.
    """

    studies: tuple[Lines, Lines]
    pairs: Pairs
    limit: np.ndarray
    mode: np.ndarray
    told: np.ndarray
    best: tuple[pd.DataFrame, pd.DataFrame]

    @property
    def ratio(self) -> np.ndarray:
        """Limit depths of second over those of first (line, speed), NaN where not both are told."""
        return np.asarray(self.limit[1] / self.limit[0])

    @property
    def settled(self) -> np.ndarray:
        """Limit depths (2, line, speed), no deeper than both studies looked; NaN where nothing is told."""
        deepest = min(one.deepest for one in self.studies)
        nothing = self.told >= TOLD.index("between lobes")
        return np.where(nothing, np.nan, np.fmin(np.where(np.isnan(self.limit), deepest, self.limit), deepest))

    @property
    def main_lines(self) -> np.ndarray:
        """Return which lines a sentence is about (line,): of sweeps those of the main parameters with all modes."""
        labels = self.pairs.labels
        if not self.studies[0].is_sweep:
            return np.ones(len(labels), dtype=bool)
        main, modes = main_parameters(labels["modal_parameters"]), labels["mode_count"]
        return np.asarray((labels["modal_parameters"] == main) & (modes == modes.max()))

    def name_of(self, line: int) -> str:
        """Return how people tell a line from the others."""
        inputs = self.studies[0].inputs
        own = None if inputs is None else inputs.iloc[self.pairs.lines[0][line]]
        label = self.pairs.labels.iloc[line].to_dict()
        return _name_of_lobes(label, self._selection) if own is None else _name_of_cut(label, own)

    @property
    def _selection(self) -> str:
        """Which modes a number of them means in both sweeps."""
        return str(self.studies[0].attributes["settings"]["grid"]["mode_selection"])


def contrast(first: Lines, second: Lines) -> Contrast:
    """Return two studies held against each other; raise InvalidInput where they cannot be."""
    pairs = pair(first, second)
    found = [at_pairs(lines, pairs, which) for which, lines in enumerate((first, second))]
    limit, mode, known, between = (np.stack([one[name] for one in found]) for name in found[0])
    deeper = np.isnan(limit)
    told = deeper[0] + 2 * deeper[1].astype(np.int8)
    told = np.where(between.any(axis=0), TOLD.index("between lobes"), told)
    told = np.where(known.all(axis=0), told, TOLD.index("no result")).astype(np.int8)
    return Contrast(
        studies=(first, second),
        pairs=pairs,
        limit=np.where(told >= TOLD.index("between lobes"), np.nan, limit),
        mode=mode,
        told=told,
        best=(_best(first, pairs.lines[0]), _best(second, pairs.lines[1])),
    )


def _best(lines: Lines, rows: np.ndarray) -> pd.DataFrame:
    return lines.best.iloc[rows].reset_index(drop=True)


def changes(found: Contrast, line: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return speeds [rpm], depths [mm] and places in CHANGES (speed, depth) of the cells that both sweeps have."""
    own = found.pairs.own
    depths = [one.depth for one in found.studies if one.depth is not None]
    same = np.isclose(depths[0][:, None], depths[1][None, :], rtol=SAME, atol=0.0)
    radius = [
        one.radius[found.pairs.lines[which][line]][np.ix_(found.pairs.before[which][own], same.any(axis=1 - which))]
        for which, one in enumerate(found.studies)
        if one.radius is not None
    ]
    stable, unknown = [one < 1.0 for one in radius], np.isnan(radius).any(axis=0)
    code = np.where(stable[0], np.where(stable[1], 1, 3), np.where(stable[1], 4, 2))
    return found.pairs.speed[own], depths[0][same.any(axis=1)], np.where(unknown, 0, code).astype(np.uint8)


def changed_shares(found: Contrast) -> pd.DataFrame:
    """Return which shares of the speeds and depths of each line become unstable, and stable again, in per cent.

    Of sweeps they are of the cells that both have, of data sets of the depths at each speed, down to the deepest.
    """
    changed, known = _changed(found)
    return pd.DataFrame(100.0 * changed / np.where(known, known, np.nan)[:, None], columns=CHANGED)


def changed_share_of_all(found: Contrast) -> pd.Series:
    """Return the shares of ``changed_shares`` of all lines together, each as much as is known of it; NaN of nothing."""
    changed, known = _changed(found)
    return pd.Series(100.0 * changed.sum(axis=0) / (known.sum() or np.nan), index=CHANGED)


def _changed(found: Contrast) -> tuple[np.ndarray, np.ndarray]:
    """Return how much of each line becomes unstable, and stable (line, 2), and of how much that is known (line,)."""
    if found.studies[0].is_sweep:
        every = [changes(found, line)[2].ravel() for line in range(len(found.pairs.labels))]
        cells = np.array([np.bincount(codes, minlength=len(CHANGES)) for codes in every])
        return cells[:, 3:], cells[:, 1:].sum(axis=1)
    lost = (found.settled[0] - found.settled[1]) / min(one.deepest for one in found.studies)
    changed = [np.nansum(np.maximum(sign * lost, 0.0), axis=1) for sign in (1.0, -1.0)]
    return np.stack(changed, axis=1), (~np.isnan(lost)).sum(axis=1)


def _name_of_lobes(label: Mapping[str, Any], selection: str) -> str:
    """Return how people tell one line of lobes from the others; selection: which modes a number of them means."""
    # Machines of measured tip modes know no preload.
    preload = f"{value_in_words(label['preload'])} N, " if label["preload"] else ""
    modes = label["mode_count"]
    # Where each study has one number of modes alone, both are said.
    kept = f"modes: {modes}" if isinstance(modes, str) else modes_in_words(selection, modes)
    alone = ", each alone" if isinstance(modes, str) and selection == "only" else ""
    return f"{label['modal_parameters']}, {preload}{kept}{alone}"


def _name_of_cut(label: Mapping[str, Any], inputs: pd.Series) -> str:
    """Return how people tell one cut of a data set from the others."""
    told = [f"{key.split('.')[-1]} {cell(value)}" for key, value in inputs.items()] if len(inputs) <= MOST_NAMED else []
    return f"machine {label['machine']}, cut {label['cut']}{': ' if told else ''}{', '.join(told)}"
