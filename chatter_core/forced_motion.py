"""The motion that unlike teeth force: the cutting force that repeats with the revolution.

Force and motion are those of ``chatter_core.contact``, at equal samples of a revolution; between samples the force is
linear, which a linear system answers exactly. The motion grows out of that of shallow cuts, so it is followed through
depths from none, and Newton's method does the rest. Deep cuts may repeat in several ways: chatter that loses contact
may do so with the revolution, too, and steps from rest end there, at a motion that stays and is not the forced one.
They are left to cuts of which this finds none.

Sources: J. Tlusty, F. Ismail, CIRP Ann. 30 (1981) 299-304 (steps through time, chatter that loses contact); L.
Qi, J. Sun, Math. Program. 58 (1993) 353-367 (Newton's method where slopes jump).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import LinearSystem
from chatter_core.jit import compiled
from chatter_core.linear_equations import solve

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Revolutions from rest, where nothing else finds a motion. A step's force is corrected so many times.
LONG, CORRECTIONS = 150, 2
#: Shares of its size by which a motion still changes with a revolution: near enough for Newton's method, and repeating.
NEAR, REPEATS = 1e-2, 1e-4
#: Newton steps at most, and halvings of one that does not come nearer.
STEPS, HALVINGS = 16, 5
#: A motion is followed from none at so many depths, with Newton steps at each and samples in a mean pitch.
RUNGS, RUNG_STEPS, COARSE = 8, 4, 8
#: Depths on the way to a motion that is not found otherwise, one set after the other.
LADDERS = (16, 1, 4)
#: Forces that are off by this share of the largest have arrived: rounding.
ARRIVED = 1e-9


class Cut(NamedTuple):
    """Cut at one operating point.

    offset (edge,): angle of each edge when the first tooth is at 0, edges of a tooth one after the other [rad]; entry,
    leave: where the work begins and ends [rad]; passed (tooth, k): mean pitches since the k-th tooth before it; longer
    (tooth, k): than that one [m]; feed: in a mean pitch [m]; tangential, radial: force of an edge over its chip [N/m].
    """

    offset: Array
    entry: float
    leave: float
    passed: Array
    longer: Array
    feed: float
    tangential: float
    radial: float


class Modes(NamedTuple):
    """Poles (pole,) [1/s] of the system that the cut moves, what is seen of each (2, pole), and drives it (pole, 2)."""

    poles: ComplexArray
    seen: ComplexArray
    driven: ComplexArray


class Answer(NamedTuple):
    """What a force at one sample moves, every revolution anew, (output, input, time) and twice over [m/N].

    after: at times since then; between: less what it moved when the k-th tooth before passed (tooth, k, ..), by times
    that the force is ahead.
    """

    after: Array
    between: Array


class Sampled(NamedTuple):
    """A cut, with sine and cosine of its edges' angles at samples, and the shares in the work (edge, sample)."""

    cut: Cut
    sine: Array
    cosine: Array
    weight: Array


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
    # Of every output, by every input.
    share = half.seen[:, :, None, :] * half.driven.swapaxes(1, 2)[:, None, :, :]
    systems, outputs, inputs, poles = share.shape
    found = (share.reshape(systems, outputs * inputs, poles) @ answer).real
    return np.ascontiguousarray(found.swapaxes(1, 2).reshape(systems, len(lag), outputs, inputs))


def twice(answer: Array) -> Array:
    """Return what is (.., time, output, input) and repeats twice over, as (.., output, input, time).

    Compiled loops then run along times, wherever they begin.

    See docs/physics.md#forced-motion.
    """
    once = np.moveaxis(answer, -3, -1)
    return np.concatenate([once, once], axis=-1)


def answer(once: Array, since: Array) -> Answer:
    """Return the answer, of all systems, that ``periodic_answer`` is; since: samples since a tooth before (tooth, k).

    See docs/physics.md#forced-motion.
    """
    outputs, inputs, times = once.shape[2], once.shape[3], once.shape[1]
    between = np.empty((len(once), *since.shape, outputs, inputs, 2 * times))
    _fill_between(once, since, between)
    return Answer(after=twice(once), between=between)


@compiled
def _fill_between(once, since, between):  # type: ignore[no-untyped-def]
    """Fill in what a force at one sample moves less what it moved when a tooth before passed; between: see Answer.

    By how many samples the force is ahead of the motion: a row of equations holds one motion and the forces in turn.
    """
    systems, times = once.shape[:2]
    for s, tooth, k in np.ndindex((systems, *since.shape)):
        whole = int(since[tooth, k])
        part = since[tooth, k] - whole
        for q in range(2 * times):
            now = -q % times
            # What is between samples is linear between them.
            after, before = once[s, (now - whole) % times], once[s, (now - whole - 1) % times]
            for o, i in np.ndindex(once.shape[2:]):
                then = (1.0 - part) * after[o, i] + part * before[o, i]
                between[s, tooth, k, o, i, q] = once[s, now, o, i] - then


@compiled
def repeating_force(cut, modes, revolution, answer, coarse):  # type: ignore[no-untyped-def]
    """Return the force (2, sample) that repeats [N], and whether it was found.

    revolution: how long one takes [s]; answer: at the samples of the force, and coarse: at COARSE in a mean pitch.

    See docs/physics.md#forced-motion.
    """
    samples = answer.after.shape[-1] // 2
    sampled = _sampled(cut, samples)
    force = _finer(_approached(_sampled(cut, coarse.after.shape[-1] // 2), coarse), samples)
    if _settled(sampled, 1.0, answer, force, STEPS):
        return force, True
    force, change = _from_rest(sampled, modes, revolution)
    found = force.copy()
    if change <= NEAR and _settled(sampled, 1.0, answer, found, STEPS):
        return found, True
    # Newton's method may go round in circles about a motion at which an edge just grazes the work.
    if change <= REPEATS:
        return force, True
    return _climbed(sampled, answer)


@compiled
def move(after, force, motion):  # type: ignore[no-untyped-def]
    """Fill in the motion (2, time) under forces (2, sample) that repeat; what comes after may be finer than samples.

    See docs/physics.md#forced-motion.
    """
    times = motion.shape[1]
    finer = times // force.shape[1]
    motion[:] = 0.0
    for sample in range(force.shape[1]):
        along, across = force[0, sample], force[1, sample]
        if along == 0.0 and across == 0.0:
            continue
        since = slice(times - sample * finer, 2 * times - sample * finer)
        for axis in range(2):
            by_along, by_across, moved = after[axis, 0][since], after[axis, 1][since], motion[axis]
            for j in range(times):
                moved[j] += by_along[j] * along + by_across[j] * across


@compiled
def at(motion, place):  # type: ignore[no-untyped-def]
    """Return the motion at a place between samples, linear between them.

    See docs/physics.md#forced-motion.
    """
    samples = motion.shape[1]
    whole = math.floor(place)
    part = place - whole
    low = int(whole)
    if not 0 <= low < samples:
        # Mostly in the revolution before: a remainder would cost more than all else here.
        low = low + samples if -samples <= low < 0 else low % samples
    high = low + 1 if low + 1 < samples else 0
    left = 1.0 - part
    return left * motion[0, low] + part * motion[0, high], left * motion[1, low] + part * motion[1, high]


@compiled
def surface(motion, place, sine, cosine, passed, longer, feed):  # type: ignore[no-untyped-def]
    """Return the chip of an edge at a place of the revolution if the tip had not moved now, and which tooth it follows.

    That is the least over the teeth before it, whose surfaces the motion has left; where the tip has moved now by x and
    y, the chip is sine x + cosine y more, whichever it follows. passed, longer: (k,).

    See docs/physics.md#forced-motion.
    """
    teeth = len(passed)
    per_pitch = motion.shape[1] / teeth
    least, which = np.inf, 0
    for k in range(teeth):
        then_x, then_y = at(motion, place - passed[k] * per_pitch)
        chip = feed * passed[k] * sine + longer[k] - sine * then_x - cosine * then_y
        if chip < least:
            least, which = chip, k
    return least, which


@compiled
def _sampled(cut, samples):  # type: ignore[no-untyped-def]
    """Return a cut at so many samples of a revolution."""
    edges, turn = len(cut.offset), 2.0 * math.pi
    sine, cosine, weight = np.empty((edges, samples)), np.empty((edges, samples)), np.empty((edges, samples))
    for e in range(edges):
        for j in range(samples):
            angle = (turn * j / samples + cut.offset[e]) % turn
            sine[e, j], cosine[e, j] = math.sin(angle), math.cos(angle)
            weight[e, j] = _share_inside(angle, turn / samples, cut.entry, cut.leave)
    return Sampled(cut, sine, cosine, weight)


@compiled
def _share_inside(angle, width, entry, leave):  # type: ignore[no-untyped-def]
    """Return the share of the angles about one that lie in the cut; the cut may reach over the full turn."""
    share = 0.0
    for around in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
        low, high = max(angle + around - 0.5 * width, entry), min(angle + around + 0.5 * width, leave)
        share += max(high - low, 0.0) / width
    return share


@compiled
def _finer(force, samples):  # type: ignore[no-untyped-def]
    """Return forces (2, coarse sample) at more samples, linear between."""
    result = np.empty((2, samples))
    for j in range(samples):
        result[0, j], result[1, j] = at(force, j * force.shape[1] / samples)
    return result


@compiled
def _from_rest(sampled, modes, revolution):  # type: ignore[no-untyped-def]
    """Cut from rest until the motion repeats, LONG revolutions at most.

    Return the force (2, sample) in the last, and by what share of its size the motion changed with it.
    """
    samples, poles = sampled.sine.shape[1], len(modes.poles)
    step = revolution / samples
    grown, early, late = np.empty(poles, np.complex128), np.empty_like(modes.driven), np.empty_like(modes.driven)
    at_once = np.zeros((2, 2))
    for n in range(poles):
        z = modes.poles[n] * step
        grown[n] = np.exp(z)
        # Of a force that is one all along a step, and one that rises to it.
        whole, rising = step * (grown[n] - 1.0) / z, step * (grown[n] - 1.0 - z) / z**2
        for axis in range(2):
            early[n, axis], late[n, axis] = (whole - rising) * modes.driven[n, axis], rising * modes.driven[n, axis]
            for out in range(2):
                at_once[out, axis] += (modes.seen[out, n] * late[n, axis]).real
    state = np.zeros(poles, np.complex128)
    left, who = np.empty(len(sampled.sine)), np.empty(sampled.sine.shape, np.int64)
    motion, force = np.zeros((2, samples)), np.zeros((2, samples))
    along = across = change = 0.0
    for _ in range(LONG):
        change = size = 0.0
        for j in range(samples):
            free_x = free_y = 0.0
            for n in range(poles):
                state[n] = grown[n] * state[n] + early[n, 0] * along + early[n, 1] * across
                free_x += (modes.seen[0, n] * state[n]).real
                free_y += (modes.seen[1, n] * state[n]).real
            x, y = _moved(free_x, free_y, at_once, along, across)
            _surfaces(sampled, motion, j, left, who)
            for _ in range(CORRECTIONS):
                along, across = _cutting(sampled, 1.0, j, x, y, left)
                x, y = _moved(free_x, free_y, at_once, along, across)
            for n in range(poles):
                state[n] += late[n, 0] * along + late[n, 1] * across
            change = max(change, abs(x - motion[0, j]), abs(y - motion[1, j]))
            size = max(size, abs(x), abs(y))
            motion[0, j], motion[1, j], force[0, j], force[1, j] = x, y, along, across
        change /= max(size, 1e-300)
        if change <= REPEATS:
            break
    return force, change


@compiled
def _moved(x, y, at_once, along, across):  # type: ignore[no-untyped-def]
    """Return a place, moved by what a force moves at once."""
    return x + at_once[0, 0] * along + at_once[0, 1] * across, y + at_once[1, 0] * along + at_once[1, 1] * across


@compiled
def _surfaces(sampled, motion, j, left, who):  # type: ignore[no-untyped-def]
    """Fill in the chip of every edge at a sample if the tip had not moved (edge,), and whom it follows; -1 is nobody.

    The chip is below all others outside of the work. motion: (2, sample), of the revolution before.
    """
    cut = sampled.cut
    slices = len(cut.offset) // len(cut.passed)
    for e in range(len(cut.offset)):
        left[e], who[e, j] = -np.inf, -1
        if sampled.weight[e, j] > 0.0:
            tooth = e // slices
            left[e], who[e, j] = surface(
                motion, float(j), sampled.sine[e, j], sampled.cosine[e, j], cut.passed[tooth], cut.longer[tooth],
                cut.feed,
            )  # fmt: skip


@compiled
def _cutting(sampled, share, j, x, y, left):  # type: ignore[no-untyped-def]
    """Return the force at a sample at a share of the depth; x, y: where the tip is; left: (edge,), see above."""
    along, across = 0.0, 0.0
    for e in range(len(left)):
        chip = left[e] + sampled.sine[e, j] * x + sampled.cosine[e, j] * y
        if chip > 0.0:
            by_along, by_across = _push(sampled, share, e, j)
            along += by_along * chip
            across += by_across * chip
    return along, across


@compiled
def _approached(sampled, answer):  # type: ignore[no-untyped-def]
    """Return about the force (2, sample) that repeats, followed through depths from none, whether it arrives or not."""
    force = np.zeros((2, sampled.sine.shape[1]))
    for rung in range(1, RUNGS + 1):
        _deeper(sampled, answer, force, rung, RUNGS, RUNG_STEPS)
    return force


@compiled
def _climbed(sampled, answer):  # type: ignore[no-untyped-def]
    """Return the force (2, sample) that repeats, by cuts that become deeper, and whether it was found."""
    force = np.zeros((2, sampled.sine.shape[1]))
    for rungs in LADDERS:
        force[:] = 0.0
        arrived = True
        for rung in range(1, rungs + 1):
            arrived = arrived and _deeper(sampled, answer, force, rung, rungs, STEPS)
        if arrived:
            return force, True
    return force, False


@compiled
def _deeper(sampled, answer, force, rung, rungs, steps):  # type: ignore[no-untyped-def]
    """Bring forces (2, sample) from one rung on the way to full depth to the next; return whether they arrived."""
    # To begin with, chips of deeper cuts are as thick as before.
    force *= rung / max(rung - 1, 1)
    return _settled(sampled, rung / rungs, answer, force, steps)


@compiled
def _settled(sampled, share, answer, force, steps):  # type: ignore[no-untyped-def]
    """Bring forces (2, sample) from near to where they repeat, at a share of the depth; return whether they arrived."""
    other, motion = np.empty_like(force), np.empty_like(force)
    who, next_who = np.empty(sampled.sine.shape, np.int64), np.empty(sampled.sine.shape, np.int64)
    move(answer.after, force, motion)
    far = _held_against(sampled, share, force, motion, who)
    for _ in range(steps):
        target = _forces(sampled, share, answer.between, who)
        length = 1.0
        for _ in range(HALVINGS):
            other[:] = force + length * (target - force)
            move(answer.after, other, motion)
            left = _held_against(sampled, share, other, motion, next_who)
            if left < far:
                break
            length *= 0.5
        force[:] = other
        who[:], far = next_who, left
        if far <= ARRIVED * np.abs(force).max():
            return True
    return False


@compiled
def _held_against(sampled, share, force, motion, who):  # type: ignore[no-untyped-def]
    """Fill in whom every edge follows (edge, sample), -1 where it cuts nothing; return how far the forces are off."""
    off, left = 0.0, np.empty(len(who))
    for j in range(force.shape[1]):
        x, y = motion[0, j], motion[1, j]
        _surfaces(sampled, motion, j, left, who)
        for e in range(len(who)):
            if left[e] + sampled.sine[e, j] * x + sampled.cosine[e, j] * y <= 0.0:
                who[e, j] = -1
        along, across = _cutting(sampled, share, j, x, y, left)
        off = max(off, abs(along - force[0, j]), abs(across - force[1, j]))
    return off


@compiled
def _forces(sampled, share, between, who):  # type: ignore[no-untyped-def]
    """Return the forces (2, sample) that repeat while who cuts what is held."""
    cut, (edges, samples) = sampled.cut, who.shape
    slices = edges // len(cut.passed)
    places, runs = _in_cut(who)
    begin, of_place, basis = _unknowns(sampled, share, who, places)
    unknowns = len(basis)
    matrix, right = np.eye(unknowns), np.zeros(unknowns)
    # What forces along and across at every place do to the unknowns of one, of which there are two at most.
    change = np.empty((2, 2, len(places)))
    for r in range(len(places)):
        j, first_own, many = places[r], begin[r], begin[r + 1] - begin[r]
        change[:] = 0.0
        for e in range(edges):
            k = who[e, j]
            if k < 0:
                continue
            s, c, tooth = sampled.sine[e, j], sampled.cosine[e, j], e // slices
            push = _push(sampled, share, e, j)
            chip = cut.feed * cut.passed[tooth, k] * s + cut.longer[tooth, k]
            for own in range(many):
                direction = basis[first_own + own]
                part = (push[0] * direction[0] + push[1] * direction[1]) / (direction[0] ** 2 + direction[1] ** 2)
                right[first_own + own] += part * chip
                for axis in range(2):
                    _add_thicker(
                        places, runs, samples - j, part * s, part * c, between[tooth, k, :, axis], change[own, axis]
                    )
        for own in range(many):
            along, across, row = change[own, 0], change[own, 1], matrix[first_own + own]
            for u in range(unknowns):
                row[u] -= along[of_place[u]] * basis[u, 0] + across[of_place[u]] * basis[u, 1]
    solved = solve(matrix, right)
    force = np.zeros((2, samples))
    for u in range(unknowns):
        j = places[of_place[u]]
        force[0, j] += solved[u] * basis[u, 0]
        force[1, j] += solved[u] * basis[u, 1]
    return force


@compiled
def _add_thicker(places, runs, ahead, sine, cosine, moved, thicker):  # type: ignore[no-untyped-def]
    """Add by how much a force at each place makes a chip thicker (place,).

    moved: (2, lag), by a force; ahead: where in it a force at the first sample is found.
    """
    for run in range(len(runs)):
        first, stop = runs[run, 0], runs[run, 1]
        since = places[first] + ahead
        x, y, here = moved[0, since : since + stop - first], moved[1, since : since + stop - first], thicker[first:stop]
        for q in range(stop - first):
            here[q] += sine * x[q] + cosine * y[q]


@compiled
def _push(sampled, share, e, j):  # type: ignore[no-untyped-def]
    """Return the force of an edge at a sample over its chip, along and across [N/m]."""
    cut, weight = sampled.cut, share * sampled.weight[e, j]
    s, c = sampled.sine[e, j], sampled.cosine[e, j]
    return -weight * (cut.tangential * c + cut.radial * s), weight * (cut.tangential * s - cut.radial * c)


@compiled
def _unknowns(sampled, share, who, places):  # type: ignore[no-untyped-def]
    """Return what the forces at places are made of: where a single edge cuts, its own direction, and its chip counts.

    That halves the unknowns of a cut in which teeth take turns. Elsewhere there are two, along and across.

    begin (place + 1,): the first unknown of each place; of_place (unknown,), the place of each; basis (unknown, 2), the
    forces that they stand for [N/m].
    """
    begin, size = np.zeros(len(places) + 1, np.int64), share * math.hypot(sampled.cut.tangential, sampled.cut.radial)
    of_place, basis = np.empty(2 * len(places), np.int64), np.zeros((2 * len(places), 2))
    for r in range(len(places)):
        cutting, last, first = 0, 0, begin[r]
        for e in range(len(who)):
            if who[e, places[r]] >= 0:
                cutting, last = cutting + 1, e
        if cutting == 1:
            basis[first] = _push(sampled, share, last, places[r])
        else:
            basis[first, 0], basis[first + 1, 1] = size, size
        begin[r + 1] = first + (1 if cutting == 1 else 2)
        of_place[first : begin[r + 1]] = r
    return begin, of_place[: begin[-1]], basis[: begin[-1]]


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
