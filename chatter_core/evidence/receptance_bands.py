"""Where measured and predicted receptances differ: around each mode of the model."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy

from chatter_core.evidence import likelihood
from chatter_core.evidence.bands import CHANCE
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.measured import Receptance, measuring_ranges
from chatter_core.evidence.prediction import Prediction
from chatter_core.stages import ComplexArray, Indices
from chatter_core.units import si_factor


@dataclass(frozen=True, kw_only=True)
class Misfit:
    """A band of a response that differs by more than noise.

    response in words; mode: whose natural frequency lies in the band, 0 along an axis without modes; low, high [Hz];
    apart: norm of the difference over that of the measured band, and expected: what noise explains; chance: that a
    right model is as far off in any band of the campaign; text.
    """

    response: str
    mode: int
    low: float
    high: float
    apart: float
    expected: float
    chance: float
    text: str


def misfits(campaign: Campaign, prediction: Prediction) -> list[Misfit]:
    """Return the bands of all responses in which measured and predicted differ by more than noise.

    A band around a mode reaches halfway to its neighbours, and is judged where measured or predicted stands out of the
    noise, for a peak may stand where the model has none, and silence beside it says nothing. Lines weigh as they do in
    a fit. Along an axis for which the model has no modes all lines are one band. A response without an answer has none.

    See docs/physics.md#comparison.
    """
    responses, ranges = campaign.receptances, measuring_ranges(campaign.receptances)
    weights = likelihood.line_weights([one.value for one in responses], ranges)
    bands = [
        (measured, predicted, largest, weight, mode, lines)
        for measured, predicted, lost, largest, weight in zip(
            responses, prediction.receptances, prediction.lost, ranges, weights, strict=True
        )
        if not lost
        for mode, lines in _loud_bands(measured, predicted, largest, prediction)
    ]
    found = []
    for measured, predicted, largest, weight, mode, lines in bands:
        error = likelihood.line_errors(measured.value, largest)[lines]
        apart = measured.value[lines] - np.nan_to_num(predicted[lines])
        # Both parts of a line have that error each.
        numbers, square = 2.0 * weight * len(lines), weight * float((np.abs(apart / error) ** 2).sum())
        chance = min(1.0, len(bands) * float(scipy.stats.chi2.sf(square, numbers)))
        if chance < CHANCE:
            norm = np.linalg.norm(measured.value[lines])
            share = float(np.linalg.norm(apart) / norm), float(np.linalg.norm(error) * np.sqrt(2.0) / norm)
            found.append(_misfit(measured, predicted, mode, lines, share, chance))
    return found


def _loud_bands(
    measured: Receptance, predicted: ComplexArray, largest: float, prediction: Prediction
) -> Iterator[tuple[int, Indices]]:
    """Yield mode and lines of each band of a response, those that stand out of the noise."""
    loud = likelihood.stands_out(measured.value, largest) | likelihood.stands_out(np.nan_to_num(predicted), largest)
    for mode, lines in _bands(measured, prediction):
        if loud[lines].any():
            yield mode, lines[loud[lines]]


def _bands(measured: Receptance, prediction: Prediction) -> Iterator[tuple[int, Indices]]:
    """Yield mode and lines of each band of a response; where the axis has no modes all lines, of mode 0."""
    built = prediction.response
    assert built is not None
    speed = int(np.searchsorted(built.spindle_speed, measured.spindle_speed))
    of_axis = np.flatnonzero(built.modes.axis == measured.output_axis)
    if not len(of_axis):
        yield 0, np.arange(len(measured.frequency))
        return
    natural = np.sort(built.modes.natural_frequency[speed, of_axis])
    borders = np.concatenate([[0.0], np.sqrt(natural[1:] * natural[:-1]), [np.inf]])
    for mode in range(1, len(natural) + 1):
        lines = np.flatnonzero((measured.frequency >= borders[mode - 1]) & (measured.frequency < borders[mode]))
        if len(lines) > 1:
            yield mode, lines


def _misfit(
    measured: Receptance, predicted: ComplexArray, mode: int, lines: Indices, share: tuple[float, float], chance: float
) -> Misfit:
    hertz = measured.frequency[lines] / si_factor("frequency_hz")
    peaks = [
        f"{hertz[size.argmax()]:.0f} Hz and {size.max() / si_factor('x_um'):.3g} um/N"
        for size in (np.abs(measured.value[lines]), np.abs(predicted[lines]))
    ]
    of_mode = f" (mode {mode})" if mode else ""
    expected = f"predicted at {peaks[1]}" if mode else "and the model has no modes along this axis"
    text = (
        f"Receptance {measured}, {hertz[0]:.0f} to {hertz[-1]:.0f} Hz{of_mode}: measured and predicted differ by "
        f"{100 * share[0]:.0f} %, noise explains {100 * share[1]:.0f} %; measured peak at {peaks[0]}, {expected}."
    )
    return Misfit(
        response=str(measured),
        mode=mode,
        low=float(hertz[0]),
        high=float(hertz[-1]),
        apart=share[0],
        expected=share[1],
        chance=chance,
        text=text,
    )
