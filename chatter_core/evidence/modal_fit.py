"""Least squares on a receptance: modes, what modes outside the band leave, the chain's phase.

Equation, with H = displacement / force for the time law exp(+i w t) and r_k = w / w_k:

    H(w) = exp(i phi) [ sum_k c_k/(1 - r_k^2 + 2 i zeta_k r_k) + c_above - 1/(m_below w^2) ],   c_k = 1/k_k > 0

Poles to start from are found by a modal analysis library; which of them are modes, and with which
values and errors, is decided here on the complex receptance, weighted by the errors of its lines.

Sources: P. Guillaume et al., "A poly-reference implementation of the least-squares complex
frequency-domain estimator", IMAC XXI (2003) (poles); D. J. Ewins, Modal Testing (2000), chapter 4
(modes outside the band); G. Schwarz, Ann. Statist. 6 (1978) 461-464 (how many modes).
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from chatter_core.threads import one_thread

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Standard deviation of the measuring chain's phase, common to all lines [rad].
PHASE_ERROR = 0.05
#: How many more modes are tried once they no longer pay.
PATIENCE = 3
#: Highest order of the library's polynomial, in modes, and candidates that are tried for each further mode.
POLE_ORDER, TRIED = 24, 3
#: Candidates nearer than this in the logarithms of frequency and damping ratio count as one.
SAME_POLE = (1e-3, 0.1)
#: Bounds of a damping ratio and of a candidate's, and the factor by which a mode may lie outside the band.
DAMPING_RATIOS, CANDIDATE_RATIOS, BAND_MARGIN = (1e-5, 0.9), (1e-4, 0.5), 1.25
#: Logarithms that are nearer to a bound than this are held by it.
AT_BOUND = 1e-3
#: A mode is one when its compliance is this many standard deviations from zero; one of negative stiffness, which
#: is looked for among many candidates, when it is so many.
SIGNIFICANCE, FOREIGN_SIGNIFICANCE = 3.0, 6.0
#: Relative change of the sum of squares at which a fit ends: of candidates, and in the end.
TRIAL_TOLERANCE, FINAL_TOLERANCE = 1e-7, 1e-13
#: Weights follow the fitted magnitude until they change by less than this, in so many rounds at most.
WEIGHT_CHANGE, WEIGHT_ROUNDS = 1e-6, 20
#: Residual, as a share of the largest magnitude, below which a fit is exact.
RESOLUTION = 1e-7
#: Least compliance, as a share of the largest magnitude, and least eigenvalue of a normalised information matrix.
LEAST_COMPLIANCE, LEAST_INFORMATION = 1e-9, 1e-14


@dataclass(frozen=True, kw_only=True)
class Band:
    """Receptance over one band, in units of its centre [rad/s] and of its largest magnitude [m/N].

    frequency, measured: (line,); relative_error, floor_error: standard deviation of a line's
    complex error, as a share of its own magnitude and of the largest in the band.
    """

    frequency: Array
    measured: Complex
    centre: float
    largest: float
    relative_error: float
    floor_error: float

    def weight(self, receptance: Complex) -> Array:
        """Return one over the standard deviation of the real and of the imaginary part of each line."""
        magnitude = np.abs(receptance)
        deviation = np.hypot(self.relative_error * magnitude, self.floor_error * magnitude.max())
        return np.asarray(math.sqrt(2.0) / deviation)


@dataclass(frozen=True, kw_only=True)
class Fit:
    """Fit of a band with some modes, in the band's units.

    poles: (2, mode) natural frequencies and damping ratios; amplitudes: (mode + 2,) compliances
    of the modes, compliance above, inverse mass below; phase [rad]; fitted: (line,); weight:
    (line,) that was used; squares: sum of the squared weighted residuals; covariance: (parameter,
    parameter) of ln w_k, ln zeta_k, amplitudes and phase, for independent errors of the expected size.
    """

    poles: Array
    amplitudes: Array
    phase: float
    fitted: Complex
    weight: Array
    squares: float
    covariance: Array

    @property
    def count(self) -> int:
        """Number of modes."""
        return int(self.poles.shape[1])

    @property
    def misfit(self) -> float:
        """Root mean square of the residual over its expected standard deviation."""
        return math.sqrt(self.squares / max(1, 2 * len(self.weight) - len(self.covariance)))

    def independent_lines(self, measured: Complex) -> float:
        """Return the number of lines over the correlation length of the residual."""
        residual = (measured - self.fitted) * self.weight
        lines, power = len(residual), float(np.sum(np.abs(residual) ** 2))
        length, lag = 1.0, 1
        while power > 0.0 and lag < lines // 4:
            correlation = float(np.sum(residual[lag:] * residual[:-lag].conj()).real) / power
            if correlation < 2.0 / math.sqrt(lines):
                break
            length, lag = length + 2.0 * correlation, lag + 1
        return lines / length


def mode_shapes(frequency: Array, poles: Array) -> Complex:
    """Return the receptance of modes of unit stiffness (line, mode).

    frequency: (line,) and natural frequencies in one unit; poles: (2, mode).

    See docs/physics.md#modes-from-measurement.
    """
    ratio = frequency[:, None] / poles[0]
    return np.asarray(1.0 / (1.0 - ratio**2 + 2j * poles[1] * ratio))


def library_poles(frequency: Array, receptance: Complex) -> Array:
    """Find candidates for poles with the modal analysis library (2, candidate).

    All poles of all orders of the least-squares complex frequency method that lie in the band and
    could be modes; natural frequencies in the unit of ``frequency``, then damping ratios. The method
    asks for evenly spaced lines that would meet zero, so the receptance is interpolated to such.
    Source: Guillaume et al. (2003).

    See docs/physics.md#modes-from-measurement.
    """
    # Imported when needed: it brings matplotlib along, to pick poles by hand.
    from sdypy import EMA

    step = (frequency[-1] - frequency[0]) / (len(frequency) - 1)
    even = step * np.arange(math.ceil(frequency[0] / step), math.floor(frequency[-1] / step) + 1)
    values = np.interp(even, frequency, receptance.real) + 1j * np.interp(even, frequency, receptance.imag)
    model = EMA.Model(
        values[None],
        even,
        lower=float(even[0]),
        upper=float(even[-1]),
        pol_order_high=min(POLE_ORDER, len(even) // 8),
        frf_form="receptance",
    )
    model.get_poles(method="lscf", show_progress=False)
    # The library turns frequencies from Hz to rad/s and its poles back, so that any unit is kept.
    poles = np.stack([np.concatenate(model.pole_freq).real, np.concatenate(model.pole_xi).real])
    useful = (poles[0] > even[0]) & (poles[0] < even[-1])
    useful &= (poles[1] > CANDIDATE_RATIOS[0]) & (poles[1] < CANDIDATE_RATIOS[1])
    poles = poles[:, useful]
    _, kept = np.unique(np.round(np.log(poles) / np.array(SAME_POLE)[:, None]), axis=1, return_index=True)
    return np.asarray(poles[:, np.sort(kept)])


def refined(band: Band, poles: Array, weight: Array, tolerance: float = FINAL_TOLERANCE) -> Fit:
    """Fit a band by weighted least squares, starting from poles (2, mode).

    Modes stay near the band, their compliances positive. It ends where the sum of squares changes
    by less than a share ``tolerance``.

    See docs/physics.md#modes-from-measurement.
    """
    count = poles.shape[1]
    design = _design(band.frequency, poles)
    amplitudes = np.linalg.lstsq(_parts(design, weight), _parts(band.measured, weight), rcond=None)[0]
    amplitudes[:count] = np.maximum(amplitudes[:count], LEAST_COMPLIANCE)
    bounds = _bounds(band, count)
    start = np.clip(np.concatenate([np.log(poles).ravel(), amplitudes, [0.0]]), *bounds)
    # Of matrices with a dozen columns several threads take several times as long as one: they wait for one another.
    with one_thread():
        solution = scipy.optimize.least_squares(
            lambda values: _residual(band, values, weight),
            start,
            lambda values: _slopes(band, values, weight),
            bounds=bounds,
            x_scale="jac",
            xtol=FINAL_TOLERANCE,
            ftol=tolerance,
            gtol=1e-15,
            max_nfev=200,
        )
    poles, amplitudes, phase = _split(solution.x)
    return Fit(
        poles=poles,
        amplitudes=amplitudes,
        phase=phase,
        fitted=np.exp(1j * phase) * (_design(band.frequency, poles) @ amplitudes),
        weight=weight,
        squares=2.0 * float(solution.cost),
        covariance=_inverse(solution.jac),
    )


def reweighted(band: Band, fit: Fit) -> Fit:
    """Repeat a fit with weights from the fitted magnitude, which no longer depend on the errors themselves.

    See docs/physics.md#modes-from-measurement.
    """
    for _ in range(WEIGHT_ROUNDS):
        weight = band.weight(fit.fitted)
        change = np.max(np.abs(weight / fit.weight - 1.0))
        fit = refined(band, fit.poles, weight)
        if change < WEIGHT_CHANGE:
            break
    return fit


def grown(band: Band, fit: Fit, candidates: Array) -> Fit | None:
    """Add the one of several candidates (2, candidate) for a mode that explains most of the residual.

    The most promising are all refined. None where every candidate asks for a negative stiffness.

    See docs/physics.md#modes-from-measurement.
    """
    asked, gain = _gains(band, fit, candidates)
    gain = np.where(asked > 0.0, gain, 0.0)
    tried: list[int] = []
    for index in np.argsort(-gain):
        apart = [
            abs(math.log(candidates[0, index] / candidates[0, other])) > candidates[1, index] + candidates[1, other]
            for other in tried
        ]
        if gain[index] > 0.0 and all(apart):
            tried.append(int(index))
        if len(tried) == TRIED:
            break
    starts = [np.column_stack([fit.poles, candidates[:, index]]) for index in tried]
    fits = [refined(band, start, fit.weight, TRIAL_TOLERANCE) for start in starts]
    sound = [found for found in fits if np.all(found.amplitudes[: found.count] > LEAST_COMPLIANCE)]
    return min(sound, key=lambda found: found.squares, default=None)


def ladder(band: Band, most: int, *, patient: bool) -> list[Fit]:
    """Fit with 0, 1, 2 ... modes up to ``most``, each fit one mode more than the last.

    It ends early when the receptance has no more to give, and where ``patient`` when further modes
    no longer pay.

    See docs/physics.md#modes-from-measurement.
    """
    fits = [refined(band, np.empty((2, 0)), band.weight(band.measured))]
    poles = library_poles(band.frequency, band.measured)
    while len(fits) <= most:
        candidates = np.concatenate([poles, library_poles(band.frequency, band.measured - fits[-1].fitted)], axis=1)
        found = grown(band, fits[-1], candidates)
        if found is None:
            break
        fits.append(found)
        if exact(band, found) or (patient and np.argmin(criterion(band, fits)) <= found.count - PATIENCE):
            break
    return fits


def criterion(band: Band, fits: list[Fit]) -> Array:
    """Return Schwarz's information criterion of each fit (count,), infinite where a mode is not significant.

    The noise level is the data's own, and correlated lines count as fewer: both as the richest fit has them.

    See docs/physics.md#modes-from-measurement.
    """
    facts = 2.0 * fits[-1].independent_lines(band.measured)
    least = (RESOLUTION / band.floor_error) ** 2
    return np.array(
        [
            facts * math.log(max(fit.squares / (2 * len(fit.weight)), least)) + len(fit.covariance) * math.log(facts)
            if _all_significant(band, fit)
            else math.inf
            for fit in fits
        ]
    )


def exact(band: Band, fit: Fit) -> bool:
    """Return whether a fit leaves nothing to explain.

    See docs/physics.md#modes-from-measurement.
    """
    return bool(np.max(np.abs(band.measured - fit.fitted)) < RESOLUTION)


def most_foreign(band: Band, fit: Fit) -> tuple[float, float] | None:
    """Return frequency and peak, both in the band's units, of the clearest mode of negative stiffness.

    None where there is none that is significant and apart from the modes of the fit.

    See docs/physics.md#modes-from-measurement.
    """
    if exact(band, fit):
        return None
    left = band.measured - fit.fitted
    candidates = np.concatenate([library_poles(band.frequency, h) for h in (band.measured, left)], axis=1)
    asked, gain = _gains(band, fit, candidates)
    distance = np.abs(np.log(candidates[0][:, None] / fit.poles[0]))
    apart = np.all(distance > 2.0 * (candidates[1][:, None] + fit.poles[1]), axis=1)
    gain = np.where((asked < 0.0) & apart, gain, 0.0)
    if not np.any(gain > FOREIGN_SIGNIFICANCE**2 * max(1.0, fit.misfit**2)):
        return None
    clearest = int(np.argmax(gain))
    return float(candidates[0, clearest]), float(-asked[clearest] / (2.0 * candidates[1, clearest]))


def _gains(band: Band, fit: Fit, candidates: Array) -> tuple[Array, Array]:
    """Return the compliance that each candidate asks for, and by how much it lowers the sum of squares."""
    turn = np.exp(1j * fit.phase)
    known, _ = np.linalg.qr(_parts(turn * _design(band.frequency, fit.poles), fit.weight))
    added = _parts(turn * mode_shapes(band.frequency, candidates), fit.weight)
    added -= known @ (known.T @ added)
    left = _parts(band.measured, fit.weight)
    left -= known @ (known.T @ left)
    size = np.sum(added**2, axis=0)
    return added.T @ left / size, (added.T @ left) ** 2 / size


def _all_significant(band: Band, fit: Fit) -> bool:
    """Return whether every mode has a compliance beyond its errors, and poles that no bound holds."""
    poles, amplitudes = np.log(fit.poles), fit.amplitudes[: fit.count]
    least, largest = (bound[: 2 * fit.count].reshape(2, fit.count) for bound in _bounds(band, fit.count))
    free = np.all((poles > least + AT_BOUND) & (poles < largest - AT_BOUND))
    deviation = np.sqrt(np.diag(fit.covariance)[2 * fit.count : 3 * fit.count])
    return bool(free and np.all(amplitudes > SIGNIFICANCE * fit.misfit * deviation))


def _parts(values: Complex, weight: Array) -> Array:
    """Return the weighted real parts, then the imaginary ones: (2 line, ...)."""
    weighted = (values.T * weight).T
    return np.concatenate([weighted.real, weighted.imag])


def _design(frequency: Array, poles: Array) -> Complex:
    """Return the receptances of unit amplitudes (line, mode + 2): modes, static compliance, mass line."""
    outside = np.stack([np.ones_like(frequency), -1.0 / frequency**2], axis=1)
    return np.concatenate([mode_shapes(frequency, poles), outside], axis=1)


def _bounds(band: Band, count: int) -> tuple[Array, Array]:
    """Return the least and the largest values of the unknowns; only what belongs to a mode is bounded."""
    free = np.full(3, np.inf)
    least = [math.log(band.frequency[0] / BAND_MARGIN), math.log(DAMPING_RATIOS[0]), 0.0]
    largest = [math.log(band.frequency[-1] * BAND_MARGIN), math.log(DAMPING_RATIOS[1]), np.inf]
    return np.concatenate([np.repeat(least, count), -free]), np.concatenate([np.repeat(largest, count), free])


def _split(values: Array) -> tuple[Array, Array, float]:
    """Return poles, amplitudes and phase of the unknowns of the least squares."""
    count = (len(values) - 3) // 3
    return np.exp(values[: 2 * count].reshape(2, count)), values[2 * count : -1], float(values[-1])


def _residual(band: Band, values: Array, weight: Array) -> Array:
    """Return the weighted residual, and last the phase over its own expected error."""
    poles, amplitudes, phase = _split(values)
    fitted = np.exp(1j * phase) * (_design(band.frequency, poles) @ amplitudes)
    return np.append(_parts(fitted - band.measured, weight), phase / PHASE_ERROR)


def _slopes(band: Band, values: Array, weight: Array) -> Array:
    """Return the derivatives of the weighted residual (2 line + 1, parameter)."""
    poles, amplitudes, phase = _split(values)
    design = _design(band.frequency, poles)
    shapes = design[:, : poles.shape[1]]
    ratio = band.frequency[:, None] / poles[0]
    steep = shapes**2 * amplitudes[: poles.shape[1]]
    slopes = np.exp(1j * phase) * np.concatenate(
        [
            steep * (2j * poles[1] * ratio - 2.0 * ratio**2),
            -steep * 2j * poles[1] * ratio,
            design,
            1j * (design @ amplitudes)[:, None],
        ],
        axis=1,
    )
    last = np.zeros((1, len(values)))
    last[0, -1] = 1.0 / PHASE_ERROR
    return np.concatenate([_parts(slopes, weight), last])


def _inverse(slopes: Array) -> Array:
    """Return the covariance of a linear least squares; directions without information get a huge one."""
    scale = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
    information, turn = np.linalg.eigh((slopes / scale).T @ (slopes / scale))
    return np.asarray((turn / np.maximum(information, LEAST_INFORMATION)) @ turn.T / np.outer(scale, scale))
