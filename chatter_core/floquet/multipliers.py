"""The critical Floquet multiplier of a batch of monodromy operators, without forming them.

Arnoldi's method on all points at once: the operator is only ever applied. Source: Y. Saad,
Numerical Methods for Large Eigenvalue Problems (2011), chapter 6.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from chatter_core.floquet.ritz import dominant_pair, leading_pairs

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Krylov = tuple[Array, Array]

#: Applications before the Krylov space is begun: they remove what decays at once.
WARM_UP = 2
#: Sizes of the Krylov space at which the critical Ritz value is tested, beyond 4 and 9/8 of the states:
#: every mode has a multiplier, and only a few more are felt.
BEYOND_STATES = (0, 4, 10, 22, 44, 84)
#: With several delays the period is longer, more has decayed, and it is worth a look before.
BEFORE_STATES = (-8, -4)
#: Size, beyond the same, at which those beside the critical one are read.
BESIDE_STATES = 10
#: Default residual of the critical Ritz pair, relative to its modulus.
RESIDUAL_TOLERANCE = 1e-9
#: Part of an applied vector outside the space, relative to it, that counts as rounding.
EXHAUSTED = 1e-13


class Monodromy(Protocol):
    """Map of the discretised state over one period, for a batch of points."""

    @property
    def shape(self) -> tuple[int, int]:
        """Number of points and size of the discretised state."""

    @property
    def states(self) -> int:
        """Number of states of the linear system, at most that of the discretised state."""

    @property
    def several_delays(self) -> bool:
        """Whether the period holds several delays."""

    def krylov(self, start: Array, steps: int, known: Krylov | None = None) -> Krylov:
        """Return Arnoldi's basis (point, steps + 1, size) and Hessenberg matrix (point, steps + 1, steps).

        known: those of fewer steps, which are gone on from.
        """

    def select(self, points: NDArray[np.intp]) -> Self:
        """Return the operator of some of the points."""

    def force(self, vectors: ComplexArray) -> tuple[Array, Array, ComplexArray]:
        """Return times (point, sample), weights (point, sample) and feedback force (point, sample, input)."""


@dataclass(frozen=True, kw_only=True)
class Multiplier:
    """A multiplier (point,) of each point and its vector (point, size).

    Of a complex pair it is the one with positive angle. ``converged`` (point,) is False where the
    value did not settle.
    """

    value: ComplexArray
    vector: ComplexArray
    converged: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class FloquetMotion:
    """A multiplier (point,) of each point and the feedback force of its motion over one period.

    ``converged`` (point,) is False where the multiplier did not settle; time, weight: (point, sample)
    [s], of a quadrature over the period; force: (point, sample, input), to any complex scale.
    """

    multiplier: ComplexArray
    converged: NDArray[np.bool_]
    time: Array
    weight: Array
    force: ComplexArray


def critical_motion(
    monodromy: Monodromy, residual_tolerance: float = RESIDUAL_TOLERANCE, known: Krylov | None = None
) -> FloquetMotion:
    """Return the critical multiplier of every point and the force of its motion.

    known: as ``critical_multiplier`` takes it.

    See docs/physics.md#critical-multiplier.
    """
    return _motion(monodromy, critical_multiplier(monodromy, residual_tolerance, known))


def _motion(monodromy: Monodromy, found: Multiplier) -> FloquetMotion:
    """Return a multiplier with the force of its motion."""
    with np.errstate(over="ignore", invalid="ignore"):
        time, weight, force = monodromy.force(found.vector)
    return FloquetMotion(multiplier=found.value, converged=found.converged, time=time, weight=weight, force=force)


def critical_multiplier(
    monodromy: Monodromy, residual_tolerance: float = RESIDUAL_TOLERANCE, known: Krylov | None = None
) -> Multiplier:
    """Return the multiplier of largest modulus of every point.

    known: a Krylov space of all points, which is tested first and gone on from.

    The Krylov space grows until the Ritz value of largest modulus has a residual below the tolerance,
    relative to it; a larger Ritz value that has not settled yet therefore never hides behind a
    settled smaller one.

    A point for which the largest space does not suffice, or whose motion leaves the range of floating
    point within a period, is marked, not hidden.

    See docs/physics.md#critical-multiplier.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        return _critical_multiplier(monodromy, residual_tolerance, known)


def _critical_multiplier(monodromy: Monodromy, residual_tolerance: float, known: Krylov | None) -> Multiplier:
    points, size = monodromy.shape
    value = np.zeros(points, dtype=complex)
    vector = np.zeros((points, size), dtype=complex)
    residual = np.full(points, np.inf)
    start = start_vector(size)
    open_points = np.arange(points)
    first, done = _felt(monodromy), 1 if known is None else known[1].shape[2]
    beyond = (*BEFORE_STATES, *BEYOND_STATES) if monodromy.several_delays else BEYOND_STATES
    for wanted in sorted({min(max(first + more, done), size) for more in beyond}):
        basis, hessenberg = monodromy.krylov(start, wanted, known)
        theta, ritz, error = dominant_pair(basis, hessenberg, residual_tolerance)
        value[open_points], vector[open_points], residual[open_points] = theta, ritz, error
        unsettled = ~(error <= residual_tolerance * np.abs(theta))
        if not unsettled.any():
            break
        open_points, monodromy = open_points[unsettled], monodromy.select(np.flatnonzero(unsettled))
        known = basis[unsettled], hessenberg[unsettled]
    # A value of exactly zero is what is left of vectors that overflowed.
    converged = (residual <= residual_tolerance * np.abs(value)) & (value != 0.0) & np.isfinite(value)
    return Multiplier(value=value, vector=vector, converged=converged)


def _felt(monodromy: Monodromy) -> int:
    """Return how many multipliers are felt, or so."""
    return monodromy.states + monodromy.states // 8 + 4


def start_vector(size: int) -> Array:
    """Return the vector that Krylov spaces begin with, always the same.

    See docs/physics.md#critical-multiplier.
    """
    return np.random.default_rng(20111).standard_normal(size)


def leading_multipliers(monodromy: Monodromy, count: int, residual_tolerance: float) -> ComplexArray:
    """Return the multipliers of largest modulus (point, count), descending, one of each complex pair.

    NaN stands for those whose residual exceeds the tolerance, relative to the modulus: the Krylov space is not grown
    for their sake.

    See docs/physics.md#critical-multiplier.
    """
    _, hessenberg = _wide_krylov(monodromy)
    return leading_pairs(hessenberg, count, residual_tolerance)[0]


def leading_motions(
    monodromy: Monodromy, count: int, residual_tolerance: float, leading_tolerance: float
) -> list[FloquetMotion]:
    """Return the motions of so many multipliers of largest modulus, from one Krylov space.

    The first is what ``critical_motion`` finds; the others are as ``leading_multipliers`` has them, with a tolerance of
    their own, and have not converged where there are fewer.

    See docs/physics.md#critical-multiplier.
    """
    basis, hessenberg = _wide_krylov(monodromy)
    values, coordinates = (one[:, 1:] for one in leading_pairs(hessenberg, count, leading_tolerance))
    found = np.isfinite(values)
    vectors = np.asarray(np.where(found[..., None], coordinates, 0j) @ basis[:, :-1], dtype=complex)
    others = [
        Multiplier(value=values[:, which], vector=vectors[:, which], converged=found[:, which])
        for which in range(count - 1)
    ]
    critical = critical_motion(monodromy, residual_tolerance, (basis, hessenberg))
    return [critical, *(_motion(monodromy, other) for other in others)]


def _wide_krylov(monodromy: Monodromy) -> Krylov:
    """Return the Krylov space in which multipliers beside the critical one are read."""
    size = monodromy.shape[1]
    with np.errstate(over="ignore", invalid="ignore"):
        return monodromy.krylov(start_vector(size), min(_felt(monodromy) + BESIDE_STATES, size))


def arnoldi(apply: Callable[[Array], Array], start: Array, steps: int, known: Krylov | None = None) -> Krylov:
    """Return basis (point, steps + 1, size) and Hessenberg matrix (point, steps + 1, steps) of a map of vectors.

    ``apply`` maps vectors (point, size); start: (point, size); known: those of fewer steps, which are gone on from.

    See docs/physics.md#critical-multiplier.
    """
    basis, hessenberg, done = grown(len(start), steps, start.shape[1], known)
    if not done:
        for _ in range(WARM_UP):
            start = _unit(apply(start))
        basis[:, 0] = start
    for j in range(done, steps):
        new = _finite(apply(basis[:, j]))
        least = EXHAUSTED * _norm(new)
        space = basis[:, : j + 1]
        for _ in range(2):  # once is not enough where the new vector nearly lies in the space
            overlap = (space @ new[:, :, None])[..., 0]
            new = new - (overlap[:, None, :] @ space)[:, 0]
            hessenberg[:, : j + 1, j] += overlap
        length = _norm(new)
        # What is left of an exhausted space is rounding. It is exact already, and a zero vector
        # adds zero multipliers and nothing else.
        exhausted = length <= least
        hessenberg[:, j + 1, j] = np.where(exhausted, 0.0, length)
        basis[:, j + 1] = np.where(exhausted, 0.0, 1.0 / np.where(exhausted, 1.0, length))[:, None] * new
    return basis, hessenberg


def grown(points: int, steps: int, size: int, known: Krylov | None) -> tuple[Array, Array, int]:
    """Return room for basis and Hessenberg matrix with what is known of them, and how many steps that is.

    See docs/physics.md#critical-multiplier.
    """
    basis, hessenberg, done = np.zeros((points, steps + 1, size)), np.zeros((points, steps + 1, steps)), 0
    if known is not None:
        done = known[1].shape[2]
        basis[:, : done + 1], hessenberg[:, : done + 1, :done] = known
    return basis, hessenberg, done


def _finite(vectors: Array) -> Array:
    """Return vectors with those that left the range of floating point replaced by zero."""
    return np.where(np.isfinite(vectors).all(axis=1, keepdims=True), vectors, 0.0)


def _norm(vectors: Array) -> Array:
    """Return norms (point,) that overflow only where an entry does."""
    largest = np.abs(vectors).max(axis=1)
    scale = np.where(largest > 0.0, largest, 1.0)
    return np.asarray(scale * np.linalg.norm(vectors / scale[:, None], axis=1))


def _unit(vectors: Array) -> Array:
    """Return vectors of norm one; zero and not finite ones are zero."""
    vectors = _finite(vectors)
    length = _norm(vectors)
    return vectors / np.where(length > 0.0, length, 1.0)[:, None]
