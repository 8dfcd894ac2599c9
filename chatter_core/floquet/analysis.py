"""Floquet analysis of a batch of equations: the critical multiplier and the motion that it belongs to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import compiled, multipliers, semi_discretization
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.method import MethodSettings
from chatter_core.floquet.multipliers import CriticalMotion

#: The residual of a multiplier is this share of the tolerance, for its condition, and never larger than that.
RESIDUAL_SHARE, LARGEST_RESIDUAL = 1e-3, 1e-7
#: Harmonics are kept up to this multiple of the fastest pole.
HARMONIC_RANGE = 1.5
#: The range is doubled, so often at most, while the strongest line lies beyond this share of it.
EDGE, WIDENINGS = 0.75, 4


@dataclass(frozen=True, kw_only=True)
class FloquetSolution:
    """Critical motion x(t) = sum_j X_j exp(s_j t) of every point.

    multiplier: (point,); converged: (point,) False where it did not settle; exponent s_j: (point,
    harmonic) [1/s]; state X_j: (point, harmonic, state); output C X_j: (point, harmonic, output).
    """

    multiplier: ComplexArray
    converged: NDArray[np.bool_]
    exponent: ComplexArray
    state: ComplexArray
    output: ComplexArray


def analyse(equation: DelayEquation, method: MethodSettings, refinement: Array | float = 1.0) -> FloquetSolution:
    """Find the critical multiplier of every point and the harmonics of its motion.

    The motion is p(t) exp(ln(mu) t / T) with periodic p, so its harmonics follow from those of
    the feedback force f: X_j = (s_j - A)^-1 B F_j, s_j = (ln(mu) + 2 pi i j) / T.
    ``refinement`` multiplies the resolution of collocation.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    critical = critical_motion(equation, method, refinement)
    # What did not converge gets a harmless value here and is marked in the answer.
    multiplier = np.where(critical.converged, critical.multiplier, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        exponent, state, output = _motion(equation, multiplier, critical)
    converged = critical.converged & np.isfinite(output).all(axis=(1, 2))
    return FloquetSolution(
        multiplier=critical.multiplier, converged=converged, exponent=exponent, state=state, output=output
    )


def critical_motion(equation: DelayEquation, method: MethodSettings, refinement: Array | float = 1.0) -> CriticalMotion:
    """Find the critical multiplier of every point and the force of its motion, and no harmonics.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    if method.name == "collocation":
        assert method.tolerance is not None
        residual = min(LARGEST_RESIDUAL, RESIDUAL_SHARE * method.tolerance)
        return multipliers.critical_motion(compiled.build(equation, refinement), residual)
    assert method.intervals is not None
    assert method.order is not None
    return multipliers.critical_motion(semi_discretization.build(equation, method.intervals, method.order))


def _motion(
    equation: DelayEquation, multiplier: ComplexArray, critical: CriticalMotion
) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
    """Return exponents, states and outputs of the harmonics.

    Each point has its own range of harmonics, whatever batch it is in; it is widened while the
    strongest line lies near its edge, where a strong feedback drives motion beyond the fastest pole.
    """
    fastest = np.abs(equation.system.spectrum.poles).max(axis=1)[equation.system_index]
    reach = np.ceil(HARMONIC_RANGE * fastest * equation.period / (2.0 * np.pi)).astype(int) + 1
    for widening in range(WIDENINGS + 1):
        order = np.arange(-reach.max(), reach.max() + 1)
        exponent = (np.log(multiplier)[:, None] + 2j * np.pi * order) / equation.period[:, None]
        state = _respond(equation, exponent, _project(equation, exponent, critical))
        state[np.abs(order) > reach[:, None]] = 0.0
        output = state @ equation.system.output_matrix[equation.system_index].swapaxes(1, 2)
        strongest = np.abs(order[np.linalg.norm(output, axis=-1).argmax(axis=-1)])
        near_edge = strongest > EDGE * reach
        if widening == WIDENINGS or not near_edge.any():
            break
        reach = np.where(near_edge, 2 * reach, reach)
    return np.asarray(exponent), state, output


def _project(equation: DelayEquation, exponent: ComplexArray, critical: CriticalMotion) -> ComplexArray:
    """Return the force's harmonics (point, harmonic, input)."""
    phase = critical.weight[:, None, :] * np.exp(-exponent[:, :, None] * critical.time[:, None, :])
    return np.asarray((phase @ critical.force) / equation.period[:, None, None])


def _respond(equation: DelayEquation, exponent: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return (s - A)^-1 B F for every harmonic (point, harmonic, state)."""
    spectrum, which = equation.system.spectrum, equation.system_index
    driven = (spectrum.inverse @ equation.system.input_matrix)[which]
    modal = (force @ driven.swapaxes(1, 2)) / (exponent[..., None] - spectrum.poles[which, None, :])
    return np.asarray(modal @ spectrum.modes[which].swapaxes(1, 2))
