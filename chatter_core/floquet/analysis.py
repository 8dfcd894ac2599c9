"""Floquet analysis of a batch of equations: the critical multiplier and the motion that it belongs to."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import compiled, multipliers, semi_discretization
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.harmonics import harmonics
from chatter_core.floquet.method import MethodSettings
from chatter_core.floquet.multipliers import CriticalMotion, CriticalMultiplier, Monodromy

Critical = TypeVar("Critical", CriticalMotion, CriticalMultiplier)

#: The residual of a multiplier is this share of the tolerance, for its condition, and never larger than that.
RESIDUAL_SHARE, LARGEST_RESIDUAL = 1e-3, 1e-7
#: Multipliers beside the critical one are asked for by their kind and frequency, not for digits.
LEADING_RESIDUAL = 1e-3


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

    ``refinement`` multiplies the resolution of collocation.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    return _with_harmonics(equation, critical_motion(equation, method, refinement))


def analyse_with_leading(
    equation: DelayEquation, method: MethodSettings, count: int
) -> tuple[FloquetSolution, ComplexArray]:
    """Return what ``analyse`` and ``leading_multipliers`` do for hardly more than either.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    operator, residual = _operator(equation, method, 1.0)
    critical, leading = multipliers.critical_motion_and_leading(operator, count, residual, LEADING_RESIDUAL)
    return _with_harmonics(equation, _where_known(equation, critical)), _known_leading(equation, leading)


def _with_harmonics(equation: DelayEquation, critical: CriticalMotion) -> FloquetSolution:
    """Return a critical motion with its harmonics."""
    # What did not converge gets a harmless value here and is marked in the answer.
    multiplier = np.where(critical.converged, critical.multiplier, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        exponent, state, output = harmonics(equation, multiplier, critical)
    converged = critical.converged & np.isfinite(output).all(axis=(1, 2))
    return FloquetSolution(
        multiplier=critical.multiplier, converged=converged, exponent=exponent, state=state, output=output
    )


def critical_motion(equation: DelayEquation, method: MethodSettings, refinement: Array | float = 1.0) -> CriticalMotion:
    """Find the critical multiplier of every point and the force of its motion, and no harmonics.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    return _where_known(equation, multipliers.critical_motion(*_operator(equation, method, refinement)))


def critical_multiplier(
    equation: DelayEquation, method: MethodSettings, refinement: Array | float = 1.0
) -> CriticalMultiplier:
    """Find the critical multiplier of every point, and not its motion.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    return _where_known(equation, multipliers.critical_multiplier(*_operator(equation, method, refinement)))


def leading_multipliers(equation: DelayEquation, method: MethodSettings, count: int) -> ComplexArray:
    """Find so many multipliers of largest modulus of every point (point, count), NaN where they did not settle.

    See docs/physics.md#critical-multiplier.
    """
    operator, _ = _operator(equation, method, 1.0)
    return _known_leading(equation, multipliers.leading_multipliers(operator, count, LEADING_RESIDUAL))


def _known_leading(equation: DelayEquation, found: ComplexArray) -> ComplexArray:
    """Return multipliers (point, count), NaN where the equation itself is not known."""
    return found if equation.known is None else np.where(equation.known[:, None], found, np.nan)


def _where_known(equation: DelayEquation, found: Critical) -> Critical:
    """Return a critical multiplier or motion that has not converged where the equation itself is not known."""
    return found if equation.known is None else replace(found, converged=found.converged & equation.known)


def _operator(equation: DelayEquation, method: MethodSettings, refinement: Array | float) -> tuple[Monodromy, float]:
    """Return the monodromy operator and the residual that a multiplier of it may have."""
    if method.name == "collocation":
        assert method.tolerance is not None
        residual = min(LARGEST_RESIDUAL, RESIDUAL_SHARE * method.tolerance)
        return compiled.build(equation, refinement), residual
    assert method.intervals is not None
    assert method.order is not None
    return semi_discretization.build(equation, method.intervals, method.order), multipliers.RESIDUAL_TOLERANCE
