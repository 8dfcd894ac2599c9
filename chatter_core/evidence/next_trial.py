"""The cut that would part two hypotheses best: where what they expect differs most, their doubts included."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from chatter_core.evidence.belief import fitted
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.measured import Trials
from chatter_core.evidence.nuisances import TYPICAL_MISLABELLED
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.planned import planned_campaign, predict_planned

#: Standard deviation [ln(depth)] by which boundaries are off beyond what a hypothesis doubts itself. Where two of them
#: differ most one errs most: without it a label was worth a third of what was expected of it, see docs/blind.md.
MODEL_ERROR = 0.15
#: Speeds and depths that are tried, within those of the campaign's own cuts.
SPEEDS, DEPTHS = 24, 12


@dataclass(frozen=True, kw_only=True)
class NextTrial:
    """A cut: spindle_speed [rad/s], axial_depth [m]; probability of chatter by each hypothesis; and expected gain.

    expected_gain: mean of both Kullback-Leibler divergences of the label [nats].
    """

    spindle_speed: float
    axial_depth: float
    probability: tuple[float, float]
    expected_gain: float


def next_trial(one: Hypothesis, other: Hypothesis, **stated: float) -> NextTrial | None:
    """Return the cut whose label parts two hypotheses best; None without cuts, whose range is kept to.

    stated: radial_immersion, feed_per_tooth [m] or direction (position in measured.DIRECTIONS) of the cut, where they
    are not the machine's.

    See docs/physics.md#diagnosis.
    """
    campaign = one.comparison.model.campaign
    if not len(campaign.cut_speeds):
        return None
    plan = _plan(campaign.cut_speeds, campaign.cut_depths, stated)
    first, second = (expected_chatter(hypothesis, plan) for hypothesis in (one, other))
    gain = 0.5 * (first - second) * (_logit(first) - _logit(second))
    best = int(np.nan_to_num(gain).argmax())
    return NextTrial(
        spindle_speed=float(plan.spindle_speed[best]),
        axial_depth=float(plan.axial_depth[best]),
        probability=(float(first[best]), float(second[best])),
        expected_gain=float(np.nan_to_num(gain)[best]),
    )


def _plan(speeds: Array, depths: Array, stated: Mapping[str, float]) -> Trials:
    """Return cuts over the range of some (cut,), set up as the machine is but for what is stated."""
    speed = np.linspace(speeds.min(), speeds.max(), SPEEDS)
    depth = np.geomspace(depths.min(), depths.max(), DEPTHS)
    grid = [axis.ravel() for axis in np.meshgrid(speed, depth, indexing="ij")]
    nothing = np.full(len(grid[0]), np.nan)
    setting = {name: np.full(len(grid[0]), value) for name, value in stated.items()}
    return Trials(
        trial=np.arange(len(grid[0])),
        spindle_speed=grid[0],
        axial_depth=grid[1],
        outcome=np.zeros(len(grid[0]), dtype=np.int8),
        chatter_frequency=nothing,
        preload=nothing,
        radial_immersion=setting.get("radial_immersion", nothing),
        feed_per_tooth=setting.get("feed_per_tooth", nothing),
        direction=np.full(len(grid[0]), stated.get("direction", NO_WORD), dtype=np.int8),
        unknown={},
    )


def expected_chatter(hypothesis: Hypothesis, plan: Trials) -> Array:
    """Return the probability by which each cut of a plan will be called chatter (trial,), wrong labels as fitted.

    MODEL_ERROR counts as the doubts about parameters do.

    See docs/physics.md#diagnosis.
    """
    model = hypothesis.comparison.model
    planned = replace(model, campaign=planned_campaign(model.campaign, plan))
    probability = predict_planned(planned, fitted(hypothesis.fit), MODEL_ERROR).probability_chatter
    wrong = TYPICAL_MISLABELLED * np.exp(model.named(hypothesis.fit.estimate).get("mislabelled", 0.0))
    return np.asarray(wrong + (1.0 - 2.0 * wrong) * probability)


def _logit(probability: Array) -> Array:
    return np.asarray(np.log(probability / (1.0 - probability)))
