"""The boundary of stability as a calibrated model has it, and how well the measurements fix it.

ln|mu| is computed over speed and depth, and how far its parameters' uncertainty moves it, to first order: where
ln|mu| is less than so many of its own deviations from zero, nobody knows whether a cut is stable.
"""

from dataclasses import dataclass

import numpy as np

from chatter_core.evidence.belief import Belief
from chatter_core.evidence.cuts import SMALLEST_RADIUS
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.evidence.stages import Indices
from chatter_core.machine import Machine

#: Speeds and depths of a field.
SPEEDS, DEPTHS = 160, 48
#: How far beyond the trials a field reaches: a share of the range of speeds to both sides, a factor of depth.
SPEED_MARGIN, DEPTH_MARGIN = 0.04, 1.15
#: Differences are taken over this share of a parameter's standard deviation.
STEP = 0.03


@dataclass(frozen=True, kw_only=True)
class Field:
    """ln|mu| over speed and depth, for the trials that were set up alike.

    machine: as they were set up, otherwise as described; trials: (trial,) which ones; spindle_speed [rad/s],
    axial_depth [m]; growth and deviation: (speed, depth), ln|mu| and its standard deviation, NaN where the model
    has no answer.
    """

    machine: Machine
    trials: Indices
    spindle_speed: Array
    axial_depth: Array
    growth: Array
    deviation: Array


def field(model: CampaignModel, belief: Belief, setup: int, *, speeds: int = SPEEDS, depths: int = DEPTHS) -> Field:
    """Return the field of one setup of the cuts, by its place in ``setups``, with what is known of the parameters.

    See docs/physics.md#comparison.
    """
    machine, points = setups(model)[setup]
    speed, depth = _grid(model, points, speeds, depths)
    known = belief.about(model)
    values, deviation = known.estimate, known.deviation
    growth = _growth(model, machine, values, speed, depth)
    slopes = []
    moved = [i for i, p in enumerate(model.parameters) if p.touches != "measurement" and deviation[i] > 0.0]
    for index in moved:
        aside = values.copy()
        step = STEP * deviation[index]
        aside[index] += step if values[index] + step <= model.parameters[index].upper else -step
        by = (aside[index] - values[index]) / deviation[index]
        slopes.append((_growth(model, machine, aside, speed, depth) - growth) / by)
    slope = np.stack(slopes, axis=-1) if slopes else np.zeros((*growth.shape, 0))
    correlation = known.correlation[np.ix_(moved, moved)]
    variance = np.einsum("sdi,ij,sdj->sd", slope, correlation, slope)
    trials = points[points < len(model.campaign.trials or ())]
    return Field(
        machine=machine,
        trials=trials,
        spindle_speed=speed,
        axial_depth=depth,
        growth=growth,
        deviation=np.sqrt(np.maximum(variance, 0.0)),
    )


def setups(model: CampaignModel) -> list[tuple[Machine, Indices]]:
    """Return machine and cuts of every setup of the campaign, the one with most cuts first.

    See docs/physics.md#comparison.
    """
    found = [(setup.machine, setup.points) for group in model.cuts.groups for setup in group.setups]
    return sorted(found, key=lambda one: -len(one[1]))


def _grid(model: CampaignModel, points: Indices, speeds: int, depths: int) -> tuple[Array, Array]:
    """Return speeds and depths around some cuts."""
    campaign = model.campaign
    tables = [table.spindle_speed for table in (campaign.trials, campaign.limits) if table is not None]
    speed = np.concatenate(tables)[points]
    room = SPEED_MARGIN * (speed.max() - speed.min()) or SPEED_MARGIN * speed.max()
    deepest = DEPTH_MARGIN * float(model.cuts.axial_depth[points].max())
    lowest = max(speed.min() - room, 0.5 * speed.min())
    return np.linspace(lowest, speed.max() + room, speeds), np.linspace(deepest / depths, deepest, depths)


def _growth(model: CampaignModel, machine: Machine, values: Array, speed: Array, depth: Array) -> Array:
    """Return ln|mu| (speed, depth)."""
    stages = model.stages(values, machine)
    built = stages.structure(stages.machine, speed, mode_count=model.available(model.cut_modes))
    index = np.repeat(np.arange(len(speed)), len(depth))
    multiplier = stages.multipliers(
        stages.machine, built, index, np.tile(depth, len(speed)), model.method, np.ones(len(index))
    )
    return np.log(np.maximum(np.abs(multiplier), SMALLEST_RADIUS)).reshape(len(speed), len(depth))
