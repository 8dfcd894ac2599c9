"""What a model says of cuts that nobody has judged yet."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from chatter_core.evidence.belief import Belief
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.measured import Trials
from chatter_core.evidence.newton import LARGEST_DIFFERENCE
from chatter_core.evidence.nuisances import TYPICAL_OUTCOME_WIDTH
from chatter_core.evidence.parameters import Array, column
from chatter_core.evidence.prediction import CampaignModel, Prediction
from chatter_core.variables import STATUS

#: Differences are taken over this share of a parameter's standard deviation, within what can be followed.
STEP = 0.3


@dataclass(frozen=True, kw_only=True)
class PlannedCuts:
    """Prediction of cuts, all (trial,).

    spectral_radius [-]; margin, and margin_deviation, its standard deviation as the uncertainty of parameters and
    model has it, in ln(depth); probability_chatter; chatter_frequency [rad/s], NaN where the model is stable; status:
    values of variables.STATUS. Where that is not ok, numbers are NaN.
    """

    spectral_radius: Array
    margin: Array
    margin_deviation: Array
    probability_chatter: Array
    chatter_frequency: Array
    status: NDArray[np.uint8]


def planned_campaign(campaign: Campaign, trials: Trials | None) -> Campaign:
    """Return a campaign with the same machine in which nothing is measured, but trials are planned.

    See docs/physics.md#comparison.
    """
    return replace(
        campaign, trials=trials, receptances=(), natural_frequencies=None, stiffness=None, limits=None, remarks=()
    )


def predict_planned(model: CampaignModel, belief: Belief, model_error: float = 0.0) -> PlannedCuts:
    """Predict the trials of a campaign, whatever their labels say.

    model_error: standard deviation [ln(depth)] by which boundaries are off beyond what is not known of the parameters.

    The probability of chatter is F(eta / s), F logistic, averaged over a normal distribution of eta:
    F(eta / sqrt(s^2 + pi sigma^2 / 8)), sigma being its deviation. A wrong label is not counted as possible.

    Source of the average: D. J. C. MacKay, Neural Comput. 4 (1992) 720-736.

    See docs/physics.md#comparison.
    """
    known = belief.about(model)
    prediction = model.predict(known.estimate, quantities=("outcome",))
    at_cut = model.stability(prediction, np.zeros(len(prediction.margin)))
    ok = (at_cut.status == STATUS["ok"]) & np.isfinite(prediction.margin)
    deviation = np.hypot(_margin_deviation(model, known, prediction), model_error)
    width = TYPICAL_OUTCOME_WIDTH * np.exp(model.named(known.estimate)["outcome_width"])
    probability = expit(prediction.margin / np.sqrt(width**2 + np.pi * deviation**2 / 8.0))
    chatters = ok & (prediction.margin > 0.0)
    failed = np.where(at_cut.status == STATUS["ok"], STATUS["not_converged"], at_cut.status)
    return PlannedCuts(
        spectral_radius=np.where(ok, at_cut.spectral_radius, np.nan),
        margin=np.where(ok, prediction.margin, np.nan),
        margin_deviation=np.where(ok, deviation, np.nan),
        probability_chatter=np.where(ok, probability, np.nan),
        chatter_frequency=np.where(chatters, at_cut.chatter_frequency, np.nan),
        status=np.where(ok, STATUS["ok"], failed).astype(np.uint8),
    )


def _margin_deviation(model: CampaignModel, known: Belief, near: Prediction) -> Array:
    """Return the standard deviation of margins (trial,), to first order in the parameters."""
    width = column(model.parameters, "prior_width")
    slopes = []
    for index, parameter in enumerate(model.parameters):
        aside = known.estimate.copy()
        if parameter.touches != "measurement" and known.deviation[index] > 0.0:
            step = min(STEP * known.deviation[index], LARGEST_DIFFERENCE * width[index])
            aside[index] += step if aside[index] + step <= parameter.upper else -step
        # A deviation that is lost in rounding is none.
        change = aside[index] - known.estimate[index]
        moved = model.predict(aside, near, quantities=("outcome",)).margin if change else near.margin
        slopes.append((moved - near.margin) / (change or 1.0) * known.deviation[index])
    slope = np.stack(slopes)
    variance = np.einsum("it,ij,jt->t", slope, known.correlation, slope)
    return np.asarray(np.sqrt(np.maximum(variance, 0.0)))
