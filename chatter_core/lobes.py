"""Stability lobes: the spectral radius over speed and depth, and the depths where it is one."""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core import cutting
from chatter_core.chain import Structure, structure
from chatter_core.crossings import Crossings, Multipliers, find_crossings
from chatter_core.floquet import MethodSettings
from chatter_core.machine import Machine
from chatter_core.stability import Stability, critical_multipliers, evaluate, without_result
from chatter_core.stages import Stages, stages_of
from chatter_core.variables import FAILED, STATUS

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.intp]

#: Crossings kept for each speed; stability is lost at the odd ones and regained at the even ones.
CROSSINGS = 8
#: Above the first depth asked for, the boundary is looked for up to this share of it, and to a micrometre.
SHALLOWEST, SHALLOWEST_DEPTH = 1e-3, 1e-6
#: Where depths are looked at only where needed, the first looks are there and at these shares of the deepest.
FIRST_LOOK = (0.25, 1.0)
#: Of two crossings nearer than this share of the deepest depth none may be seen.
FINEST = 1.0 / 64.0
#: Near the boundary, depths looked at lie no farther apart than this share of the edge's axial pitch, and
#: of the deepest depth.
COARSEST = 1.0 / 8.0
#: A finer look multiplies the resolution by this.
REFINEMENT_STEP = 1.5
#: Depths of a speed, those nearest to the boundary, of which the error is estimated.
ERROR_CELLS = 2
#: The finer look errs too, by up to a seventh of what the first does: estimates are stated so much larger.
FINER_ERROR = 1.15
#: What collocation is compared with has this share of its tolerance, which settles its eigenvalues better.
STRICTER = 1e-2
#: What semi-discretization is compared with.
ERROR_REFERENCE = MethodSettings(name="collocation", tolerance=1e-4)
#: Looks finer than the first before a point counts as not converged.
REFINEMENTS = 8


@dataclass(frozen=True, kw_only=True)
class LobeBlock:
    """Lobes of a block of speeds, named as in variables.SWEEP, in SI.

    Arrays over the grid are (speed, depth), limits are (speed, crossing) padded with NaN (codes
    with 0), error_estimate and limits_complete are (speed,).
    """

    spectral_radius: Array
    multiplier_angle: Array
    chatter_frequency: Array
    bifurcation: NDArray[np.int8]
    dominant_mode: NDArray[np.int8]
    dominant_mode_share: Array
    error_estimate: Array
    limits_complete: NDArray[np.int8]
    limit_depth: Array
    limit_chatter_frequency: Array
    limit_dominant_mode: NDArray[np.int8]
    limit_bifurcation: NDArray[np.int8]
    status: NDArray[np.uint8]


def lobe_block(
    model: Machine | Stages,
    *,
    spindle_speed: Array,
    axial_depth: Array,
    mode_count: int,
    modal_parameters: str,
    method: MethodSettings,
    mode_selection: str = "up_to",
    cells: str = "all",
) -> LobeBlock:
    """Compute the lobes of a block of speeds (speed,) [rad/s] on a grid of depths (depth,) [m].

    With ``cells`` ``all`` every cell is evaluated. With ``adaptive`` depths are chosen, speed by speed,
    as the search for the boundary needs them; cells between them are interpolated and say so.
    The resolution is raised, speed by speed, until the spectral radius nearest to one changes by
    less than the method's tolerance; a speed for which that fails is marked not converged.

    Raises InvalidInput when the machine has fewer modes than ``mode_count``.

    See docs/physics.md#lobes.
    """
    stages = stages_of(model)
    built = structure(
        stages,
        spindle_speed,
        mode_count=mode_count,
        modal_parameters=modal_parameters,
        mode_selection=mode_selection,
    )
    solver = _Solver(stages=stages, built=built, method=method, refinement=np.ones(len(spindle_speed)))
    if cells == "all":
        grid, error = _evaluate_all(solver, axial_depth)
        crossings = _limits_within(solver, axial_depth, grid)
    else:
        grid, error, crossings = _evaluate_where_needed(solver, axial_depth)
    limits = crossings.depth
    at_limit = solver.at_limits(limits)
    shape = (len(spindle_speed), len(axial_depth))
    known = np.isfinite(grid.multiplier)
    return LobeBlock(
        spectral_radius=grid.spectral_radius.reshape(shape),
        multiplier_angle=np.where(known, np.angle(grid.multiplier), np.nan).reshape(shape),
        chatter_frequency=grid.chatter_frequency.reshape(shape),
        bifurcation=grid.bifurcation.reshape(shape),
        dominant_mode=grid.dominant_mode.reshape(shape),
        dominant_mode_share=grid.mode_share.max(axis=-1).reshape(shape),
        error_estimate=error,
        limits_complete=crossings.complete.astype(np.int8),
        limit_depth=limits,
        limit_chatter_frequency=at_limit.chatter_frequency.reshape(limits.shape),
        limit_dominant_mode=at_limit.dominant_mode.reshape(limits.shape),
        limit_bifurcation=at_limit.bifurcation.reshape(limits.shape),
        status=grid.status.reshape(shape),
    )


def evaluate_to_tolerance(
    model: Machine | Stages, built: Structure, axial_depth: Array, method: MethodSettings
) -> tuple[Stability, Array]:
    """Evaluate one depth (speed,) [m] at each speed of a structure, to the method's tolerance.

    Returns the stability and the estimated relative error of the spectral radius (speed,).

    See docs/physics.md#lobes.
    """
    results, errors = [], []
    for speed, depth in enumerate(axial_depth):
        one = built.at(np.array([speed]))
        solver = _Solver(stages=stages_of(model), built=one, method=method, refinement=np.ones(1))
        stability, error = _evaluate_all(solver, np.array([depth]))
        results.append(stability)
        errors.append(error)
    joined = {f.name: np.concatenate([getattr(r, f.name) for r in results]) for f in fields(Stability)}
    return Stability(**joined), np.concatenate(errors)


@dataclass(frozen=True, kw_only=True)
class _Solver:
    """What evaluates the points of a block; refinement (speed,) of the resolution is raised in place."""

    stages: Stages
    built: Structure
    method: MethodSettings
    refinement: Array

    @property
    def modes(self) -> int:
        return int(self.built.cut_modes.label.max())

    def evaluate(self, speed: Indices, depth: Array) -> Stability:
        return evaluate(self.stages, self.built, speed, depth, self.method, self.refinement[speed])

    def multipliers(self, speed: Indices, depth: Array) -> ComplexArray:
        return critical_multipliers(self.stages, self.built, speed, depth, self.method, self.refinement[speed])

    def error(self, speed: Indices, depth: Array, radius: Array) -> Array:
        """Estimate relative errors of spectral radii (point,).

        Collocation is compared with itself on a finer mesh, with eigenvalues that are better settled;
        semi-discretization with collocation, because with its own doubled intervals it can agree on a
        wrong branch.
        """
        finer, covering = ERROR_REFERENCE, 1.0
        if self.method.tolerance is not None:
            covering = FINER_ERROR
            finer = self.method.model_copy(update={"tolerance": STRICTER * self.method.tolerance})
        refinement = REFINEMENT_STEP * self.refinement[speed]
        fine = critical_multipliers(self.stages, self.built, speed, depth, finer, refinement)
        return np.asarray(covering * np.abs(radius / np.abs(fine) - 1.0))

    def crossings(self, look: Multipliers, depth: Array, known: ComplexArray, finest: float = np.inf) -> Crossings:
        """Search for limit depths from multipliers known at some depths (speed, depth)."""
        return find_crossings(
            look,
            depth,
            known,
            finest=min(FINEST * depth[-1], finest),
            coarsest=COARSEST * min(cutting.axial_pitch(self.stages.machine.tool), depth[-1]),
            most=CROSSINGS,
        )

    def at_limits(self, limits: Array) -> Stability:
        """Evaluate the limit depths (speed, crossing); those that are not there have no result."""
        result = without_result(limits.size, self.modes)
        found = np.flatnonzero(np.isfinite(limits.ravel()))
        if len(found):
            speed = np.repeat(np.arange(len(limits)), limits.shape[1])[found]
            result.overwrite(found, self.evaluate(speed, limits.ravel()[found]))
        return result


def _evaluate_all(solver: _Solver, axial_depth: Array) -> tuple[Stability, Array]:
    """Evaluate every cell at the resolution that the tolerance asks for.

    Returns the results (speed x depth,) and the error estimate (speed,).
    """
    speeds, depths = len(solver.refinement), len(axial_depth)
    index, depth = np.repeat(np.arange(speeds), depths), np.tile(axial_depth, speeds)
    grid, error = solver.evaluate(index, depth), np.full(speeds, np.nan)
    pending = np.flatnonzero(solver.built.solved)
    for _ in range(REFINEMENTS):
        radius = grid.spectral_radius.reshape(speeds, depths)[pending]
        error[pending] = _error_near_boundary(solver, pending, np.tile(axial_depth, (len(pending), 1)), radius)
        pending = _too_inexact(solver, pending, error)
        if not len(pending):
            break
        again = np.flatnonzero(np.isin(index, pending))
        grid.overwrite(again, solver.evaluate(index[again], depth[again]))
    else:
        _mark_unsettled(solver, grid, np.isin(index, pending))
    return grid, error


def _error_near_boundary(solver: _Solver, speed: Indices, depth: Array, radius: Array) -> Array:
    """Return the largest error (speed,) of the spectral radii (speed, depth) nearest to one; NaN where none is known.

    What has no result has no error either, and says nothing of its neighbours.
    """
    distance = np.nan_to_num(np.abs(np.log(radius)), nan=np.inf)
    nearest = np.argsort(distance, axis=1, kind="stable")[:, :ERROR_CELLS]
    at, of = (np.take_along_axis(array, nearest, axis=1) for array in (depth, radius))
    known = np.isfinite(of)
    found = np.full(nearest.shape, -np.inf)
    found[known] = solver.error(np.repeat(speed, known.sum(axis=1)), at[known], of[known])
    return np.where(known.any(axis=1), found.max(axis=1), np.nan)


def _too_inexact(solver: _Solver, pending: Indices, error: Array) -> Indices:
    """Return the speeds whose error is too large, at a resolution raised for them."""
    if solver.method.tolerance is None:  # nothing to choose
        return pending[:0]
    pending = pending[~(error[pending] <= solver.method.tolerance)]
    solver.refinement[pending] *= REFINEMENT_STEP
    return pending


def _mark_unsettled(solver: _Solver, grid: Stability, cells: NDArray[np.bool_]) -> None:
    """Take the results from cells whose error stayed too large."""
    unsettled = np.flatnonzero(cells & ~np.isin(grid.status, FAILED))
    grid.overwrite(unsettled, without_result(len(unsettled), solver.modes, STATUS["not_converged"]))


def _shallowest(axial_depth: Array) -> float:
    return float(min(SHALLOWEST * axial_depth[0], SHALLOWEST_DEPTH))


def _limits_within(solver: _Solver, axial_depth: Array, grid: Stability) -> Crossings:
    """Return the limit depths of an evaluated grid, the part above its first depth included."""
    speeds = np.arange(len(solver.refinement))
    shallow = _shallowest(axial_depth)
    first = solver.multipliers(speeds, np.full(len(speeds), shallow))
    known = np.concatenate([first[:, None], grid.multiplier.reshape(len(speeds), -1)], axis=1)
    return solver.crossings(solver.multipliers, np.concatenate([[shallow], axial_depth]), known)


class _Samples:
    """Depths of some speeds that were looked at, and what was found there."""

    def __init__(self, solver: _Solver, speeds: Indices) -> None:
        self._solver, self._speeds = solver, speeds
        self._looks: list[tuple[Indices, Array, Stability]] = []

    def __call__(self, place: Indices, depth: Array) -> ComplexArray:
        """Look at depths (point,) of speeds by their place (point,); return the multipliers."""
        self._looks.append((place, depth, self._solver.evaluate(self._speeds[place], depth)))
        return self._looks[-1][2].multiplier

    def by_speed(self) -> Iterator[tuple[Array, Stability]]:
        """Yield depths and results of every speed, by depth, each depth once."""
        place, depth = (np.concatenate([look[i] for look in self._looks]) for i in (0, 1))
        found = [look[2] for look in self._looks]
        joined = {f.name: np.concatenate([getattr(one, f.name) for one in found]) for f in fields(Stability)}
        for speed in range(len(self._speeds)):
            own = np.flatnonzero(place == speed)
            order = own[np.unique(depth[own], return_index=True)[1]]
            yield depth[order], Stability(**{name: array[order] for name, array in joined.items()})


def _evaluate_where_needed(solver: _Solver, axial_depth: Array) -> tuple[Stability, Array, Crossings]:
    """Evaluate depths as the search for the boundary needs them, and interpolate the grid's cells.

    Returns the results (speed x depth,), the error estimate (speed,) and the limit depths.
    """
    speeds, depths = len(solver.refinement), len(axial_depth)
    first = np.array([_shallowest(axial_depth), *np.multiply(axial_depth[-1], FIRST_LOOK)])
    smallest_step = float(np.diff(axial_depth).min(initial=np.inf))
    grid = without_result(speeds * depths, solver.modes, STATUS["outside_validity"])
    error, limits = np.full(speeds, np.nan), np.full((speeds, CROSSINGS), np.nan)
    complete = np.zeros(speeds, dtype=bool)
    pending = np.flatnonzero(solver.built.solved)
    for _ in range(REFINEMENTS):
        samples = _Samples(solver, pending)
        known = samples(np.repeat(np.arange(len(pending)), len(first)), np.tile(first, len(pending)))
        crossings = solver.crossings(samples, first, known.reshape(-1, len(first)), smallest_step)
        limits[pending], complete[pending] = crossings.depth, crossings.complete
        samples(*_cells_at_boundary(axial_depth, limits[pending]))
        for speed, (depth, found) in zip(pending, samples.by_speed(), strict=True):
            (error[speed],) = _error_near_boundary(solver, np.array([speed]), depth[None], found.spectral_radius[None])
            grid.overwrite(speed * depths + np.arange(depths), _between(axial_depth, depth, found))
        pending = _too_inexact(solver, pending, error)
        if not len(pending):
            break
    else:
        _mark_unsettled(solver, grid, np.isin(np.repeat(np.arange(speeds), depths), pending))
        limits[pending], complete[pending] = np.nan, False
    return grid, error, Crossings(depth=limits, complete=complete)


def _cells_at_boundary(axial_depth: Array, limits: Array) -> tuple[Indices, Array]:
    """Return speed and depth (cell,) of the cells below and above every limit depth (speed, crossing)."""
    speed, crossing = np.nonzero(np.isfinite(limits))
    above = np.searchsorted(axial_depth, limits[speed, crossing])
    inside = (above > 0) & (above < len(axial_depth))
    speed, above = np.repeat(speed[inside], 2), np.repeat(above[inside], 2)
    return speed, axial_depth[above - np.arange(len(above)) % 2]


def _between(cell: Array, depth: Array, found: Stability) -> Stability:
    """Interpolate ln|mu| at the cells' depths; take the rest from the nearer sample on the same side of the boundary.

    A cell between samples of which one has no result has none either, and the same status.
    """
    above = np.clip(np.searchsorted(depth, cell), 1, len(depth) - 1)
    below = above - 1
    growth = np.log(found.spectral_radius)
    share = (cell - depth[below]) / (depth[above] - depth[below])
    between = (1.0 - share) * growth[below] + share * growth[above]
    nearer = np.where(share < 0.5, below, above)
    farther = below + above - nearer
    exact = depth[nearer] == cell
    # What was computed at a cell is its own, whatever its neighbour has.
    between = np.where(exact, growth[nearer], between)
    taken = np.where(exact | ((growth[nearer] > 0.0) == (between > 0.0)), nearer, farther)
    cells = Stability(**{f.name: getattr(found, f.name)[taken] for f in fields(Stability)})
    angle = np.exp(1j * np.angle(cells.multiplier))
    failed = np.maximum(found.status[below], found.status[above])
    status = np.where(exact, found.status[nearer], np.where(failed > STATUS["ok"], failed, STATUS["interpolated"]))
    radius = np.exp(between)
    result = replace(cells, spectral_radius=radius, multiplier=radius * angle, status=status.astype(np.uint8))
    lost = np.flatnonzero(np.isin(status, FAILED))
    result.overwrite(lost, replace(without_result(len(lost), found.mode_share.shape[1]), status=result.status[lost]))
    return result
