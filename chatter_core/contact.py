"""Who cuts what while the cut itself moves the tool: the motion that unlike teeth force, and who meets the work on it.

Teeth of unlike radii or pitches remove unlike chips. Their force repeats with the revolution and moves the tip by w(t);
the tip carries the teeth along, so that of the chips

    h_k = f t_k sin(theta) + R_i - R_(i+k) + n(theta) . [w(t) - w(t - tau_k)],   n = (sin(theta), cos(theta))

tooth i removes the least, where that is positive (``chatter_core.teeth``). Who cuts what hangs on the motion, and the
motion on who cuts what: ``chatter_core.forced_motion`` finds both.

Teeth that are all alike are moved alike, and their motion drops out of all chips: nothing is to be found.

Sources: J. Tlusty, F. Ismail, CIRP Ann. 30 (1981) 299-304 (chips on the motion, loss of contact); T. Insperger, B. P.
Mann, T. Surmann, G. Stepan, Int. J. Mach. Tools Manuf. 48 (2008) 1081-1089 (stability about the motion that runout
forces).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.cutting import CuttingGain
from chatter_core.floquet import LinearSystem
from chatter_core.forced_motion import Cut, Modes, at, move, nearby_force, repeating_force, steps_of, surface
from chatter_core.jit import compiled
from chatter_core.teeth import Engagement, Passages, Teeth

Array = NDArray[np.float64]

#: Samples of force and motion in a mean pitch.
SAMPLES = 48
#: Forces lead to those of a cut that differs by no more than this in ln(depth).
NEAR_DEPTH = 0.05
#: Slices of a helical edge, parts of it that are in contact for themselves: so many at least and at most, and no wider
#: than this [rad], nor than this share of the arc in the work.
FEWEST, MOST, WIDEST, SHARE_OF_ARC = 2, 16, 0.5, 0.5
#: Fields of passages that all points share.
OF_PASSAGES = ("ahead", "pitches", "longer", "lower", "upper")
#: Stretches of a revolution on which one edge follows one other, at most: the motion parts one into several. Of 720
#: cuts of unlike pitches none has more; where one does, its motion counts as not found.
STRETCHES = 12
#: Looks at whom an edge follows in a sample of the motion: shorter stretches may be missed until they have grown.
LOOKS = 6
#: By this share of the work an edge is looked at inside of where it enters and leaves.
JUST_INSIDE = 1e-6
#: Halvings of the interval in which a stretch ends.
BISECTIONS = 22


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Who cuts what on the motion that the cut forces.

    passages: with entries and exits of every point (point, passage); motion: the tip's displacement (point, sample, 2)
    [m] at equal times of a revolution, from when the first tooth is at angle 0; force (point, 2, sample) [N];
    found: (point,), False where Newton's method has not arrived, or an edge begins and ends to follow too often.
    """

    passages: Passages
    motion: Array
    force: Array
    found: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class KnownForces:
    """Forces that repeat with the revolution, from which those of a model that hardly differs are found.

    spindle_speed [rad/s], axial_depth [m]: (point,); force: (point, 2, sample) [N].
    """

    spindle_speed: Array
    axial_depth: Array
    force: Array

    def near(self, spindle_speed: Array, axial_depth: Array) -> Array:
        """Return the forces (cut, 2, sample) at the speed and the nearest depth of cuts (cut,); NaN where none is near.

        See docs/physics.md#forced-motion.
        """
        apart = np.abs(np.log(axial_depth[:, None] / self.axial_depth))
        apart[spindle_speed[:, None] != self.spindle_speed] = np.inf
        nearest = apart.argmin(axis=1)
        near = apart[np.arange(len(nearest)), nearest] <= NEAR_DEPTH
        return np.where(near[:, None, None], self.force[nearest], np.nan)


def forced_contact(
    cut: CuttingGain,
    teeth: Teeth,
    engagement: Engagement,
    feed_per_tooth: float,
    system: LinearSystem,
    system_index: NDArray[np.intp],
    known: KnownForces | None = None,
) -> Contact:
    """Return who cuts what at operating points.

    cut: with any passages; feed_per_tooth [m] is that of a mean pitch; system_index: (point,), which of the systems
    moves the tip; known: forces of a model that hardly differs.

    Raises UnsupportedEquation when a system cannot be diagonalised.

    See docs/physics.md#forced-motion.
    """
    count, lag = len(teeth.pitch), np.asarray(cut.lag_angle)
    passed = np.array([np.cumsum(np.roll(teeth.pitch, -tooth)) for tooth in range(count)])
    longer = np.array([teeth.radius[tooth] - np.roll(teeth.radius, -tooth - 1) for tooth in range(count)])
    ahead = 2.0 * math.pi / count * np.concatenate([[0.0], np.cumsum(teeth.pitch)[:-1]])
    samples = count * SAMPLES
    motion, found = np.zeros((len(lag), 2, samples)), np.zeros(len(lag), dtype=np.bool_)
    force = np.full((len(lag), 2, samples), np.nan) if known is None else known.near(cut.spindle_speed, cut.axial_depth)
    half = system.half_spectrum
    modes = Modes(half.poles, half.seen, half.driven)
    tangential, radial = (
        np.broadcast_to(np.asarray(one, dtype=float), lag.shape)
        for one in (cut.coefficients.tangential, cut.coefficients.radial)
    )
    parts, number = list[tuple[NDArray[np.intp], Passages]](), slices_of(lag, engagement)
    for slices in np.unique(number):
        points = np.flatnonzero(number == slices)
        begin = np.zeros((len(points), count * slices, count, STRETCHES))
        end, motions, forces, arrived = np.zeros_like(begin), motion[points], force[points], found[points]
        _meet(
            modes,
            2.0 * math.pi / cut.spindle_speed[points],
            system_index[points],
            lag[points],
            cut.axial_depth[points] / slices,
            tangential[points],
            radial[points],
            ahead,
            passed,
            longer,
            feed_per_tooth,
            engagement.entry,
            engagement.exit,
            forces,
            motions,
            begin,
            end,
            arrived,
        )
        motion[points], force[points], found[points] = motions, forces, arrived
        parts.append((points, _listed(begin, end, ahead, passed, longer, int(slices), teeth.repeat)))
    return Contact(passages=_together(parts, len(lag)), motion=motion.swapaxes(1, 2), force=force, found=found)


def slices_of(lag: Array, engagement: Engagement) -> NDArray[np.intp]:
    """Return into how many slices the edges of points (point,) are parted, by how far they lag over the depth [rad].

    A number that hangs on the point alone: what is found for a cut is the same whatever else is asked with it.

    See docs/physics.md#forced-motion.
    """
    widest = min(WIDEST, SHARE_OF_ARC * (engagement.exit - engagement.entry))
    doublings = np.ceil(np.log2(np.maximum(lag / (FEWEST * widest), 1.0))).astype(np.intp)
    return np.where(lag > 0.0, np.minimum(FEWEST * 2**doublings, MOST), 1)


def _together(parts: list[tuple[NDArray[np.intp], Passages]], points: int) -> Passages:
    """Return the passages of groups of points as those of all; a point has none of the other groups'."""
    if len(parts) == 1:
        return parts[0][1]

    def spread(of: NDArray[np.intp], angles: Array) -> Array:
        every = np.zeros((points, angles.shape[1]))
        every[of] = angles
        return every

    told, first = [passages for _, passages in parts], parts[0][1]
    shared = {name: np.concatenate([getattr(one, name) for one in told]) for name in OF_PASSAGES}
    return Passages(
        entry=np.concatenate([spread(of, passages.entry) for of, passages in parts], axis=1),
        exit=np.concatenate([spread(of, passages.exit) for of, passages in parts], axis=1),
        repeat=first.repeat,
        teeth=first.teeth,
        **shared,
    )


def _listed(begin: Array, end: Array, ahead: Array, passed: Array, longer: Array, slices: int, repeat: int) -> Passages:
    """Return the stretches (point, edge, k, stretch) of the teeth until they repeat as passages, without empty ones."""
    kept = np.argwhere((end > begin).any(axis=0))
    # Of two teeth that are alike the later one left the lower surface, but for ties of rounding where chips vanish.
    kept = kept[(kept[:, 0] // slices < repeat) & (kept[:, 1] < repeat)]
    edge, k, stretch = kept.T
    tooth = edge // slices
    return Passages(
        ahead=ahead[tooth],
        entry=begin[:, edge, k, stretch],
        exit=end[:, edge, k, stretch],
        pitches=passed[tooth, k],
        longer=longer[tooth, k],
        lower=(edge % slices) / slices,
        upper=(edge % slices + 1.0) / slices,
        repeat=repeat,
        teeth=len(ahead),
    )


@compiled
def _meet(  # type: ignore[no-untyped-def]
    modes, revolutions, system, lags, depths, tangentials, radials, ahead, passed, longer, feed, entry, leave, forces,
    motions, begin, end, found,
):  # fmt: skip
    """Fill in forces, motions, where each edge begins and ends to follow each other, and what was found.

    forces (point, 2, sample): from nearby, not a number where nothing is known.
    """
    edges = begin.shape[1]
    slices = edges // len(ahead)
    for p in range(len(depths)):
        offset = np.empty(edges)
        for e in range(edges):
            offset[e] = ahead[e // slices] - lags[p] * (e % slices + 0.5) / slices
        cut = Cut(offset, entry, leave, passed, longer, feed, depths[p] * tangentials[p], depths[p] * radials[p])
        own = Modes(modes.poles[system[p]], modes.seen[system[p]], modes.driven[system[p]])
        if np.isfinite(forces[p, 0, 0]):
            force, found[p] = nearby_force(cut, own, revolutions[p], forces[p])
        else:
            force, found[p] = repeating_force(cut, own, revolutions[p], forces.shape[2])
        forces[p] = force
        move(steps_of(own, revolutions[p], motions.shape[2]), force, motions[p])
        found[p] = found[p] and np.isfinite(motions[p]).all()
        for e in range(edges):
            found[p] = _follow(cut, motions[p], e, begin[p, e], end[p, e]) and found[p]


@compiled
def _follow(cut, motion, edge, begin, end):  # type: ignore[no-untyped-def]
    """Fill in the angles (k, stretch) between which an edge follows the k-th tooth before it; tell whether all fit."""
    samples, entry, leave = motion.shape[1], cut.entry, cut.leave
    pieces = math.ceil((leave - entry) * LOOKS * samples / (2.0 * math.pi))
    filled = np.zeros(cut.passed.shape[1], np.int64)
    # Where the chip begins and ends with nothing rounding would say who cuts.
    inside = JUST_INSIDE * (leave - entry)
    now, start = _whom(cut, motion, edge, entry + inside), entry
    for piece in range(pieces):
        high = min(entry + (leave - entry) * (piece + 1) / pieces, leave - inside)
        following = _whom(cut, motion, edge, high)
        # Several may take turns within a piece, however briefly.
        for _ in range(len(filled)):
            if now == following:
                break
            below, above = max(start, entry + (leave - entry) * piece / pieces), high
            for _ in range(BISECTIONS):
                middle = 0.5 * (below + above)
                if _whom(cut, motion, edge, middle) == now:
                    below = middle
                else:
                    above = middle
            if now >= 0:
                _note(now, start, below, filled, begin, end)
            now, start = _whom(cut, motion, edge, above), below
        now = following
    if now >= 0:
        _note(now, start, leave, filled, begin, end)
    return filled.max() <= begin.shape[1]


@compiled
def _note(k, start, stop, filled, begin, end):  # type: ignore[no-untyped-def]
    """Write a stretch down where there is room for it, and count it."""
    if filled[k] < begin.shape[1]:
        begin[k, filled[k]], end[k, filled[k]] = start, stop
    filled[k] += 1


@compiled
def _whom(cut, motion, edge, angle):  # type: ignore[no-untyped-def]
    """Return whom an edge follows at an angle, -1 where it cuts nothing."""
    tooth = edge * len(cut.passed) // len(cut.offset)
    place = (angle - cut.offset[edge]) * motion.shape[1] / (2.0 * math.pi)
    sine, cosine = math.sin(angle), math.cos(angle)
    left, k = surface(motion, place, sine, cosine, cut.passed[tooth], cut.longer[tooth], cut.feed)
    x, y = at(motion, place)
    return k if left + sine * x + cosine * y > 0.0 else -1
