"""Newton's method for many small balances of forces at once, each damped for itself."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]

#: Residual force that counts as equilibrium, relative to the largest force of the system.
FORCE_TOLERANCE = 1e-12
#: Rounding of a distance, relative to it.
ROUNDING = 8.0 * np.finfo(float).eps
#: Newton steps, and halvings of a step, before a system counts as not solved.
STEPS, HALVINGS = 40, 10

#: Takes unknowns (n, k) and which systems they belong to (n,); returns residuals (n, k) [N], Jacobians
#: (n, k, k) and the largest force of each system (n,) [N], zero where the unknowns make no sense.
System = Callable[[Array, Index], tuple[Array, Array, Array]]


def damped_newton(system: System, start: Array, length: float) -> tuple[Array, NDArray[np.bool_]]:
    """Return the unknowns (n, k) of n systems in balance, and which of them were solved (n,).

    ``start``: (n, k) first guess; ``length``: size of the distances [m] whose rounding limits how well
    a force can be known. A step is halved until the residual falls by a tenth of what it promises.
    A trial may lie where numbers end; it is refused. What one system does changes no bit of another's
    result.

    See docs/physics.md#preloaded-bearing.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return _damped_newton(system, np.array(start, dtype=float), length)


def _damped_newton(system: System, unknowns: Array, length: float) -> tuple[Array, NDArray[np.bool_]]:
    solved, active = np.zeros(len(unknowns), dtype=bool), np.arange(len(unknowns))
    residual, jacobian, size = system(unknowns, active)
    for _ in range(STEPS):
        allowed = FORCE_TOLERANCE * size + ROUNDING * np.abs(jacobian).max(axis=(1, 2)) * length
        done = np.abs(residual).max(axis=1) <= allowed
        solved[active[done]] = True
        # An exactly singular system has no step; determinants do not decide anything else here.
        going = ~done & np.isfinite(residual).all(axis=1) & (np.linalg.det(jacobian) != 0.0)
        active, residual, jacobian = active[going], residual[going], jacobian[going]
        if not active.size:
            break
        step = np.linalg.solve(jacobian, -residual[..., None])[..., 0]
        moved, residual, jacobian, size = _halved_until_better(system, unknowns, active, step, residual)
        active = active[moved]
    return unknowns, solved


def _halved_until_better(
    system: System, unknowns: Array, active: Index, step: Array, residual: Array
) -> tuple[Index, Array, Array, Array]:
    """Move every active system by its step or a part of it; return which moved and where they stand."""
    count, width = step.shape
    found, jacobian, size = np.zeros((count, width)), np.zeros((count, width, width)), np.zeros(count)
    before, here = np.linalg.norm(residual, axis=1), unknowns[active]
    waiting = np.arange(count)
    for damping in 0.5 ** np.arange(HALVINGS):
        trial = here[waiting] + damping * step[waiting]
        trial_residual, trial_jacobian, trial_size = system(trial, active[waiting])
        norm = np.linalg.norm(trial_residual, axis=1)
        better = (trial_size > 0.0) & (norm <= (1.0 - 0.1 * damping) * before[waiting])
        taken = waiting[better]
        unknowns[active[taken]] = trial[better]
        found[taken], jacobian[taken], size[taken] = trial_residual[better], trial_jacobian[better], trial_size[better]
        waiting = waiting[~better]
        if not waiting.size:
            break
    moved = np.setdiff1d(np.arange(count), waiting)
    return moved, found[moved], jacobian[moved], size[moved]
