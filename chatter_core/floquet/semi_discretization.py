"""Monodromy operator by semi-discretization of order zero, one or two: the textbook methods.

The period is cut into n equal intervals. In each, the gains are replaced by their means and the
delayed outputs by a polynomial through their samples; what is left is solved exactly. The samples
of order zero lie at the interval's start minus the delay, those of order one at its end too, those
of order two at the sample before as well. The error falls with the first power of n at order zero
and with the second at orders one and two, whose gains are means all the same. So these are
references to be compared with, not methods to work with.

Sources: T. Insperger, G. Stepan, Semi-Discretization for Time-Delay Systems (Springer 2011), also
for the higher orders; order zero in the form of equations 34-46 of "Effects of spindle
speed-dependent dynamic characteristics of ball bearing and multi-modes on the stability of milling
processes".
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation, Gain
from chatter_core.floquet.multipliers import Krylov, arnoldi

#: Gauss nodes in each smooth part of an interval for the mean of a gain.
MEAN_NODES = 4
#: Mean over an interval of what the value and each derivative at its start stand for.
MEAN_OF_POWERS = np.array([1.0, 1.0 / 2.0, 1.0 / 6.0])


#: Samples of the delayed output, counted in intervals from the one nearest to the interval's start
#: minus the delay, by the order of the polynomial through them.
SAMPLES = {0: (0,), 1: (0, 1), 2: (-1, 0, 1)}


@dataclass(frozen=True, kw_only=True)
class Delayed:
    """One delayed term over the intervals of a period.

    lag: (point,) whole intervals; drive: (point, interval, state, sample x output), what the samples
    do to the next state; mean: (point, sample), their weights in the mean over an interval;
    mean_gain: (point, interval, input, output).
    """

    lag: NDArray[np.intp]
    drive: Array
    mean: Array
    mean_gain: Array

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the term of some of the points."""
        return replace(
            self,
            lag=self.lag[points],
            drive=self.drive[points],
            mean=self.mean[points],
            mean_gain=self.mean_gain[points],
        )


@dataclass(frozen=True, kw_only=True)
class SemiDiscretizationMonodromy:
    """Map of (x_j, w_j-1, ..., w_j-h) over the n intervals of a period.

    present: (point, interval, state, state); velocity: (point, interval, input, output), mean gains on the
    outputs' velocities; the output matrix gives w = C x; history: number h of past samples.
    """

    present: Array
    delayed: tuple[Delayed, ...]
    velocity: Array
    output_matrix: Array
    interval: Array
    samples: tuple[int, ...]
    history: int

    @property
    def states(self) -> int:
        """Number of states of the linear system."""
        return int(self.present.shape[2])

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and size of the discretised state."""
        points, _, states, _ = self.present.shape
        return points, states + self.history * self.output_matrix.shape[1]

    def apply(self, vectors: Array) -> Array:
        """Map vectors (point, size) over one period."""
        state, outputs = self._march(vectors)
        latest = outputs[:, -2 : -self.history - 2 : -1]
        return np.concatenate([state, latest.reshape(len(vectors), -1)], axis=1)

    @property
    def several_delays(self) -> bool:
        """Whether the period holds several delays."""
        return len(self.delayed) > 1

    def krylov(self, start: Array, steps: int, known: Krylov | None = None) -> Krylov:
        """Return basis and Hessenberg matrix of Arnoldi's method, see ``multipliers.arnoldi``."""
        return arnoldi(self.apply, np.broadcast_to(start, self.shape), steps, known)

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the operator of some of the points."""
        return replace(
            self,
            present=self.present[points],
            delayed=tuple(term.select(points) for term in self.delayed),
            velocity=self.velocity[points],
            output_matrix=self.output_matrix[points],
            interval=self.interval[points],
        )

    def force(self, vectors: ComplexArray) -> tuple[Array, Array, ComplexArray]:
        """Return times (point, sample), weights (point, sample) and feedback force (point, sample, input)."""
        _, outputs = self._march(vectors)
        intervals, h = self.present.shape[1], self.history
        time = self.interval[:, None] * (np.arange(intervals) + 0.5)
        present = 0.5 * (outputs[:, h:-1] + outputs[:, h + 1 :])
        # The mean velocity over an interval is what the output has moved in it.
        moved = (outputs[:, h + 1 :] - outputs[:, h:-1]) / self.interval[:, None, None]
        force = (self.velocity @ moved[..., None])[..., 0].astype(vectors.dtype)
        for term in self.delayed:
            place = h + np.arange(intervals) - term.lag[:, None]
            past = sum(
                term.mean[:, i, None, None] * np.take_along_axis(outputs, (place + offset)[..., None], axis=1)
                for i, offset in enumerate(self.samples)
            )
            force += (term.mean_gain @ (present - past)[..., None])[..., 0]
        return time, np.broadcast_to(self.interval[:, None], time.shape), force

    def _march(self, vectors: NDArray) -> tuple[NDArray, NDArray]:  # type: ignore[type-arg]
        """Return the last state and the outputs w_-h .. w_n."""
        points, intervals, states, _ = self.present.shape
        h, rows = self.history, np.arange(points)[:, None]
        state = vectors[:, :states, None]
        outputs = np.empty((points, h + intervals + 1, self.output_matrix.shape[1]), dtype=vectors.dtype)
        outputs[:, :h] = vectors[:, states:].reshape(points, h, -1)[:, ::-1]
        outputs[:, h] = (self.output_matrix @ state)[..., 0]
        places = [h - term.lag[:, None] + np.array(self.samples) for term in self.delayed]
        for j in range(intervals):
            after = self.present[:, j] @ state
            for term, place in zip(self.delayed, places, strict=True):
                after += term.drive[:, j] @ outputs[rows, place + j].reshape(points, -1, 1)
            state = after
            outputs[:, h + j + 1] = (self.output_matrix @ state)[..., 0]
        return state[..., 0], outputs


def build(equation: DelayEquation, intervals: int, order: int) -> SemiDiscretizationMonodromy:
    """Build the operator with n = ``intervals`` a period.

    A delay that is no whole number of intervals is rounded to one at order zero and kept at orders
    one and two.

    See docs/physics.md#semi-discretization.
    """
    points, states = len(equation), equation.system.state_matrix.shape[-1]
    state_matrix, input_matrix, output_matrix = (
        matrix[equation.system_index]
        for matrix in (equation.system.state_matrix, equation.system.input_matrix, equation.system.output_matrix)
    )
    step = equation.period / intervals
    means = [_interval_means(equation, feedback.gain, intervals) for feedback in equation.feedback]
    velocity = sum(
        (_interval_means(equation, gain, intervals) for gain in equation.velocity_gain),
        start=np.zeros((points, intervals, input_matrix.shape[2], output_matrix.shape[1])),
    )
    outputs, powers = output_matrix.shape[1], order + 1
    block = outputs * powers
    # One exponential gives the present and the driven part, also where W_0 is singular: the delayed
    # output v_0 and its derivatives v_k drive themselves, v_k' = v_k+1 / step.
    generator = np.zeros((points, intervals, states + block * len(means), states + block * len(means)))
    generator[..., :states, :states] = state_matrix[:, None]
    if equation.velocity_gain:
        generator[..., :states, :states] += input_matrix[:, None] @ velocity @ (output_matrix @ state_matrix)[:, None]
    for i, mean in enumerate(means):
        fed_back, start = input_matrix[:, None] @ mean, states + i * block
        generator[..., :states, :states] += fed_back @ output_matrix[:, None]
        generator[..., :states, start : start + outputs] = -fed_back
        for k in range(order):
            here = start + k * outputs + np.arange(outputs)
            generator[..., here, here + outputs] = 1.0 / step[:, None, None]
    moved = scipy.linalg.expm(generator * step[:, None, None, None])
    terms = []
    for i, (feedback, mean) in enumerate(zip(equation.feedback, means, strict=True)):
        driven = moved[..., :states, states + i * block : states + (i + 1) * block]
        driven = driven.reshape(points, intervals, states, powers, outputs)
        lag = np.clip(np.rint(feedback.delay / step).astype(np.intp), 1, intervals)
        taylor = _taylor(order, lag - feedback.delay / step)
        terms.append(
            Delayed(
                lag=lag,
                drive=np.einsum("pnxko,psk->pnxso", driven, taylor).reshape(points, intervals, states, -1),
                mean=taylor @ MEAN_OF_POWERS[:powers],
                mean_gain=mean,
            )
        )
    return SemiDiscretizationMonodromy(
        present=moved[..., :states, :states],
        delayed=tuple(terms),
        velocity=velocity,
        output_matrix=output_matrix,
        interval=step,
        samples=SAMPLES[order],
        history=intervals - min(SAMPLES[order]),
    )


def _taylor(order: int, place: Array) -> Array:
    """Return what each sample adds to the polynomial's value and derivatives (point, sample, power).

    place: (point,) of the interval's start minus the delay, in intervals from the nearest sample.
    """
    one = np.ones_like(place)
    if order == 0:
        columns = [[one]]
    elif order == 1:
        columns = [[1.0 - place, -one], [place, one]]
    else:
        columns = [
            [0.5 * place * (place - 1.0), place - 0.5, one],
            [1.0 - place**2, -2.0 * place, -2.0 * one],
            [0.5 * place * (place + 1.0), place + 0.5, one],
        ]
    return np.moveaxis(np.array(columns), -1, 0)


def _interval_means(equation: DelayEquation, gain: Gain, intervals: int) -> Array:
    """Return the mean of a gain over every interval (point, interval, input, output).

    Intervals are broken at the equation's breakpoints, so that Gauss's rule meets smooth parts only.
    """
    grid = equation.period[:, None] * np.arange(intervals + 1) / intervals
    edges = np.sort(np.concatenate([grid, equation.breakpoints], axis=1), axis=1)
    nodes, weights = np.polynomial.legendre.leggauss(MEAN_NODES)
    length = np.diff(edges, axis=1)
    values = gain(edges[:, :-1, None] + length[..., None] * 0.5 * (nodes + 1.0))
    parts = np.einsum("pjnab,n,pj->pjab", values, 0.5 * weights, length)
    middle = 0.5 * (edges[:, 1:] + edges[:, :-1])
    owner = np.minimum((middle / grid[:, 1:2]).astype(int), intervals - 1)
    total = np.zeros((len(equation), intervals, *parts.shape[2:]))
    np.add.at(total, (np.arange(len(equation))[:, None], owner), parts)
    return total / grid[:, 1, None, None, None]
