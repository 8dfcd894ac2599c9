"""How far a cut is from the boundary of stability: the nearest crossing of |mu| = 1 in ln(depth).

The slope of ln|mu| at the cut itself does not tell. Away from the boundary the critical multiplier is often
that of a mode which the cut hardly drives, flat in depth, until a steeper branch takes over just before the
limit: ln|mu| over its local slope then is a hundred times the distance, or has the wrong sign. So crossings are
bracketed among a few depths around the cuts, and found. Cuts that differ in depth alone lie on one curve, and share
what is known of it.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

#: Curves and ln(depth), (point,) each -> ln|mu| (point,), not a number where unknown.
Growth = Callable[[Indices, Array], Array]

#: A crossing is looked for so far from a cut in ln(depth); what lies beyond counts as that far.
REACH = 0.45
#: The limit of a model that is held against a measured one is looked for so far, from a tenth of it to ten times, where
#: there is none within REACH: of a limit the distance is what counts, and not only the side. Where stability is
#: regained is no limit.
LIMIT_REACH = float(np.log(10.0))
#: ln|mu| is looked at in every cut and REACH beyond the outermost ones, and halfway between as long as a gap is wider,
#: but for one whose ends are so far on one side of the boundary that curves would have to be steeper than STEEPEST, per
#: ln(depth), to cross it and come back. Of 2256 margins of models about six campaigns one is off by more than 0.02 from
#: what looks at every 0.06 find, the same one as with gaps of 0.25.
WIDEST_GAP, STEEPEST = 0.5, 2.5
#: ln|mu| where a curve has answers elsewhere and none here, as where no motion repeats with the revolution (any
#: longer). Such a cut is not steady: it counts as unstable, by however much.
NOT_STEADY = 0.1
#: Crossings are bracketed to this in ln(depth), or found where ln|mu| is as small as the second, and told by a straight
#: line within: of 479 on smooth curves and kinks half to 3e-7, all to 5e-4, with three quarters of the evaluations that
#: brackets alone take. A leap of ln|mu| is bracketed to the third, and anywhere within.
CROSSING_TOLERANCE, GROWTH_TOLERANCE, LEAP_TOLERANCE = 1e-3, 1e-4, 1e-4
#: Step in ln(depth) for the slope at a crossing, and how far a crossing may move to be followed.
SLOPE_STEP, FARTHEST = 1e-3, 0.05
#: Slopes of ln|mu| beyond this, ten times the steepest of curves, are leaps.
LEAPS = 10.0 * STEEPEST


def margins(growth: Growth, curve: Indices, place: Array, reach: Array | float = REACH) -> tuple[Array, Array]:
    """Return the margin of each cut and the crossing that it is measured from, (cut,) each, in ln(depth).

    curve, place: (cut,), the curve on which a cut lies and its own ln(depth); reach: (cut,), REACH, or LIMIT_REACH of
    measured limits. The margin is the distance to the nearest crossing, positive where the cut is unstable: ln(depth /
    limit depth) where the boundary is a single limit. Without a crossing within reach it is that reach, with its sign,
    and the crossing, told from the cut, is NaN. Of measured limits the margin is ln(measured / predicted), to the
    nearest crossing at which stability is lost. A depth without an answer on a curve that has some counts as unstable;
    both are NaN on a curve without any.

    See docs/physics.md#margin.
    """
    limits = np.broadcast_to(reach > REACH, place.shape)
    margin, crossing = _margins_within(growth, curve, place, limits, REACH)
    far = np.flatnonzero(limits & np.isnan(crossing))
    if len(far):
        margin[far], crossing[far] = _margins_within(growth, curve[far], place[far], limits[far], LIMIT_REACH)
    return margin, crossing


def _margins_within(
    growth: Growth, curve: Indices, place: Array, limits: NDArray[np.bool_], reach: float
) -> tuple[Array, Array]:
    """Return margins and crossings (cut,) that are looked for so far from every cut; limits: which are limits."""
    on, at, looked = _looks(growth, curve, place, reach)
    own = looked[_position(on, at, curve, place)]
    nearest = np.full(len(place), np.nan)
    for root_curve, root, lost in zip(*_crossings(growth, on, at, looked), strict=True):
        among = (curve == root_curve) & (lost | ~limits)
        nearer = among & ~(np.abs(nearest - place) <= np.abs(root - place))
        nearest[nearer] = root
    crossing = np.where(np.isfinite(own) & (np.abs(nearest - place) <= reach), nearest - place, np.nan)
    known = np.isfinite(crossing)
    distance = np.where(known, np.abs(crossing), reach)
    grows = np.where(limits & known, crossing < 0.0, own > 0.0)
    return np.where(np.isnan(own), np.nan, np.where(grows, distance, -distance)), crossing


def out_of_reach(limit_margin: Array) -> NDArray[np.bool_]:
    """Return of which measured limit depths (row,) a model's own limit is farther away than is looked.

    See docs/physics.md#margin.
    """
    return np.asarray(np.abs(limit_margin) >= LIMIT_REACH)


def crossing_lines(growth: Growth, curve: Indices, place: Array, crossing: Array) -> tuple[Array, Array]:
    """Return the slope of ln|mu| per ln(depth) at the crossings and what is left of ln|mu| there, (cut,) each.

    Both are NaN where there is no crossing. Where ln|mu| leaps, or has no answer beside, the slope is infinite.

    See docs/physics.md#margin.
    """
    slope, left = np.full((2, len(place)), np.nan)
    known = np.flatnonzero(np.isfinite(crossing))
    if len(known):
        on, at, which, _ = shared(curve, place, crossing, known)
        here, beside = np.split(growth(np.tile(on, 2), np.concatenate([at, at + SLOPE_STEP])), 2)
        smooth = np.maximum(np.abs(here), np.abs(beside - here)) <= LEAPS * SLOPE_STEP
        slope[known] = np.where(smooth, (beside - here) / SLOPE_STEP, np.inf)[which]
        left[known] = here[which]
    return slope, left


def followed_margins(
    growth: Growth,
    curve: Indices,
    place: Array,
    margin: Array,
    crossing: Array,
    slope: Array,
    left: Array,
    reach: Array | float = REACH,
) -> tuple[Array, Array]:
    """Return margins and crossings (cut,) of a model that hardly differs from one whose are given.

    A Newton step from each crossing; what had none in reach, or no answer, has none now. For differences
    between neighbouring models, which move a crossing by a few thousandths. Where one moves farther than
    FARTHEST, or a leap farther than SLOPE_STEP, all of its curve is looked for anew. slope, left: (cut,), the
    other model's ``crossing_lines``: the slope of one that hardly differs hardly does, and a crossing moves by
    what changes where the other one was found, which is not quite a crossing; reach: as for ``margins``.

    See docs/physics.md#margin.
    """
    known = np.flatnonzero(np.isfinite(crossing))
    if not len(known):
        return margin, crossing
    on, before, which, first = shared(curve, place, crossing, known)
    steep, was = slope[known[first]], left[known[first]]
    leaps = np.flatnonzero(np.isinf(steep))
    asked = [before, before[leaps] - SLOPE_STEP, before[leaps] + SLOPE_STEP]
    at, below, above = np.split(
        growth(np.concatenate([on, on[leaps], on[leaps]]), np.concatenate(asked)), [len(on), len(on) + len(leaps)]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        step = (was - at) / steep
    # What is known of a leap is whether it is still there.
    stays = (_steady(below) > 0.0) != (_steady(above) > 0.0)
    step[leaps] = np.where(stays, 0.0, np.nan)
    moved = step[which]
    followed, after = margin.copy(), crossing.copy()
    after[known] += moved
    # The side on which the cut lies changes smoothly when the crossing passes through it.
    followed[known] += np.where(margin[known] * crossing[known] > 0.0, moved, -moved)
    anew = np.flatnonzero(np.isin(curve, on[~(np.abs(step) <= FARTHEST)]))
    if len(anew):
        within = np.broadcast_to(reach, place.shape)[anew]
        followed[anew], after[anew] = margins(growth, curve[anew], place[anew], within)
    return followed, after


def shared(curve: Indices, place: Array, crossing: Array, known: Indices) -> tuple[Indices, Array, Indices, Indices]:
    """Return the distinct crossings of known cuts: curve and place (crossing,), which is whose, and whose is first.

    Cuts that share a crossing tell its place from their own, to the last digit but one.

    See docs/physics.md#margin.
    """
    told = np.stack([curve[known], np.round(place[known] + crossing[known], 12)])
    distinct, first, which = np.unique(told, axis=1, return_index=True, return_inverse=True)
    return distinct[0].astype(np.intp), distinct[1], which.ravel(), first


def _steady(growth: Array) -> Array:
    """Return ln|mu| with what is not steady."""
    return np.where(np.isnan(growth), NOT_STEADY, growth)


def _looks(growth: Growth, curve: Indices, place: Array, reach: float) -> tuple[Indices, Array, Array]:
    """Return curves, places and ln|mu| (look,) of where it is looked at, sorted along each curve."""
    on, at = _stations(curve, place, reach)
    looked = growth(on, at)
    while True:
        answered = np.isin(on, on[np.isfinite(looked)])
        steady = np.where(answered, _steady(looked), np.nan)
        low = _wide(on, at, steady)
        if not len(low):
            return on, at, steady
        middle = 0.5 * (at[low] + at[low + 1])
        found = growth(on[low], middle)
        order = np.argsort(np.concatenate([np.arange(len(at)), low + 0.5]))
        on, at = np.concatenate([on, on[low]])[order], np.concatenate([at, middle])[order]
        looked = np.concatenate([looked, found])[order]


def _wide(on: Indices, at: Array, looked: Array) -> Indices:
    """Return the looks after which a gap may hide crossings."""
    gap = np.where(on[:-1] == on[1:], np.diff(at), 0.0)
    before, after = looked[:-1], looked[1:]
    hides = (before > 0.0) != (after > 0.0)
    hides |= ~(np.abs(before) + np.abs(after) > STEEPEST * gap)
    # Nothing is known of a curve that has no answer anywhere.
    return np.flatnonzero((gap > WIDEST_GAP) & hides & np.isfinite(before))


def _stations(curve: Indices, place: Array, reach: float) -> tuple[Indices, Array]:
    """Return curves and places (look,) of every cut and of what lies REACH, and reach, beyond the outermost, sorted."""
    curves, parts, beyond = np.unique(curve), [], np.unique([REACH, reach])
    for one in curves:
        own = np.unique(place[curve == one])
        parts.append(np.concatenate([own[0] - beyond[::-1], own, own[-1] + beyond]))
    on = np.repeat(curves, [len(part) for part in parts])
    return on, np.concatenate([np.empty(0), *parts])


def _position(on: Indices, at: Array, curve: Indices, place: Array) -> Indices:
    """Return which look (cut,) is that of each cut itself."""
    first = np.searchsorted(on, curve)
    count = np.searchsorted(on, curve, side="right") - first
    return np.array(
        [
            start + np.searchsorted(at[start : start + many], own)
            for start, many, own in zip(first, count, place, strict=True)
        ],
        dtype=np.intp,
    )


def _crossings(growth: Growth, on: Indices, at: Array, looked: Array) -> tuple[Indices, Array, NDArray[np.bool_]]:
    """Return curve and place of all crossings between neighbouring looks, and whether stability is lost (crossing,)."""
    before, after = looked[:-1], looked[1:]
    # Comparisons with NaN are false on both sides: what is not known brackets nothing.
    lost, regained = (before <= 0.0) & (after > 0.0), (before > 0.0) & (after <= 0.0)
    low = np.flatnonzero((lost | regained) & (on[:-1] == on[1:]))
    if not len(low):
        return on[:0], at[:0], lost[:0]
    found = _bracketed(growth, on[low], (at[low], at[low + 1]), (before[low], after[low]), CROSSING_TOLERANCE)
    place = _between(found.bracket, found.f_bracket)
    is_near = np.min(np.abs(found.f_bracket), axis=0) <= GROWTH_TOLERANCE
    leaps = np.flatnonzero(~is_near & (np.abs(np.subtract(*found.f_bracket)) > LEAPS * CROSSING_TOLERANCE))
    if len(leaps):
        ends, values = ([end[leaps] for end in pair] for pair in (found.bracket, found.f_bracket))
        closer = _bracketed(growth, on[low][leaps], ends, values, LEAP_TOLERANCE)
        place[leaps] = _between(closer.bracket, closer.f_bracket)
    return on[low][found.success], place[found.success], lost[low][found.success]


def _bracketed(growth: Growth, on: Indices, ends: Sequence[Array], values: Sequence[Array], tolerance: float) -> Any:
    """Return what the root finder tells of crossings between ends (crossing,) with known ln|mu|, on their curves."""
    known = iter(values)

    def ask(place: Array, which: Array) -> Array:
        """Answer what is known at the ends, which the root finder asks for first, and evaluate the rest."""
        at_end = next(known, None)
        return at_end if at_end is not None else _steady(growth(which.astype(np.intp), place))

    tolerances = {"xatol": tolerance, "xrtol": 0.0, "fatol": GROWTH_TOLERANCE}
    return elementwise.find_root(ask, tuple(ends), args=(on.astype(float),), tolerances=tolerances)


def _between(bracket: tuple[Array, Array], value: tuple[Array, Array]) -> Array:
    """Return where straight lines through the ends of brackets cross zero (crossing,)."""
    (low, high), (below, above) = bracket, value
    # A crossing that was met exactly is one of the ends, or both.
    share = np.divide(below, below - above, out=np.zeros_like(below), where=below != above)
    return np.asarray(low + share * (high - low))
