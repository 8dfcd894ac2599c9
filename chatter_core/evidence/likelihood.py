"""How probable measurements are under a prediction: one density for each kind of datum.

Every function returns log densities of single data, so that it can be told where a model fails. What a
model cannot answer is never left out, which would reward it: such a datum counts as far off.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit, gammaln, stdtr

from chatter_core.evidence.measured import OUTCOMES

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Errors of a receptance: share of the line's own size, and of the response's largest.
LINE_ERROR, FLOOR_ERROR = 0.04, 0.02
#: Where only sizes are compared, their logarithms may be off by so much: a search by them is to be blind to detail.
SIZE_ERROR = 0.3
#: Numbers that one resonance holds: frequency, damping, and the two parts of its residue.
FACTS_OF_A_PEAK = 4.0
#: Chatter frequency: share of itself, for reading it, and the least [rad/s]; and the share by which it drifts as
#: chatter grows, for teeth that leave the cut cut less, times the margin in ln(depth).
FREQUENCY_SHARE, FREQUENCY_FLOOR, FREQUENCY_DRIFT = 0.005, 2.0 * np.pi * 3.0, 0.025
#: Degrees of freedom of its distribution; share of those that belong to another branch of multipliers. So many lines to
#: either side of the nearest count one by one, those farther off as if spread evenly.
FREQUENCY_FREEDOM, FREQUENCY_ELSEWHERE, NEIGHBOURS = 4.0, 0.1, 3
#: Places in a line spacing at which it is asked what a frequency that is heard there would say.
MOVED = 400
#: Frequencies that are moved at once: memory of 50 MB.
MOVED_AT_ONCE = 64
#: Degrees of freedom of a limit depth's: beside a lobe's peak a resonance that is slightly off is off by a factor.
LIMIT_FREEDOM = 4.0
#: Coordinate of a limit depth that is one scale off: the root of the expected information of a location.
LIMIT_UNIT = ((LIMIT_FREEDOM + 1.0) / (LIMIT_FREEDOM + 3.0)) ** 0.5
#: Standard deviations of the logarithm: natural frequency, damping ratio, stiffness of a single bearing.
NATURAL_FREQUENCY_ERROR, DAMPING_RATIO_ERROR, STIFFNESS_ERROR = 0.005, 0.2, 0.05
#: What a model cannot answer is off by so many standard deviations.
UNANSWERED = 10.0


@dataclass(frozen=True, kw_only=True)
class Contribution:
    """What one quantity says: log density of each datum (datum,), and its information coordinates (datum, coordinate).

    The Gram matrix of the coordinates' derivatives is the expected Fisher information of the data. score: (datum,
    coordinate), the derivatives of the log density by the coordinates, of which it is a function.
    """

    log_density: Array
    coordinates: Array
    score: Array


def outcome_probabilities(
    margin: Array, *, mislabelled: float, width: float, marginal_width: float | None = None
) -> Array:
    """Return the probability of every outcome (trial, category), from the quiet to the loud.

    margin: (trial,) in ln(depth). With F logistic and e the share of wrong labels, chatter has
    e + (1 - 2 e) F(margin / width) where no cut is called marginal (two categories). With
    ``marginal_width`` w an ordered logit has three: F((margin - w) / width) for chatter,
    F(margin / width) for chatter or marginal, and a wrong label is one of the other two: what is called
    marginal grows, but little in the time of a cut.
    An unknown margin makes every label as improbable as a wrong one: its row does not add up to one.

    Source: P. McCullagh, J. R. Stat. Soc. B 42 (1980) 109-142 (ordered logit).

    See docs/physics.md#likelihoods.
    """
    if marginal_width is None:
        plain = np.stack([expit(-margin / width), expit(margin / width)], axis=-1)
    else:
        # Of two tails the difference is taken where both are small: near one it would be rounding.
        half, size = 0.5 * marginal_width, -np.abs(margin - 0.5 * marginal_width)
        middle = expit((size + half) / width) - expit((size - half) / width)
        ends = [expit(-margin / width), middle, expit((margin - marginal_width) / width)]
        plain = np.stack(ends, axis=-1)
    wrong = mislabelled / (plain.shape[-1] - 1)
    mixed = wrong + (1.0 - plain.shape[-1] * wrong) * plain
    return np.asarray(np.where(np.isnan(margin)[:, None], wrong, mixed))


def outcome(outcome: NDArray[np.int8], probability: Array) -> Contribution:
    """Return what labels (trial,), positions in OUTCOMES, say; probability: (trial, category).

    See docs/physics.md#likelihoods.
    """
    category = outcome
    if probability.shape[-1] == 2:
        category = (outcome == OUTCOMES.index("chatter")).astype(np.int8)
    seen = np.take_along_axis(probability, category[:, None].astype(np.intp), axis=-1)[:, 0]
    score = np.zeros_like(probability)
    np.put_along_axis(score, category[:, None].astype(np.intp), 1.0 / np.sqrt(seen)[:, None], axis=-1)
    return Contribution(log_density=np.log(seen), coordinates=2.0 * np.sqrt(probability), score=score)


def to_lines(measured: Array, predicted: Array, spacing: Array) -> Array:
    """Return measured minus predicted chatter frequency, to the nearest line of either sign (..., sign) [rad/s].

    A motion with multiplier angle w T has lines at |w + j Omega| for every whole j, at both signs of w, and a
    measurement may show any of them as the strongest. An unknown prediction is off by half the line spacing.

    See docs/physics.md#likelihoods.
    """
    distance = [_to_nearest(measured - sign * predicted, spacing) for sign in (1, -1)]
    return np.stack([np.where(np.isnan(predicted), 0.5 * spacing, one) for one in distance], axis=-1)


def _to_nearest(distance: Array, spacing: Array) -> Array:
    """Return a distance to one of evenly spaced lines as that to the nearest."""
    return np.asarray((distance + 0.5 * spacing) % spacing - 0.5 * spacing)


def frequency_residual(measured: Array, predicted: Array, spacing: Array) -> Array:
    """Return measured minus predicted chatter frequency, to the nearest line of its motion, of one shape [rad/s].

    See docs/physics.md#likelihoods.
    """
    residual = to_lines(measured, predicted, spacing)
    nearest = np.abs(residual).argmin(axis=-1)[..., None]
    return np.asarray(np.take_along_axis(residual, nearest, axis=-1)[..., 0])


def frequency_scale(measured: Array, margin: Array) -> Array:
    """Return the scale (trial,) [rad/s] of measured chatter frequencies (trial,) at margins (trial,) in ln(depth).

    See docs/physics.md#likelihoods.
    """
    drift = FREQUENCY_DRIFT * np.nan_to_num(margin).clip(min=0.0)
    return np.asarray(np.sqrt(((FREQUENCY_SHARE**2 + drift**2) * measured**2) + FREQUENCY_FLOOR**2))


def wrapped_student(residual: Array, scale: Array, spacing: Array) -> tuple[Array, Array]:
    """Return the density of a residual to the nearest of evenly spaced lines, and its slope, all of one shape.

    Any of the lines may have been heard, so the density integrates to one over a spacing.

    See docs/physics.md#likelihoods.
    """
    freedom, lines = FREQUENCY_FREEDOM, np.arange(-NEIGHBOURS, NEIGHBOURS + 1)
    peak = np.exp(gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom)) / np.sqrt(freedom * np.pi) / scale
    standard = (residual[..., None] + spacing[..., None] * lines) / scale[..., None]
    each = peak[..., None] * (1.0 + standard**2 / freedom) ** (-0.5 * (freedom + 1.0))
    slope = -(freedom + 1.0) * each * standard / (freedom + standard**2) / scale[..., None]
    farther = 2.0 * stdtr(freedom, -(NEIGHBOURS + 0.5) * spacing / scale) / spacing
    return each.sum(axis=-1) + farther, slope.sum(axis=-1)


def heard_motion(residual: Array, share: Array, scale: Array, spacing: Array) -> tuple[Array, Array, Array]:
    """Return residual (trial,) to the line that was heard most probably, the density of all lines, and its slope by it.

    residual: (trial, motion, sign), of each motion that grows to the nearest line of either sign, as ``to_lines`` has
    it; share: (trial, motion), how much of all growth is its own: any of them may be the loudest; scale, spacing:
    (trial,) [rad/s]. Where the heard line moves that of the other sign moves as far to the other side.

    See docs/physics.md#likelihoods.
    """
    apart, width = (np.broadcast_to(one[:, None, None], residual.shape) for one in (spacing, scale))
    density, slope = wrapped_student(residual, width, apart)
    weight, trial = 0.5 * share[:, :, None], np.arange(len(residual))
    motion, sign = np.unravel_index((weight * density).reshape(len(residual), -1).argmax(axis=1), residual.shape[1:])
    own = (weight * slope)[trial, motion]
    together = (weight * density).sum(axis=(1, 2))
    return residual[trial, motion, sign], together, own[trial, sign] - own[trial, 1 - sign]


def chance_beyond(far: Array, residual: Array, share: Array, scale: Array, spacing: Array) -> Array:
    """Return how probably (trial,) a chatter frequency is farther than ``far`` [rad/s] from the line that was heard.

    residual, share, scale, spacing: as for ``heard_motion``, of any frequency: it is moved over a spacing, and what it
    would be then is weighed by the density that ``chatter_frequency`` has. Where lines lie close, few lie beyond.

    See docs/physics.md#comparison.
    """
    together = (far, residual, share, scale, spacing)
    blocks = range(0, len(far), MOVED_AT_ONCE)
    return np.concatenate([_beyond(*(one[start : start + MOVED_AT_ONCE] for one in together)) for start in blocks])


def _beyond(far: Array, residual: Array, share: Array, scale: Array, spacing: Array) -> Array:
    """Return ``chance_beyond`` of a few frequencies."""
    shift = spacing[:, None] * (np.arange(MOVED) + 0.5) / MOVED
    moved = _to_nearest(residual[:, None] + shift[:, :, None, None], spacing[:, None, None, None])
    each = [np.repeat(one, MOVED, axis=0) for one in (share, scale, spacing)]
    heard, nearby, _ = heard_motion(moved.reshape(-1, *residual.shape[1:]), *each)
    density = (1.0 - FREQUENCY_ELSEWHERE) * nearby + FREQUENCY_ELSEWHERE / each[-1]
    beyond = np.abs(heard).reshape(shift.shape) > far[:, None]
    chance = (beyond * density.reshape(shift.shape)).sum(axis=1) * spacing / MOVED
    # What lies between two places is not seen, and may be heard all the same.
    return np.asarray(np.maximum(chance, FREQUENCY_ELSEWHERE / MOVED))


def chatter_frequency(residual: Array, share: Array, scale: Array, spacing: Array) -> Contribution:
    """Return what chatter frequencies say: Student-t, for saturated chatter departs from theory.

    residual, share, scale, spacing: as for ``heard_motion``. One in ten lies anywhere between two lines of the teeth,
    and a single label of a branch must not outweigh all other data.

    See docs/physics.md#likelihoods.
    """
    freedom, elsewhere = FREQUENCY_FREEDOM, FREQUENCY_ELSEWHERE
    heard, nearby, slope = heard_motion(residual, share, scale, spacing)
    density = (1.0 - elsewhere) * nearby + elsewhere / spacing
    # Expected information of a location: (freedom + 1) / (freedom + 3) over the scale squared, for those that tell it.
    unit = np.sqrt((1.0 - elsewhere) * (freedom + 1.0) / (freedom + 3.0)) / scale
    score = (1.0 - elsewhere) * slope / density
    return Contribution(log_density=np.log(density), coordinates=(unit * heard)[:, None], score=(score / unit)[:, None])


def line_errors(value: ComplexArray, largest: float) -> Array:
    """Return the standard deviation of both parts of every line (line,) [m/N]; largest: the measuring range [m/N].

    See docs/physics.md#likelihoods.
    """
    return np.asarray(np.hypot(LINE_ERROR * np.abs(value), FLOOR_ERROR * largest))


def facts(value: ComplexArray, largest: float) -> float:
    """Return how many independent numbers a measured response (line,) holds.

    Neighbouring lines repeat each other: a resonance is four numbers, over however many lines it spreads. With
    u = H / error, the number of resonances that stand out of the errors is the width over which u is large,
    (sum |u|^2)^2 / sum |u|^4 lines, over the length along which it is like itself, ``line_weight``. Were the error the
    same on every line, either would be pi B for a single resonance of half-power bandwidth B. Never more than the
    numbers that were measured; of what does not stand out of the noise as many as of one peak; largest: the measuring
    range [m/N].

    See docs/physics.md#likelihoods.
    """
    power = np.abs(_standing_out(value, largest)) ** 2
    weight, measured = line_weight(value, largest), 2.0 * len(value)
    if np.isnan(weight):
        return min(FACTS_OF_A_PEAK, measured)
    wide = power.sum() ** 2 / (power**2).sum()
    return float(min(max(2.0 * weight * wide, FACTS_OF_A_PEAK), measured))


def line_weight(value: ComplexArray, largest: float) -> float:
    """Return how much of an independent one each line of a measured response (line,) is; NaN where none stands out.

    Along the length over which u = H / error is like itself, the sum of its autocorrelation up to its first zero, to
    both sides, lines hold FACTS_OF_A_PEAK numbers together. So what a peak weighs does not hang on how far beside it
    was measured, nor how closely; largest: the measuring range [m/N].

    See docs/physics.md#likelihoods.
    """
    signal = _standing_out(value, largest)
    if not signal.any():
        return float("nan")
    alike = np.fft.ifft(np.abs(np.fft.fft(signal, 2 * len(value))) ** 2)[: len(value)].real
    # Beyond its first zero the correlation is that of other resonances.
    ends = np.flatnonzero(alike <= 0.0)
    length = 2.0 * alike[: ends[0] if len(ends) else len(value)].sum() / alike[0] - 1.0
    return float(min(0.5 * FACTS_OF_A_PEAK / length, 1.0))


def line_weights(values: Sequence[ComplexArray], largest: Sequence[float]) -> list[float]:
    """Return the weight of each line of every response.

    One that shows nothing but noise is as wide as the widest peaks of all others, or one peak altogether.

    See docs/physics.md#likelihoods.
    """
    found = [line_weight(value, top) for value, top in zip(values, largest, strict=True)]
    least = min((weight for weight in found if not np.isnan(weight)), default=np.nan)
    one_peak = [min(0.5 * FACTS_OF_A_PEAK / len(value), 1.0) for value in values]
    silent = one_peak if np.isnan(least) else [least] * len(values)
    return [other if np.isnan(weight) else weight for weight, other in zip(found, silent, strict=True)]


def stands_out(value: ComplexArray, largest: float) -> NDArray[np.bool_]:
    """Return which lines (line,) of a response noise alone hardly makes; largest: the measuring range [m/N].

    As resonances do, and neither noise nor a hum, they stand together: one line of noise is loud in most responses,
    two side by side are in one of as many as there are lines.

    See docs/physics.md#likelihoods.
    """
    # Of so many lines of noise, each the square of two normal numbers, one is larger than this by chance.
    least = np.sqrt(2.0 * np.log(max(len(value), 2)))
    loud = np.abs(value) > least * line_errors(value, largest)
    beside = np.zeros_like(loud)
    beside[1:] |= loud[:-1]
    beside[:-1] |= loud[1:]
    return np.asarray(loud & beside)


def _standing_out(value: ComplexArray, largest: float) -> ComplexArray:
    """Return a response (line,) in standard deviations where it stands out, else 0."""
    loud = stands_out(value, largest)
    return np.divide(value, line_errors(value, largest), out=np.zeros(len(value), dtype=complex), where=loud)


def receptance(measured: ComplexArray, predicted: ComplexArray, weight: float, largest: float) -> Contribution:
    """Return what the lines (line,) of a response say, each with the weight that ``line_weight`` has.

    An unknown prediction counts as a tip that does not move; largest: the measuring range [m/N].

    See docs/physics.md#likelihoods.
    """
    error = line_errors(measured, largest)
    residual = (measured - np.where(np.isnan(predicted), 0.0, predicted)) / error
    density = -0.5 * np.abs(residual) ** 2 - np.log(2.0 * np.pi * error**2)
    parts = np.sqrt(weight) * np.stack([residual.real, residual.imag], axis=-1)
    return Contribution(log_density=weight * density, coordinates=parts, score=-parts)


def receptance_by_size(measured: ComplexArray, predicted: ComplexArray, weight: float, largest: float) -> Contribution:
    """Return what the logarithms of a response's size (line,) say, roughly, weighted like ``receptance``.

    Where a predicted resonance lies beside the measured one, its distance shows from afar, as that of the responses
    themselves does not.

    See docs/physics.md#diagnosis.
    """
    floor = FLOOR_ERROR * largest
    sizes = (np.log(np.abs(value) + floor) for value in (measured, np.where(np.isnan(predicted), 0.0, predicted)))
    residual = np.subtract(*sizes) / SIZE_ERROR
    parts = np.sqrt(weight) * residual[:, None]
    return Contribution(log_density=-0.5 * weight * residual**2, coordinates=parts, score=-parts)


def with_unanswered(residual: Array, error: Array | float, least: float = 0.0) -> Array:
    """Return residuals (datum,) with a standard deviation; one that is none is off by UNANSWERED deviations.

    That is NaN, where a model has no answer, or infinite, as a damping ratio of zero is far from any measured one.
    least: by how much such a one is off at least, what the worst of answers is.

    See docs/physics.md#likelihoods.
    """
    return np.where(np.isfinite(residual), residual, np.maximum(UNANSWERED * np.asarray(error), least))


def gaussian(residual: Array, error: Array | float) -> Contribution:
    """Return what residuals (datum,) with a standard deviation say, those without an answer as far off.

    See docs/physics.md#likelihoods.
    """
    error = np.broadcast_to(error, residual.shape)
    standard = with_unanswered(residual, error) / error
    return Contribution(
        log_density=-0.5 * standard**2 - np.log(error) - 0.5 * np.log(2.0 * np.pi),
        coordinates=standard[:, None],
        score=-standard[:, None],
    )


def limit_depth(residual: Array, error: Array, farthest: float) -> Contribution:
    """Return what limit depths say: Student-t in the logarithm, for one of many must not outweigh all other data.

    residual: (row,), ln(measured / predicted), farthest where no limit of the model's is that near; error: (row,).

    See docs/physics.md#likelihoods.
    """
    freedom, standard = LIMIT_FREEDOM, with_unanswered(residual, error, farthest) / error
    normaliser = gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom) - 0.5 * np.log(freedom * np.pi)
    score = -(freedom + 1.0) * standard / (freedom + standard**2)
    return Contribution(
        log_density=normaliser - np.log(error) - 0.5 * (freedom + 1.0) * np.log1p(standard**2 / freedom),
        coordinates=LIMIT_UNIT * standard[:, None],
        score=score[:, None] / LIMIT_UNIT,
    )


def balanced_error(outcome: NDArray[np.int8], margin: Array) -> float:
    """Return the mean of both shares of trials that are told wrongly: stable ones, and those with chatter.

    Marginal trials do not count, an unknown margin is wrong either way, and a class without trials is left out;
    NaN where there are none at all.

    See docs/physics.md#likelihoods.
    """
    shares = []
    for name, right in (("stable", margin <= 0.0), ("chatter", margin > 0.0)):
        of_class = outcome == OUTCOMES.index(name)
        if of_class.any():
            shares.append(1.0 - right[of_class].mean())
    return float(np.mean(shares)) if shares else float("nan")
