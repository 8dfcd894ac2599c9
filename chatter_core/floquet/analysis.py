"""Floquet analysis of a batch of equations: the critical multiplier and the motion that it belongs to."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import collocation, semi_discretization
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.method import MethodSettings
from chatter_core.floquet.multipliers import critical_multiplier

#: Harmonics are kept up to this multiple of the fastest pole.
HARMONIC_RANGE = 1.5


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
    """
    monodromy: collocation.CollocationMonodromy | semi_discretization.SemiDiscretizationMonodromy
    if method.name == "collocation":
        monodromy = collocation.build(equation, refinement)
    else:
        assert method.intervals is not None
        assert method.order is not None
        monodromy = semi_discretization.build(equation, method.intervals, method.order)
    critical = critical_multiplier(monodromy)
    exponent = _exponents(equation, critical.value)
    time, weight, force = monodromy.force(critical.vector)
    phase = weight[:, None, :] * np.exp(-exponent[:, :, None] * time[:, None, :])
    harmonics = (phase @ force) / equation.period[:, None, None]
    state = _respond(equation, exponent, harmonics)
    output = state @ equation.system.output_matrix[equation.system_index].swapaxes(1, 2)
    return FloquetSolution(
        multiplier=critical.value, converged=critical.converged, exponent=exponent, state=state, output=output
    )


def _exponents(equation: DelayEquation, multiplier: ComplexArray) -> ComplexArray:
    fastest = np.abs(equation.system.spectrum.poles).max(axis=1)[equation.system_index]
    reach = int(np.ceil(HARMONIC_RANGE * (fastest * equation.period).max() / (2.0 * np.pi))) + 1
    order = np.arange(-reach, reach + 1)
    return np.asarray((np.log(multiplier)[:, None] + 2j * np.pi * order) / equation.period[:, None])


def _respond(equation: DelayEquation, exponent: ComplexArray, force: ComplexArray) -> ComplexArray:
    """Return (s - A)^-1 B F for every harmonic (point, harmonic, state)."""
    spectrum, which = equation.system.spectrum, equation.system_index
    driven = (spectrum.inverse @ equation.system.input_matrix)[which]
    modal = (force @ driven.swapaxes(1, 2)) / (exponent[..., None] - spectrum.poles[which, None, :])
    return np.asarray(modal @ spectrum.modes[which].swapaxes(1, 2))
