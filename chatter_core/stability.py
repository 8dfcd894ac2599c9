"""Stability of operating points: the critical multiplier, and what its motion says.

Source: T. Insperger, G. Stepan, Semi-Discretization for Time-Delay Systems (Springer 2011), chapter 5
(multipliers, kinds of stability loss and chatter frequencies in milling).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from chatter_core.chain import Structure, milling_equation, repeating_forces
from chatter_core.contact import KnownForces
from chatter_core.floquet import (
    DelayEquation,
    FloquetSolution,
    MethodSettings,
    analyse,
    analyse_leading,
    critical_multiplier,
    leading_multipliers,
)
from chatter_core.floquet.harmonics import square
from chatter_core.machine import Machine
from chatter_core.stages import Stages, stages_of
from chatter_core.variables import BIFURCATION, STATUS

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

#: Points analysed at once, at most; and the memory that they may take together [bytes].
BATCH = 256
BATCH_MEMORY = 64e6
#: What a point takes for each wave and each passage of a tooth in a period, and for each interval [bytes]:
#: the most that was measured, with velocities among the unknowns.
WAVE_MEMORY, INTERVAL_MEMORY = 46e3, 24e3
#: Waves of the fastest mode in a period of the cut beyond which a point is not analysed: a crawling spindle.
MOST_WAVES = 600.0
TOO_SLOW = "the spindle is so slow that the waves of its fastest mode in a tooth period cannot be resolved"
#: The same times the refinement of the resolution.
MOST_RESOLVED_WAVES = 1500.0
#: A multiplier counts as real when its imaginary part is below this share of its modulus.
REAL_TOLERANCE = 1e-9


@dataclass(frozen=True, kw_only=True)
class Stability:
    """Stability of operating points; every array is (point,), but for mode_share (point, mode).

    spectral_radius [-], per mean tooth period; multiplier, the critical Floquet multiplier, with this modulus
    and the angle of the equation's own period, a revolution where teeth differ; chatter_frequency [rad/s],
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

    def overwrite(self, points: NDArray[np.intp], new: "Stability") -> None:
        """Put new results in the place of some."""
        for field in fields(self):
            getattr(self, field.name)[points] = getattr(new, field.name)


def evaluate(
    model: Machine | Stages,
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
    result = without_result(len(axial_depth), int(built.cut_modes.label.max()))
    stages = stages_of(model)
    with stages.blaming():
        for points, equation in _equations(stages, built, speed_index, axial_depth, method, refinement, result.status):
            solution = analyse(equation, method, refinement[points])
            _fill(result, points, built, speed_index[points], solution, stages.passages.repeat)
    return result


def critical_multipliers(
    model: Machine | Stages,
    built: Structure,
    speed_index: NDArray[np.intp],
    axial_depth: Array,
    method: MethodSettings,
    refinement: Array,
) -> ComplexArray:
    """Return the critical multipliers (point,) alone, NaN where ``evaluate`` would have no result.

    See docs/physics.md#lobes.
    """
    result = np.full(len(axial_depth), np.nan, dtype=complex)
    stages = stages_of(model)
    with stages.blaming():
        for points, equation in _equations(stages, built, speed_index, axial_depth, method, refinement):
            critical = critical_multiplier(equation, method, refinement[points])
            growth = per_tooth(critical.value, stages.passages.repeat)
            result[points] = np.where(critical.converged, growth, np.nan)
    return result


def branches(
    stages: Stages,
    built: Structure,
    speed_index: NDArray[np.intp],
    axial_depth: Array,
    method: MethodSettings,
    count: int,
) -> tuple[Array, Array]:
    """Return ln|mu| and frequency [rad/s] of the motions of so many multipliers, (point, count) each.

    The largest comes first; both are NaN where there are fewer. A motion has lines at its frequency plus and minus
    every multiple of 2 pi over the period: the frequency is the one below half of that.

    See docs/physics.md#critical-multiplier.
    """
    growth, frequency = np.full((2, len(axial_depth), count), np.nan)
    with stages.blaming():
        for points, equation in _equations(stages, built, speed_index, axial_depth, method):
            found = leading_multipliers(equation, method, count)
            growth[points] = np.log(np.abs(per_tooth(found, stages.passages.repeat)))
            frequency[points] = np.abs(np.angle(found)) / equation.period[:, None]
    return growth, frequency


def motions(
    stages: Stages,
    built: Structure,
    speed_index: NDArray[np.intp],
    axial_depth: Array,
    method: MethodSettings,
    count: int,
) -> tuple[Array, Array]:
    """Return ln|mu| and chatter frequency [rad/s] of the motions of so many multipliers, (point, count) each.

    The largest comes first, as ``evaluate`` has it; both are NaN where there are fewer. A motion is heard at its
    strongest line.

    See docs/physics.md#critical-multiplier.
    """
    growth, frequency = np.full((2, len(axial_depth), count), np.nan)
    with stages.blaming():
        for points, equation in _equations(stages, built, speed_index, axial_depth, method):
            for which, motion in enumerate(analyse_leading(equation, method, count)):
                found = np.where(motion.converged, motion.multiplier, np.nan)
                growth[points, which] = np.log(np.abs(per_tooth(found, stages.passages.repeat)))
                frequency[points, which] = np.where(motion.converged, _strongest_line(motion), np.nan)
    return growth, frequency


def known_forces(
    stages: Stages, built: Structure, speed_index: NDArray[np.intp], axial_depth: Array
) -> KnownForces | None:
    """Return the forces that repeat at those operating points that ``evaluate`` analyses; None where there are none.

    See docs/physics.md#forced-motion.
    """
    count = len(axial_depth)
    with stages.blaming():
        points, _ = _candidates(stages, built, speed_index, np.ones(count), np.zeros(count, dtype=np.uint8))
        return repeating_forces(stages, built, speed_index[points], axial_depth[points]) if len(points) else None


def _equations(
    stages: Stages,
    built: Structure,
    speed_index: NDArray[np.intp],
    axial_depth: Array,
    method: MethodSettings,
    refinement: Array | None = None,
    status: NDArray[np.uint8] | None = None,
) -> Iterator[tuple[NDArray[np.intp], DelayEquation]]:
    """Yield batches of the points that can be analysed, and their equations; the others get their status (point,).

    refinement: (point,), none is 1.
    """
    count = len(axial_depth)
    refinement = np.ones(count) if refinement is None else refinement
    status = np.zeros(count, dtype=np.uint8) if status is None else status
    candidates, resolved = _candidates(stages, built, speed_index, refinement, status)
    for points in _batches(candidates, resolved + len(stages.passages), method):
        yield points, milling_equation(stages, built, speed_index[points], axial_depth[points])


def per_tooth(multiplier: ComplexArray, tooth_periods: int) -> ComplexArray:
    """Return multipliers of so many tooth periods with the modulus that they have in one; their angle stays.

    So growth is comparable whatever the teeth, and the boundary |mu| = 1 is where it was.

    See docs/physics.md#teeth.
    """
    if tooth_periods == 1:
        return multiplier
    modulus = np.abs(multiplier)
    return multiplier * np.where(modulus > 0.0, modulus, 1.0) ** (1.0 / tooth_periods - 1.0)


def without_result(points: int, modes: int, status: int = 0) -> Stability:
    """Return points without results, all of one status.

    See docs/physics.md#lobes.
    """
    return Stability(
        spectral_radius=np.full(points, np.nan),
        multiplier=np.full(points, np.nan, dtype=complex),
        chatter_frequency=np.full(points, np.nan),
        bifurcation=np.zeros(points, dtype=np.int8),
        mode_share=np.full((points, modes), np.nan),
        status=np.full(points, status, dtype=np.uint8),
    )


def _candidates(
    stages: Stages, built: Structure, speed_index: NDArray[np.intp], refinement: Array, status: NDArray[np.uint8]
) -> tuple[NDArray[np.intp], Array]:
    """Return the points that can be analysed and their waves, ascending; the others get their status.

    Points of like resolution stand together, for a batch is as fine as its finest point.
    """
    waves = _waves(stages, built)[speed_index]
    possible = built.solved[speed_index] & (waves <= MOST_WAVES)
    resolved = waves * refinement
    status[~possible] = STATUS["outside_validity"]
    status[possible & (resolved > MOST_RESOLVED_WAVES)] = STATUS["not_converged"]
    candidates = np.flatnonzero(possible & (resolved <= MOST_RESOLVED_WAVES))
    candidates = candidates[np.argsort(resolved[candidates], kind="stable")]
    return candidates, resolved[candidates]


def too_slow(stages: Stages, built: Structure) -> NDArray[np.bool_]:
    """Return at which speeds (speed,) nothing can be computed for TOO_SLOW, whatever the depth.

    See docs/physics.md#lobes.
    """
    return np.asarray(built.solved & (_waves(stages, built) > MOST_WAVES))


def _waves(stages: Stages, built: Structure) -> Array:
    """Return the waves of the fastest mode in the period of the cut (speed,); NaN where nothing is known."""
    with np.errstate(divide="ignore"):
        period = stages.passages.repeat * 2.0 * np.pi / (stages.passages.teeth * built.spindle_speed)
    return np.asarray(built.cut_modes.natural_frequency.max(axis=1) * period / (2.0 * np.pi))


def _batches(candidates: NDArray[np.intp], pieces: Array, method: MethodSettings) -> Iterator[NDArray[np.intp]]:
    """Yield points in batches that fit the memory; ``pieces``, waves and passages of a point, ascend.

    The maps of the elements or intervals, the Krylov space and the harmonics take memory in proportion
    to their number.
    """
    first = 0
    while first < len(candidates):
        last = min(first + BATCH, len(candidates))
        memory = WAVE_MEMORY * pieces[last - 1] + INTERVAL_MEMORY * (method.intervals or 0)
        last = max(first + 1, min(last, first + int(BATCH_MEMORY / memory)))
        yield candidates[first:last]
        first = last


def _fill(
    result: Stability,
    points: NDArray[np.intp],
    built: Structure,
    speed: NDArray[np.intp],
    solution: FloquetSolution,
    tooth_periods: int,
) -> None:
    """Write what a solution over so many tooth periods says of its points into the result."""
    result.status[points] = np.where(solution.converged, STATUS["ok"], STATUS["not_converged"])
    good = np.flatnonzero(solution.converged)
    points = points[good]
    multiplier = per_tooth(solution.multiplier[good], tooth_periods)
    result.multiplier[points] = multiplier
    result.spectral_radius[points] = np.abs(multiplier)
    result.bifurcation[points] = _bifurcation(multiplier)
    result.chatter_frequency[points] = _strongest_line(solution)[good]
    result.mode_share[points] = _mode_share(built, speed[good], solution.exponent[good], solution.state[good])


def _strongest_line(solution: FloquetSolution) -> Array:
    """Return the frequency of the strongest line of each motion (point,) [rad/s]."""
    strongest = square(solution.output).sum(axis=-1).argmax(axis=-1)
    return np.asarray(np.abs(solution.exponent[np.arange(len(strongest)), strongest].imag))


def _bifurcation(multiplier: NDArray[np.complex128]) -> NDArray[np.int8]:
    real = np.abs(multiplier.imag) <= REAL_TOLERANCE * np.abs(multiplier)
    kind = np.where(multiplier.real < 0.0, BIFURCATION["flip"], BIFURCATION["fold"])
    return np.where(real, kind, BIFURCATION["hopf"]).astype(np.int8)


def _mode_share(
    built: Structure, speed: NDArray[np.intp], exponent: NDArray[np.complex128], state: NDArray[np.complex128]
) -> Array:
    """Return each mode's share of kinetic and potential energy, summed over harmonics and axes (point, mode)."""
    modes = built.cut_modes
    displacement = square(state[..., : len(modes)])
    kinetic = (square(exponent)[:, None, :] @ displacement)[:, 0]
    potential = modes.natural_frequency[speed] ** 2 * displacement.sum(axis=1)
    energy = modes.modal_mass[speed] * (kinetic + potential)
    labels = np.arange(1, int(modes.label.max()) + 1)
    share = energy @ (modes.label[:, None] == labels).astype(float)
    total = share.sum(axis=-1, keepdims=True)
    # A cut so light that its forces vanish in rounding moves no mode: nobody has a share then.
    return np.asarray(np.divide(share, total, out=np.full_like(share, np.nan), where=total > 0.0))
