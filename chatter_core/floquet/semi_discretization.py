"""Monodromy operator by semi-discretization of order zero: the textbook method.

The period is cut into n equal intervals. In each, the gains are replaced by their means and the
delayed outputs by their value at the interval's start minus the delay; what is left is solved
exactly. The error falls with the first power of n, so this is a reference to be compared with,
not the method to work with.

Source: T. Insperger, G. Stepan, Semi-Discretization for Time-Delay Systems (Springer 2011); in
the form of equations 34-46 of "Effects of spindle speed-dependent dynamic characteristics of ball
bearing and multi-modes on the stability of milling processes".
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation, Gain

#: Gauss nodes in each smooth part of an interval for the mean of a gain.
MEAN_NODES = 4


@dataclass(frozen=True, kw_only=True)
class SemiDiscretizationMonodromy:
    """Map of (x_j, w_j-1, ..., w_j-n) over the n intervals of a period.

    present: (point, interval, state, state); delayed: one (point, interval, state, output) for each
    delay of ``lags`` (point, delay) intervals; the output matrix gives w = C x.
    """

    present: Array
    delayed: tuple[Array, ...]
    mean_gain: tuple[Array, ...]
    lags: NDArray[np.intp]
    output_matrix: Array
    interval: Array

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and size of the discretised state."""
        points, intervals, states, _ = self.present.shape
        return points, states + intervals * self.output_matrix.shape[1]

    def apply(self, vectors: Array) -> Array:
        """Map vectors (point, size) over one period."""
        state, outputs, _ = self._march(vectors)
        return np.concatenate([state, outputs[:, : -self.present.shape[1] - 1 : -1].reshape(len(vectors), -1)], axis=1)

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the operator of some of the points."""
        return replace(
            self,
            present=self.present[points],
            delayed=tuple(d[points] for d in self.delayed),
            mean_gain=tuple(g[points] for g in self.mean_gain),
            lags=self.lags[points],
            output_matrix=self.output_matrix[points],
            interval=self.interval[points],
        )

    def force(self, vectors: ComplexArray) -> tuple[Array, Array, ComplexArray]:
        """Return times (point, sample), weights (point, sample) and feedback force (point, sample, input)."""
        _, _, force = self._march(vectors)
        intervals = self.present.shape[1]
        time = self.interval[:, None] * (np.arange(intervals) + 0.5)
        return time, np.broadcast_to(self.interval[:, None], time.shape), force

    def _march(self, vectors: NDArray) -> tuple[NDArray, NDArray, NDArray]:  # type: ignore[type-arg]
        """Return the last state, the outputs w_-n .. w_n-1 and the mean force in every interval."""
        points, intervals, states, _ = self.present.shape
        inputs = self.mean_gain[0].shape[-2]
        rows = np.arange(points)
        state = vectors[:, :states]
        outputs = np.empty((points, 2 * intervals, self.output_matrix.shape[1]), dtype=vectors.dtype)
        outputs[:, :intervals] = vectors[:, states:].reshape(points, intervals, -1)[:, ::-1]
        force = np.zeros((points, intervals, inputs), dtype=vectors.dtype)
        for j in range(intervals):
            outputs[:, intervals + j] = (self.output_matrix @ state[..., None])[..., 0]
            after = (self.present[:, j] @ state[..., None])[..., 0]
            past = [outputs[rows, intervals + j - self.lags[:, i]] for i in range(len(self.delayed))]
            for i, old in enumerate(past):
                after = after + (self.delayed[i][:, j] @ old[..., None])[..., 0]
            middle = 0.5 * (outputs[:, intervals + j] + (self.output_matrix @ after[..., None])[..., 0])
            for i, old in enumerate(past):
                force[:, j] += (self.mean_gain[i][:, j] @ (middle - old)[..., None])[..., 0]
            state = after
        return state, outputs, force


def build(equation: DelayEquation, intervals: int) -> SemiDiscretizationMonodromy:
    """Build the operator with n = ``intervals`` a period; every delay is rounded to whole intervals."""
    points, states = len(equation), equation.system.state_matrix.shape[-1]
    state_matrix, input_matrix, output_matrix = (
        matrix[equation.system_index]
        for matrix in (equation.system.state_matrix, equation.system.input_matrix, equation.system.output_matrix)
    )
    step = equation.period / intervals
    means = tuple(_interval_means(equation, feedback.gain, intervals) for feedback in equation.feedback)
    outputs = means[0].shape[-1]
    wide = states + outputs * len(means)
    # One exponential gives the present and the delayed part, also where W_0 is singular.
    generator = np.zeros((points, intervals, wide, wide))
    generator[..., :states, :states] = state_matrix[:, None]
    for i, mean in enumerate(means):
        fed_back = input_matrix[:, None] @ mean
        generator[..., :states, :states] += fed_back @ output_matrix[:, None]
        generator[..., :states, states + i * outputs : states + (i + 1) * outputs] = -fed_back
    moved = scipy.linalg.expm(generator * step[:, None, None, None])
    lags = np.stack([np.rint(feedback.delay / step).astype(np.intp) for feedback in equation.feedback], axis=1)
    return SemiDiscretizationMonodromy(
        present=moved[..., :states, :states],
        delayed=tuple(
            moved[..., :states, states + i * outputs : states + (i + 1) * outputs] for i in range(len(means))
        ),
        mean_gain=means,
        lags=np.clip(lags, 1, intervals),
        output_matrix=output_matrix,
        interval=step,
    )


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
