"""How far a cut is from the boundary of stability: the nearest crossing of |mu| = 1 in ln(depth).

The slope of ln|mu| at the cut itself does not tell. Away from the boundary the critical multiplier is often
that of a mode which the cut hardly drives, flat in depth, until a steeper branch takes over just before the
limit: ln|mu| over its local slope then is a hundred times the distance, or has the wrong sign. So crossings are
bracketed among a few depths around the cuts, and found. Cuts that differ in depth alone lie on one curve, and share
what is known of it.
"""

from collections.abc import Callable

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
#: there is none within REACH: of a limit the distance is what counts, and not only the side.
LIMIT_REACH = float(np.log(10.0))
#: ln|mu| is looked at in every cut and REACH beyond the outermost ones, and halfway between as long as a gap is wider,
#: but for one whose ends are so far on one side of the boundary that curves would have to be steeper than STEEPEST, per
#: ln(depth), to cross it and come back. Of 2256 margins of models about six campaigns one is off by more than 0.02 from
#: what looks at every 0.06 find, the same one as with gaps of 0.25.
WIDEST_GAP, STEEPEST = 0.5, 2.5
#: ln|mu| where a curve has answers elsewhere and none here, as where no motion repeats with the revolution (any
#: longer). Such a cut is not steady: it counts as unstable, by however much.
NOT_STEADY = 0.1
#: Crossings are bracketed to this in ln(depth), and told by a straight line within: those of smooth curves to some
#: 1e-7. A leap of ln|mu| is anywhere within.
CROSSING_TOLERANCE = 1e-3
#: Step in ln(depth) for the slope at a crossing, and how far a crossing may move to be followed.
SLOPE_STEP, FARTHEST = 1e-3, 0.05
#: Slopes of ln|mu| beyond this, ten times the steepest of curves, are leaps.
LEAPS = 10.0 * STEEPEST


def margins(growth: Growth, curve: Indices, place: Array, reach: Array | float = REACH) -> tuple[Array, Array]:
    """Return the margin of each cut and the crossing that it is measured from, (cut,) each, in ln(depth).

    curve, place: (cut,), the curve on which a cut lies and its own ln(depth); reach: (cut,), REACH or, where a crossing
    is looked for farther if there is none within that, LIMIT_REACH. The margin is the distance to the nearest crossing,
    positive where the cut is unstable: ln(depth / limit depth) where the boundary is a single limit. Without a crossing
    within reach it is that reach, with its sign, and the crossing, told from the cut, is NaN. A depth without an answer
    on a curve that has some counts as unstable; both are NaN on a curve without any.

    See docs/physics.md#margin.
    """
    margin, crossing = _margins_within(growth, curve, place, REACH)
    far = np.flatnonzero((reach > REACH) & np.isnan(crossing))
    if len(far):
        margin[far], crossing[far] = _margins_within(growth, curve[far], place[far], LIMIT_REACH)
    return margin, crossing


def _margins_within(growth: Growth, curve: Indices, place: Array, reach: float) -> tuple[Array, Array]:
    """Return margins and crossings (cut,) that are looked for so far from every cut."""
    on, at, looked = _looks(growth, curve, place, reach)
    own = looked[_position(on, at, curve, place)]
    nearest = np.full(len(place), np.nan)
    for root_curve, root in zip(*_crossings(growth, on, at, looked), strict=True):
        among = curve == root_curve
        nearer = among & ~(np.abs(nearest - place) <= np.abs(root - place))
        nearest[nearer] = root
    crossing = np.where(np.isfinite(own) & (np.abs(nearest - place) <= reach), nearest - place, np.nan)
    distance = np.where(np.isnan(crossing), reach, np.abs(crossing))
    return np.where(np.isnan(own), np.nan, np.where(own > 0.0, distance, -distance)), crossing


def out_of_reach(limit_margin: Array) -> NDArray[np.bool_]:
    """Return of which measured limit depths (row,) a model's own limit is farther away than is looked.

    See docs/physics.md#margin.
    """
    return np.asarray(np.abs(limit_margin) >= LIMIT_REACH)


def crossing_lines(growth: Growth, curve: Indices, place: Array, crossing: Array) -> tuple[Array, Array]:
    """Return the slope of ln|mu| per ln(depth) at the crossings and what is left of ln|mu| there, (cut,) each.

    Both are NaN where there is no crossing. Where ln|mu| leaps the slope is infinite and nothing is left, for neither
    says anything there.

    See docs/physics.md#margin.
    """
    slope, left = np.full((2, len(place)), np.nan)
    known = np.flatnonzero(np.isfinite(crossing))
    if len(known):
        on, at, which, _ = _shared(curve, place, crossing, known)
        here, beside = np.split(growth(np.tile(on, 2), np.concatenate([at, at + SLOPE_STEP])), 2)
        leaps = np.maximum(np.abs(here), np.abs(beside - here)) > LEAPS * SLOPE_STEP
        slope[known] = np.where(leaps, np.inf, (beside - here) / SLOPE_STEP)[which]
        left[known] = np.where(leaps, 0.0, here)[which]
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
    FARTHEST, all of its curve is looked for anew. slope, left: (cut,), the other model's ``crossing_lines``: the slope
    of one that hardly differs hardly does, and a crossing moves by what changes where the other one was found, which
    is not quite a crossing; reach: as for ``margins``.

    See docs/physics.md#margin.
    """
    known = np.flatnonzero(np.isfinite(crossing))
    if not len(known):
        return margin, crossing
    on, before, which, first = _shared(curve, place, crossing, known)
    steep, was = slope[known[first]], left[known[first]]
    leaps = np.flatnonzero(~np.isfinite(steep))
    asked = growth(np.concatenate([on, on[leaps]]), np.concatenate([before, before[leaps] + SLOPE_STEP]))
    at, beside = np.split(asked, [len(on)])
    steep[leaps] = (beside - at[leaps]) / SLOPE_STEP
    with np.errstate(divide="ignore", invalid="ignore"):
        step = (was - at) / steep
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


def _shared(curve: Indices, place: Array, crossing: Array, known: Indices) -> tuple[Indices, Array, Indices, Indices]:
    """Return the distinct crossings of known cuts: curve and place (crossing,), which is whose, and whose is first.

    Cuts that share a crossing tell its place from their own, to the last digit but one.
    """
    told = np.stack([curve[known], np.round(place[known] + crossing[known], 12)])
    shared, first, which = np.unique(told, axis=1, return_index=True, return_inverse=True)
    return shared[0].astype(np.intp), shared[1], which.ravel(), first


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
    """Return curves and places (look,) of every cut and of what lies so far beyond the outermost, sorted."""
    curves, parts = np.unique(curve), []
    for one in curves:
        own = np.unique(place[curve == one])
        parts.append(np.concatenate([[own[0] - reach], own, [own[-1] + reach]]))
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


def _crossings(growth: Growth, on: Indices, at: Array, looked: Array) -> tuple[Indices, Array]:
    """Return curve and place (crossing,) of all crossings between neighbouring looks."""
    before, after = looked[:-1], looked[1:]
    # Comparisons with NaN are false on both sides: what is not known brackets nothing.
    changes = ((before > 0.0) & (after <= 0.0)) | ((before <= 0.0) & (after > 0.0))
    low = np.flatnonzero(changes & (on[:-1] == on[1:]))
    if not len(low):
        return on[:0], at[:0]
    ends = iter((looked[low], looked[low + 1]))

    def ask(place: Array, which: Array) -> Array:
        """Answer what is known at the ends, which the root finder asks for first, and evaluate the rest."""
        known = next(ends, None)
        return known if known is not None else _steady(growth(which.astype(np.intp), place))

    found = elementwise.find_root(
        ask,
        (at[low], at[low + 1]),
        args=(on[low].astype(float),),
        tolerances={"xatol": CROSSING_TOLERANCE, "xrtol": 0.0},
    )
    return on[low][found.success], _between(found.bracket, found.f_bracket)[found.success]


def _between(bracket: tuple[Array, Array], value: tuple[Array, Array]) -> Array:
    """Return where straight lines through the ends of brackets cross zero (crossing,)."""
    (low, high), (below, above) = bracket, value
    # A crossing that was met exactly is one of the ends, or both.
    share = np.divide(below, below - above, out=np.zeros_like(below), where=below != above)
    return np.asarray(low + share * (high - low))
