"""Stability lobes: the spectral radius over speed and depth, and the depths where it is one.

Sources: T. Insperger, G. Stepan, Semi-Discretization for Time-Delay Systems (Springer 2011),
chapter 5 (multipliers, kinds of stability loss and chatter frequencies in milling); T. R.
Chandrupatla, Adv. Eng. Softw. 28 (1997) 145-149 (the bracketing root finder, as in scipy).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

from chatter_core.chain import Structure, milling_equation, structure
from chatter_core.floquet import FloquetSolution, MethodSettings, analyse
from chatter_core.floquet.harmonics import square
from chatter_core.machine import Machine
from chatter_core.variables import BIFURCATION, STATUS

Array = NDArray[np.float64]

#: Crossings kept for each speed; stability is lost at the odd ones and regained at the even ones.
CROSSINGS = 8
#: Points analysed at once, at most; and the memory that they may take together [bytes].
BATCH = 64
BATCH_MEMORY = 64e6
#: Waves of the fastest mode in a tooth period beyond which a point is not analysed: a crawling spindle.
MOST_WAVES = 600.0
#: The same times the refinement of the resolution.
MOST_RESOLVED_WAVES = 1500.0
#: Limit depths are found to this [m].
DEPTH_TOLERANCE = 1e-7
#: Below the first depth asked for, the boundary is looked for down to this share of it.
SHALLOWEST = 1e-3
#: A finer look multiplies the resolution by this.
REFINEMENT_STEP = 1.5
#: Cells of a speed, those nearest to the boundary, of which the error is estimated.
ERROR_CELLS = 2
#: What collocation is compared with has this share of its tolerance, which settles its eigenvalues better.
STRICTER = 1e-2
#: What semi-discretization is compared with.
ERROR_REFERENCE = MethodSettings(name="collocation", tolerance=1e-4)
#: Looks finer than the first before a point counts as not converged.
REFINEMENTS = 8
#: A multiplier counts as real when its imaginary part is below this share of its modulus.
REAL_TOLERANCE = 1e-9


@dataclass(frozen=True, kw_only=True)
class Stability:
    """Stability of operating points; every array is (point,), but for mode_share (point, mode).

    spectral_radius [-]; multiplier, the critical Floquet multiplier; chatter_frequency [rad/s],
    the strongest line of its branch at the tip; bifurcation, a value of variables.BIFURCATION;
    mode_share, the share of each mode of both axes in the energy of the critical motion; status,
    a value of variables.STATUS. Where the status is not ok, numbers are NaN and codes are 0.
    """

    spectral_radius: Array
    multiplier: NDArray[np.complex128]
    chatter_frequency: Array
    bifurcation: NDArray[np.int8]
    mode_share: Array
    status: NDArray[np.uint8]

    @property
    def dominant_mode(self) -> NDArray[np.int8]:
        """Number of the mode with the largest share, from 1; 0 where there is no result."""
        ok = self.status == STATUS["ok"]
        return np.where(ok, np.argmax(np.nan_to_num(self.mode_share), axis=-1) + 1, 0).astype(np.int8)


@dataclass(frozen=True, kw_only=True)
class LobeBlock:
    """Lobes of a block of speeds, named as in variables.SWEEP, in SI.

    Arrays over the grid are (speed, depth), limits are (speed, crossing) padded with NaN (codes
    with 0), error_estimate is (speed,).
    """

    spectral_radius: Array
    multiplier_angle: Array
    chatter_frequency: Array
    bifurcation: NDArray[np.int8]
    dominant_mode: NDArray[np.int8]
    dominant_mode_share: Array
    error_estimate: Array
    limit_depth: Array
    limit_chatter_frequency: Array
    limit_dominant_mode: NDArray[np.int8]
    limit_bifurcation: NDArray[np.int8]
    status: NDArray[np.uint8]


def lobe_block(
    machine: Machine,
    *,
    spindle_speed: Array,
    axial_depth: Array,
    mode_count: int,
    modal_parameters: str,
    method: MethodSettings,
    mode_selection: str = "up_to",
) -> LobeBlock:
    """Compute the lobes of a block of speeds (speed,) [rad/s] on a grid of depths (depth,) [m].

    The resolution is raised, speed by speed, until the spectral radius nearest to one changes by
    less than the method's tolerance; a speed for which that fails is marked not converged.
    Crossings are bracketed by the grid, so of two within one step of depth none is seen.

    Raises InvalidInput when the machine has fewer modes than ``mode_count``.

    See docs/physics.md#lobes.
    """
    built = structure(
        machine,
        spindle_speed,
        mode_count=mode_count,
        modal_parameters=modal_parameters,
        mode_selection=mode_selection,
    )
    grid, refinement, error = _resolved_grid(machine, built, axial_depth, method)
    limits, at_limit = _limit_depths(machine, built, axial_depth, grid, method, refinement)
    shape = (len(spindle_speed), len(axial_depth))
    ok = grid.status == STATUS["ok"]
    return LobeBlock(
        spectral_radius=grid.spectral_radius.reshape(shape),
        multiplier_angle=np.where(ok, np.angle(grid.multiplier), np.nan).reshape(shape),
        chatter_frequency=grid.chatter_frequency.reshape(shape),
        bifurcation=grid.bifurcation.reshape(shape),
        dominant_mode=grid.dominant_mode.reshape(shape),
        dominant_mode_share=grid.mode_share.max(axis=-1).reshape(shape),
        error_estimate=error,
        limit_depth=limits,
        limit_chatter_frequency=at_limit.chatter_frequency.reshape(limits.shape),
        limit_dominant_mode=at_limit.dominant_mode.reshape(limits.shape),
        limit_bifurcation=at_limit.bifurcation.reshape(limits.shape),
        status=grid.status.reshape(shape),
    )


def evaluate(
    machine: Machine,
    built: Structure,
    speed_index: NDArray[np.intp],
    axial_depth: Array,
    method: MethodSettings,
    refinement: Array,
) -> Stability:
    """Evaluate operating points: speed_index (point,) into the structure, axial_depth (point,) [m].

    refinement: (point,), multiplies the method's resolution.

    See docs/physics.md#lobes.
    """
    modes = int(built.modes.label.max())
    result = _empty(len(axial_depth), modes)
    waves = _waves(machine, built)[speed_index]
    possible = built.solved[speed_index] & (waves <= MOST_WAVES)
    result.status[~possible] = STATUS["outside_validity"]
    resolved = waves * refinement
    result.status[possible & (resolved > MOST_RESOLVED_WAVES)] = STATUS["not_converged"]
    candidates = np.flatnonzero(possible & (resolved <= MOST_RESOLVED_WAVES))
    # Points of like resolution together: a batch is as fine as its finest point.
    candidates = candidates[np.argsort(resolved[candidates], kind="stable")]
    for points in _batches(candidates, resolved[candidates], method):
        equation = milling_equation(machine, built, speed_index[points], axial_depth[points])
        solution = analyse(equation, method, refinement[points])
        _fill(result, points, built, speed_index[points], solution)
    return result


def evaluate_to_tolerance(
    machine: Machine, built: Structure, axial_depth: Array, method: MethodSettings
) -> tuple[Stability, Array]:
    """Evaluate one depth (speed,) [m] at each speed of a structure, to the method's tolerance.

    Returns the stability and the estimated relative error of the spectral radius (speed,).

    See docs/physics.md#lobes.
    """
    results, errors = [], []
    for speed, depth in enumerate(axial_depth):
        one = replace(
            built,
            spindle_speed=built.spindle_speed[[speed]],
            modes=built.modes.at(np.array([speed])),
            solved=built.solved[[speed]],
        )
        stability, _, error = _resolved_grid(machine, one, np.array([depth]), method)
        results.append(stability)
        errors.append(error)
    joined = {f.name: np.concatenate([getattr(r, f.name) for r in results]) for f in fields(Stability)}
    return Stability(**joined), np.concatenate(errors)


def _waves(machine: Machine, built: Structure) -> Array:
    """Return the waves of the fastest mode in a tooth period (speed,); NaN where nothing is known."""
    with np.errstate(divide="ignore"):
        period = 2.0 * np.pi / (machine.tool.teeth * built.spindle_speed)
    return np.asarray(built.modes.natural_frequency.max(axis=1) * period / (2.0 * np.pi))


def _batches(candidates: NDArray[np.intp], waves: Array, method: MethodSettings) -> Iterator[NDArray[np.intp]]:
    """Yield points in batches that fit the memory; ``waves`` ascend.

    The harmonics of the force take harmonics times samples, both in proportion to the waves; the
    maps of the elements or intervals take their number times some 20 kB.
    """
    first = 0
    while first < len(candidates):
        last = min(first + BATCH, len(candidates))
        most = waves[last - 1]
        memory = 720.0 * most**2 + 24e3 * (most + 1.0) + 24e3 * (method.intervals or 0)
        last = max(first + 1, min(last, first + int(BATCH_MEMORY / memory)))
        yield candidates[first:last]
        first = last


def _empty(points: int, modes: int) -> Stability:
    return Stability(
        spectral_radius=np.full(points, np.nan),
        multiplier=np.full(points, np.nan, dtype=complex),
        chatter_frequency=np.full(points, np.nan),
        bifurcation=np.zeros(points, dtype=np.int8),
        mode_share=np.full((points, modes), np.nan),
        status=np.zeros(points, dtype=np.uint8),
    )


def _fill(
    result: Stability, points: NDArray[np.intp], built: Structure, speed: NDArray[np.intp], solution: FloquetSolution
) -> None:
    """Write what a solution says of its points into the result."""
    result.status[points] = np.where(solution.converged, STATUS["ok"], STATUS["not_converged"])
    good = np.flatnonzero(solution.converged)
    points = points[good]
    multiplier = solution.multiplier[good]
    result.multiplier[points] = multiplier
    result.spectral_radius[points] = np.abs(multiplier)
    result.bifurcation[points] = _bifurcation(multiplier)
    strongest = square(solution.output[good]).sum(axis=-1).argmax(axis=-1)
    result.chatter_frequency[points] = np.abs(solution.exponent[good, strongest].imag)
    result.mode_share[points] = _mode_share(built, speed[good], solution.exponent[good], solution.state[good])


def _bifurcation(multiplier: NDArray[np.complex128]) -> NDArray[np.int8]:
    real = np.abs(multiplier.imag) <= REAL_TOLERANCE * np.abs(multiplier)
    kind = np.where(multiplier.real < 0.0, BIFURCATION["flip"], BIFURCATION["fold"])
    return np.where(real, kind, BIFURCATION["hopf"]).astype(np.int8)


def _mode_share(
    built: Structure, speed: NDArray[np.intp], exponent: NDArray[np.complex128], state: NDArray[np.complex128]
) -> Array:
    """Return each mode's share of kinetic and potential energy, summed over harmonics and axes (point, mode)."""
    modes = built.modes
    displacement = square(state[..., : len(modes)])
    kinetic = (square(exponent)[:, None, :] @ displacement)[:, 0]
    potential = modes.natural_frequency[speed] ** 2 * displacement.sum(axis=1)
    energy = modes.modal_mass[speed] * (kinetic + potential)
    labels = np.arange(1, int(modes.label.max()) + 1)
    share = energy @ (modes.label[:, None] == labels).astype(float)
    total = share.sum(axis=-1, keepdims=True)
    # A cut so light that its forces vanish in rounding moves no mode: nobody has a share then.
    return np.asarray(np.divide(share, total, out=np.full_like(share, np.nan), where=total > 0.0))


def _resolved_grid(
    machine: Machine, built: Structure, axial_depth: Array, method: MethodSettings
) -> tuple[Stability, Array, Array]:
    """Evaluate the grid at the resolution that the tolerance asks for.

    Returns the results (speed x depth,), the refinement and the error estimate (speed,).
    """
    speeds, depths = len(built.spindle_speed), len(axial_depth)
    index = np.repeat(np.arange(speeds), depths)
    depth = np.tile(axial_depth, speeds)
    refinement, error = np.ones(speeds), np.full(speeds, np.nan)
    grid = evaluate(machine, built, index, depth, method, refinement[index])
    pending = np.flatnonzero(built.solved)
    for _ in range(REFINEMENTS):
        error[pending] = _error_near_boundary(machine, built, axial_depth, grid, method, refinement, pending)
        if method.tolerance is None:  # nothing to choose
            break
        pending = pending[~(error[pending] <= method.tolerance)]
        if not len(pending):
            break
        refinement[pending] *= REFINEMENT_STEP
        again = np.flatnonzero(np.isin(index, pending))
        _overwrite(grid, again, evaluate(machine, built, index[again], depth[again], method, refinement[index[again]]))
    else:
        unsettled = np.isin(index, pending) & (grid.status == STATUS["ok"])
        _overwrite(grid, np.flatnonzero(unsettled), _not_converged(int(unsettled.sum()), grid.mode_share.shape[1]))
    return grid, refinement, error


def _not_converged(points: int, modes: int) -> Stability:
    result = _empty(points, modes)
    result.status[:] = STATUS["not_converged"]
    return result


def _error_near_boundary(
    machine: Machine,
    built: Structure,
    axial_depth: Array,
    grid: Stability,
    method: MethodSettings,
    refinement: Array,
    speeds: NDArray[np.intp],
) -> Array:
    """Estimate the relative error of the spectral radius nearest to one at some speeds.

    It is the larger of those of the two cells nearest to one. Collocation is compared with itself on
    a finer mesh, with eigenvalues that are better settled; semi-discretization with collocation,
    because with its own doubled intervals it can agree on a wrong branch.
    """
    shape = (len(built.spindle_speed), len(axial_depth))
    radius = grid.spectral_radius.reshape(shape)[speeds]
    distance = np.nan_to_num(np.abs(np.log(radius)), nan=np.inf)
    nearest = np.argsort(distance, axis=1, kind="stable")[:, :ERROR_CELLS]
    rows = np.repeat(speeds, nearest.shape[1])
    finer = ERROR_REFERENCE
    if method.tolerance is not None:
        finer = method.model_copy(update={"tolerance": STRICTER * method.tolerance})
    fine = evaluate(machine, built, rows, axial_depth[nearest.ravel()], finer, REFINEMENT_STEP * refinement[rows])
    error = np.abs(np.take_along_axis(radius, nearest, axis=1) / fine.spectral_radius.reshape(nearest.shape) - 1.0)
    return np.asarray(error.max(axis=1))


def _overwrite(result: Stability, points: NDArray[np.intp], new: Stability) -> None:
    for field in fields(result):
        getattr(result, field.name)[points] = getattr(new, field.name)


def _limit_depths(
    machine: Machine, built: Structure, axial_depth: Array, grid: Stability, method: MethodSettings, refinement: Array
) -> tuple[Array, Stability]:
    """Find every depth (speed, crossing) [m] where the spectral radius is one, and the stability there."""
    speeds = len(built.spindle_speed)
    limits = np.full((speeds, CROSSINGS), np.nan)
    speed, slot, lower, upper = _brackets(machine, built, axial_depth, grid, method, refinement)

    def log_radius(depth: Array, index: Array) -> Array:
        which = index.astype(np.intp)
        return np.log(evaluate(machine, built, which, depth, method, refinement[which]).spectral_radius)

    if len(speed):
        root = elementwise.find_root(
            log_radius, (lower, upper), args=(speed.astype(float),), tolerances={"xatol": DEPTH_TOLERANCE}
        )
        limits[speed, slot] = np.where(root.success, root.x, np.nan)
    index = np.repeat(np.arange(speeds), CROSSINGS)
    at_limit = _empty(limits.size, grid.mode_share.shape[1])
    found = np.flatnonzero(np.isfinite(limits.ravel()))
    if len(found):
        _overwrite(
            at_limit,
            found,
            evaluate(machine, built, index[found], limits.ravel()[found], method, refinement[index[found]]),
        )
    return limits, at_limit


def _brackets(
    machine: Machine, built: Structure, axial_depth: Array, grid: Stability, method: MethodSettings, refinement: Array
) -> tuple[NDArray[np.intp], NDArray[np.intp], Array, Array]:
    """Return speed index, crossing slot, and the depths below and above each change of sign."""
    speeds = np.arange(len(built.spindle_speed))
    shallow = np.full(len(speeds), SHALLOWEST * axial_depth[0])
    first = evaluate(machine, built, speeds, shallow, method, refinement).spectral_radius
    radius = np.concatenate([first[:, None], grid.spectral_radius.reshape(len(speeds), -1)], axis=1)
    depth = np.concatenate([shallow[:1], axial_depth])
    unstable = radius > 1.0
    # Beyond a cell without a result nobody knows whether stability is lost or regained.
    known = np.logical_and.accumulate(np.isfinite(radius), axis=1)
    speed, step = np.nonzero((unstable[:, 1:] != unstable[:, :-1]) & known[:, 1:])
    slot = np.arange(len(speed)) - np.searchsorted(speed, speed)
    kept = slot < CROSSINGS
    return speed[kept], slot[kept], depth[step[kept]], depth[step[kept] + 1]
