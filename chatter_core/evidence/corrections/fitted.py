"""Corrections fitted to a campaign beside everything else, and what they say: a curve, its band, and a sentence."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.assessment import WIDTHS, dominant_modes
from chatter_core.evidence.calibration import START_GAIN
from chatter_core.evidence.candidates import Hypothesis, carried
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.corrections.terms import TRIAL, Correction
from chatter_core.evidence.corrections.trial_order import OrderedModel
from chatter_core.evidence.failures import Failure, but_for_effects, failures
from chatter_core.evidence.fit import Fit, free_parameters, height, maximise, result
from chatter_core.evidence.newton import Climb, Maximum
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.evidence.pursuit import LEFT_GAIN
from chatter_core.evidence.verdict import failed_checks
from chatter_core.units import si_factor

#: Places at which a curve is told.
PLACES = 60
#: Log evidence over that of the base model [nats] by which measurements want a correction, and below which a quadratic
#: of the posterior at the start is believed: it would have to be off by twice what it takes to be wanted.
WANTED, HOPELESS = 5.0, -5.0


@dataclass(frozen=True, kw_only=True)
class Corrected:
    """A model with a correction, fitted. log_evidence of it [nats]; left: the checks that still fail.

    climbed: whether the fit was looked for, and not only promised to be hopeless; its curve is zero otherwise.
    """

    correction: Correction
    comparison: Comparison
    fit: Fit
    climbed: bool
    log_evidence: float
    left: tuple[Failure, ...]


@dataclass(frozen=True, kw_only=True)
class Told:
    """What a correction says.

    gain: its log evidence over that of the base model [nats]; places (place,) in the unit of the axis' name; factor of
    the quantity, as ``total_slope`` has it, low and high with COVERAGE, (place,) each, NaN where it was not climbed;
    level: the factor that the base model's calibration gives the quantity as a whole; text: a sentence.
    """

    corrected: Corrected
    gain: float
    places: Array
    factor: Array
    low: Array
    high: Array
    level: float
    text: str

    @property
    def wanted(self) -> bool:
        """Whether the measurements want it."""
        return self.gain >= WANTED

    @property
    def mends(self) -> bool:
        """Whether it is wanted and no check fails with it."""
        return self.wanted and not self.corrected.left


def corrected_model(model: CampaignModel, correction: Correction) -> CampaignModel:
    """Return a model with a correction that acts after all its terms.

    See docs/physics.md#corrections.
    """
    terms = (*model.terms, correction)
    if correction.axis != TRIAL:
        return replace(model, terms=terms)
    settings = {field.name: getattr(model, field.name) for field in fields(CampaignModel)}
    return OrderedModel(**settings | {"terms": terms})


def fit_correction(base: Hypothesis, correction: Correction) -> Corrected:
    """Fit a correction together with everything that the base model has, from where its own fit ended.

    Where the slope there promises so little that the evidence is HOPELESS, the fit stays at a curve of zero.

    See docs/physics.md#corrections.
    """
    comparison = replace(base.comparison, model=corrected_model(base.comparison.model, correction))
    own = carried(comparison, base.fit)
    free = free_parameters(comparison, (), own)
    stayed = maximise(comparison, [own], free, 1, np.inf)
    fit = result(comparison, stayed, 0, -np.inf)
    evidence = fit.log_evidence + _promise(stayed, fit)
    climbed = evidence > base.fit.log_evidence + HOPELESS
    if climbed:
        fit = _climbed(comparison, own, free)
        evidence = fit.log_evidence
    else:
        fit = replace(fit, converged=False, reason="not climbed: what its slope promises is hopeless")
    left = tuple(checks_failed(comparison, fit, correction))
    return Corrected(
        correction=correction, comparison=comparison, fit=fit, climbed=climbed, log_evidence=evidence, left=left
    )


def _promise(stayed: Maximum, fit: Fit) -> float:
    """Return what a step from where a fit stayed promises [nats], bounds staying where they hold."""
    moving = np.flatnonzero(stayed.free & ~fit.at_bound)
    gradient, information = stayed.gradient[moving], stayed.information[np.ix_(moving, moving)]
    return float(0.5 * gradient @ np.linalg.solve(information, gradient))


def _climbed(comparison: Comparison, own: Array, free: NDArray[np.bool_]) -> Fit:
    """Return the fit from a start (parameter,): by what is smooth, then by everything."""
    first = Climb(comparison.smooth or comparison, free).approach(own, START_GAIN)
    found = maximise(comparison, [own, first.values], free, 1, LEFT_GAIN, leaps=False)
    return result(comparison, found, first.evaluations, height(comparison, own))


def checks_failed(comparison: Comparison, fit: Fit, correction: Correction | None = None) -> list[Failure]:
    """Return the checks that fail with a fit.

    How large an effect has to be is none, nor is any coordinate of a correction's own curve.

    See docs/physics.md#corrections.
    """
    compared = comparison.compare(fit.estimate)
    modes = dominant_modes(comparison.model, compared.prediction).astype(float)
    curve = [parameter.name for parameter in correction.parameters] if correction is not None else []
    found = failures(comparison.model, compared, modes, fit, curve)
    return failed_checks(but_for_effects(found, comparison.model, fit))


def told(base: Fit, failed: int, corrected: Corrected) -> Told:
    """Return what a fitted correction says. base: the fit without it; failed: how many checks fail with that.

    See docs/physics.md#corrections.
    """
    correction = corrected.correction
    x = np.linspace(correction.curve.knots[0], correction.curve.knots[-1], PLACES)
    slope = total_slope(corrected, x)
    gain = corrected.log_evidence - base.log_evidence
    factor, low, high = _band(corrected.fit, slope) if corrected.climbed else np.full((3, PLACES), np.nan)
    unit = si_factor(correction.axis.name)
    words = [_place(correction, value / unit) for value in x]
    levels = dict(zip((p.name for p in base.parameters), np.exp(base.estimate), strict=True))
    found = Told(
        corrected=corrected,
        gain=gain,
        places=x / unit,
        factor=factor,
        low=low,
        high=high,
        level=float(levels.get(correction.quantity.held_by, 1.0)),
        text="",
    )
    return replace(found, text=_sentence(found, slope, words, failed))


def mending(found: Sequence[Told]) -> str:
    """Return in a sentence or two whether corrections, the most probable first, mend what is left.

    See docs/physics.md#corrections.
    """
    if not found:
        return "Nothing was measured over a range that a correction could be told from."
    mends = [one for one in found if one.mends]
    if mends:
        return mends[0].text
    wanted = [one for one in found if one.wanted]
    if wanted:
        return f"No correction of these mends it by itself. What helps most: {wanted[0].text}"
    best = f"{found[0].corrected.correction}, gains {found[0].gain:+.1f} nats"
    return f"No correction of these mends it: the best of {len(found)}, {best}."


def total_slope(corrected: Corrected, x: Array) -> Array:
    """Return the derivatives of ln(factor) at places (place,) by all parameters of the fit (place, parameter).

    Where a nuisance multiplies the quantity as a whole the factor is that of the quantity as it was described: the
    nuisance's is in it, for the data tell their product.

    See docs/physics.md#corrections.
    """
    correction, names = corrected.correction, [p.name for p in corrected.fit.parameters]
    slope = np.zeros((len(x), len(names)))
    slope[:, [names.index(p.name) for p in correction.parameters]] = correction.curve.slope(x)
    if correction.quantity.held_by in names:
        slope[:, names.index(correction.quantity.held_by)] = 1.0
    return slope


def _band(fit: Fit, slope: Array) -> tuple[Array, Array, Array]:
    """Return a factor, low and high (place,) for derivatives of its logarithm (place, parameter)."""
    deviation = fit.standard_deviation
    covariance = fit.correlation * deviation[:, None] * deviation
    half = WIDTHS * np.sqrt(np.einsum("pi,ij,pj->p", slope, covariance, slope))
    middle = slope @ fit.estimate
    return np.exp(middle), np.exp(middle - half), np.exp(middle + half)


def _place(correction: Correction, value: float) -> str:
    """Return a place of an axis in words."""
    if correction.axis == TRIAL:
        return f"trial {value:.0f}"
    if correction.axis.name.endswith("_rpm"):
        return f"{value:.0f} rpm"
    if correction.axis.name.endswith("_mm"):
        return f"{value:.3g} mm"
    return f"{value:.3g}"


def _sentence(found: Told, slope: Array, words: list[str], failed: int) -> str:
    """Return what a correction says in a sentence or two."""
    correction, left = found.corrected.correction, len(found.corrected.left)
    if not found.wanted:
        return (
            f"The measurements do not ask for another {correction.quantity.words} against {correction.axis.words} "
            f"({found.gain:+.1f} nats)."
        )

    def at(place: int) -> str:
        return f"{found.factor[place]:.2f} ({found.low[place]:.2f} to {found.high[place]:.2f}) at {words[place]}"

    last = len(words) - 1
    ratio, low, high = (float(one[0]) for one in _band(found.corrected.fit, slope[[last]] - slope[[0]]))
    how = "rise" if low > 1.0 else "fall" if high < 1.0 else "change"
    turns = [place for place in (int(found.factor.argmin()), int(found.factor.argmax())) if _turns(found, place)]
    by_way = "".join(f", by way of {at(place)}," for place in sorted(turns))
    return (
        f"The measurements want the {correction.quantity.words} to {how} with {correction.axis.words}: from a factor "
        f"{at(0)}{by_way} to {at(last)}, the last {ratio:.2f} times the first ({low:.2f} to {high:.2f}); "
        f"{found.gain:.0f} nats. {_checks(failed)} without it, {left or 'none'} with it."
    )


def _checks(count: int) -> str:
    return "No check fails" if not count else "1 check fails" if count == 1 else f"{count} checks fail"


def _turns(found: Told, place: int) -> bool:
    """Return whether the curve turns at a place: it lies outside the bands of both ends."""
    inside = 0 < place < len(found.factor) - 1
    ends = ((found.low[0], found.high[0]), (found.low[-1], found.high[-1]))
    return inside and all(not low <= found.factor[place] <= high for low, high in ends)
