"""Which lines and speeds of two studies are held against each other, or why none can be."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from chatter_core.errors import InvalidInput
from pipeline.contrast.lines import Lines
from pipeline.lobes import OUTER

#: Values on an axis that differ by less than this, relative to them, are the same: grids are rounded.
SAME = 1e-9
#: Neighbours between which a limit depth is interpolated belong to one lobe: with the same mode and kind of loss, waves
#: of chatter in a revolution less than this apart (from lobe to lobe it is one for each tooth), and limit depths that
#: are so near to each other that nothing between them is far off.
MOST_WAVES, MOST_RATIO = 0.5, 1.2


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Places in two studies that belong together, of both in this order.

    labels: (line,) of the pairs; lines: (2, line) places of lines; speed: (speed,) [rpm]; before, after: (2, speed)
    places of the speeds between which each lies, equal where it is one of the study's own.
    """

    labels: pd.DataFrame
    lines: np.ndarray
    speed: np.ndarray
    before: np.ndarray
    after: np.ndarray

    @property
    def own(self) -> np.ndarray:
        """Return which speeds are those of both studies (speed,)."""
        return np.asarray((self.before == self.after).all(axis=0))


def pair(first: Lines, second: Lines) -> Pairs:
    """Return what belongs together; raise InvalidInput where studies cannot be held against each other."""
    if first.is_sweep != second.is_sweep:
        kinds = ["a sweep" if one.is_sweep else "a data set" for one in (first, second)]
        raise InvalidInput([f"first is {kinds[0]}, second {kinds[1]}; allowed: two of one kind"])
    labels, lines = _lines_of_sweeps(first, second) if first.is_sweep else _lines_of_datasets(first, second)
    speed = _common_speeds(first.speed, second.speed)
    places = [_between(one.speed, speed) for one in (first, second)]
    before, after = (np.stack([place[side] for place in places]) for side in (0, 1))
    return Pairs(labels=labels, lines=lines, speed=speed, before=before, after=after)


def _lines_of_sweeps(first: Lines, second: Lines) -> tuple[pd.DataFrame, np.ndarray]:
    """Return labels and places of the lines on which both studies say the same, or each but one thing."""
    selections = [one.attributes["settings"]["grid"]["mode_selection"] for one in (first, second)]
    if selections[0] != selections[1]:
        found = f"first {selections[0]}, second {selections[1]}"
        raise InvalidInput([f"grid.mode_selection: found {found}; a number of modes means other modes in each"])
    keys, said, problems = [first.labels.copy(), second.labels.copy()], {}, []
    for axis in OUTER:
        own = [one.labels[axis].unique() for one in (first, second)]
        if len(own[0]) == len(own[1]) == 1 and not _same(own[0][0], own[1][0]):
            # Each has one value alone: that is what they differ in.
            said[axis] = f"{value_in_words(own[0][0])} and {value_in_words(own[1][0])}"
            keys[0][axis] = keys[1][axis] = 0
            continue
        keys[1][axis] = keys[1][axis].map(lambda value, of=own[0]: next((o for o in of if _same(o, value)), value))
        if not set(keys[0][axis]) & set(keys[1][axis]):
            told = [", ".join(map(value_in_words, values[:8])) for values in own]
            problems.append(f"{axis}: found {told[0]} in first, {told[1]} in second; none is in both")
    if problems:
        raise InvalidInput(problems)
    for place, key in enumerate(keys):
        key[f"place_{place}"] = np.arange(len(key))
    both = keys[0].merge(keys[1], on=list(OUTER), how="inner")
    return both[list(OUTER)].assign(**said), both[["place_0", "place_1"]].values.T


def _same(one: object, other: object) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    return bool(np.isclose(float(one), float(other), rtol=SAME, atol=0.0))  # type: ignore[arg-type]


def value_in_words(value: object) -> str:
    """Return a value on an axis as people read it."""
    return value if isinstance(value, str) else f"{value:g}"


def _lines_of_datasets(first: Lines, second: Lines) -> tuple[pd.DataFrame, np.ndarray]:
    """Return labels and places of the machines and cuts that both studies have, the first ones of the larger."""
    assert first.inputs is not None
    assert second.inputs is not None
    keys = [list(one.inputs) for one in (first, second)]  # type: ignore[arg-type]
    if keys[0] != keys[1]:
        told = [", ".join(own) for own in keys]
        raise InvalidInput([f"design: first varies {told[0]}; second {told[1]}; allowed: the same keys in both"])
    numbered = [
        one.labels.assign(**{f"place_{i}": np.arange(len(one.labels))}) for i, one in enumerate((first, second))
    ]
    both = numbered[0].merge(numbered[1], on=["machine", "cut"], how="inner")
    lines = both[["place_0", "place_1"]].values.T
    differing = (first.inputs.iloc[lines[0]].values != second.inputs.iloc[lines[1]].values).any(axis=1)
    if differing.any():
        row = both.iloc[int(differing.argmax())]
        found = f"machine {row['machine']}, cut {row['cut']} is another one in second than in first"
        raise InvalidInput(
            [f"design: {found}; allowed: two studies of one design (the same seed, counts of cuts, values)"]
        )
    return both[["machine", "cut"]], lines


def _common_speeds(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the speeds [rpm] of the coarser study that lie within the other's; raise InvalidInput where none does."""
    low, high = max(first[0], second[0]) * (1.0 - SAME), min(first[-1], second[-1]) * (1.0 + SAME)
    inside = [speed[(speed >= low) & (speed <= high)] for speed in (first, second)]
    if not len(inside[0]) or not len(inside[1]):
        ranges = [f"{speed[0]:g} to {speed[-1]:g} rpm" for speed in (first, second)]
        raise InvalidInput([f"spindle_speed: found {ranges[0]} in first, {ranges[1]} in second; no speed is in both"])
    return np.asarray(min(inside, key=len))


def _between(own: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the places of the speeds of a study below and above each speed, twice the same where it is one of them."""
    after = np.clip(np.searchsorted(own, speed * (1.0 - SAME)), 0, len(own) - 1)
    before = np.where(np.abs(own[after] - speed) <= SAME * speed, after, np.maximum(after - 1, 0))
    return before, after


def at_pairs(lines: Lines, pairs: Pairs, which: int) -> dict[str, np.ndarray]:
    """Return limit, mode and known (line, speed) of a study where it is compared, and between: what cannot be told.

    A limit depth is interpolated over speed within one lobe alone.
    """
    rows, before, after = pairs.lines[which][:, None], pairs.before[which], pairs.after[which]
    own = before == after
    span = np.where(own, 1.0, lines.speed[after] - lines.speed[before])
    share = np.where(own, 0.0, (pairs.speed - lines.speed[before]) / span)
    values = [{name: getattr(lines, name)[rows, place] for name in _READ} for place in (before, after)]
    waves = [60.0 * one["frequency"] / lines.speed[place] for one, place in zip(values, (before, after), strict=True)]
    limits = [one["limit"].astype(float) for one in values]
    with np.errstate(invalid="ignore"):
        near = np.maximum(limits[0] / limits[1], limits[1] / limits[0]) <= MOST_RATIO
        near &= np.abs(waves[0] - waves[1]) < MOST_WAVES
    for name in ("mode", "loss"):
        near &= values[0][name] == values[1][name]
    known = values[0]["known"] & values[1]["known"]
    return {
        "limit": (1.0 - share) * limits[0] + share * limits[1],
        "mode": values[0]["mode"],
        "known": known,
        "between": known & ~own & ~near,
    }


#: What is read of both neighbours of a speed.
_READ = ("limit", "frequency", "mode", "loss", "known")
