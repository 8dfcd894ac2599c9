"""How far a cut is from the boundary of stability: the nearest crossing of |mu| = 1 in ln(depth).

The slope of ln|mu| at the cut itself does not tell. Away from the boundary the critical multiplier is often
that of a mode which the cut hardly drives, flat in depth, until a steeper branch takes over just before the
limit: ln|mu| over its local slope then is a hundred times the distance, or has the wrong sign. So the crossing is
bracketed among a few depths around the cut, and found.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Trials and ln(depth / depth of the cut), (point,) each -> ln|mu| (point,), not a number where unknown.
Growth = Callable[[Indices, Array], Array]

#: ln(depth) around a cut at which ln|mu| is looked at; what lies beyond counts as that far.
LOOKS = (-0.45, -0.15, 0.0, 0.15, 0.45)
REACH = LOOKS[-1]
#: Crossings are found to this in ln(depth): far less than any outcome curve is wide.
CROSSING_TOLERANCE = 1e-5
#: Step in ln(depth) for the slope at a crossing, and how far a crossing may move to be followed.
SLOPE_STEP, FARTHEST = 1e-3, 0.05


def margins(growth: Growth, trials: int) -> tuple[Array, Array]:
    """Return the margin of each trial and the crossing that it is measured from, (trial,) each, in ln(depth).

    The margin is the distance to the nearest crossing, positive where the cut is unstable: ln(depth / limit
    depth) where the boundary is a single limit. Without a crossing within REACH it is REACH, with its sign,
    and the crossing is NaN. Both are NaN where ln|mu| of the cut itself is not known.

    See docs/physics.md#margin.
    """
    every = np.arange(trials)
    looked = growth(np.tile(every, len(LOOKS)), np.repeat(LOOKS, trials)).reshape(len(LOOKS), trials)
    own = looked[LOOKS.index(0.0)]
    crossing = np.full(trials, np.nan)
    interval, bracketed = _nearest_interval(looked)
    which = np.flatnonzero(bracketed & np.isfinite(own))
    if len(which):
        low = interval[which]
        crossing[which] = _roots(growth, which, low, looked[low, which], looked[low + 1, which])
    distance = np.where(np.isnan(crossing), REACH, np.abs(crossing))
    return np.where(np.isnan(own), np.nan, np.where(own > 0.0, distance, -distance)), crossing


def followed_margins(growth: Growth, margin: Array, crossing: Array) -> tuple[Array, Array]:
    """Return margins and crossings (trial,) of a model that hardly differs from one whose are given.

    A Newton step from each crossing; what had none in reach, or no answer, has none now. For differences
    between neighbouring models, which move a crossing by a few thousandths. Where one moves farther than
    FARTHEST everything is looked for anew.

    See docs/physics.md#margin.
    """
    known = np.flatnonzero(np.isfinite(crossing))
    if not len(known):
        return margin, crossing
    before = crossing[known]
    at, beside = np.split(growth(np.tile(known, 2), np.concatenate([before, before + SLOPE_STEP])), 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        moved = -at * SLOPE_STEP / (beside - at)
    if not np.all(np.abs(moved) <= FARTHEST):
        return margins(growth, len(margin))
    followed, after = margin.copy(), crossing.copy()
    after[known] = before + moved
    # The side on which the cut lies changes smoothly when the crossing passes through it.
    followed[known] = margin[known] + np.where(margin[known] * before > 0.0, moved, -moved)
    return followed, after


def _nearest_interval(looked: Array) -> tuple[Indices, NDArray[np.bool_]]:
    """Return the interval between looks (trial,) whose chord crosses zero nearest to the cut, and whether one does."""
    places = np.array(LOOKS)[:, None]
    before, after = looked[:-1], looked[1:]
    # Comparisons with NaN are false on both sides: what is not known brackets nothing.
    changes = ((before > 0.0) & (after <= 0.0)) | ((before <= 0.0) & (after > 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        chord = places[:-1] - before * (places[1:] - places[:-1]) / (after - before)
    distance = np.where(changes, np.abs(chord), np.inf)
    nearest = distance.argmin(axis=0)
    return nearest, np.asarray(changes.any(axis=0))


def _roots(growth: Growth, trials: Indices, low: Indices, at_low: Array, at_high: Array) -> Array:
    """Return the crossings (root,) in brackets between looks ``low`` and the next; NaN where not found."""
    ends = iter((at_low, at_high))

    def ask(place: Array, trial: Array) -> Array:
        """Answer what is known at the ends, which the root finder asks for first, and evaluate the rest."""
        known = next(ends, None)
        return known if known is not None else growth(trial.astype(np.intp), place)

    places = np.array(LOOKS)
    found = elementwise.find_root(
        ask,
        (places[low], places[low + 1]),
        args=(trials.astype(float),),
        tolerances={"xatol": CROSSING_TOLERANCE, "xrtol": 0.0},
    )
    return np.where(found.success, found.x, np.nan)
