"""Harmonics of a motion, from the feedback force that goes with it.

The motion is p(t) exp(ln(mu) t / T) with periodic p, so with the force's harmonics F_j

    x(t) = sum_j X_j exp(s_j t),   X_j = (s_j - A)^-1 B F_j,   s_j = (ln(mu) + 2 pi i j) / T.
"""

import numpy as np

from chatter_core.floquet.equation import ComplexArray, DelayEquation
from chatter_core.floquet.multipliers import FloquetMotion
from chatter_core.jit import compiled

#: Harmonics are kept up to this multiple of the fastest pole.
RANGE = 1.5
#: The range is doubled, so often at most, while the strongest line lies beyond this share of it.
EDGE, WIDENINGS = 0.75, 4


def harmonics(
    equation: DelayEquation, multiplier: ComplexArray, motion: FloquetMotion
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return exponents s_j (point, harmonic) [1/s], states X_j (.., state) and outputs C X_j (.., output).

    Each point has its own range of harmonics, whatever batch it is in, and zeros beyond; it is widened
    while the strongest line lies near its edge, where a strong feedback drives motion beyond the fastest pole.

    See docs/physics.md#critical-multiplier.
    """
    system, which = equation.system, equation.system_index
    fastest = np.abs(system.spectrum.poles).max(axis=1)[which]
    reach = np.ceil(RANGE * fastest * equation.period / (2.0 * np.pi)).astype(int) + 1
    driven = system.spectrum.inverse @ system.input_matrix
    for widening in range(WIDENINGS + 1):
        order = np.arange(-reach.max(), reach.max() + 1)
        exponent = (np.log(multiplier)[:, None] + 2j * np.pi * order) / equation.period[:, None]
        state = np.zeros((*exponent.shape, driven.shape[1]), dtype=complex)
        output = np.zeros((*exponent.shape, system.output_matrix.shape[1]), dtype=complex)
        _respond(
            exponent, reach, equation.period, motion.time, motion.weight, np.ascontiguousarray(motion.force),
            which, system.spectrum.poles, system.spectrum.modes, driven, system.output_matrix, state, output,
        )  # fmt: skip
        lines = square(output).sum(axis=-1)
        # Nothing moves without a force: none of its lines is the strongest.
        near_edge = (np.abs(order[lines.argmax(axis=-1)]) > EDGE * reach) & lines.any(axis=-1)
        if widening == WIDENINGS or not near_edge.any():
            break
        reach = np.where(near_edge, 2 * reach, reach)
    return exponent, state, output


def square(values: ComplexArray) -> np.ndarray:
    """Return the square of the modulus of every entry, ten times faster than by its root.

    See docs/physics.md#critical-multiplier.
    """
    return np.asarray(values.real**2 + values.imag**2)


@compiled
def _respond(  # type: ignore[no-untyped-def]
    exponent, reach, period, time, weight, force, system, poles, modes, driven, output_matrix, state, output
):
    """Fill the states and outputs of every harmonic within a point's reach."""
    count, inputs, states = exponent.shape[1], force.shape[2], modes.shape[1]
    line = np.empty((count, inputs), np.complex128)
    for p in range(len(exponent)):
        s, first = system[p], count // 2 - reach[p]
        line[:] = 0.0
        for t in range(time.shape[1]):
            if weight[p, t] == 0.0:
                continue
            phase = weight[p, t] / period[p] * np.exp(-exponent[p, first] * time[p, t])
            turn = np.exp(-2j * np.pi * time[p, t] / period[p])
            for j in range(first, count - first):
                for c in range(inputs):
                    line[j, c] += phase * force[p, t, c]
                phase *= turn
        for j in range(first, count - first):
            for k in range(states):
                modal = 0.0 + 0.0j
                for c in range(inputs):
                    modal += driven[s, k, c] * line[j, c]
                away = exponent[p, j] - poles[s, k]
                modal *= away.conjugate() / (away.real**2 + away.imag**2)
                for i in range(states):
                    if modes[s, i, k] != 0.0:
                        state[p, j, i] += modes[s, i, k] * modal
            for o in range(output.shape[2]):
                for i in range(states):
                    output[p, j, o] += output_matrix[s, o, i] * state[p, j, i]
