"""The paper's method coded plainly: the yardstick.

Order-zero semi-discretization with n intervals, as equations 34 to 46 of the paper have it: in each
interval the gain is its mean and the delayed displacement its sample, the interval is solved exactly,
the state is extended by the n states before it, the n full matrices are multiplied, and all eigenvalues
of the product are found. One point at a time, nothing shared, which is how textbooks and papers code it.
"""

import numpy as np
import scipy.linalg

from chatter_core.floquet import DelayEquation

#: Gauss nodes for the mean of the gain over an interval, in each of as many parts.
MEAN_NODES, MEAN_PARTS = 4, 8


def spectral_radius(equation: DelayEquation, point: int, intervals: int = 40) -> float:
    """Return the spectral radius of one point of a batch of equations with one delay, a period."""
    system = int(equation.system_index[point])
    state = equation.system.state_matrix[system]
    driven, seen = equation.system.input_matrix[system], equation.system.output_matrix[system]
    states = len(state)
    step = float(equation.period[point]) / intervals
    size = (intervals + 1) * states
    product = np.eye(size)
    for number in range(intervals):
        cut = driven @ _mean_gain(equation, point, number * step, step) @ seen
        inside = state + cut
        grown = scipy.linalg.expm(inside * step)
        full = np.eye(size, k=-states)
        full[:states, :states] = grown
        full[:states, -states:] = -(grown - np.eye(states)) @ np.linalg.solve(inside, cut)
        product = full @ product
    return float(np.abs(scipy.linalg.eigvals(product)).max())


def _mean_gain(equation: DelayEquation, point: int, start: float, step: float) -> np.ndarray:
    """Return the mean of the gain over an interval (input, output)."""
    nodes, weights = np.polynomial.legendre.leggauss(MEAN_NODES)
    parts = (np.arange(MEAN_PARTS)[:, None] + 0.5 * (nodes + 1.0)) / MEAN_PARTS
    time = np.zeros((len(equation), parts.size))
    time[point] = start + step * parts.ravel()
    gain = equation.feedback[0].gain(time)[point]
    return np.einsum("q,qab->ab", np.tile(0.5 * weights, MEAN_PARTS) / MEAN_PARTS, gain)
