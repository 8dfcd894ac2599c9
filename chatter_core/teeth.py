"""Teeth one by one: which tooth cuts at which angles, and how long ago another left the surface there.

Tooth i follows tooth i + 1 by its pitch. Ahead of it at the angle theta lies the surface that the k-th tooth before
it left, higher than its own path by

    h_k(theta) = f t_k sin(theta) + R_i - R_(i+k),    t_k pitches passed since then, f the feed of a mean pitch,

so it removes the least of them, h = min_k h_k, and misses where that is negative. A tooth as long as its neighbours
always cuts after the one before it; one that is shorter by more than the feed misses altogether, and the tooth
behind it looks back two pitches. As straight lines in sin(theta) the h_k have a concave lower envelope, whose corners
are where k changes.

Source: W. A. Kline, R. E. DeVor, "The effect of runout on cutting geometry and forces in end milling", Int. J. Mach.
Tool Des. Res. 23 (1983) 123-140.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Digits of a pitch to which two teeth left the surface equally long ago: sums of pitches differ by rounding.
DELAY_DIGITS = 9


@dataclass(frozen=True, kw_only=True)
class Engagement:
    """Angles at which a tooth enters and leaves the workpiece [rad], 0 <= entry < exit <= pi."""

    entry: float
    exit: float


@dataclass(frozen=True, kw_only=True)
class Teeth:
    """Teeth against the turning: pitch (tooth,) from each to the one ahead, the mean being 1; radius (tooth,) [m].

    Radii are deviations from the nominal one.
    """

    pitch: Array
    radius: Array

    @property
    def repeat(self) -> int:
        """Number of teeth after which all are as before: 1 where all are alike."""
        both, count = np.stack([self.pitch, self.radius]), len(self.pitch)
        alike = (n for n in range(1, count) if count % n == 0 and np.array_equal(both, np.roll(both, n, axis=1)))
        return next(alike, count)


@dataclass(frozen=True, kw_only=True)
class Passages:
    """Stretches of angle on which one tooth removes what one other left, arrays (passage,).

    ahead: where the tooth sits in front of the first one; entry, exit: the stretch [rad], (point, passage) where it
    hangs on the operating point; pitches: mean pitches passed since the other tooth was there, the delay in tooth
    periods; longer: by how much its radius is larger than the other's [m]; lower, upper: the part of the edge, from 0
    at its tip to 1; repeat: number of teeth that are listed, after which the cut repeats itself; teeth: of the cutter.
    """

    ahead: Array
    entry: Array
    exit: Array
    pitches: Array
    longer: Array
    lower: Array
    upper: Array
    repeat: int
    teeth: int

    def __len__(self) -> int:
        return len(self.ahead)

    def select(self, kept: NDArray[np.intp]) -> "Passages":
        """Return some of the passages."""
        names = ("ahead", "entry", "exit", "pitches", "longer", "lower", "upper")
        arrays = {name: getattr(self, name)[..., kept] for name in names}
        return replace(self, **arrays)

    def by_delay(self) -> tuple["Passages", ...]:
        """Return the passages apart by how long ago the surface was left, the shortest first."""
        if len(self) == 1:
            return (self,)
        _, group = np.unique(np.round(self.pitches, DELAY_DIGITS), return_inverse=True)
        return tuple(self.select(np.flatnonzero(group == number)) for number in range(group.max() + 1))

    def chip_thickness(self, angle: Array, feed_per_tooth: float) -> Array:
        """Return the nominal chip thickness [m] at angles (..., passage) [rad], without vibration."""
        return np.asarray(feed_per_tooth * self.pitches * np.sin(angle) + self.longer)


def equal_teeth(count: int) -> Teeth:
    """Return teeth of one pitch and radius.

    See docs/physics.md#teeth.
    """
    return Teeth(pitch=np.ones(count), radius=np.zeros(count))


def passages(teeth: Teeth, engagement: Engagement, feed_per_tooth: float) -> Passages:
    """Return who cuts what; feed_per_tooth [m] is that of a mean pitch.

    See docs/physics.md#teeth.
    """
    count, repeat, rows = len(teeth.pitch), teeth.repeat, list[tuple[float, ...]]()
    for tooth in range(repeat):
        ahead = float(teeth.pitch[:tooth].sum()) * 2.0 * math.pi / count
        pitches = np.cumsum(np.roll(teeth.pitch, -tooth))
        longer = teeth.radius[tooth] - np.roll(teeth.radius, -tooth - 1)
        for low, high, k in _envelope(feed_per_tooth * pitches, longer):
            for entry, leave in _stretches(low, high, engagement):
                rows.append((ahead, entry, leave, float(pitches[k]), float(longer[k])))
    ahead_of, entries, exits, since, excess = np.array(rows).T
    return Passages(
        ahead=ahead_of,
        entry=entries,
        exit=exits,
        pitches=since,
        longer=excess,
        lower=np.zeros(len(rows)),
        upper=np.ones(len(rows)),
        repeat=repeat,
        teeth=count,
    )


def _envelope(slope: Array, start: Array) -> list[tuple[float, float, int]]:
    """Return stretches (from, to, k) of s = sin(theta) on which start_k + slope_k s is the least, and not negative.

    slope: (k,), positive and ascending; start: (k,) [m], the last one zero. To the right ever flatter lines take over.
    """
    low = max(0.0, float(np.max(-start / slope)))
    if low >= 1.0:
        return []
    height = start + slope * low
    now = int(np.flatnonzero(height <= height.min() + 1e-12 * slope[0])[0])
    found = []
    while True:
        meeting = (start[:now] - start[now]) / (slope[now] - slope[:now])
        high = float(meeting.min(initial=1.0))
        if high > low:
            found.append((low, min(high, 1.0), now))
        if high >= 1.0:
            return found
        now, low = int(np.argmin(meeting)), max(low, high)


def _stretches(low: float, high: float, engagement: Engagement) -> list[tuple[float, float]]:
    """Return the angles within the engagement at which sin(theta) lies between two values: rising, then falling."""
    first, last = math.asin(low), math.asin(high)
    ranges = [(first, math.pi - first)] if high == 1.0 else [(first, last), (math.pi - last, math.pi - first)]
    within = [(max(a, engagement.entry), min(b, engagement.exit)) for a, b in ranges]
    return [(a, b) for a, b in within if a < b]
