"""The boundary of stability as a calibrated model has it, and how well the measurements fix it.

ln|mu| is computed over speed and depth, and how far its parameters' uncertainty moves it, to first order: where
ln|mu| is less than so many of its own deviations from zero, nobody knows whether a cut is stable. Several motions may
grow at once; one that surely does is enough.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator
from scipy.ndimage import binary_dilation, distance_transform_edt

from chatter_core.chain import Structure, structure
from chatter_core.contact import KnownForces
from chatter_core.errors import OwnLawFails
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.cuts import SMALLEST_RADIUS
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.stability import branches, critical_multipliers, known_forces
from chatter_core.stages import Indices, Stages

#: Speeds and depths of a field, and of the coarser one over which its deviation is known.
GRID, COARSE_GRID = (320, 96), (120, 36)
#: How far beyond the trials a field reaches: a share of the range of speeds to both sides, a factor of depth.
SPEED_MARGIN, DEPTH_MARGIN = 0.04, 1.15
#: Differences are taken over this share of a parameter's standard deviation: where another branch of multipliers
#: takes over within one, its slope would count far from where it rules.
STEP = 0.03
#: Where ln|mu| is farther than this from zero its deviation is not asked for, and told as none: there no parameter is
#: so uncertain that it would matter.
FAR = 1.0
#: Nor is it where ln|mu| is farther from zero than so many of the largest deviations, and all cells beside are as well.
#: How large they are is known first, at every FEW-th speed and depth.
ENOUGH, FEW = 3.0, 4
#: Unstable cells nearer to the boundary than so many deviations are looked at motion by motion, and so many of those.
DOUBTFUL, MOTIONS = 3.0, 4
#: No ln|mu| is told to be surer than this.
LEAST_DEVIATION = 1e-9


@dataclass(frozen=True, kw_only=True)
class Field:
    """ln|mu| over speed and depth, for the trials that were set up alike.

    machine: as they were set up, otherwise as described; trials: (trial,) which ones; limits: (row,) which limit
    depths; spindle_speed [rad/s], axial_depth [m]; growth: (speed, depth), ln|mu|; deviation: its standard deviation,
    less where a slower motion grows more surely, 0 so far from the boundary that it does not matter; both NaN where the
    model has no answer.
    """

    machine: Machine
    trials: Indices
    limits: Indices
    spindle_speed: Array
    axial_depth: Array
    growth: Array
    deviation: Array

    def with_deviation(self, deviation: Array) -> "Field":
        """Return the same field with a deviation (speed, depth), NaN where the model has no answer."""
        return replace(self, deviation=np.where(np.isnan(self.growth), np.nan, deviation))


def sure_field(model: CampaignModel, belief: Belief, setup: int, grid: tuple[int, int] = GRID) -> Field:
    """Return the field of one setup of the cuts as if its parameters were known: all deviations are none.

    See docs/physics.md#comparison.
    """
    machine, points = setups(model)[setup]
    speed, depth = _axes(model, points, grid)
    try:
        growth = _growth_near_boundary(model.stages(belief.about(model).estimate, machine), model, speed, depth)
    except OwnLawFails as failure:
        model.forgive(failure)
        growth = np.full((len(speed), len(depth)), np.nan)
    return Field(
        machine=machine,
        trials=points[points < model.cuts.trials],
        limits=points[points >= model.cuts.trials] - model.cuts.trials,
        spindle_speed=speed,
        axial_depth=depth,
        growth=growth,
        deviation=np.where(np.isnan(growth), np.nan, 0.0),
    )


def deviation(
    model: CampaignModel,
    belief: Belief,
    setup: int,
    grid: tuple[int, int] = GRID,
    coarse_grid: tuple[int, int] = COARSE_GRID,
    share: tuple[int, int] = (0, 1),
) -> Array:
    """Return the deviation (speed, depth) of the same field, for ``Field.with_deviation``.

    It takes several times as long as the field. share: of the speeds, their first half by (0, 2), the other by (1, 2).

    See docs/physics.md#comparison.
    """
    machine, points = setups(model)[setup]
    speed, depth = _axes(model, points, grid)
    own = np.array_split(speed, share[1])[share[0]]
    coarse_speed, coarse_depth = _axes(model, points, coarse_grid)
    around = slice(np.searchsorted(coarse_speed, own[0], side="right") - 1, np.searchsorted(coarse_speed, own[-1]) + 1)
    coarse = _deviation(model, machine, belief.about(model), coarse_speed[around], coarse_depth)
    place = np.stack(np.meshgrid(own, depth, indexing="ij"), axis=-1)
    axes = coarse_speed[around], coarse_depth
    known = RegularGridInterpolator(axes, _without_holes(coarse), bounds_error=False, fill_value=None)
    # Above the coarse grid's first depth it is told by the slope from there, which may lead below none.
    return np.asarray(np.maximum(known(place), 0.0))


def _without_holes(deviation: Array) -> Array:
    """Return deviations (speed, depth) with those of the nearest cell where one is NaN, as one without an answer is."""
    unknown = np.isnan(deviation)
    if unknown.all():
        return deviation
    nearest = distance_transform_edt(unknown, return_distances=False, return_indices=True)
    return np.asarray(deviation[tuple(nearest)])


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
    asides = list(_asides(model, known))
    if not asides:
        return np.zeros((len(speed), len(depth)))
    at_speed, depths = np.repeat(np.arange(len(speed)), len(depth)), np.tile(depth, len(speed))
    cells = _Cells(model=model, machine=machine, speed=speed, index=at_speed, depth=depths)
    growth = cells.growth(known.estimate)
    deviation = np.where(np.isnan(growth), np.nan, 0.0)
    correlation = known.correlation[np.ix_(*2 * [[index for index, _, _ in asides]])]
    wanted = np.abs(growth) < FAR
    at_depth = np.tile(np.arange(len(depth)), len(speed))
    few = np.flatnonzero(wanted & (at_speed % FEW == 0) & (at_depth % FEW == 0))
    largest = np.nanmax(_moved(cells.select(few), growth[few], asides, correlation), initial=0.0)
    close = _close(growth.reshape(len(speed), len(depth)), ENOUGH * largest)
    near = np.flatnonzero(wanted & close.ravel())
    noted = cells.select(near).noting_forces(known.estimate)
    deviation[near] = _moved(noted, growth[near], asides, correlation)
    among = np.flatnonzero((growth[near] > 0.0) & (growth[near] < DOUBTFUL * deviation[near]))
    sureness, doubtful = _sureness(noted.select(among), known.estimate, asides, correlation), near[among]
    deviation[doubtful] = np.minimum(deviation[doubtful], growth[doubtful] / sureness)
    return deviation.reshape(len(speed), len(depth))


def _moved(cells: "_Cells", growth: Array, asides: Sequence[tuple[int, Array, float]], correlation: Array) -> Array:
    """Return by how much uncertain parameters move ln|mu| of cells (cell,) from where it is, a standard deviation."""
    slope = np.stack([(cells.growth(aside) - growth) / by for _, aside, by in asides], axis=-1)
    return _spread(slope, correlation)


def _close(growth: Array, reach: float) -> NDArray[np.bool_]:
    """Return the cells (speed, depth) within reach of the boundary, or where it passes, and all beside them.

    Between cells deviations are interpolated: those beside a band must not be none.
    """
    grows, beside = growth > 0.0, np.ones((3, 3))
    passing = binary_dilation(grows, beside) & binary_dilation(~grows, beside)
    return np.asarray(binary_dilation((np.abs(growth) < reach) | passing, beside))


def _asides(model: CampaignModel, known: Belief) -> Iterator[tuple[int, Array, float]]:
    """Yield each uncertain parameter of a cut, values (parameter,) where it is moved, and by how many deviations."""
    for index, parameter in enumerate(model.parameters):
        if parameter.touches == "measurement" or known.deviation[index] == 0.0:
            continue
        aside, step = known.estimate.copy(), STEP * known.deviation[index]
        aside[index] += step if aside[index] + step <= parameter.upper else -step
        # A deviation that is lost in rounding is none.
        if aside[index] != known.estimate[index]:
            yield index, aside, (aside[index] - known.estimate[index]) / known.deviation[index]


def _spread(slope: Array, correlation: Array) -> Array:
    """Return standard deviations (...) of what has slopes (..., parameter) by parameters that correlate."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("...i,ij,...j->...", slope, correlation, slope), 0.0)))


def _sureness(
    cells: "_Cells", estimate: Array, asides: Sequence[tuple[int, Array, float]], correlation: Array
) -> Array:
    """Return by how many of its own deviations the surest of the growing motions grows (cell,).

    A motion that grows fast and is doubtful may hide a slow one that is not: the cut is unstable either way.
    """
    growth, frequency = cells.motions(estimate)
    slopes = []
    # Motions that are missing have no number, and are no growing ones.
    with np.errstate(invalid="ignore", divide="ignore"):
        for _, aside, by in asides:
            moved, heard = cells.motions(aside)
            change = np.abs(np.log(heard[:, None, :] / frequency[:, :, None]))
            # The same motion is the one that has changed least.
            apart = np.abs(moved[:, None, :] - growth[:, :, None]) + change
            same = np.where(np.isnan(apart), np.inf, apart).argmin(axis=2)
            slopes.append((np.take_along_axis(moved, same, axis=1) - growth) / by)
        deviation = _spread(np.stack(slopes, axis=-1), correlation)
        sureness = np.where(growth > 0.0, growth / np.maximum(deviation, LEAST_DEVIATION), 0.0)
    return np.asarray(np.nanmax(sureness, axis=1))


@dataclass(frozen=True, kw_only=True)
class _Cells:
    """Cells of a field: at a speed [rad/s] by its index, and a depth [m].

    forces: that repeat at values nearby, from which those at others are found.
    """

    model: CampaignModel
    machine: Machine
    speed: Array
    index: Indices
    depth: Array
    forces: KnownForces | None = None

    def select(self, kept: Indices) -> "_Cells":
        """Return some of the cells."""
        return replace(self, index=self.index[kept], depth=self.depth[kept])

    def noting_forces(self, values: Array) -> "_Cells":
        """Return the same cells with the forces that repeat in them at values (parameter,) that have an answer."""
        return replace(self, forces=known_forces(*self._built(values), self.index, self.depth))

    def growth(self, values: Array) -> Array:
        """Return ln|mu| (cell,) at values (parameter,)."""
        method, ones = self.model.method, np.ones(len(self.index))
        try:
            multiplier = critical_multipliers(*self._built(values), self.index, self.depth, method, ones)
        except OwnLawFails as failure:
            self.model.forgive(failure)
            return np.full(len(self.index), np.nan)
        return np.asarray(np.log(np.maximum(np.abs(multiplier), SMALLEST_RADIUS)))

    def motions(self, values: Array) -> tuple[Array, Array]:
        """Return ln|mu| and frequency [rad/s] of the fastest growing motions (cell, motion) at values (parameter,)."""
        try:
            return branches(*self._built(values), self.index, self.depth, self.model.method, MOTIONS)
        except OwnLawFails as failure:
            self.model.forgive(failure)
            growth, frequency = np.full((2, len(self.index), MOTIONS), np.nan)
            return growth, frequency

    def _built(self, values: Array) -> tuple[Stages, Structure]:
        stages = replace(self.model.stages(values, self.machine), known_forces=self.forces)
        return stages, structure(stages, self.speed, mode_count=self.model.available(self.model.cut_modes))
