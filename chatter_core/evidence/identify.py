"""Modes at the tool tip from one measured receptance, with their uncertainties.

What the receptance is taken for is checked here; the least squares are in ``modal_fit``.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

from chatter_core.errors import InvalidInput
from chatter_core.evidence.modal_fit import (
    Band,
    Fit,
    criterion,
    grown,
    ladder,
    mode_shapes,
    most_foreign,
    refined,
    reweighted,
)
from chatter_core.units import si_factor

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Standard deviation of a line's complex error: this share of its own magnitude, and of the largest in the band.
RELATIVE_ERROR, FLOOR_ERROR = 0.04, 0.02
#: Fewer lines say nothing of a resonance; more are a wider band than one fit is meant for.
FEWEST_LINES, MOST_LINES = 20, 20_000
#: Modes looked for in one receptance at most, and lines needed for each mode that is asked for.
MOST_MODES, LINES_PER_MODE = 12, 5
#: A mode that a receptance shows badly is looked for within this factor of its frequency at the nearest speed.
SEARCH = 1.4
#: Mean sine of the phase at the strongest lines from which the tip would move ahead of the force.
AHEAD = 0.2
#: Peak of negative stiffness, as a share of the highest, from which a receptance is no direct one.
FOREIGN_PEAK = 0.1


@dataclass(frozen=True, kw_only=True)
class IdentifiedModes:
    """Modes of one direct receptance, ascending, and what modes outside the band leave in it.

    natural_frequency [rad/s], damping_ratio [-], modal_stiffness [N/m] felt at the tip: (mode,);
    compliance_above [m/N] and inverse_mass_below [1/kg]: static compliance of the modes above the
    band and mass line of those below; phase [rad]: error of the measuring chain.

    deviation: (parameter,) standard deviations in the units above; correlation: (parameter,
    parameter). Both count natural frequencies, damping ratios, stiffnesses, compliance_above,
    inverse_mass_below, phase.

    frequency [rad/s], measured and fitted [m/N]: (line,); relative_error, floor_error: expected of
    a line; misfit: root mean square of the residual over its expected error; independent_lines:
    lines over the correlation length of the residual; criterion: (count,) information criterion
    with 0, 1, 2 ... modes, infinite where a mode would not be significant, empty where the number
    of modes was given.
    """

    natural_frequency: Array
    damping_ratio: Array
    modal_stiffness: Array
    compliance_above: float
    inverse_mass_below: float
    phase: float
    deviation: Array
    correlation: Array
    frequency: Array
    measured: Complex
    fitted: Complex
    relative_error: float
    floor_error: float
    misfit: float
    independent_lines: float
    criterion: Array

    def __len__(self) -> int:
        return len(self.natural_frequency)

    @property
    def frequency_deviation(self) -> Array:
        """Standard deviations of the natural frequencies (mode,) [rad/s]."""
        return self.deviation[: len(self)]

    @property
    def damping_deviation(self) -> Array:
        """Standard deviations of the damping ratios (mode,) [-]."""
        return self.deviation[len(self) : 2 * len(self)]

    @property
    def stiffness_deviation(self) -> Array:
        """Standard deviations of the modal stiffnesses (mode,) [N/m]."""
        return self.deviation[2 * len(self) : 3 * len(self)]

    @property
    def poles(self) -> Array:
        """Natural frequencies [rad/s], then damping ratios (2, mode)."""
        return np.stack([self.natural_frequency, self.damping_ratio])

    @property
    def contributions(self) -> Complex:
        """Receptance of every mode, turned by the chain's phase as the measurement is (line, mode) [m/N]."""
        return np.asarray(np.exp(1j * self.phase) * mode_shapes(self.frequency, self.poles) / self.modal_stiffness)

    @property
    def outside(self) -> Complex:
        """Receptance that modes outside the band leave in it, turned likewise (line,) [m/N]."""
        left = self.compliance_above - self.inverse_mass_below / self.frequency**2
        return np.asarray(np.exp(1j * self.phase) * left)

    @property
    def expected_error(self) -> Array:
        """Expected standard deviation of each line's complex error (line,) [m/N]."""
        magnitude = np.abs(self.fitted)
        return np.asarray(np.hypot(self.relative_error * magnitude, self.floor_error * magnitude.max()))

    def statement(self) -> str:
        """Return one sentence on how well the modes explain the receptance."""
        correlated = len(self.frequency) / self.independent_lines
        # The root mean square of so many independent values is one within three of its deviations.
        unexplained = self.misfit > 1.0 + 3.0 / math.sqrt(4.0 * self.independent_lines)
        return (
            f"residual {self.misfit:.2g} times the expected error, "
            + (f"alike over {correlated:.1f} lines" if correlated > 1.0 else "independent from line to line")
            + (": more than errors explain, deviations are enlarged by it" if unexplained else "")
            + f"; phase error {math.degrees(self.phase):.1f} deg"
        )


def identify_modes(
    frequency: Array,
    receptance: Complex,
    *,
    mode_count: int | None = None,
    relative_error: float = RELATIVE_ERROR,
    floor_error: float = FLOOR_ERROR,
) -> IdentifiedModes:
    """Identify the modes in a direct receptance of one axis at the tool tip.

    frequency: (line,) [rad/s], ascending; receptance: (line,) displacement over force for the time
    law exp(+i w t) [m/N], at one point in one direction, so that every modal stiffness is positive.
    ``mode_count`` fits so many modes; without it an information criterion chooses among the fits
    whose modes are all significant. A line errs by ``relative_error`` of its own magnitude and by
    ``floor_error`` of the largest, together the standard deviation of its complex value.

    Deviations hold for errors of that size, independent from line to line; where the residual is
    larger or correlated they grow with it. An error of gain, which no receptance shows by itself,
    is not among them.

    Raises InvalidInput for lines that are too few, not ascending or not finite; for more modes than
    the receptance can tell apart; when no resonance lies in the band; and when the data contradict a
    direct receptance.

    See docs/physics.md#modes-from-measurement.
    """
    _check_lines(frequency, receptance, mode_count)
    band = _scaled(frequency, receptance, relative_error, floor_error)
    _check_sense(band)
    fits = ladder(band, mode_count or MOST_MODES, patient=mode_count is None)
    _check_stiffness(band, fits[-1])
    if mode_count is not None:
        if fits[-1].count < mode_count:
            raise InvalidInput(
                [f"mode_count: found {mode_count}, but this receptance tells only {fits[-1].count} modes apart"]
            )
        return _identified(band, reweighted(band, fits[-1]), np.empty(0))
    values = criterion(band, fits)
    best = fits[int(np.argmin(values))]
    if best.count == 0:
        ends = [_hertz(band, band.frequency[end]) for end in (0, -1)]
        raise InvalidInput(
            [
                f"receptance: no resonance from {ends[0]} to {ends[1]} stands out of its errors; "
                "take a band that holds one, or name the number of modes"
            ]
        )
    return _identified(band, reweighted(band, best), values)


def continue_modes(found: IdentifiedModes, neighbour: IdentifiedModes) -> IdentifiedModes:
    """Add to the modes of a receptance those that only a neighbour, at another speed, shows clearly.

    Modes are paired by frequency. Where a neighbour's mode is left alone the missing one is looked
    for and refined by this receptance; its deviations tell how well, or badly, it is known here.

    Raises InvalidInput when the receptance contains no trace of one of them.

    See docs/physics.md#modes-from-measurement.
    """
    band = _scaled(found.frequency, found.measured, found.relative_error, found.floor_error)
    fit = refined(band, _in_band(band, found.poles), band.weight(band.measured))
    distance = np.abs(np.log(found.natural_frequency[:, None] / neighbour.natural_frequency))
    paired = scipy.optimize.linear_sum_assignment(distance)[1]
    for index in np.setdiff1d(np.arange(len(neighbour)), paired):
        expected = neighbour.natural_frequency[index]
        larger = grown(band, fit, _in_band(band, _around(expected, neighbour.damping_ratio[index])))
        if larger is None:
            raise InvalidInput(
                [
                    "receptance: no trace of the mode that a neighbouring speed has at "
                    f"{expected / si_factor('frequency_hz'):.0f} Hz; name the number of modes, or leave out a speed"
                ]
            )
        fit = larger
    return _identified(band, reweighted(band, fit), found.criterion)


def _identified(band: Band, fit: Fit, values: Array) -> IdentifiedModes:
    """Return a fit in SI, modes ascending, with deviations enlarged by misfit and correlation."""
    count = fit.count
    order = np.argsort(fit.poles[0])
    rank = np.concatenate([order, count + order, 2 * count + order, 3 * count + np.arange(3)])
    stiffness = 1.0 / (fit.amplitudes[order] * band.largest)
    mass_line = band.largest * band.centre**2
    # From ln w_k, ln zeta_k, c_k, c_above, 1/m_below, phi to the values themselves: d k = -k d c / c.
    scale = np.concatenate(
        [
            fit.poles[0, order] * band.centre,
            fit.poles[1, order],
            -stiffness / fit.amplitudes[order],
            [band.largest, mass_line, 1.0],
        ]
    )
    lines = fit.independent_lines(band.measured)
    enlarged = max(1.0, fit.misfit**2) * len(band.frequency) / lines
    covariance = fit.covariance[np.ix_(rank, rank)] * np.outer(scale, scale) * enlarged
    deviation = np.sqrt(np.diag(covariance))
    return IdentifiedModes(
        natural_frequency=scale[:count],
        damping_ratio=scale[count : 2 * count],
        modal_stiffness=stiffness,
        compliance_above=float(fit.amplitudes[count] * band.largest),
        inverse_mass_below=float(fit.amplitudes[count + 1] * mass_line),
        phase=fit.phase,
        deviation=deviation,
        correlation=covariance / np.outer(deviation, deviation),
        frequency=band.frequency * band.centre,
        measured=band.measured * band.largest,
        fitted=fit.fitted * band.largest,
        relative_error=band.relative_error,
        floor_error=band.floor_error,
        misfit=fit.misfit,
        independent_lines=lines,
        criterion=values,
    )


def _scaled(frequency: Array, receptance: Complex, relative_error: float, floor_error: float) -> Band:
    centre, largest = math.sqrt(float(frequency[0] * frequency[-1])), float(np.max(np.abs(receptance)))
    return Band(
        frequency=frequency / centre,
        measured=receptance / largest,
        centre=centre,
        largest=largest,
        relative_error=relative_error,
        floor_error=floor_error,
    )


def _around(natural_frequency: float, damping_ratio: float) -> Array:
    """Return poles (2, candidate) of one damping ratio, half a bandwidth apart, around a frequency."""
    steps = math.ceil(math.log(SEARCH) / damping_ratio)
    factors = np.exp(np.linspace(-1.0, 1.0, 2 * steps + 1) * math.log(SEARCH))
    return np.stack([natural_frequency * factors, np.full(len(factors), damping_ratio)])


def _in_band(band: Band, poles: Array) -> Array:
    return np.asarray(poles / np.array([[band.centre], [1.0]]))


def _hertz(band: Band, frequency: float) -> str:
    return f"{frequency * band.centre / si_factor('frequency_hz'):.4g} Hz"


def _check_lines(frequency: Array, receptance: Complex, mode_count: int | None) -> None:
    """Raise InvalidInput for lines that no fit can start from."""
    lines = len(frequency)
    if frequency.shape != (lines,) or receptance.shape != (lines,):
        raise InvalidInput([f"receptance: found {np.shape(receptance)} values at {np.shape(frequency)} frequencies"])
    problems = []
    if not FEWEST_LINES <= lines <= MOST_LINES:
        problems.append(f"frequency: found {lines} lines, allowed: {FEWEST_LINES} to {MOST_LINES}")
    if not (np.all(np.isfinite(frequency)) and np.all(np.isfinite(receptance))):
        problems.append("receptance: found values that are not finite; leave those lines out")
    elif lines and (frequency[0] <= 0.0 or np.any(np.diff(frequency) <= 0.0)):
        problems.append("frequency: found lines at or below 0 Hz, or not ascending; allowed: positive, each once")
    elif lines and not np.any(receptance):
        problems.append("receptance: found nothing but zeros")
    if mode_count is not None and not 1 <= mode_count <= min(MOST_MODES, lines // LINES_PER_MODE):
        most = min(MOST_MODES, lines // LINES_PER_MODE)
        problems.append(f"mode_count: found {mode_count}, allowed: 1 to {most} for {lines} lines")
    if problems:
        raise InvalidInput(problems)


def _check_sense(band: Band) -> None:
    """Raise InvalidInput where the tip would move ahead of the force at its strongest resonances."""
    strong = band.measured[np.abs(band.measured) > 0.5]
    if np.sum(strong.imag) > AHEAD * np.sum(np.abs(strong)):
        peak = band.frequency[np.argmax(np.abs(band.measured))]
        raise InvalidInput(
            [
                f"receptance: its imaginary part is positive at its peak, {_hertz(band, peak)}; that of a direct "
                "receptance for exp(+i w t) is negative: is the sign of force or sensor turned, the time law "
                "exp(-i w t), or is it an acceleration over force?"
            ]
        )


def _check_stiffness(band: Band, fit: Fit) -> None:
    """Raise InvalidInput where a mode of negative stiffness stands out of the residual."""
    foreign = most_foreign(band, fit)
    if foreign is not None and foreign[1] > FOREIGN_PEAK:
        raise InvalidInput(
            [
                f"receptance: a mode near {_hertz(band, foreign[0])} has a negative stiffness, its peak "
                f"{100.0 * foreign[1]:.0f} % of the highest; force and displacement at one point in one direction have "
                "none: is it a receptance between two points or two axes?"
            ]
        )
