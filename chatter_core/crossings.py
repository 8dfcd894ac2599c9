"""Depths where stability is lost or regained: every crossing of |mu| = 1 along depth, from few evaluations.

ln|mu| over depth is the largest of smooth branches, one for each multiplier. Intervals of depth are
halved until the value halfway says that nothing can hide in them: until ln|mu| at their ends is larger
than what the value halfway deviated from the chord, or four times that where the multiplier's angle
says that another branch may have taken over. Intervals in which the sign changes go to a bracketing
root finder once they are as plain. Source of the latter: T. R. Chandrupatla, Adv. Eng. Softw. 28
(1997) 145-149, as in scipy.

Each speed is searched on its own, all of them side by side.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.intp]

#: Speeds and depths [m], (point,) each -> critical multipliers (point,), not a number where unknown.
Multipliers = Callable[[Indices, Array], ComplexArray]

#: Crossings are found to this [m].
DEPTH_TOLERANCE = 5e-7
#: ln|mu| at the ends of an interval, in deviations from the chord, that lets nothing hide: on one branch
#: of multipliers, and where another may have taken over.
SAFE_ON_BRANCH, SAFE_ACROSS = 1.0, 4.0
#: Change of ln|mu| over an interval with a crossing, in deviations, that lets no further two hide.
PLAIN_CHANGE = 4.0
#: Beyond this |ln|mu|| an interval may be wider than the coarsest.
FAR = 0.3
#: So many first depths tell by themselves how far ln|mu| deviates from its chords.
MANY = 8
#: Two multipliers are of one branch when their angles are this near [rad]; three are when the middle one
#: is this near to the mean of the others, and those not farther apart than that.
NEAR_ANGLE, MEAN_ANGLE, FARTHEST_ANGLE = 0.15, 0.1, 2.0


@dataclass(frozen=True, kw_only=True)
class Crossings:
    """Crossings of every speed.

    depth: (speed, crossing) [m], ascending, padded with NaN. complete: (speed,), False where an interval
    stayed suspicious down to the finest, the first depth is unstable, a multiplier is not known, or there was
    no room for a crossing.
    """

    depth: Array
    complete: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class _Intervals:
    """Intervals of depth, each array (interval, ...): speed; depth [m] and multiplier (.., 2) at the ends.

    deviation: of ln|mu| halfway the interval that this is a half of, from its chord; NaN before any was
    halved. one_branch: whether the multipliers are of one branch, as far as angles tell.
    """

    speed: Indices
    depth: Array
    multiplier: ComplexArray
    deviation: Array
    one_branch: NDArray[np.bool_]

    @property
    def growth(self) -> Array:
        """ln|mu| at the ends (interval, 2)."""
        return np.asarray(np.log(np.abs(self.multiplier)))

    @property
    def width(self) -> Array:
        """Width (interval,) [m]."""
        return np.asarray(self.depth[:, 1] - self.depth[:, 0])

    @property
    def crossed(self) -> NDArray[np.bool_]:
        """Whether stability differs between the ends (interval,)."""
        growth = self.growth
        return np.asarray((growth[:, 0] > 0.0) != (growth[:, 1] > 0.0))

    def select(self, which: NDArray[np.bool_]) -> "_Intervals":
        return _Intervals(**{name: array[which] for name, array in vars(self).items()})

    def then(self, other: "_Intervals") -> "_Intervals":
        return _Intervals(**{name: np.concatenate([array, vars(other)[name]]) for name, array in vars(self).items()})


def find_crossings(
    multipliers: Multipliers,
    depth: Array,
    known: ComplexArray,
    *,
    finest: float,
    coarsest: float,
    most: int,
) -> Crossings:
    """Find every depth at which the critical multiplier crosses the unit circle.

    depth: (depth,) ascending [m], where the search begins, and ``known`` (speed, depth) the multipliers
    there. Intervals are halved down to ``finest`` [m]: of two crossings nearer than that none may be
    seen. Wider than ``coarsest`` [m], the scale on which the cut changes with depth, they stay only far
    from the boundary. At most ``most`` crossings of a speed are kept.

    See docs/physics.md#limit-depth.
    """
    speeds = len(known)
    unknown_from = np.full(speeds, np.inf)
    # Where it is unstable from the start, stability is lost above the first depth.
    suspicious = np.abs(known[:, 0]) > 1.0
    brackets = _Intervals(
        speed=np.empty(0, dtype=np.intp),
        depth=np.empty((0, 2)),
        multiplier=np.empty((0, 2), dtype=complex),
        deviation=np.empty(0),
        one_branch=np.empty(0, dtype=bool),
    )
    intervals = _first_intervals(depth, known)
    while len(intervals.speed):
        below, above = np.isfinite(intervals.multiplier).T
        lost = ~(below & above)
        small = intervals.width <= finest * (1.0 + 1e-9)
        # A limit may lie before the depth from which on there are no answers: that is found, too.
        edge = below & ~above & ~small
        np.minimum.at(unknown_from, intervals.speed[lost & ~edge], intervals.depth[lost & ~edge, 0])
        edge &= intervals.depth[:, 0] < unknown_from[intervals.speed]
        edges, intervals, small = intervals.select(edge), intervals.select(~lost), small[~lost]
        closed, plain = _judge(intervals, coarsest)
        brackets = brackets.then(intervals.select(intervals.crossed & (plain | small)))
        # A half deviates from its own chord by a quarter as much, where it is smooth.
        nearest = np.abs(intervals.growth).min(axis=1)
        doubtful = small & ~intervals.crossed & (nearest < 0.25 * intervals.deviation)
        suspicious[intervals.speed[doubtful]] = True
        intervals = _halve(intervals.select(~(closed | plain | small)).then(edges), multipliers)
    limits, room = _roots(brackets, multipliers, unknown_from, speeds, most)
    return Crossings(depth=limits, complete=room & ~suspicious & np.isinf(unknown_from))


def _first_intervals(depth: Array, known: ComplexArray) -> _Intervals:
    """Return the intervals between the first depths; where these are many, they tell the deviations too."""
    speeds, gaps = len(known), len(depth) - 1
    deviation, one_branch = np.full((speeds, gaps), np.nan), np.ones((speeds, gaps), dtype=bool)
    if len(depth) >= MANY:
        growth, angle = np.log(np.abs(known)), np.abs(np.angle(known))
        share = (depth[1:-1] - depth[:-2]) / (depth[2:] - depth[:-2])
        chord = (1.0 - share) * growth[:, :-2] + share * growth[:, 2:]
        inner = np.abs(growth[:, 1:-1] - chord)
        deviation = np.maximum(np.pad(inner, ((0, 0), (1, 0))), np.pad(inner, ((0, 0), (0, 1))))
        one_branch = np.abs(np.diff(angle, axis=1)) < NEAR_ANGLE
    return _Intervals(
        speed=np.repeat(np.arange(speeds), gaps),
        depth=np.tile(np.stack([depth[:-1], depth[1:]], axis=1), (speeds, 1)),
        multiplier=np.stack([known[:, :-1], known[:, 1:]], axis=-1).reshape(-1, 2),
        deviation=deviation.ravel(),
        one_branch=one_branch.ravel(),
    )


def _judge(intervals: _Intervals, coarsest: float) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return which intervals hide nothing, and which have one crossing and no more."""
    growth, crossed = intervals.growth, intervals.crossed
    nearest = np.abs(growth).min(axis=1)
    # Before an interval was halved nothing is known of its inside: comparisons with NaN are false.
    safe = nearest > np.where(intervals.one_branch, SAFE_ON_BRANCH, SAFE_ACROSS) * intervals.deviation
    change = np.abs(growth[:, 1] - growth[:, 0])
    fine = intervals.width <= coarsest
    closed = ~crossed & safe & (fine | (nearest > FAR))
    plain = crossed & intervals.one_branch & fine & (change > PLAIN_CHANGE * intervals.deviation)
    return closed, plain


def _halve(intervals: _Intervals, multipliers: Multipliers) -> _Intervals:
    """Evaluate intervals halfway and return both halves of each."""
    middle = intervals.depth.mean(axis=1)
    found = multipliers(intervals.speed, middle)
    deviation = np.abs(np.log(np.abs(found)) - intervals.growth.mean(axis=1))
    outer, inner = np.abs(np.angle(intervals.multiplier)), np.abs(np.angle(found))
    between = np.abs(inner - outer.mean(axis=1)) < MEAN_ANGLE
    all_of_one = between & (np.abs(outer[:, 1] - outer[:, 0]) < FARTHEST_ANGLE)
    halves = []
    for end in (0, 1):
        depth, multiplier = intervals.depth.copy(), intervals.multiplier.copy()
        depth[:, 1 - end], multiplier[:, 1 - end] = middle, found
        one_branch = all_of_one | (np.abs(inner - outer[:, end]) < NEAR_ANGLE)
        halves.append(
            replace(intervals, depth=depth, multiplier=multiplier, deviation=deviation, one_branch=one_branch)
        )
    return halves[0].then(halves[1])


def _roots(
    brackets: _Intervals, multipliers: Multipliers, unknown_from: Array, speeds: int, most: int
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the crossings (speed, crossing) of all brackets, and whether there was room for all of a speed."""
    limits, room = np.full((speeds, most), np.nan), np.ones(speeds, dtype=bool)
    # Beyond a depth where nothing is known nobody can say whether stability is lost or regained.
    brackets = brackets.select(brackets.depth[:, 0] < unknown_from[brackets.speed])
    order = np.lexsort([brackets.depth[:, 0], brackets.speed])
    speed, depth, growth = brackets.speed[order], brackets.depth[order], brackets.growth[order]
    if not len(speed):
        return limits, room
    ends = iter((growth[:, 0], growth[:, 1]))

    def log_radius(where: Array, index: Array) -> Array:
        """Answer what is known at the ends, which the root finder asks for first, and evaluate the rest."""
        at_end = next(ends, None)
        return at_end if at_end is not None else np.log(np.abs(multipliers(index.astype(np.intp), where)))

    found = elementwise.find_root(
        log_radius, (depth[:, 0], depth[:, 1]), args=(speed.astype(float),), tolerances={"xatol": DEPTH_TOLERANCE}
    )
    slot = np.arange(len(speed)) - np.searchsorted(speed, speed)
    # Where a multiplier is not known on the way to a crossing, nothing is known from there on.
    known = np.full(len(room), most)
    np.minimum.at(known, speed[~found.success], slot[~found.success])
    kept = slot < known[speed]
    room[speed[~kept]] = False
    limits[speed[kept], slot[kept]] = found.x[kept]
    return limits, room
