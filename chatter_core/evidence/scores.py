"""How far a model is from what was measured, in one number for each quantity, with its interval.

Intervals hold for independent data: cuts at one speed are not quite, and theirs are somewhat too narrow.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.comparison import Compared, Comparison
from chatter_core.evidence.likelihood import (
    DAMPING_RATIO_ERROR,
    LIMIT_FREEDOM,
    NATURAL_FREQUENCY_ERROR,
    STIFFNESS_ERROR,
    balanced_error,
    facts,
    frequency_residual,
    outcome,
    with_unanswered,
)
from chatter_core.evidence.margin import LIMIT_REACH, REACH, out_of_reach
from chatter_core.evidence.measured import OUTCOMES, Receptance, Trials, measuring_ranges
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import Prediction
from chatter_core.stages import ComplexArray

#: Coverage of the intervals.
COVERAGE = 0.9
#: Drawn means from which an interval of a mean is read: its ends are known to a hundredth of its width.
DRAWS, SEED = 2000, 1
#: Quantity -> unit and meaning of its error.
ERRORS = {
    "outcome": ("1", "share of cuts told wrongly, mean of stable cuts and of those with chatter"),
    "log_loss": ("nat", "mean of -ln(probability) of the labels"),
    "depth_margin": ("ln", "mean distance in ln(depth) of cuts from the side of the boundary that they belong to"),
    "chatter_frequency": ("Hz", "median distance to the nearest line of the critical motion"),
    "limit_depth": ("ln", "root mean square of ln(measured / predicted limit depth)"),
    "receptance": ("1", "norm of measured minus predicted over norm of measured, root mean square of the responses"),
    "natural_frequency": ("ln", "root mean square of ln(measured / predicted)"),
    "damping_ratio": ("ln", "root mean square of ln(measured / predicted)"),
    "bearing_stiffness": ("ln", "root mean square of ln(measured / predicted)"),
}


@dataclass(frozen=True, kw_only=True)
class Score:
    """Error of one quantity; low and high enclose it with COVERAGE, NaN where data are too few; count: of data.

    unanswered: how many of them the model has no answer for, which count as wrong; at_least: whether it may be larger,
    for some data are farther off than is looked; nothing encloses it then.
    """

    value: float
    low: float
    high: float
    count: int
    unanswered: int = 0
    at_least: bool = False


@dataclass(frozen=True, kw_only=True)
class Told:
    """What a model says of the cuts, in the order of the campaign's tables.

    margin and chatter_frequency [rad/s]: (trial,); probability: (trial, category), of the labels; limit_margin:
    (row,).
    """

    margin: Array
    probability: Array
    chatter_frequency: Array
    limit_margin: Array


def told(comparison: Comparison, values: Array, prediction: Prediction) -> Told:
    """Return what a prediction says of the cuts.

    See docs/physics.md#comparison.
    """
    some = comparison.model.campaign.trials is not None
    probability = comparison.outcome_probabilities(values, prediction.margin) if some else np.empty((0, 2))
    return Told(
        margin=prediction.margin,
        probability=probability,
        chatter_frequency=prediction.chatter_frequency,
        limit_margin=prediction.limit_margin,
    )


def cut_scores(campaign: Campaign, said: Told) -> dict[str, Score]:
    """Return the scores of what was measured in cuts.

    See docs/physics.md#comparison.
    """
    found = {} if campaign.trials is None else _trial_scores(campaign.trials, campaign.machine.tool.teeth, said)
    if campaign.limits is not None:
        error = campaign.limits.uncertainty / campaign.limits.limit_depth
        found["limit_depth"] = _of_limits(said.limit_margin, error)
        if out_of_reach(said.limit_margin).any():
            # An interval of what is only a bound would say nothing.
            found["limit_depth"] = replace(found["limit_depth"], low=np.nan, high=np.nan, at_least=True)
    return found


def _trial_scores(trials: Trials, teeth: int, said: Told) -> dict[str, Score]:
    """Return the scores of trial cuts; what is without an answer is counted, and wrong."""
    found, unanswered = {}, np.isnan(said.margin)
    judged = trials.outcome != OUTCOMES.index("marginal")
    if judged.any():
        lost = int(unanswered[judged].sum())
        found["outcome"] = replace(_outcome_error(trials.outcome, said.margin), unanswered=lost)
        misplacement = _mean(misplaced(trials.outcome, said.margin), REACH)
        found["depth_margin"] = replace(misplacement, unanswered=lost)
    loss = _mean(-outcome(trials.outcome, said.probability).log_density, float(-np.log(said.probability.min())))
    found["log_loss"] = replace(loss, unanswered=int(unanswered.sum()))
    heard = np.isfinite(trials.chatter_frequency)
    if heard.any():
        tooth_passing, predicted = teeth * trials.spindle_speed[heard], said.chatter_frequency[heard]
        apart = np.abs(frequency_residual(trials.chatter_frequency[heard], predicted, tooth_passing))
        lost = int(np.isnan(predicted).sum())
        found["chatter_frequency"] = replace(_median(apart / (2.0 * np.pi)), unanswered=lost)
    return found


def structure_scores(campaign: Campaign, compared: Compared) -> dict[str, Score]:
    """Return the scores of what was measured without cutting.

    See docs/physics.md#comparison.
    """
    found, prediction = {}, compared.prediction
    if campaign.receptances:
        found["receptance"] = _receptance_error(campaign.receptances, prediction.receptances)
    modes, stiffness = campaign.natural_frequencies, campaign.stiffness
    if modes is not None:
        measured, predicted = modes.natural_frequency, prediction.natural_frequency
        found["natural_frequency"] = _log_error(measured, predicted, NATURAL_FREQUENCY_ERROR)
        if np.isfinite(modes.damping_ratio).any():
            found["damping_ratio"] = _log_error(modes.damping_ratio, prediction.damping_ratio, DAMPING_RATIO_ERROR)
    if stiffness is not None:
        measured = np.concatenate([stiffness.radial_stiffness, stiffness.axial_stiffness])
        predicted = np.concatenate([prediction.radial_stiffness, prediction.axial_stiffness])
        found["bearing_stiffness"] = _log_error(measured, predicted, STIFFNESS_ERROR)
    return found


def _receptance_error(measured: tuple[Receptance, ...], predicted: tuple[ComplexArray, ...]) -> Score:
    """Return the error of the direct responses; one without an answer is a tip that does not move."""
    triples = list(zip(measured, measuring_ranges(measured), predicted, strict=True))
    # A response across the axes may hold nothing but noise.
    direct = [one for one in triples if one[0].is_direct or not any(other.is_direct for other in measured)]
    apart = [np.linalg.norm(one.value - np.nan_to_num(h)) / np.linalg.norm(one.value) for one, _, h in direct]
    # The parts of a response scatter and not its norm: an interval knows as many numbers as they hold.
    found = _root_mean_square(np.array(apart), sum(facts(one.value, top) for one, top, _ in direct))
    return replace(found, unanswered=sum(bool(np.isnan(h).all()) for _, _, h in direct))


def misplaced(labels: NDArray[np.int8], margin: Array) -> Array:
    """Return how far each cut (cut,) that is not marginal lies on the wrong side of the boundary, in ln(depth).

    0 where the model is right; a cut without an answer counts as far off as any, by REACH.

    See docs/physics.md#comparison.
    """
    stable, chatter = labels == OUTCOMES.index("stable"), labels == OUTCOMES.index("chatter")
    wrong = np.where(np.isnan(margin), REACH, np.where(stable, margin, -margin))
    return np.asarray(np.maximum(wrong, 0.0)[stable | chatter])


def _outcome_error(labels: NDArray[np.int8], margin: Array) -> Score:
    """Return the balanced error; its interval from Wilson's of both shares, whose distances add up as deviations do.

    Source: G. Y. Zou, A. Donner, Stat. Med. 27 (2008) 1693-1702.
    """
    value, below, above, classes, count = balanced_error(labels, margin), 0.0, 0.0, 0, 0
    for name, right in (("stable", margin <= 0.0), ("chatter", margin > 0.0)):
        of_class = labels == OUTCOMES.index(name)
        seen = int(of_class.sum())
        if seen:
            share = scipy.stats.binomtest(int((of_class & ~right).sum()), seen)
            interval = share.proportion_ci(COVERAGE, method="wilson")
            below += (share.statistic - interval.low) ** 2
            above += (interval.high - share.statistic) ** 2
            classes, count = classes + 1, count + seen
    return Score(value=value, low=value - below**0.5 / classes, high=value + above**0.5 / classes, count=count)


def _mean(data: Array, largest: float) -> Score:
    """Return the mean of data (datum,) between 0 and ``largest``, with an interval that skew data need.

    Student's would end at zero where nothing failed, and misses what is large and rare. An end is the quantile
    of the mean with random (Dirichlet) weights of the data and of one datum more, at the border on its side; for
    data that are 0 or 1 it is Clopper's and Pearson's.

    Source: N. Gaffke, Math. Methods Stat. 14 (2005) 451-467.
    """
    weight = np.random.default_rng(SEED).standard_exponential((DRAWS, len(data) + 1))
    weight /= weight.sum(axis=1, keepdims=True)
    below, tail = weight[:, 1:] @ data, 0.5 * (1.0 - COVERAGE)
    low, high = np.quantile(below, tail), np.quantile(below + weight[:, 0] * largest, 1.0 - tail)
    return Score(value=float(data.mean()), low=float(low), high=float(high), count=len(data))


def _median(data: Array) -> Score:
    """Return the median of data (datum,), with the interval that order statistics give."""
    interval = scipy.stats.quantile_test(data, q=float(np.median(data)), p=0.5).confidence_interval(COVERAGE)
    return Score(value=float(np.median(data)), low=float(interval.low), high=float(interval.high), count=len(data))


def _root_mean_square(data: Array, freedom: float) -> Score:
    """Return the root mean square of data (datum,), with the chi-square interval of normal ones.

    freedom: how many independent numbers they hold.
    """
    value = float(np.sqrt((data**2).mean()))
    tails = [0.5 * (1.0 + COVERAGE), 0.5 * (1.0 - COVERAGE)]
    low, high = value * np.sqrt(freedom / scipy.stats.chi2.ppf(tails, freedom))
    return Score(value=value, low=float(low), high=float(high), count=len(data))


def _of_residuals(residual: Array, error: Array | float, least: float = 0.0) -> Score:
    """Return the root mean square of residuals (datum,) with a standard deviation; as in a fit, none is far off.

    least: as ``with_unanswered`` has it.
    """
    found = _root_mean_square(with_unanswered(residual, error, least), len(residual))
    return replace(found, unanswered=int((~np.isfinite(residual)).sum()))


def _of_limits(margin: Array, error: Array | float) -> Score:
    """Return the root mean square of margins of limit depths (row,), with the interval of data by Student's law.

    They are fitted by it: few of them are far off, and where none of these is among the data a model looks better than
    it is. For normal data the interval is too wide.
    """
    found = _of_residuals(margin, error, LIMIT_REACH)
    drawn = np.random.default_rng(SEED).standard_t(LIMIT_FREEDOM, (DRAWS, found.count))
    variance = LIMIT_FREEDOM / (LIMIT_FREEDOM - 2.0)
    tails = [0.5 * (1.0 + COVERAGE), 0.5 * (1.0 - COVERAGE)]
    low, high = found.value / np.sqrt(np.quantile((drawn**2).mean(axis=1) / variance, tails))
    return replace(found, low=float(low), high=float(high))


def _log_error(measured: Array, predicted: Array, error: float) -> Score:
    """Return the error of what was measured; cells of a table (row,) that are empty were not."""
    stated = np.isfinite(measured)
    return _of_residuals(np.log(measured[stated] / predicted[stated]), error)
