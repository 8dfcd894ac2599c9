"""Where the fit of one effect more begins: strengths and shapes, and what each promises.

A displaced resonance has no slope that would lead to it, so places are looked at and not only slopes.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.candidates import Candidate
from chatter_core.evidence.comparison import Compared, Comparison
from chatter_core.evidence.newton import Climb, Maximum
from chatter_core.evidence.parameters import Array, Evaluation, Parameter

#: Amplitudes at which a fit is started, in the widths that they are searched by; to both sides where they can go there.
#: The first is looked at with every shape.
AMPLITUDES = (1.0, 0.3, 0.5, 2.0, 3.0)
#: Those that are looked at beside a model that fails no check: a strong effect more would have failed some.
SLIGHT_AMPLITUDES = (1.0, 0.3)
#: By this share a scanned strength may be above the largest that is looked at: both are products.
ROUNDING = 1e-9
#: Shapes at which it is, in widths of theirs.
SHAPES = (-1.2, -0.6, 0.0, 0.6, 1.2)
#: Nearer to each other than this shapes are one, in widths of theirs.
SAME_SHAPE = 0.3
#: An effect that is heard is looked at where chatter was and the model is off by so many deviations; frequencies nearer
#: to each other than this share are one, and so many of those that were heard most often count. The natural frequency
#: lies beside, by some such share.
MISSED_BY, SAME_FREQUENCY, MOST_FREQUENCIES, BESIDE = 3.0, 0.05, 3, 0.02
#: Strengths with which values of a shape are looked at one by one, in the same widths: to a weak effect that is
#: not quite right the data do not object, and a strong one is seen by no weak one's light. Where no chatter frequency
#: was heard it takes the one between, too.
SCANNED_AMPLITUDES, SCANNED_IN_SILENCE = (0.3, 3.0), (0.3, 1.0, 3.0)
#: Of starts that make teeth unlike so many are looked at with the motion that they force, which takes several times as
#: long as without.
SCREENED = 6
#: Of all cuts that chatter so many leave no more waves between two teeth than count.
MANY_WAVES = 0.9
#: An effect of which a step from its null promises less stays there [nats].
SMALLEST_PROMISE = 0.3
#: Of all starts so many of the best are climbed from.
CLIMBED = 2
#: Of a strength that may go to both sides the best start to each that is no smaller than the first amplitude is climbed
#: from too, unless it promises less than this [nats]: where all else has bent to imitate an effect, a small one beside
#: its null promises most.
HOPELESS = -15.0


@dataclass(frozen=True, kw_only=True)
class Promises:
    """Starts (parameter,) of an effect, and what each promises over its null [nats].

    still: of scanned strengths that make teeth unlike the one that promises most as if these forced no motion, with
    that promise: where the motion makes a posterior rough, a step beside the truth may fall by far more than the right
    delays gain.
    """

    starts: list[tuple[float, Array]]
    still: list[tuple[float, Array]]


def promises(
    worth: "Worth",
    comparison: Comparison,
    own: Array,
    new: Candidate,
    at_null: Evaluation,
    *,
    scanned: bool,
    amplitudes: Sequence[float] = AMPLITUDES,
) -> Promises:
    """Return starts of an effect, and what each promises over its null [nats]; scanned: whether a scan is among them.

    Of starts that make teeth unlike only some are looked at with the motion that these force.

    See docs/physics.md#diagnosis.
    """
    one_by_one = _scanned(new, comparison, own, amplitudes) if scanned else []
    shapes = shapes_of(new, comparison, at_null)
    first = starts_at(comparison, own, new, amplitudes[:1], shapes) + one_by_one
    unlike = any(worth.makes_teeth_unlike(start) for start in first)
    found = _places(worth.still if unlike else worth, comparison, new, first, one_by_one, shapes, amplitudes[1:])
    if not unlike:
        return Promises(starts=found, still=[])
    most = [max(found, key=lambda one: one[0])] if _is_scanned_strength(new) else []
    return Promises(starts=_screened(worth, comparison, new, found), still=most)


def _places(
    worth: "Worth",
    comparison: Comparison,
    new: Candidate,
    first: Sequence[Array],
    one_by_one: Sequence[Array],
    shapes: Sequence[float],
    amplitudes: Sequence[float],
) -> list[tuple[float, Array]]:
    """Return starts (parameter,) and what they promise [nats].

    Each shape is looked at with the first strength, the best of them and of what is scanned with the others too, and
    all shapes again with the strength that was best. Where all strength that an effect has is scanned no other is
    looked at.
    """
    if len(one_by_one) > SCREENED and _is_scanned_strength(new):
        return [(worth.of(start), start) for start in one_by_one]
    found = [(worth.of(start), start) for start in first]

    def add(starts: Iterable[Array]) -> None:
        for start in starts:
            if not any(np.array_equal(start, known_start) for _, known_start in found):
                found.append((worth.of(start), start))

    best = sorted(found, key=lambda one: -one[0])[:CLIMBED]
    add(start for _, shaped in best for start in starts_at(comparison, shaped, new, amplitudes, ()))
    _, strong = max(found, key=lambda one: one[0])
    add(_shaped(comparison, strong, new, shapes))
    return found


def _is_scanned_strength(new: Candidate) -> bool:
    """Return whether the only strength of an effect is scanned, to each side where it can go, and its shape with it."""
    if new.scan is None or [strength.name for strength in new.amplitudes] != [new.scan[0]]:
        return False
    if new.shapes and not new.scanned_shapes:
        return False
    (strength,), values = new.amplitudes, new.scan[1]
    below, above = min(values) < strength.null, max(values) > strength.null
    return (below or strength.lower == strength.null) and (above or strength.upper == strength.null)


def _screened(
    worth: "Worth", comparison: Comparison, new: Candidate, still: Sequence[tuple[float, Array]]
) -> list[tuple[float, Array]]:
    """Return starts that make teeth unlike, and what they promise [nats] where chips force a motion.

    still: what they promise as if none were forced. Only those are looked at that promise most so, of what is scanned
    the peaks before others. The rest promises minus infinity: it parts peaks as it does where all are looked at.
    """
    ordered = [*_ordered(comparison, new, still), *sorted(still, key=lambda one: -one[0])]
    # Each start once.
    looked_at = list(dict.fromkeys(id(start) for _, start in ordered))[:SCREENED]
    return [(worth.of(start) if id(start) in looked_at else -np.inf, start) for _, start in still]


def other_shapes(comparison: Comparison, values: Array, new: Candidate) -> list[Array]:
    """Return values (parameter,) with other shapes of an effect than theirs; none of what chatter frequencies tell.

    See docs/physics.md#diagnosis.
    """
    displacing = _displacing(new)
    if displacing is None or new.heard == displacing.name:
        return []
    place = [parameter.name for parameter in comparison.parameters].index(displacing.name)
    found = _shaped(comparison, values, new, shapes_of(new, comparison, None))
    return [one for one in found if abs(one[place] - values[place]) > SAME_SHAPE * displacing.prior_width]


def _shaped(comparison: Comparison, start: Array, new: Candidate, shapes: Sequence[float]) -> list[Array]:
    """Return starts of one strength with each of the shapes."""
    displacing = _displacing(new)
    names = [parameter.name for parameter in comparison.parameters]
    found = [start.copy() for _ in shapes]
    for one, shape in zip(found, shapes, strict=True):
        assert displacing is not None
        one[names.index(displacing.name)] = _within(displacing, shape)
    return found


def shapes_of(new: Candidate, comparison: Comparison, at_null: Evaluation | None) -> list[float]:
    """Return values of the shape that displaces, a frequency or an exponent; none where an effect has no shape.

    A frequency at which cuts chatter is also looked for where they did and the model ``at_null`` does not know why.

    See docs/physics.md#diagnosis.
    """
    displacing = _displacing(new)
    if displacing is None:
        return []
    shapes = [displacing.prior_mean + share * displacing.prior_width for share in SHAPES]
    if new.heard != displacing.name or at_null is None:
        return shapes
    missed = missed_frequencies(comparison, at_null) / (2.0 * np.pi)
    return [*shapes, *missed, *(1.0 - BESIDE) * missed, *(1.0 + BESIDE) * missed]


def is_silent(comparison: Comparison) -> bool:
    """Return whether no chatter frequency was heard that would say what a model misses.

    See docs/physics.md#diagnosis.
    """
    trials = comparison.model.campaign.trials
    return trials is None or not np.isfinite(trials.chatter_frequency).any()


def waves_between_teeth(campaign: Campaign) -> float:
    """Return how many waves chatter has left between two teeth, in all but a tenth of the cuts; infinity if unheard.

    See docs/physics.md#diagnosis.
    """
    trials = campaign.trials
    if trials is None or not np.isfinite(trials.chatter_frequency).any():
        return np.inf
    tooth_passing = campaign.machine.tool.teeth * trials.spindle_speed
    return float(np.nanquantile(trials.chatter_frequency / tooth_passing, MANY_WAVES))


def scanned_widely(new: Candidate, comparison: Comparison) -> bool:
    """Return whether what is scanned of an effect is looked at beside the machine as described, too.

    Strengths always are, shapes where no chatter frequency was heard.

    See docs/physics.md#diagnosis.
    """
    return new.scan is not None and (is_silent(comparison) or any(p.name == new.scan[0] for p in new.amplitudes))


def _scanned(new: Candidate, comparison: Comparison, own: Array, amplitudes: Sequence[float]) -> list[Array]:
    """Return starts (parameter,) at the values that are looked at one by one; where slight strengths are, no others.

    Each is with every shape that is scanned with it.
    """
    if new.scan is None:
        return []
    name, values = new.scan
    scanned = next((p for p in new.amplitudes if p.name == name), None)
    if scanned is not None and max(amplitudes) < max(AMPLITUDES):
        largest = (1.0 + ROUNDING) * max(amplitudes) * scanned.searched_by
        values = tuple(one for one in values if abs(one - scanned.null) <= largest)
    strengths = SCANNED_IN_SILENCE if is_silent(comparison) else SCANNED_AMPLITUDES
    allowed = [size for size in strengths if size <= max(amplitudes)]
    sizes = [{p.name: p.searched_at(size) for p in new.amplitudes} for size in allowed]
    displacing, shapes = _displacing(new), [dict[str, float]()]
    if new.scanned_shapes:
        assert displacing is not None
        shapes = [{displacing.name: value} for value in new.scanned_shapes]
    found = list[Array]()
    for size, value, shape in itertools.product(sizes, values, shapes):
        known = {**size, name: value, **shape}
        start = np.array([known.get(p.name, own[i]) for i, p in enumerate(comparison.parameters)])
        # Of a strength that is scanned all sizes are the same.
        if not any(np.array_equal(start, other) for other in found):
            found.append(start)
    return found


def missed_frequencies(comparison: Comparison, evaluation: Evaluation) -> Array:
    """Return the frequencies (frequency,) [rad/s] at which chatter was heard most often that a model does not know.

    See docs/physics.md#diagnosis.
    """
    assert isinstance(evaluation.state, Compared)
    trials = comparison.model.campaign.trials
    said = evaluation.state.contributions.get("chatter_frequency")
    if trials is None or said is None:
        return np.empty(0)
    heard = trials.chatter_frequency[np.isfinite(trials.chatter_frequency)]
    missed = np.sort(heard[np.abs(said.coordinates[:, 0]) > MISSED_BY])
    places = np.split(missed, np.flatnonzero(np.diff(np.log(missed)) > SAME_FREQUENCY) + 1) if len(missed) else []
    return np.array([np.median(place) for place in sorted(places, key=len, reverse=True)[:MOST_FREQUENCIES]])


def _displacing(new: Candidate) -> Parameter | None:
    """Return the first shape of an effect, the one that displaces it; None where it has none."""
    return next((p for p in new.term.parameters if p.name in new.shapes), None)


def chosen(
    comparison: Comparison,
    new: Candidate,
    promised: Sequence[tuple[float, Array]],
    still: Sequence[tuple[float, Array]] = (),
) -> list[tuple[float, Array]]:
    """Return the starts that are climbed from, and what they promise: the best, and the best large one to each side.

    Of those that differ in nothing that is scanned, or in nothing of the effect, the best; of what is scanned, the
    peaks: the second best of all lies beside the best, and leads nowhere else. Of a scanned shape those with strengths
    beyond the first are chosen apart: where all else follows, a strong effect in a wrong place may promise more than a
    weak one in the right place. The best of ``still``, as ``Promises`` has it, besides, if it promises more than all.

    See docs/physics.md#diagnosis.
    """
    parts = [_ordered(comparison, new, part) for part in _parted(comparison, new, promised)]
    chosen = [one for part in parts for one in part[:CLIMBED] if one[0] >= SMALLEST_PROMISE]
    ordered = sorted((one for part in parts for one in part), key=lambda one: -one[0])
    first = new.amplitudes[0]
    place, large = _strength(comparison, new)
    for side in (1.0, -1.0) if first.lower < first.null < first.upper else ():
        of_side = [
            one for one in ordered if side * (one[1][place] - first.null) >= 0.999 * large and one[0] >= HOPELESS
        ]
        if of_side and not any(np.array_equal(of_side[0][1], start) for _, start in chosen):
            chosen.append(of_side[0])
    most = max(still, key=lambda one: one[0], default=None)
    if most is None or most[0] <= max([SMALLEST_PROMISE, *(promise for promise, _ in chosen)]):
        return chosen
    return chosen if any(np.array_equal(most[1], start) for _, start in chosen) else [*chosen, most]


def _strength(comparison: Comparison, new: Candidate) -> tuple[int, float]:
    """Return the place of the strength of an effect among the parameters, and the first that is looked at."""
    first = new.amplitudes[0]
    return [p.name for p in comparison.parameters].index(first.name), AMPLITUDES[0] * first.searched_by


def _parted(
    comparison: Comparison, new: Candidate, promised: Sequence[tuple[float, Array]]
) -> list[list[tuple[float, Array]]]:
    """Return starts that are chosen apart: of a scanned shape those stronger than the first strength, else none."""
    place, large = _strength(comparison, new)
    null = new.amplitudes[0].null
    if new.scan is None or new.scan[0] == new.amplitudes[0].name:
        return [list(promised)]
    slight, strong = list[tuple[float, Array]](), list[tuple[float, Array]]()
    for one in promised:
        (strong if abs(one[1][place] - null) > (1.0 + ROUNDING) * large else slight).append(one)
    return [slight, strong]


def _ordered(
    comparison: Comparison, new: Candidate, promised: Sequence[tuple[float, Array]]
) -> list[tuple[float, Array]]:
    """Return starts that differ in what tells them apart, the best first; of what is scanned, the peaks."""
    names = [parameter.name for parameter in comparison.parameters]
    telling = [new.scan[0]] if new.scan else [parameter.name for parameter in new.term.parameters]
    own = [names.index(name) for name in telling]
    best: dict[tuple[float, ...], tuple[float, Array]] = {}
    for one in promised:
        key = tuple(one[1][own])
        best[key] = max(best.get(key, one), one, key=lambda found: found[0])
    return sorted(_peaks(best) if new.scan else best.values(), key=lambda one: -one[0])


def _peaks(promised: dict[tuple[float, ...], tuple[float, Array]]) -> list[tuple[float, Array]]:
    """Return starts by a scanned value of which neither neighbour promises more."""
    line, aside = [promised[value] for value in sorted(promised)], (-np.inf, np.empty(0))
    ends = [aside, *line, aside]
    return [
        one
        for before, one, behind in zip(ends[:-2], line, ends[2:], strict=True)
        if one[0] >= max(before[0], behind[0])
    ]


class Worth:
    """What places promise over the null of an effect, by themselves or once everything else has followed [nats].

    Where chatter frequencies go then is not foreseen: they jump. So either all data count, and nothing follows, or
    the smooth ones, and everything does.
    """

    def __init__(self, climb: Climb, at_null: Maximum, known: Array, added: NDArray[np.bool_]) -> None:
        # The effect itself stays where it is put.
        self.climb = Climb(climb.problem, climb.free & ~added)
        self.at_null, self.known, self.added = at_null, known, added
        self.height = at_null.log_posterior
        self.slope = np.where(smooth_rows(at_null.evaluation)[:, None], known, 0.0)
        self.rest = self._followed(at_null.values, at_null.evaluation, self.height)

    @property
    def still(self) -> "Worth":
        """The same as if the chips of unlike teeth forced no motion, where at the null none are unlike."""
        comparison = self.climb.problem
        assert isinstance(comparison, Comparison)
        return Worth(Climb(comparison.still, self.climb.free), self.at_null, self.known, self.added)

    def makes_teeth_unlike(self, values: Array) -> bool:
        """Return whether teeth are unlike at values (parameter,), and alike at the null."""
        comparison = self.climb.problem
        assert isinstance(comparison, Comparison)
        unlike = comparison.model.has_unlike_teeth
        return unlike(values) and not unlike(self.at_null.values)

    def of(self, values: Array) -> float:
        """Return what values (parameter,) promise."""
        reached, there = self.climb.posterior(values)
        return max(reached - self.height, self._followed(values, there, reached) - self.rest)

    def _followed(self, values: Array, evaluation: Evaluation, reached: float) -> float:
        return smooth_height(reached, evaluation) + self.climb.promise(values, evaluation, self.slope)


def smooth_rows(evaluation: Evaluation) -> NDArray[np.bool_]:
    """Return which coordinates (coordinate,) do not jump when parameters move: all but chatter frequencies.

    See docs/physics.md#diagnosis.
    """
    assert isinstance(evaluation.state, Compared)
    rows = np.ones(len(evaluation.coordinates), dtype=bool)
    rows[evaluation.state.coordinates_of.get("chatter_frequency", slice(0))] = False
    return rows


def smooth_height(height: float, evaluation: Evaluation) -> float:
    """Return the log posterior by the smooth data alone, from that by all.

    See docs/physics.md#diagnosis.
    """
    return height - float(evaluation.log_density[evaluation.datum[~smooth_rows(evaluation)]].sum())


def starts_at(
    comparison: Comparison, own: Array, new: Candidate, amplitudes: Sequence[float], shapes: Sequence[float]
) -> list[Array]:
    """Return starts (parameter,) at strengths of a candidate and values of its shape.

    Strengths in the widths that they are searched by, to both sides where they can go there; without shapes ``own`` has
    them.

    See docs/physics.md#diagnosis.
    """
    place = {parameter.name: index for index, parameter in enumerate(comparison.parameters)}
    strengths = [sign * size for size in amplitudes for sign in (1.0, -1.0)]
    displacing, starts = _displacing(new), list[Array]()
    for strength, shape in itertools.product(strengths, shapes or (None,)):
        start = own.copy()
        for parameter in new.amplitudes:
            start[place[parameter.name]] = parameter.searched_at(strength)
        if displacing is not None and shape is not None:
            start[place[displacing.name]] = _within(displacing, shape)
        # An amplitude that cannot go to one side stays at its null there, and so does the model.
        moved = any(start[place[p.name]] != p.null for p in new.amplitudes)
        if moved and not any(np.array_equal(start, other) for other in starts):
            starts.append(start)
    return starts


def _within(parameter: Parameter, value: float) -> float:
    return float(np.clip(value, parameter.lower, parameter.upper))
