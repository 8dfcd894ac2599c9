"""The boundary of stability as a calibrated model has it, and how well the measurements fix it.

ln|mu| is computed over speed and depth, and how far its parameters' uncertainty moves it, to first order: where
ln|mu| is less than so many of its own deviations from zero, nobody knows whether a cut is stable.
"""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from chatter_core.chain import structure
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.cuts import SMALLEST_RADIUS
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.evidence.stages import Indices, Stages
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.stability import critical_multipliers

#: Speeds and depths of a field, and of the coarser one over which its deviation is known.
GRID, COARSE_GRID = (320, 96), (160, 48)
#: How far beyond the trials a field reaches: a share of the range of speeds to both sides, a factor of depth.
SPEED_MARGIN, DEPTH_MARGIN = 0.04, 1.15
#: Differences are taken over this share of a parameter's standard deviation: where another branch of multipliers
#: takes over within one, its slope would count far from where it rules.
STEP = 0.03
#: Where ln|mu| is farther than this from zero its deviation is not asked for, and told as none: there no parameter is
#: so uncertain that it would matter.
FAR = 1.0


@dataclass(frozen=True, kw_only=True)
class Field:
    """ln|mu| over speed and depth, for the trials that were set up alike.

    machine: as they were set up, otherwise as described; trials: (trial,) which ones; limits: (row,) which limit
    depths; spindle_speed [rad/s], axial_depth [m]; growth: (speed, depth), ln|mu|; deviation: its standard deviation,
    0 farther than FAR from the boundary; both NaN where the model has no answer.
    """

    machine: Machine
    trials: Indices
    limits: Indices
    spindle_speed: Array
    axial_depth: Array
    growth: Array
    deviation: Array


def field(
    model: CampaignModel,
    belief: Belief,
    setup: int,
    *,
    grid: tuple[int, int] = GRID,
    coarse_grid: tuple[int, int] = COARSE_GRID,
) -> Field:
    """Return the field of one setup of the cuts, by its place in ``setups``, with what is known of the parameters.

    See docs/physics.md#comparison.
    """
    machine, points = setups(model)[setup]
    known = belief.about(model)
    speed, depth = _axes(model, points, grid)
    place = np.stack(np.meshgrid(speed, depth, indexing="ij"), axis=-1)
    coarse_axes = _axes(model, points, coarse_grid)
    coarse = _deviation(model, machine, known, *coarse_axes)
    return Field(
        machine=machine,
        trials=points[points < model.cuts.trials],
        limits=points[points >= model.cuts.trials] - model.cuts.trials,
        spindle_speed=speed,
        axial_depth=depth,
        growth=_growth_near_boundary(model.stages(known.estimate, machine), model, speed, depth),
        deviation=RegularGridInterpolator(coarse_axes, coarse, bounds_error=False, fill_value=None)(place),
    )


def setups(model: CampaignModel) -> list[tuple[Machine, Indices]]:
    """Return machine and cuts of every setup of the campaign, the one with most cuts first.

    See docs/physics.md#comparison.
    """
    found = [(setup.machine, setup.points) for group in model.cuts.groups for setup in group.setups]
    return sorted(found, key=lambda one: -len(one[1]))


def _axes(model: CampaignModel, points: Indices, grid: tuple[int, int]) -> tuple[Array, Array]:
    """Return speeds and depths around some cuts."""
    campaign, (speeds, depths) = model.campaign, grid
    tables = [table.spindle_speed for table in (campaign.trials, campaign.limits) if table is not None]
    speed = np.concatenate(tables)[points]
    room = SPEED_MARGIN * (speed.max() - speed.min()) or SPEED_MARGIN * speed.max()
    deepest = DEPTH_MARGIN * float(model.cuts.axial_depth[points].max())
    lowest = max(speed.min() - room, 0.5 * speed.min())
    return np.linspace(lowest, speed.max() + room, speeds), np.linspace(deepest / depths, deepest, depths)


def _growth_near_boundary(stages: Stages, model: CampaignModel, speed: Array, depth: Array) -> Array:
    """Return ln|mu| (speed, depth), exact where it matters and interpolated elsewhere."""
    block = lobe_block(
        stages,
        spindle_speed=speed,
        axial_depth=depth,
        mode_count=model.available(model.cut_modes),
        modal_parameters="dynamic",
        method=model.method,
        cells="adaptive",
    )
    return np.asarray(np.log(np.maximum(block.spectral_radius, SMALLEST_RADIUS)))


def _deviation(model: CampaignModel, machine: Machine, known: Belief, speed: Array, depth: Array) -> Array:
    """Return the standard deviation of ln|mu| (speed, depth), to first order in the parameters; 0 where it is far."""
    at_speed, depths = np.repeat(np.arange(len(speed)), len(depth)), np.tile(depth, len(speed))
    growth, slopes = _growth(model, machine, known.estimate, speed, at_speed, depths), []
    near = np.abs(growth) < FAR
    moved = [i for i, p in enumerate(model.parameters) if p.touches != "measurement" and known.deviation[i] > 0.0]
    for index in moved:
        aside = known.estimate.copy()
        step = STEP * known.deviation[index]
        aside[index] += step if aside[index] + step <= model.parameters[index].upper else -step
        by = (aside[index] - known.estimate[index]) / known.deviation[index]
        slopes.append((_growth(model, machine, aside, speed, at_speed[near], depths[near]) - growth[near]) / by)
    deviation = np.where(np.isnan(growth), np.nan, 0.0)
    if moved:
        slope, correlation = np.stack(slopes, axis=-1), known.correlation[np.ix_(moved, moved)]
        deviation[near] = np.sqrt(np.maximum(np.einsum("ci,ij,cj->c", slope, correlation, slope), 0.0))
    return deviation.reshape(len(speed), len(depth))


def _growth(model: CampaignModel, machine: Machine, values: Array, speed: Array, index: Indices, depth: Array) -> Array:
    """Return ln|mu| (cell,) of cells at a speed by its index and a depth."""
    stages = model.stages(values, machine)
    built = structure(stages, speed, mode_count=model.available(model.cut_modes))
    multiplier = critical_multipliers(stages, built, index, depth, model.method, np.ones(len(index)))
    return np.log(np.maximum(np.abs(multiplier), SMALLEST_RADIUS))
