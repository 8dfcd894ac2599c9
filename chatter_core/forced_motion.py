"""The motion that unlike teeth force: the cutting force that repeats with the revolution.

Force and motion are those of ``chatter_core.contact``, at equal samples of a revolution. Between samples the force is
linear, which a linear system answers exactly, once it is sharpened by what lines take off its waves; the motion is a
cubic. It grows out of that of shallow cuts, so it is followed through depths from none, and Newton's method does the
rest. Deep cuts may repeat in several ways: chatter that loses contact may do so with the revolution, too, and steps
from rest end there, at a motion that stays and is not the forced one. They are left to cuts of which this finds none.

Sources: J. Tlusty, F. Ismail, CIRP Ann. 30 (1981) 299-304 (steps through time, chatter that loses contact); L.
Qi, J. Sun, Math. Program. 58 (1993) 353-367 (Newton's method where slopes jump).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chatter_core.jit import compiled
from chatter_core.linear_equations import arrived, begun, combined

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Revolutions from rest, where nothing else finds a motion. A step's force is corrected so many times.
LONG, CORRECTIONS = 150, 2
#: Shares of its size by which a motion still changes with a revolution: near enough for Newton's method, and repeating.
NEAR, REPEATS = 1e-2, 1e-4
#: Newton steps at most, and halvings of one that does not come nearer.
STEPS, HALVINGS = 30, 5
#: It gives up where so many steps have not come nearer than this share of the nearest before: it goes in circles.
PATIENCE, NEARER = 8, 0.7
#: Below this size of z sums tell (e^z - 1) / z and (e^z - 1 - z) / z^2, of so many terms, to rounding.
NEAR_ZERO, TERMS = 0.5, 16
#: Samples in a mean pitch while a motion is followed from none.
COARSE = 8
#: Forces that are off by this share of the largest have arrived.
ARRIVED = 1e-9


class Way(NamedTuple):
    """How a motion is followed through depths.

    rungs: so many depths; steps: of Newton's method at each; at_each: whether it has to arrive there.
    """

    rungs: int
    steps: int
    at_each: bool


#: How a motion is followed from none, how from nearby, and how where it is not found so, one after the other. Numbers
#: that are passed on one by one would be compiled for each of their values.
ROUGHLY, DIRECTLY = Way(8, 4, False), Way(1, STEPS, True)
LADDERS = (Way(16, STEPS, True), DIRECTLY, Way(4, STEPS, True))


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


class Steps(NamedTuple):
    """A step of time: states y become grown y + driven f, under forces f that are linear between steps.

    The tip is at the real part of seen y, and at_once f (output, input) besides. grown (part, pole), driven and seen
    (axis, part, pole), forever (part, pole): how much larger states are that a revolution leaves for all revolutions
    before; the parts are real and imaginary.
    """

    grown: Array
    driven: Array
    seen: Array
    at_once: Array
    forever: Array


class Sampled(NamedTuple):
    """A cut, with sine and cosine of its edges' angles at samples, and the shares in the work (edge, sample)."""

    cut: Cut
    sine: Array
    cosine: Array
    weight: Array


@compiled
def steps_of(modes, revolution, times):  # type: ignore[no-untyped-def]
    """Return what a step of time does to modes; so many times are a revolution [s].

    Of a force that rises to one in a step the states z of the modes get ``late``, and y is z less late f.

    See docs/physics.md#forced-motion.
    """
    poles, step = len(modes.poles), revolution / times
    grown, forever, at_once = np.empty((2, poles)), np.empty((2, poles)), np.zeros((2, 2))
    driven, seen = np.empty((2, 2, poles)), np.empty((2, 2, poles))
    for n in range(poles):
        whole, rising = _acted(modes.poles[n] * step)
        left = np.exp(modes.poles[n] * step)
        grown[0, n], grown[1, n] = left.real, left.imag
        lost = 1.0 - np.exp(modes.poles[n] * revolution)
        # Of a mode that does not die away there is no motion that repeats.
        all_before = 1.0 / lost if lost != 0.0 else complex(np.nan, np.nan)
        forever[0, n], forever[1, n] = all_before.real, all_before.imag
        for axis in range(2):
            late = step * rising * modes.driven[n, axis]
            following = step * (whole - rising) * modes.driven[n, axis] + left * late
            driven[axis, 0, n], driven[axis, 1, n] = following.real, following.imag
            seen[axis, 0, n], seen[axis, 1, n] = modes.seen[axis, n].real, modes.seen[axis, n].imag
            for out in range(2):
                at_once[out, axis] += (modes.seen[out, n] * late).real
    return Steps(grown, driven, seen, at_once, forever)


@compiled
def _acted(z):  # type: ignore[no-untyped-def]
    """Return what has acted on exp(z t) until t = 1 of a force that is one, and of one that has risen to it."""
    if abs(z) > NEAR_ZERO:
        return (np.exp(z) - 1.0) / z, (np.exp(z) - 1.0 - z) / z**2
    whole, rising, term = 0.0 * z, 0.0 * z, 1.0 + 0.0 * z
    for k in range(1, TERMS + 1):
        # Of order k - 1: z^(k-1) / k! and z^(k-1) / (k+1)!.
        term /= k
        whole += term
        rising += term / (k + 1)
        term *= z
    return whole, rising


@compiled
def repeating_force(cut, modes, revolution, samples):  # type: ignore[no-untyped-def]
    """Return the force (2, sample) that repeats [N], and whether it was found.

    revolution: how long one takes [s]; samples: in one.

    See docs/physics.md#forced-motion.
    """
    sampled, steps = _sampled(cut, samples), steps_of(modes, revolution, samples)
    few = COARSE * len(cut.passed)
    coarse = np.zeros((2, few))
    _followed(_sampled(cut, few), steps_of(modes, revolution, few), coarse, ROUGHLY)
    force = _finer(coarse, samples)
    if _followed(sampled, steps, force, DIRECTLY):
        return force, True
    force, change = _from_rest(sampled, steps)
    found = force.copy()
    if change <= NEAR and _followed(sampled, steps, found, DIRECTLY):
        return found, True
    # Newton's method may go round in circles about a motion at which an edge just grazes the work.
    if change <= REPEATS:
        return force, True
    for way in LADDERS:
        force[:] = 0.0
        if _followed(sampled, steps, force, way):
            return force, True
    return force, False


@compiled
def nearby_force(cut, modes, revolution, near):  # type: ignore[no-untyped-def]
    """Return what ``repeating_force`` does, to which forces (2, sample) of a cut that hardly differs mostly lead.

    near: those.

    See docs/physics.md#forced-motion.
    """
    samples, force = near.shape[1], near.copy()
    if _followed(_sampled(cut, samples), steps_of(modes, revolution, samples), force, DIRECTLY):
        return force, True
    return repeating_force(cut, modes, revolution, samples)


@compiled
def move(steps, force, motion):  # type: ignore[no-untyped-def]
    """Fill in the motion (2, sample) under forces (2, sample) that repeat.

    See docs/physics.md#forced-motion.
    """
    state, sharpened = np.zeros(steps.grown.shape), np.empty_like(force)
    _sharpen(force, sharpened)
    _revolve(steps, sharpened, state, motion)
    for n in range(state.shape[1]):
        left = complex(state[0, n], state[1, n]) * complex(steps.forever[0, n], steps.forever[1, n])
        state[0, n], state[1, n] = left.real, left.imag
    _revolve(steps, sharpened, state, motion)


@compiled
def _sharpen(force, sharpened):  # type: ignore[no-untyped-def]
    """Fill in forces (2, sample) of which straight lines have the waves of these.

    By themselves lines between samples take off a twelfth of a wave whose angle turns by one between them.
    """
    samples = force.shape[1]
    for axis in range(2):
        for j in range(samples):
            here, after = force[axis, j], force[axis, j + 1 if j + 1 < samples else 0]
            sharpened[axis, j] = here - (force[axis, j - 1] - 2.0 * here + after) / 12.0


@compiled
def _revolve(steps, force, state, motion):  # type: ignore[no-untyped-def]
    """Bring states (part, pole) forward by a revolution, and fill in the motion (2, sample) meanwhile."""
    # Here all the time goes, and names of their own let the compiler take several modes at once.
    grown_real, grown_imaginary, real, imaginary = steps.grown[0], steps.grown[1], state[0], state[1]
    (x_real, x_imaginary), (y_real, y_imaginary) = steps.seen
    (along_real, along_imaginary), (across_real, across_imaginary) = steps.driven
    for j in range(force.shape[1]):
        along, across = force[0, j], force[1, j]
        x = y = 0.0
        for n in range(len(real)):
            now, turned = real[n], imaginary[n]
            x += x_real[n] * now - x_imaginary[n] * turned
            y += y_real[n] * now - y_imaginary[n] * turned
            added = along_real[n] * along + across_real[n] * across
            real[n] = grown_real[n] * now - grown_imaginary[n] * turned + added
            added = along_imaginary[n] * along + across_imaginary[n] * across
            imaginary[n] = grown_real[n] * turned + grown_imaginary[n] * now + added
        motion[0, j], motion[1, j] = _moved(x, y, steps, along, across)


@compiled
def _free(steps, state):  # type: ignore[no-untyped-def]
    """Return where the tip is, but for what a force moves at once."""
    x = y = 0.0
    for n in range(state.shape[1]):
        x += steps.seen[0, 0, n] * state[0, n] - steps.seen[0, 1, n] * state[1, n]
        y += steps.seen[1, 0, n] * state[0, n] - steps.seen[1, 1, n] * state[1, n]
    return x, y


@compiled
def _step(steps, state, along, across):  # type: ignore[no-untyped-def]
    """Bring states (part, pole) forward by a step, from a time at which forces are given."""
    grown, driven = steps.grown, steps.driven
    for n in range(state.shape[1]):
        real, imaginary = state[0, n], state[1, n]
        added = driven[0, 0, n] * along + driven[1, 0, n] * across
        state[0, n] = grown[0, n] * real - grown[1, n] * imaginary + added
        added = driven[0, 1, n] * along + driven[1, 1, n] * across
        state[1, n] = grown[0, n] * imaginary + grown[1, n] * real + added


@compiled
def at(motion, place):  # type: ignore[no-untyped-def]
    """Return the motion at a place between samples, by the cubic through the two before and the two behind.

    Teeth of unequal pitch meet surfaces that were left between samples: a straight line there would take an eighth off
    the waves of a mode of which there are six samples to each.

    See docs/physics.md#forced-motion.
    """
    samples = motion.shape[1]
    whole = math.floor(place)
    part = place - whole
    low = int(whole)
    if not 0 <= low < samples:
        # Mostly in the revolution before: a remainder would cost more than all else here.
        low = low + samples if -samples <= low < 0 else low % samples
    lower = low - 1 if low > 0 else samples - 1
    high = low + 1 if low + 1 < samples else 0
    higher = high + 1 if high + 1 < samples else 0
    left, more, less = 1.0 - part, 1.0 + part, 2.0 - part
    outer, inner = part * left / 6.0, more * less / 2.0
    first, second, third, fourth = -outer * less, left * inner, part * inner, -outer * more
    return (
        first * motion[0, lower] + second * motion[0, low] + third * motion[0, high] + fourth * motion[0, higher],
        first * motion[1, lower] + second * motion[1, low] + third * motion[1, high] + fourth * motion[1, higher],
    )


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
    """Return the share in the cut of the angles about one, nearer ones counting more; the cut may reach over a turn.

    By the same straight lines that join forces between samples: what they add up to, and about when, is kept so where
    the cut begins and ends.
    """
    share = 0.0
    for around in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
        share += _before((leave - angle - around) / width) - _before((entry - angle - around) / width)
    return share


@compiled
def _before(place):  # type: ignore[no-untyped-def]
    """Return the share before a place, in samples, of what rises by a line from the sample before, and falls so."""
    left = 1.0 - min(abs(place), 1.0)
    return 0.5 * left**2 if place < 0.0 else 1.0 - 0.5 * left**2


@compiled
def _finer(force, samples):  # type: ignore[no-untyped-def]
    """Return forces (2, coarse sample) at more samples."""
    result = np.empty((2, samples))
    for j in range(samples):
        result[0, j], result[1, j] = at(force, j * force.shape[1] / samples)
    return result


@compiled
def _from_rest(sampled, steps):  # type: ignore[no-untyped-def]
    """Cut from rest until the motion repeats, LONG revolutions at most.

    Return the force (2, sample) in the last, and by what share of its size the motion changed with it.
    """
    samples, state = sampled.sine.shape[1], np.zeros(steps.grown.shape)
    left, who = np.empty(len(sampled.sine)), np.empty(sampled.sine.shape, np.int64)
    motion, force = np.zeros((2, samples)), np.zeros((2, samples))
    along = across = change = 0.0
    for _ in range(LONG):
        change = size = 0.0
        for j in range(samples):
            free_x, free_y = _free(steps, state)
            x, y = _moved(free_x, free_y, steps, along, across)
            _surfaces(sampled, motion, j, left, who)
            for _ in range(CORRECTIONS):
                along, across = _cutting(sampled, 1.0, j, x, y, left)
                x, y = _moved(free_x, free_y, steps, along, across)
            _step(steps, state, along, across)
            change = max(change, abs(x - motion[0, j]), abs(y - motion[1, j]))
            size = max(size, abs(x), abs(y))
            motion[0, j], motion[1, j], force[0, j], force[1, j] = x, y, along, across
        change /= max(size, 1e-300)
        if change <= REPEATS:
            break
    return force, change


@compiled
def _moved(x, y, steps, along, across):  # type: ignore[no-untyped-def]
    """Return a place, moved by what a force moves at once."""
    own = steps.at_once
    return x + own[0, 0] * along + own[0, 1] * across, y + own[1, 0] * along + own[1, 1] * across


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
def _followed(sampled, steps, force, way):  # type: ignore[no-untyped-def]
    """Bring forces (2, sample) to where they repeat, through depths from a first one; return whether they arrived."""
    there = False
    for rung in range(1, way.rungs + 1):
        # To begin with, chips of deeper cuts are as thick as before.
        force *= rung / max(rung - 1, 1)
        there = _settled(sampled, rung / way.rungs, steps, force, way.steps)
        if way.at_each and not there:
            break
    return there


@compiled
def _settled(sampled, share, steps, force, most):  # type: ignore[no-untyped-def]
    """Bring forces (2, sample) from near to where they repeat, at a share of the depth; return whether they arrived."""
    other, motion = np.empty_like(force), np.empty_like(force)
    who, next_who = np.empty(sampled.sine.shape, np.int64), np.empty(sampled.sine.shape, np.int64)
    move(steps, force, motion)
    far = _held_against(sampled, share, force, motion, who)
    nearest, since = far, 0
    for _ in range(most):
        missed = _corrected(sampled, share, steps, force, motion, who)
        if not math.isfinite(_largest(missed)):
            return False
        for halving in range(HALVINGS):
            length = 0.5**halving
            _add_up(force, length, missed, other)
            move(steps, other, motion)
            left = _held_against(sampled, share, other, motion, next_who)
            if left < far:
                break
        _add_up(force, length, missed, force)
        who, next_who, far = next_who, who, left
        if far <= ARRIVED * _largest(force):
            return True
        nearest, since = (far, 0) if far < NEARER * nearest else (nearest, since + 1)
        if since == PATIENCE:
            return False
    return False


@compiled
def _add_up(force, factor, other, result):  # type: ignore[no-untyped-def]
    """Fill in the sum of forces (2, sample) and so many times others."""
    # In loops: an array expression takes a second to compile, once more in each function above.
    for axis in range(2):
        for j in range(force.shape[1]):
            result[axis, j] = force[axis, j] + factor * other[axis, j]


@compiled
def _largest(force):  # type: ignore[no-untyped-def]
    """Return the largest of forces (2, sample) by size; infinity where any is none."""
    largest = 0.0
    for axis in range(2):
        for j in range(force.shape[1]):
            size = abs(force[axis, j])
            if not size < math.inf:
                return math.inf
            largest = max(largest, size)
    return largest


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
def _corrected(sampled, share, steps, force, motion, who):  # type: ignore[no-untyped-def]
    """Return by how much forces (2, sample) miss those that repeat while who cuts what is held, but for 1e-8 of that.

    motion: (2, sample), the one under the forces.
    """
    answer, moved, direction = np.empty_like(force), np.empty_like(force), np.empty_like(force)
    _cut(sampled, share, who, motion, 1.0, answer)
    _add_up(answer, -1.0, force, answer)
    last, found = 0, begun(answer.ravel())
    if found.size == 0.0:
        return answer
    for number in range(force.size):
        last = number
        _fill(direction, found.basis[number])
        move(steps, direction, moved)
        _cut(sampled, share, who, moved, 0.0, answer)
        _add_up(direction, -1.0, answer, answer)
        if arrived(found, number, answer.ravel()):
            break
    _fill(answer, combined(found, last))
    return answer


@compiled
def _fill(force, values):  # type: ignore[no-untyped-def]
    """Fill forces (2, sample) with values, the first axis first."""
    samples = force.shape[1]
    for axis in range(2):
        for j in range(samples):
            force[axis, j] = values[axis * samples + j]


@compiled
def _cut(sampled, share, who, motion, feed, force):  # type: ignore[no-untyped-def]
    """Fill in the forces (2, sample) on a motion (2, sample) while who cuts what (edge, sample) is held.

    feed: the share of feed and radii that counts beside the motion.
    """
    cut, (edges, samples), slices = sampled.cut, who.shape, len(who) // len(sampled.cut.passed)
    per_pitch = samples / len(cut.passed)
    force[:] = 0.0
    for e in range(edges):
        tooth = e // slices
        for j in range(samples):
            k = who[e, j]
            if k < 0:
                continue
            s, c = sampled.sine[e, j], sampled.cosine[e, j]
            then_x, then_y = at(motion, j - cut.passed[tooth, k] * per_pitch)
            chip = feed * (cut.feed * cut.passed[tooth, k] * s + cut.longer[tooth, k])
            chip += s * (motion[0, j] - then_x) + c * (motion[1, j] - then_y)
            along, across = _push(sampled, share, e, j)
            force[0, j] += along * chip
            force[1, j] += across * chip


@compiled
def _push(sampled, share, e, j):  # type: ignore[no-untyped-def]
    """Return the force of an edge at a sample over its chip, along and across [N/m]."""
    cut, weight = sampled.cut, share * sampled.weight[e, j]
    s, c = sampled.sine[e, j], sampled.cosine[e, j]
    return -weight * (cut.tangential * c + cut.radial * s), weight * (cut.tangential * s - cut.radial * c)
