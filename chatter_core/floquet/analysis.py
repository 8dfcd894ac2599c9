"""Floquet analysis of a batch of equations: the critical multiplier and the motion that it belongs to."""

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet import compiled, multipliers, semi_discretization
from chatter_core.floquet.equation import Array, ComplexArray, DelayEquation
from chatter_core.floquet.harmonics import harmonics
from chatter_core.floquet.method import MethodSettings
from chatter_core.floquet.multipliers import FloquetMotion, Monodromy, Multiplier

Found = TypeVar("Found", FloquetMotion, Multiplier)

#: The residual of a multiplier is this share of the tolerance, for its condition, and never larger than that.
RESIDUAL_SHARE, LARGEST_RESIDUAL = 1e-3, 1e-7
#: Multipliers beside the critical one are asked for by their kind and frequency, not for digits.
LEADING_RESIDUAL = 1e-3


@dataclass(frozen=True, kw_only=True)
class FloquetSolution:
    """Motion x(t) = sum_j X_j exp(s_j t) of every point, the critical one or another.

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


def analyse_leading(equation: DelayEquation, method: MethodSettings, count: int) -> list[FloquetSolution]:
    """Find so many multipliers of largest modulus of every point and the harmonics of their motions.

    The first is what ``analyse`` finds, and the others are those of ``leading_multipliers``; where there are fewer they
    have not converged.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    operator, residual = _operator(equation, method, 1.0)
    found = multipliers.leading_motions(operator, count, residual, LEADING_RESIDUAL)
    return [_with_harmonics(equation, _where_known(equation, motion)) for motion in found]


def _with_harmonics(equation: DelayEquation, motion: FloquetMotion) -> FloquetSolution:
    """Return a motion with its harmonics."""
    # What did not converge gets a harmless value here and is marked in the answer.
    multiplier = np.where(motion.converged, motion.multiplier, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        exponent, state, output = harmonics(equation, multiplier, motion)
    converged = motion.converged & np.isfinite(output).all(axis=(1, 2))
    return FloquetSolution(
        multiplier=motion.multiplier, converged=converged, exponent=exponent, state=state, output=output
    )


def critical_motion(equation: DelayEquation, method: MethodSettings, refinement: Array | float = 1.0) -> FloquetMotion:
    """Find the critical multiplier of every point and the force of its motion, and no harmonics.

    Raises UnsupportedEquation when the method does not solve such an equation.

    See docs/physics.md#critical-multiplier.
    """
    return _where_known(equation, multipliers.critical_motion(*_operator(equation, method, refinement)))


def critical_multiplier(equation: DelayEquation, method: MethodSettings, refinement: Array | float = 1.0) -> Multiplier:
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
    found = multipliers.leading_multipliers(operator, count, LEADING_RESIDUAL)
    return found if equation.known is None else np.where(equation.known[:, None], found, np.nan)


def _where_known(equation: DelayEquation, found: Found) -> Found:
    """Return a multiplier or motion that has not converged where the equation itself is not known."""
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
