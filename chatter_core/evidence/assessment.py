"""A model held against a campaign from all sides: as described, calibrated, and on cuts held out.

The pieces are functions without side effects that do not need each other, so that they can be computed anywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from chatter_core.errors import NotConverged
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.boundary import Field
from chatter_core.evidence.calibration import calibrate
from chatter_core.evidence.comparison import Compared, Comparison
from chatter_core.evidence.cuts import where_it_chatters
from chatter_core.evidence.failures import Failure, failures
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.held_out import together
from chatter_core.evidence.intervals import End, profile_end
from chatter_core.evidence.prediction import CampaignModel, Prediction
from chatter_core.evidence.scores import COVERAGE, Score, Told, cut_scores, structure_scores, told

#: Half the interval of a normal distribution, in standard deviations.
WIDTHS = float(ndtri(0.5 * (1.0 + COVERAGE)))


#: An end of an interval, or why there is none.
Ended = End | NotConverged


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Interval of a parameter in its unit, with COVERAGE; by ``profile``, or by ``curvature`` for a reason."""

    low: float
    high: float
    method: str
    reason: str = ""


@dataclass(frozen=True, kw_only=True)
class Version:
    """A model with certain values of its parameters, held against the campaign.

    title: in words; belief: what is known of the parameters; fit: how they were found; compared: what every quantity
    says; told: of the cuts; dominant_mode: (trial,) which mode chatters, 0 where unknown; scores; failures; fields:
    of the setups that are drawn.
    """

    title: str
    belief: Belief
    fit: Fit
    compared: Compared
    told: Told
    dominant_mode: NDArray[np.int8]
    scores: dict[str, Score]
    failures: list[Failure]
    fields: Sequence[Field]


@dataclass(frozen=True, kw_only=True)
class Assessment:
    """Everything that is known of how a model and a campaign agree.

    described: as it was before the campaign; refitted: calibrated by it; held_out: what was said of cuts by
    calibrations without them, None where speeds are too few, with its scores and the number of groups;
    intervals: of every parameter, by name.
    """

    comparison: Comparison
    described: Version
    refitted: Version
    held_out: Told | None
    held_out_scores: dict[str, Score]
    held_out_groups: int
    intervals: dict[str, Limits]


def as_described(comparison: Comparison, belief: Belief) -> Fit:
    """Fit what concerns the sensors alone; the machine stays as it is believed to be.

    See docs/physics.md#comparison.
    """
    fixed = [parameter.name for parameter in comparison.parameters if parameter.touches != "measurement"]
    return calibrate(comparison, start=belief.about(comparison.model).estimate, fixed=fixed)


def interval_end(comparison: Comparison, fit: Fit, name: str, side: int) -> Ended:
    """Return an end of the profile interval of a parameter, the lower or the upper one; why where profiling fails.

    See docs/physics.md#fit.
    """
    try:
        return profile_end(comparison, fit, name, side, COVERAGE)
    except NotConverged as error:
        return error


def interval(fit: Fit, name: str, low: Ended, high: Ended) -> Limits:
    """Return the profile interval of a parameter between two ends; where one failed, that of the curvature, and why.

    See docs/physics.md#fit.
    """
    if isinstance(low, End) and isinstance(high, End):
        return Limits(low=low.value, high=high.value, method="profile")
    return curvature(fit, name, str(high if isinstance(low, End) else low))


def curvature(fit: Fit, name: str, reason: str) -> Limits:
    """Return the interval of a parameter that the fit's curvature gives, within its bounds.

    See docs/physics.md#fit.
    """
    (index,) = (i for i, parameter in enumerate(fit.parameters) if parameter.name == name)
    parameter, half = fit.parameters[index], WIDTHS * float(fit.standard_deviation[index])
    middle = float(fit.estimate[index])
    return Limits(
        low=max(middle - half, parameter.lower),
        high=min(middle + half, parameter.upper),
        method="curvature",
        reason=reason,
    )


def assess(
    comparison: Comparison,
    *,
    described: tuple[Fit, Belief, Sequence[Field]],
    refitted: tuple[Fit, Belief, Sequence[Field]],
    held_out: Sequence[Told],
    intervals: dict[str, Limits],
) -> Assessment:
    """Return everything that is known of how a model and a campaign agree, from its pieces.

    described, refitted: fit, what is known of the parameters, and fields of the model as described and
    calibrated; held_out: what was said of each group's cuts; intervals: of parameters that were profiled.

    See docs/physics.md#comparison.
    """
    fit = refitted[0]
    others = {
        parameter.name: curvature(fit, parameter.name, "not profiled: it is of the measurement and not of the machine")
        for parameter in fit.parameters
        if parameter.name not in intervals
    }
    said = together(held_out) if held_out else None
    return Assessment(
        comparison=comparison,
        described=version("Model as described", comparison, *described),
        refitted=version("Calibrated", comparison, *refitted),
        held_out=said,
        held_out_scores=cut_scores(comparison.model.campaign, said) if said is not None else {},
        held_out_groups=len(held_out),
        intervals={**intervals, **others},
    )


def version(title: str, comparison: Comparison, fit: Fit, belief: Belief, fields: Sequence[Field]) -> Version:
    """Return a model with the values of a fit, held against the campaign.

    belief: what is known of its parameters, which is more than the fit for a model as described.

    See docs/physics.md#comparison.
    """
    campaign = comparison.model.campaign
    compared = comparison.compare(fit.estimate)
    said = told(comparison, fit.estimate, compared.prediction)
    modes = dominant_modes(comparison.model, compared.prediction)
    calibrated = None if fit.fixed.any() else fit
    return Version(
        title=title,
        belief=belief,
        fit=fit,
        compared=compared,
        told=said,
        dominant_mode=modes,
        scores={**cut_scores(campaign, said), **structure_scores(campaign, compared)},
        failures=failures(comparison.model, compared, modes.astype(float), calibrated),
        fields=fields,
    )


def dominant_modes(model: CampaignModel, prediction: Prediction) -> NDArray[np.int8]:
    """Return which mode chatters in each trial (trial,), as the model has it; 0 where unknown.

    See docs/physics.md#comparison.
    """
    if prediction.cuts is None:
        return np.zeros(0, dtype=np.int8)
    offset = where_it_chatters(prediction.cuts.margin, prediction.cuts.crossing)
    return model.stability(prediction, offset).dominant_mode[: prediction.trials]
