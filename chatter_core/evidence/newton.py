"""The maximum of a posterior: Fisher scoring with Levenberg's damping, within bounds.

A step solves (F + 1 + damping diag(F + 1)) d = g in units of the priors' widths, F = J^T J being the expected
Fisher information and g the gradient of the log posterior; it is taken when the log posterior rises.
Unlike least squares on square roots of deviances it has the right curvature for labels and heavy tails.

Far from the maximum a Jacobian serves for many steps: each of them corrects it by what it showed.

Sources: M. R. Osborne, "Fisher's method of scoring", Int. Stat. Rev. 60 (1992) 99-117; C. G. Broyden, Math. Comput.
19 (1965) 577-593 (the correction); H. B. Nielsen, Report IMM-REP-1999-05, Tech. Univ. Denmark (1999) (the damping).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.parameters import Array, Evaluation, Problem, column, log_prior

#: A fit has arrived when the next step promises less than this [nats].
SMALLEST_GAIN = 0.005
#: Where steps fail although they promise no more than this, the maximum lies at an edge where a datum jumps, and
#: has been reached as well [nats].
ROUGHNESS = 1.0
#: Differences are taken over this share of a parameter's standard deviation, and of its prior's width at most.
DIFFERENCE_SHARE, LARGEST_DIFFERENCE = 0.1, 0.02
#: A coordinate that changes by more over such a difference is steep or has jumped, and the difference is shortened, so
#: many times.
JUMP, SHORTER_DIFFERENCES = 0.5, 3
#: All coordinates together change by a tenth over a tenth of the deviation that they leave, a little more where slopes
#: have grown since. Where they change by more, what is found anew may be another than what is followed from it, however
#: short the way, and the difference is taken between two that were followed: as a slope it would shorten the next
#: difference, and that the one after, without end.
SUSPECT = 1.25 * DIFFERENCE_SHARE
#: Where the nearer of the two lies, in differences.
NEARER = 0.1
#: Damping at the start, its factors after a failed step (twice that after each further one, as Nielsen has it) and
#: after a good one, and where a direction is given up.
DAMPING, DAMPING_UP, DAMPING_DOWN, DAMPING_MOST, DAMPING_LEAST = 1e-3, 4.0, 0.2, 1e6, 1e-6
#: After a step that falls the next one differs from it by this share of its length at least.
OTHERWISE = 0.3
#: Lengths at which a step is tried, as long as it rises: where data contradict each other the information is
#: large and steps are short. The first of all is lengthened when it falls too, to leap over an edge, if there is more
#: to be gained than ROUGHNESS.
LENGTHS = (1.0, 2.0, 4.0, 8.0)
#: A step that rises by less than this over its promise is long enough: with a curvature that is 1.6 times too
#: large it would rise by so much, and twice its length would be no better.
WORTH_LENGTHENING = 1.35
#: A coordinate that a step changes by so much more or less than foreseen has jumped [standard deviations].
MISSED = 3.0
#: An approach gives up after so many steps in a row that fall, each so much shorter than the one before, and where with
#: one Jacobian so many together gain less than one has to promise.
FALLS, SHORTER, SLOW = 4, 0.3, 5
#: No step moves a parameter farther than this, in widths of its prior.
LONGEST_STEP = 2.0
MOST_STEPS = 40


@dataclass(frozen=True, kw_only=True)
class Maximum:
    """Where the climb ended.

    values: (parameter,); log_posterior; gradient (parameter,) and information (parameter, parameter) of the
    log posterior there, in units of the priors' widths, the latter with the priors' own; free: (parameter,)
    which ones were moved; evaluations; converged, and the reason in words.
    """

    values: Array
    evaluation: Evaluation
    log_posterior: float
    gradient: Array
    information: Array
    free: NDArray[np.bool_]
    evaluations: int
    converged: bool
    reason: str


@dataclass(frozen=True, kw_only=True)
class Place:
    """Values (parameter,) with their log posterior and evaluation."""

    values: Array
    height: float
    evaluation: Evaluation


class Climb:
    """A climb of a problem's log posterior; ``free`` (parameter,) says which parameters move."""

    def __init__(self, problem: Problem, free: NDArray[np.bool_]) -> None:
        self.problem = problem
        self.free = free
        self.mean = column(problem.parameters, "prior_mean")
        self.width = column(problem.parameters, "prior_width")
        self.lower = column(problem.parameters, "lower")
        self.upper = column(problem.parameters, "upper")
        self.evaluations = 0

    def posterior(self, values: Array) -> tuple[float, Evaluation]:
        """Return the log posterior and the evaluation of values, the same from wherever the climb comes."""
        self.evaluations += 1
        place = self.known_place(values, self.problem.evaluate(values))
        return place.height, place.evaluation

    def place(self, values: Array) -> Place:
        """Return the place at values (parameter,), or at what bounds leave of them."""
        within = np.clip(values, self.lower, self.upper)
        height, evaluation = self.posterior(within)
        return Place(values=within, height=height, evaluation=evaluation)

    def known_place(self, values: Array, evaluation: Evaluation) -> Place:
        """Return the place at values (parameter,) whose evaluation is known."""
        height = evaluation.log_likelihood + log_prior(self.problem.parameters, values)
        return Place(values=values, height=height, evaluation=evaluation)

    def from_start(self, start: Array, smallest_gain: float = SMALLEST_GAIN, *, leaps: bool = True) -> Maximum:
        """Return where ``from_place`` leads from values (parameter,)."""
        return self.from_place(self.place(start), smallest_gain, leaps=leaps)

    def from_place(self, here: Place, smallest_gain: float = SMALLEST_GAIN, *, leaps: bool = True) -> Maximum:
        """Climb until a step promises less than ``smallest_gain`` or none succeeds.

        leaps: whether it goes on beyond an edge at which it is stuck, once, where a slope leads there.
        """
        damping, before, stuck = DAMPING, [here.values], None
        reason, converged = f"no end after {MOST_STEPS} steps", False
        gradient, information = self.slope(here.values, here.evaluation, self.width)
        for _ in range(MOST_STEPS):
            moving = self.free & ~self._held(here.values, gradient)
            _, gain = _step(gradient, information, moving, 0.0)
            if gain < smallest_gain:
                reason, converged = f"the next step promises {gain:.2g} nats", True
                break
            found = self._climb_once(
                here, gradient, information, moving, damping, smallest_gain, eager=gain >= ROUGHNESS
            )
            if found is None and gain >= ROUGHNESS and stuck is None and leaps:
                # An edge, and a slope that leads beyond it: once, the fit goes on from there.
                step, _ = _step(gradient, information, moving, 0.0)
                stuck = here, gradient, information
                found = self._aside(here, step * self.width, 1.0), DAMPING
            elif found is None:
                converged = gain < max(ROUGHNESS, smallest_gain)
                reason = f"no step rises, though one should by {gain:.2g} nats: the posterior has an edge"
                break
            here, damping = found
            # In a narrow valley steps zigzag: what two of them have in common leads along it.
            if len(before) > 1:
                here = self._rise(here, here.values - before[-2]) or here
            before.append(here.values)
            gradient, information = self.slope(here.values, here.evaluation, self.width / np.sqrt(np.diag(information)))
        if stuck is not None and stuck[0].height > here.height:
            here, gradient, information = stuck
            converged, reason = False, "the posterior has an edge, and beyond it is none higher"
        return self._end(here, gradient, information, converged, reason)

    def approach(
        self,
        start: Array,
        smallest_gain: float,
        known: Array | None = None,
        added: NDArray[np.bool_] | None = None,
        least: float = -np.inf,
    ) -> Maximum:
        """Return where ``approach_from`` leads from values (parameter,)."""
        return self.approach_from(self.place(start), smallest_gain, known, added, least)

    def approach_from(
        self,
        here: Place,
        smallest_gain: float,
        known: Array | None = None,
        added: NDArray[np.bool_] | None = None,
        least: float = -np.inf,
    ) -> Maximum:
        """Climb to near a maximum, where a step promises less than ``smallest_gain`` [nats], with one Jacobian.

        known: Jacobian (coordinate, parameter) not far from the start, in units of the priors' widths; ``added``:
        (parameter,), whose columns it lacks; without a Jacobian all are. What is missing is found at the start. The
        Jacobian is corrected by what every step shows, and found anew where steps fall. What then promises to end below
        ``least`` is given up.
        """
        damping, falls, heights = DAMPING, 0, [here.height]
        jacobian = self._jacobian(here, known, added)
        length, blind, anew = 1.0, False, False
        for _ in range(MOST_STEPS):
            if len(heights) > SLOW and here.height - heights[-1 - SLOW] < smallest_gain:
                break
            gradient, information = self.expected(here.values, here.evaluation, jacobian)
            moving = self.free & ~self._held(here.values, gradient)
            step, gain = _step(gradient, information, moving, damping)
            if anew and here.height + gain < least:
                break
            if gain < smallest_gain:
                if not blind:
                    break
                # What jumped has no slope: nothing is promised by data that were not asked.
                jacobian, blind = self.derivatives(here.values, here.evaluation, self.width)[0], False
                heights = [here.height]
                continue
            there = self._aside(here, step * self.width, length)
            risen = there.height > here.height
            heights.append(max(here.height, there.height))
            falls = 0 if risen else falls + 1
            if falls == FALLS:
                break
            if falls == FALLS - 1:
                jacobian, length, anew = self.derivatives(here.values, here.evaluation, self.width)[0], 1.0, True
                heights = [here.height]
                continue
            anew = False
            shift = (there.values - here.values) / self.width
            jumped = _correct(jacobian, there.evaluation.coordinates - here.evaluation.coordinates, shift)
            length = 1.0 if risen else SHORTER * length
            if risen:
                here, damping = there, max(damping * DAMPING_DOWN, DAMPING_LEAST)
                jacobian[jumped] = 0.0
                blind = blind or bool(jumped.any())
        return self._near(here, jacobian)

    def expected(self, values: Array, evaluation: Evaluation, jacobian: Array) -> tuple[Array, Array]:
        """Return gradient and information of the log posterior, in units of the priors' widths, by a Jacobian."""
        gradient = jacobian.T @ evaluation.score - (values - self.mean) / self.width
        return np.where(self.free, gradient, 0.0), jacobian.T @ jacobian + np.eye(len(values))

    def promise(self, values: Array, evaluation: Evaluation, jacobian: Array) -> float:
        """Return what a step from values (parameter,) promises [nats], no longer than a step may be."""
        return self._promise(values, *self.expected(values, evaluation, jacobian))

    def promise_of(self, found: Maximum) -> float:
        """Return what a step from where a climb ended promises [nats], no longer than a step may be."""
        return self._promise(found.values, found.gradient, found.information)

    def _promise(self, values: Array, gradient: Array, information: Array) -> float:
        step = self._cut(_step(gradient, information, self.free & ~self._held(values, gradient), 0.0)[0])
        return float(gradient @ step - 0.5 * step @ information @ step)

    def stay(self, here: Place, known: Array, added: NDArray[np.bool_] | None = None) -> Maximum:
        """Return a place as where a climb ended; known and added: as for ``approach``."""
        return self._near(here, self._jacobian(here, known, added))

    def _jacobian(self, here: Place, known: Array | None, added: NDArray[np.bool_] | None) -> Array:
        """Return a Jacobian (coordinate, parameter) of which some columns are found and others may be known."""
        if known is None:
            return self.derivatives(here.values, here.evaluation, self.width)[0]
        missing = np.zeros_like(self.free) if added is None else added
        return self.derivatives(here.values, here.evaluation, self.width, missing)[0] + known

    def _near(self, here: Place, jacobian: Array) -> Maximum:
        gradient, information = self.expected(here.values, here.evaluation, jacobian)
        gain = self._promise(here.values, gradient, information)
        return self._end(here, gradient, information, False, f"not climbed: the next step promises {gain:.2g} nats")

    def _end(self, here: Place, gradient: Array, information: Array, converged: bool, reason: str) -> Maximum:
        return Maximum(
            values=here.values,
            evaluation=here.evaluation,
            log_posterior=here.height,
            gradient=gradient,
            information=information,
            free=self.free,
            evaluations=self.evaluations,
            converged=converged,
            reason=reason,
        )

    def slope(self, values: Array, evaluation: Evaluation, deviation: Array) -> tuple[Array, Array]:
        """Return gradient and information of the log posterior, in units of the priors' widths."""
        jacobian, gradient = self.derivatives(values, evaluation, deviation)
        information = jacobian.T @ jacobian
        prior = (values - self.mean) / self.width
        return np.where(self.free, gradient - prior, 0.0), information + np.eye(len(values))

    def derivatives(
        self, values: Array, evaluation: Evaluation, deviation: Array, which: NDArray[np.bool_] | None = None
    ) -> tuple[Array, Array]:
        """Return the derivatives of the coordinates (coordinate, parameter) and of the log-likelihood (parameter,).

        Both in units of the priors' widths; deviation: (parameter,), over a share of which differences are taken;
        which: (parameter,), by which they are, those that are free if nothing is said. Others are zero.
        """
        gradient = np.zeros(len(values))
        jacobian = np.zeros((len(evaluation.coordinates), len(values)))
        for index in np.flatnonzero(self.free if which is None else which):
            jacobian[:, index], gradient[index] = self._differences(
                values, evaluation, int(index), float(deviation[index])
            )
        return jacobian, gradient

    def _differences(self, values: Array, here: Evaluation, index: int, deviation: float) -> tuple[Array, float]:
        """Return the derivatives of the coordinates (coordinate,) and of the log-likelihood by one parameter.

        Where a datum jumps, the difference is taken anew over a tenth: what is merely steep then is smooth. What still
        jumps, as where another branch of multipliers takes over, has no slope and is left out.
        """
        size = min(DIFFERENCE_SHARE * deviation, LARGEST_DIFFERENCE * self.width[index])
        size = size if values[index] + size <= self.upper[index] else -size
        for _ in range(SHORTER_DIFFERENCES + 1):
            there = self._beside(values, here, index, size)
            difference = there.coordinates - here.coordinates
            jumping = np.abs(difference) > JUMP
            if not jumping.any():
                break
            size /= 10.0
        else:
            size *= 10.0
        start, begins = here, 0.0
        # Of a prior's width it is not known what changes may be expected over a share of it.
        if deviation < self.width[index] and np.linalg.norm(difference[~jumping]) > SUSPECT:
            start, begins = self._beside(values, here, index, NEARER * size), NEARER
        change = (1.0 - begins) * size / self.width[index]
        jumps = np.zeros(len(here.log_density), dtype=bool)
        jumps[here.datum[jumping]] = True
        slope = np.where(jumps[here.datum], 0.0, there.coordinates - start.coordinates) / change
        # The difference tells the slope in its middle; from here that is off by the curvature, which is known.
        middle = 0.5 * (1.0 + begins) * size / self.width[index]
        rise = (there.log_density - start.log_density)[~jumps].sum()
        return slope, float(rise / change + middle * (slope @ slope))

    def _beside(self, values: Array, here: Evaluation, index: int, size: float) -> Evaluation:
        """Return the evaluation of values (parameter,) of which one is another by so much, near one that is known."""
        aside = values.copy()
        aside[index] += size
        self.evaluations += 1
        return self.problem.evaluate(aside, here)

    def _held(self, values: Array, gradient: Array) -> NDArray[np.bool_]:
        """Return which parameters stand at a bound that they would leave."""
        at_lower, at_upper = (values <= self.lower) & (gradient < 0.0), (values >= self.upper) & (gradient > 0.0)
        return np.asarray(at_lower | at_upper)

    def _room(self, direction: Array) -> float:
        """Return how many times a direction may be gone at once."""
        longest = float(np.abs(direction / self.width).max())
        return LONGEST_STEP / longest if longest else 0.0

    def _cut(self, step: Array) -> Array:
        """Return a step (parameter,) in widths of the priors, no longer than may be gone at once."""
        return min(1.0, self._room(step * self.width)) * step

    def _aside(self, here: Place, direction: Array, length: float) -> Place:
        """Return the place at so many times a direction (parameter,), as far as there is room and bounds allow."""
        return self.place(here.values + min(length, self._room(direction)) * direction)

    def _climb_once(
        self,
        here: Place,
        gradient: Array,
        information: Array,
        moving: NDArray[np.bool_],
        damping: float,
        smallest_gain: float,
        *,
        eager: bool,
    ) -> tuple[Place, float] | None:
        """Return the next place and its damping; None where every step falls that promises ``smallest_gain``.

        eager: the first step is lengthened when it falls, too.
        """
        up = DAMPING_UP
        while damping <= DAMPING_MOST:
            step, promised = _step(gradient, information, moving, damping)
            if not eager and promised < smallest_gain:
                return None
            found = self._rise(here, step * self.width, enough=WORTH_LENGTHENING * promised, eager=eager)
            if found is not None:
                return found, max(damping * DAMPING_DOWN, DAMPING_LEAST)
            fallen, eager = self._cut(step), False
            damping, up = damping * up, 2.0 * up
            # Where little damping makes no difference the next step would fall as this one did.
            while damping <= DAMPING_MOST:
                step, _ = _step(gradient, information, moving, damping)
                if not _alike(self._cut(step), fallen):
                    break
                damping, up = damping * up, 2.0 * up
        return None

    def _rise(self, here: Place, direction: Array, *, enough: float = -np.inf, eager: bool = False) -> Place | None:
        """Return the highest place along a direction (parameter,), at lengths that double while they rise.

        ``enough``: a rise [nats] at the first length that is no more needs no second one; ``eager`` tries all
        lengths until one rises. None where none does.
        """
        room, best = self._room(direction), None
        for length in LENGTHS:
            if length > LENGTHS[0] and length > room:
                break
            there = self._aside(here, direction, length)
            if there.height > (here.height if best is None else best.height):
                best = there
                if length == LENGTHS[0] and best.height - here.height <= enough:
                    break
            elif best is not None or not eager:
                break
        return best


def _correct(jacobian: Array, difference: Array, shift: Array) -> NDArray[np.bool_]:
    """Correct a Jacobian by a difference of coordinates (coordinate,) over a shift (parameter,), as Broyden does.

    Return which coordinates miss by more than MISSED: they have jumped to where another slope holds, and their rows
    are left as they were.
    """
    missed = difference - jacobian @ shift
    jumped = np.abs(missed) > MISSED
    jacobian += np.outer(np.where(jumped, 0.0, missed), shift) / (shift @ shift)
    return np.asarray(jumped)


def _alike(step: Array, fallen: Array) -> bool:
    """Return whether a step (parameter,) leads to about where one that fell has led, both cut to what may be gone."""
    return bool(np.abs(step - fallen).max() < OTHERWISE * np.abs(fallen).max())


def _step(gradient: Array, information: Array, moving: NDArray[np.bool_], damping: float) -> tuple[Array, float]:
    """Return the step (parameter,) in widths of the priors, and what the quadratic model promises of it."""
    step = np.zeros(len(gradient))
    if not moving.any():
        return step, 0.0
    block = information[np.ix_(moving, moving)]
    step[moving] = np.linalg.solve(block + damping * np.diag(np.diag(block)), gradient[moving])
    return step, float(0.5 * gradient @ step)
