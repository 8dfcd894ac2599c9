"""The equation that is solved: a linear periodic system with delayed feedback through few outputs.

x'(t) = A x(t) + B sum_l K_l(t) [C x(t) - C x(t - tau_l)] + B sum_k D_k(t) C x'(t),

K_l and D_k of period T. A position has no jump, C B = 0, so its velocity is an output as well: C x' = C A x.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chatter_core.errors import UnsupportedEquation

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Times (point, ...) -> feedback matrices (point, ..., input, output).
Gain = Callable[[Array], Array]

#: Largest condition number of the eigenvectors of A that is still diagonalised.
LARGEST_CONDITION = 1e9


@dataclass(frozen=True, kw_only=True)
class Spectrum:
    """A = modes diag(poles) modes^-1: poles (system, pole) [1/s], modes and inverse (system, pole, pole)."""

    poles: ComplexArray
    modes: ComplexArray
    inverse: ComplexArray


@dataclass(frozen=True, kw_only=True)
class HalfSpectrum:
    """One pole of each conjugate pair: sums over all poles are real parts of weighted sums over these.

    poles (system, pole) [1/s]; modes (system, state, pole), already weighted, 2 for a pair, 1 for a real
    pole and 0 for filling; inverse (system, pole, state); seen = C modes, weighted, (system, output,
    pole); driven = modes^-1 B (system, pole, input).
    """

    poles: ComplexArray
    modes: ComplexArray
    inverse: ComplexArray
    seen: ComplexArray
    driven: ComplexArray


@dataclass(frozen=True, kw_only=True)
class LinearSystem:
    """The linear systems of a batch of equations; many equations may share one.

    state_matrix A: (system, state, state); input_matrix B: (system, state, input); output_matrix C:
    (system, output, state); known_spectrum: where whoever made A knows it in closed form.
    """

    state_matrix: Array
    input_matrix: Array
    output_matrix: Array
    known_spectrum: Spectrum | None = None

    @cached_property
    def spectrum(self) -> Spectrum:
        """Eigenvalues and eigenvectors of A, found once.

        Raises UnsupportedEquation when A cannot be diagonalised.
        """
        spectrum, condition = self.known_spectrum or self._find_spectrum(), np.inf
        if np.all(np.isfinite(spectrum.inverse)):
            norms = np.linalg.norm(spectrum.modes, axis=(1, 2)) * np.linalg.norm(spectrum.inverse, axis=(1, 2))
            condition = float(norms.max())
        if not condition < LARGEST_CONDITION:
            raise UnsupportedEquation(
                f"state matrix cannot be diagonalised (condition {condition:.1e}, allowed "
                f"{LARGEST_CONDITION:.0e}): two poles coincide, as at critical damping; change one of them a little"
            )
        return spectrum

    def _find_spectrum(self) -> Spectrum:
        """Return the spectrum; an inverse that does not exist is not a number."""
        poles, modes = np.linalg.eig(self.state_matrix)
        try:
            inverse = np.linalg.inv(modes)
        except np.linalg.LinAlgError:
            inverse = np.full_like(modes, np.nan)
        return Spectrum(poles=poles.astype(complex), modes=modes.astype(complex), inverse=inverse.astype(complex))

    @cached_property
    def half_spectrum(self) -> HalfSpectrum:
        """The upper half of the spectrum, with what B and C make of it, found once.

        Raises UnsupportedEquation when A cannot be diagonalised.
        """
        spectrum = self.spectrum
        upper = spectrum.poles.imag >= 0.0
        kept = np.argsort(~upper, axis=1, kind="stable")[:, : int(upper.sum(axis=1).max())]
        poles = np.take_along_axis(spectrum.poles, kept, axis=1)
        weight = np.where(poles.imag > 0.0, 2.0, np.where(poles.imag == 0.0, 1.0, 0.0))
        modes = np.take_along_axis(spectrum.modes, kept[:, None, :], axis=2) * weight[:, None, :]
        inverse = np.take_along_axis(spectrum.inverse, kept[:, :, None], axis=1)
        return HalfSpectrum(
            poles=poles,
            modes=modes,
            inverse=inverse,
            seen=self.output_matrix @ modes,
            driven=inverse @ self.input_matrix,
        )

    @cached_property
    def fastest_pole(self) -> Array:
        """Largest modulus of a pole (system,) [1/s]."""
        return np.asarray(np.abs(self.spectrum.poles).max(axis=1))

    @cached_property
    def seen_with_velocities(self) -> ComplexArray:
        """What outputs, and their velocities over the fastest pole, see of the half spectrum (system, .., pole).

        Raises UnsupportedEquation when an output has no velocity, because an input makes it jump.
        """
        jump = np.abs(self.output_matrix @ self.input_matrix).max()
        if jump > 0.0:
            raise UnsupportedEquation("a gain on velocities needs outputs that no input makes jump, C B = 0")
        half = self.half_spectrum
        velocity = half.seen * (half.poles / self.fastest_pole[:, None])[:, None, :]
        return np.concatenate([half.seen, velocity], axis=1)


@dataclass(frozen=True, kw_only=True)
class DelayedFeedback:
    """One term K(t) [C x(t) - C x(t - tau)]; delay: (point,) [s], at most the period."""

    gain: Gain
    delay: Array


@dataclass(frozen=True, kw_only=True)
class DelayEquation:
    """A batch of equations of one shape, one per point.

    system: the linear systems; system_index: (point,), which of them is a point's; period: (point,)
    [s]; breakpoints: (point, breakpoint), the times in [0, period) where a gain is not smooth, at
    least one; velocity_gain: D_k, on the outputs' velocities; known: (point,), where the gains are what they should
    be, None where everywhere. What is not known has no solution.
    """

    system: LinearSystem
    system_index: NDArray[np.intp]
    feedback: tuple[DelayedFeedback, ...]
    period: Array
    breakpoints: Array
    velocity_gain: tuple[Gain, ...] = ()
    known: NDArray[np.bool_] | None = None

    def __len__(self) -> int:
        return len(self.period)
