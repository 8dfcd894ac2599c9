"""Who cuts what while the cut itself moves the tool: the motion that unlike teeth force, and who meets the work on it.

Teeth of unlike radii remove unlike chips. Their force repeats with the revolution and moves the tip by w(t); the tip
carries the teeth along, so that of the chips

    h_k = f t_k sin(theta) + R_i - R_(i+k) + n(theta) . [w(t) - w(t - tau_k)],   n = (sin(theta), cos(theta))

tooth i removes the least, where that is positive (``chatter_core.teeth``). Who cuts what hangs on the motion, and the
motion on who cuts what. With who cuts what held, chips and forces are linear in each other; so the motion that
repeats is found by Newton's method, on forces that are linear between samples, which a linear system answers exactly.

Teeth of one radius are moved alike, and their motion drops out of all chips: nothing is to be found.

Sources: J. Tlusty, F. Ismail, CIRP Ann. 30 (1981) 299-304 (chips on the motion, loss of contact); T. Insperger, B. P.
Mann, T. Surmann, G. Stepan, Int. J. Mach. Tools Manuf. 48 (2008) 1081-1089 (stability about the motion that runout
forces); L. Qi, J. Sun, Math. Program. 58 (1993) 353-367 (Newton's method where slopes jump).
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.cutting import CuttingGain
from chatter_core.floquet import LinearSystem
from chatter_core.jit import compiled
from chatter_core.teeth import Engagement, Passages, Teeth

Array = NDArray[np.float64]

#: Samples of the force in a mean pitch, and how much finer the motion is.
SAMPLES, FINER = 32, 3
#: Slices of a helical edge: parts of it that are in contact for themselves.
SLICES = 2
#: Stretches of a revolution on which one edge follows one other, at most; the motion may part one into several.
STRETCHES = 4
#: Newton steps at most, halvings of one that does not come nearer, and of the interval in which a stretch ends.
STEPS, HALVINGS, BISECTIONS = 16, 5, 32
#: The motion is first followed from none at so many depths, with Newton steps at each and samples in a mean pitch.
RUNGS, RUNG_STEPS, COARSE = 8, 4, 8
#: Depths on the way to a motion that is not found from there, one set after the other.
LADDERS = (16, 1, 4)
#: Forces that are off by this share of the largest have arrived: rounding.
ARRIVED = 1e-9


@dataclass(frozen=True, kw_only=True)
class Contact:
    """Who cuts what on the motion that the cut forces.

    passages: with entries and exits of every point (point, passage); motion: the tip's displacement (point, sample, 2)
    [m] at equal times of a revolution, from when the first tooth is at angle 0; found: (point,), False where Newton's
    method has not arrived.
    """

    passages: Passages
    motion: Array
    found: NDArray[np.bool_]


def forced_contact(
    cut: CuttingGain,
    teeth: Teeth,
    engagement: Engagement,
    feed_per_tooth: float,
    system: LinearSystem,
    system_index: NDArray[np.intp],
) -> Contact:
    """Return who cuts what at operating points.

    cut: with any passages; feed_per_tooth [m] is that of a mean pitch; system_index: (point,), which of the systems
    moves the tip.

    Raises UnsupportedEquation when a system cannot be diagonalised.

    See docs/physics.md#forced-motion.
    """
    count, lag = len(teeth.pitch), np.asarray(cut.lag_angle)
    slices = SLICES if cut.tool.helix_angle > 0.0 else 1
    passed = np.array([np.cumsum(np.roll(teeth.pitch, -tooth)) for tooth in range(count)])
    longer = np.array([teeth.radius[tooth] - np.roll(teeth.radius, -tooth - 1) for tooth in range(count)])
    ahead = 2.0 * math.pi / count * np.concatenate([[0.0], np.cumsum(teeth.pitch)[:-1]])
    speed = np.empty(len(system.state_matrix))
    speed[system_index] = cut.spindle_speed
    points = len(lag)
    begin = np.zeros((points, count * slices, count, STRETCHES))
    end, found = np.zeros_like(begin), np.zeros(points, dtype=np.bool_)
    motion = np.zeros((points, 2, count * SAMPLES * FINER))
    answer = periodic_answer(system, 2.0 * math.pi / speed, count * SAMPLES, FINER)
    coarse = periodic_answer(system, 2.0 * math.pi / speed, count * COARSE)
    _meet(
        _twice(answer),
        *_answers(answer[:, ::FINER], passed * SAMPLES),
        *_answers(coarse, passed * COARSE),
        system_index,
        lag,
        cut.axial_depth / slices,
        np.broadcast_to(np.asarray(cut.coefficients.tangential, dtype=float), (points,)),
        np.broadcast_to(np.asarray(cut.coefficients.radial, dtype=float), (points,)),
        ahead,
        passed,
        longer,
        feed_per_tooth,
        engagement.entry,
        engagement.exit,
        motion,
        begin,
        end,
        found,
    )
    return Contact(
        passages=_listed(begin, end, ahead, passed, longer, slices, teeth.repeat),
        motion=motion.swapaxes(1, 2),
        found=found,
    )


def periodic_answer(system: LinearSystem, period: Array, samples: int, finer: int = 1) -> Array:
    """Return what a force that is one at a sample, zero at all others and linear between moves (system, lag, 2, 2).

    The force comes once in a period (system,) [s] of so many samples; lag: time since then, so many times finer than
    samples; output and input axis [m/N].

    See docs/physics.md#forced-motion.
    """
    half, step = system.half_spectrum, period[:, None] / samples
    turned = half.poles * step
    around, grown = np.exp(half.poles * period[:, None]), np.exp(turned)
    # Of a force (1 - |u|), u in samples, what has acted on exp(pole t) until a lag, and what acts in all. What is
    # still to come acted a period ago.
    lag = np.arange(samples * finer) / finer
    near = np.minimum(lag, samples - lag) < 1.0
    since = np.where(near & (lag > 1.0), lag - samples, lag)
    acted = np.zeros((*turned.shape, len(lag)), dtype=complex)
    z, t = turned[..., None], since[near]
    rising, falling = np.exp(z * (1.0 + np.minimum(t, 0.0))) - 1.0 - z * (1.0 + np.minimum(t, 0.0)), np.maximum(t, 0.0)
    acted[..., near] = rising * np.exp(z * falling) + (z - 1.0) * np.exp(z * falling) + 1.0 - z + z * falling
    whole = np.exp(z * (np.where(near, since + samples, lag) - 1.0)) * (1.0 - grown[..., None]) ** 2
    acted[..., near] *= (1.0 - around)[..., None]
    answer = (acted + whole) * (step / (turned**2 * (1.0 - around)))[..., None]
    return np.ascontiguousarray(np.einsum("sop,spn,spi->snoi", half.seen, answer, half.driven, optimize=True).real)


def _between(answer: Array, since: Array) -> Array:
    """Return what a force moves the tip by between two times, so many samples apart (tooth, k).

    As ``answer``, (system, tooth, k, lag, 2, 2): what is between samples is linear between them.
    """
    result = np.empty((len(answer), *since.shape, *answer.shape[1:]))
    for tooth, k in np.ndindex(since.shape):
        whole, part = int(since[tooth, k]), float(since[tooth, k] % 1.0)
        then = (1.0 - part) * np.roll(answer, whole, axis=1) + part * np.roll(answer, whole + 1, axis=1)
        result[:, tooth, k] = answer - then
    return result


def _answers(answer: Array, since: Array) -> tuple[Array, Array]:
    """Return the answer to a force, and between two times to one that is so much later, as compiled loops want it."""
    return _twice(answer), _twice(_between(answer, since)[..., -np.arange(answer.shape[1]), :, :])


def _twice(answer: Array) -> Array:
    """Return what is (.., time, output, input) and repeats twice over, as (.., output, input, time).

    Compiled loops then run along times, wherever they begin.
    """
    once = np.moveaxis(answer, -3, -1)
    return np.concatenate([once, once], axis=-1)


def _listed(begin: Array, end: Array, ahead: Array, passed: Array, longer: Array, slices: int, repeat: int) -> Passages:
    """Return the stretches (point, edge, k, stretch) of the teeth until they repeat as passages, without empty ones."""
    kept = np.argwhere((end > begin).any(axis=0))
    kept = kept[kept[:, 0] // slices < repeat]
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
    fines, answers, betweens, coarse_answers, coarse_betweens, system, lags, depths, tangentials, radials, ahead,
    passed, longer, feed, entry, leave, motions, begin, end, found,
):  # fmt: skip
    """Fill in the motions, where each edge begins and ends to follow each other, and what was found."""
    samples, teeth = answers.shape[-1] // 2, len(ahead)
    edges = begin.shape[1]
    slices = edges // teeth
    for p in range(len(depths)):
        offset = np.empty(edges)
        for e in range(edges):
            offset[e] = ahead[e // slices] - lags[p] * (e % slices + 0.5) / slices
        tangential, radial = depths[p] * tangentials[p], depths[p] * radials[p]
        force = _finer(
            _approached(
                coarse_answers[system[p]], coarse_betweens[system[p]], tangential, radial, offset, passed, longer,
                feed, entry, leave,
            ),
            samples,
        )  # fmt: skip
        found[p] = _repeating(
            answers[system[p]], betweens[system[p]], tangential, radial, *_edges(offset, samples, entry, leave),
            passed, longer, feed, force,
        )  # fmt: skip
        _move(fines[system[p]], force, motions[p])
        for e in range(edges):
            _follow(
                motions[p],
                offset[e],
                passed[e // slices],
                longer[e // slices],
                feed,
                entry,
                leave,
                begin[p, e],
                end[p, e],
            )


@compiled
def _edges(offset, samples, entry, leave):  # type: ignore[no-untyped-def]
    """Return sine and cosine of the edges' angles at samples of a revolution, and how far they cut (edge, sample)."""
    edges, turn = len(offset), 2.0 * math.pi
    sine, cosine, weight = np.empty((edges, samples)), np.empty((edges, samples)), np.empty((edges, samples))
    for e in range(edges):
        for j in range(samples):
            angle = (turn * j / samples + offset[e]) % turn
            sine[e, j], cosine[e, j] = math.sin(angle), math.cos(angle)
            weight[e, j] = _share_inside(angle, turn / samples, entry, leave)
    return sine, cosine, weight


@compiled
def _share_inside(angle, width, entry, leave):  # type: ignore[no-untyped-def]
    """Return the share of the angles about one that lie in the cut; the cut may reach over the full turn."""
    share = 0.0
    for around in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
        low, high = max(angle + around - 0.5 * width, entry), min(angle + around + 0.5 * width, leave)
        share += max(high - low, 0.0) / width
    return share


@compiled
def _approached(  # type: ignore[no-untyped-def]
    answer, between, tangential, radial, offset, passed, longer, feed, entry, leave,
):  # fmt: skip
    """Return about the force (2, coarse sample) that repeats, followed through depths from none.

    Deep cuts may repeat in several ways. A cut that begins at rest comes to the one that grows out of shallow cuts.
    """
    samples = answer.shape[-1] // 2
    sine, cosine, weight = _edges(offset, samples, entry, leave)
    force = np.zeros((2, samples))
    for rung in range(1, RUNGS + 1):
        _deeper(
            answer, between, tangential, radial, sine, cosine, weight, passed, longer, feed, force, rung, RUNGS,
            RUNG_STEPS,
        )  # fmt: skip
    return force


@compiled
def _repeating(  # type: ignore[no-untyped-def]
    answer, between, tangential, radial, sine, cosine, weight, passed, longer, feed, force,
):  # fmt: skip
    """Find the force (2, sample) that repeats near one, and return whether it was found; forces over chips [N/m].

    At once, or else by cuts that become deeper, each from the motion of the one before.
    """
    there = _deeper(
        answer, between, tangential, radial, sine, cosine, weight, passed, longer, feed, force, 1, 1, STEPS,
    )  # fmt: skip
    for rungs in LADDERS:
        if there:
            break
        force[:] = 0.0
        for rung in range(1, rungs + 1):
            there = _deeper(
                answer, between, tangential, radial, sine, cosine, weight, passed, longer, feed, force, rung, rungs,
                STEPS,
            )  # fmt: skip
            if not there:
                break
    return there


@compiled
def _deeper(  # type: ignore[no-untyped-def]
    answer, between, tangential, radial, sine, cosine, weight, passed, longer, feed, force, rung, rungs, steps,
):  # fmt: skip
    """Bring forces (2, sample) from one rung on the way to full depth to the next; return whether they arrived."""
    share = rung / rungs
    # To begin with, chips of deeper cuts are as thick as before.
    force *= rung / max(rung - 1, 1)
    return _settled(
        answer, between, share * tangential, share * radial, sine, cosine, weight, passed, longer, feed, force, steps,
    )  # fmt: skip


@compiled
def _finer(force, samples):  # type: ignore[no-untyped-def]
    """Return forces (2, coarse sample) at more samples, linear between."""
    result = np.empty((2, samples))
    for j in range(samples):
        result[0, j], result[1, j] = _at(force, j * force.shape[1] / samples)
    return result


@compiled
def _settled(  # type: ignore[no-untyped-def]
    answer, between, tangential, radial, sine, cosine, weight, passed, longer, feed, force, steps,
):  # fmt: skip
    """Bring forces (2, sample) that repeat from near to where they belong; return whether they have arrived."""
    edges, samples = sine.shape
    other, motion = np.empty((2, samples)), np.empty((2, samples))
    who, next_who = np.empty((edges, samples), np.int64), np.empty((edges, samples), np.int64)
    _move(answer, force, motion)
    far = _held_against(force, motion, tangential, radial, sine, cosine, weight, passed, longer, feed, who)
    for _ in range(steps):
        target = _forces(between, tangential, radial, sine, cosine, weight, passed, longer, feed, who)
        share = 1.0
        for _ in range(HALVINGS):
            other[:] = force + share * (target - force)
            _move(answer, other, motion)
            left = _held_against(
                other, motion, tangential, radial, sine, cosine, weight, passed, longer, feed, next_who
            )
            if left < far:
                break
            share *= 0.5
        force[:] = other
        who[:], far = next_who, left
        if far <= ARRIVED * np.abs(force).max():
            return True
    return False


@compiled
def _move(answer, force, motion):  # type: ignore[no-untyped-def]
    """Fill in the motion (2, time) under forces (2, sample) that repeat; the answer may be finer than samples."""
    times = motion.shape[1]
    finer = times // force.shape[1]
    motion[:] = 0.0
    for sample in range(force.shape[1]):
        along, across = force[0, sample], force[1, sample]
        if along == 0.0 and across == 0.0:
            continue
        since = slice(times - sample * finer, 2 * times - sample * finer)
        for axis in range(2):
            by_along, by_across, moved = answer[axis, 0][since], answer[axis, 1][since], motion[axis]
            for j in range(times):
                moved[j] += by_along[j] * along + by_across[j] * across


@compiled
def _at(motion, place):  # type: ignore[no-untyped-def]
    """Return the motion at a place between samples, linear between them."""
    samples = motion.shape[1]
    whole = math.floor(place)
    part = place - whole
    low = whole % samples
    high = low + 1 if low + 1 < samples else 0
    left = 1.0 - part
    return left * motion[0, low] + part * motion[0, high], left * motion[1, low] + part * motion[1, high]


@compiled
def _least(motion, place, sine, cosine, passed, longer, feed):  # type: ignore[no-untyped-def]
    """Return the least chip at a place of the revolution, and of which tooth before it is; pitches passed (k,)."""
    teeth = len(passed)
    per_pitch = motion.shape[1] / teeth
    now_x, now_y = _at(motion, place)
    least, which = np.inf, 0
    for k in range(teeth):
        then_x, then_y = _at(motion, place - passed[k] * per_pitch)
        chip = feed * passed[k] * sine + longer[k] + sine * (now_x - then_x) + cosine * (now_y - then_y)
        if chip < least:
            least, which = chip, k
    return least, which


@compiled
def _held_against(  # type: ignore[no-untyped-def]
    force, motion, tangential, radial, sine, cosine, weight, passed, longer, feed, who,
):  # fmt: skip
    """Fill in whom every edge follows (edge, sample), -1 where it cuts nothing; return how far the forces are off."""
    edges, samples = sine.shape
    slices = edges // len(passed)
    off = 0.0
    for j in range(samples):
        along, across = 0.0, 0.0
        for e in range(edges):
            who[e, j] = -1
            if weight[e, j] > 0.0:
                s, c = sine[e, j], cosine[e, j]
                chip, k = _least(motion, float(j), s, c, passed[e // slices], longer[e // slices], feed)
                if chip > 0.0:
                    who[e, j] = k
                    along -= weight[e, j] * (tangential * c + radial * s) * chip
                    across += weight[e, j] * (tangential * s - radial * c) * chip
        off = max(off, abs(along - force[0, j]), abs(across - force[1, j]))
    return off


@compiled
def _forces(  # type: ignore[no-untyped-def]
    between, tangential, radial, sine, cosine, weight, passed, longer, feed, who,
):  # fmt: skip
    """Return the forces (2, sample) that repeat while who cuts what is held."""
    edges, samples = sine.shape
    slices = edges // len(passed)
    places, runs = _in_cut(who)
    count = len(places)
    matrix, right = np.eye(2 * count), np.zeros(2 * count)
    for r in range(count):
        j = places[r]
        for e in range(edges):
            k = who[e, j]
            if k < 0:
                continue
            s, c, tooth = sine[e, j], cosine[e, j], e // slices
            along = -weight[e, j] * (tangential * c + radial * s)
            across = weight[e, j] * (tangential * s - radial * c)
            chip = feed * passed[tooth, k] * s + longer[tooth, k]
            right[r] += along * chip
            right[count + r] += across * chip
            for axis in range(2):
                moved_x, moved_y = between[tooth, k, 0, axis], between[tooth, k, 1, axis]
                row_along, row_across = matrix[r], matrix[count + r]
                for run in range(len(runs)):
                    first, size = runs[run, 0], runs[run, 1] - runs[run, 0]
                    since = places[first] - j + samples
                    column = axis * count + first
                    x, y = moved_x[since : since + size], moved_y[since : since + size]
                    to_along, to_across = row_along[column : column + size], row_across[column : column + size]
                    for q in range(size):
                        chip = s * x[q] + c * y[q]
                        to_along[q] -= along * chip
                        to_across[q] -= across * chip
    solved = np.linalg.solve(matrix, right)
    force = np.zeros((2, samples))
    for r in range(count):
        force[0, places[r]], force[1, places[r]] = solved[r], solved[count + r]
    return force


@compiled
def _in_cut(who):  # type: ignore[no-untyped-def]
    """Return the samples at which an edge cuts (place,), and where runs of neighbours begin and end (run, 2)."""
    edges, samples = who.shape
    places, runs = np.empty(samples, np.int64), np.empty((samples, 2), np.int64)
    count, many = 0, 0
    for j in range(samples):
        cuts = False
        for e in range(edges):
            cuts = cuts or who[e, j] >= 0
        if not cuts:
            continue
        if count == 0 or places[count - 1] != j - 1:
            runs[many, 0] = count
            many += 1
        places[count] = j
        count += 1
        runs[many - 1, 1] = count
    return places[:count], runs[:many]


@compiled
def _follow(motion, offset, passed, longer, feed, entry, leave, begin, end):  # type: ignore[no-untyped-def]
    """Fill in the angles (k, stretch) between which an edge follows the k-th tooth before it."""
    samples = motion.shape[1]
    pieces = math.ceil((leave - entry) * samples / (2.0 * math.pi))
    filled = np.zeros(len(passed), np.int64)
    low = entry
    now = _whom(motion, low, offset, passed, longer, feed)
    start = low
    for piece in range(pieces):
        high = entry + (leave - entry) * (piece + 1) / pieces
        following = _whom(motion, high, offset, passed, longer, feed)
        if following != now:
            below, above = low, high
            for _ in range(BISECTIONS):
                middle = 0.5 * (below + above)
                if _whom(motion, middle, offset, passed, longer, feed) == now:
                    below = middle
                else:
                    above = middle
            if now >= 0:
                _note(now, start, below, filled, begin, end)
            now, start = following, below
        low = high
    if now >= 0:
        _note(now, start, leave, filled, begin, end)


@compiled
def _note(k, start, stop, filled, begin, end):  # type: ignore[no-untyped-def]
    """Write a stretch down; one too many lengthens the last."""
    place = min(filled[k], begin.shape[1] - 1)
    if filled[k] == place:
        begin[k, place] = start
    end[k, place] = stop
    filled[k] = place + 1


@compiled
def _whom(motion, angle, offset, passed, longer, feed):  # type: ignore[no-untyped-def]
    """Return whom an edge follows at an angle, -1 where it cuts nothing."""
    place = (angle - offset) * motion.shape[1] / (2.0 * math.pi)
    chip, k = _least(motion, place, math.sin(angle), math.cos(angle), passed, longer, feed)
    return k if chip > 0.0 else -1
