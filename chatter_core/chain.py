"""The whole chain on one screen: bearing -> spindle -> tip -> cutting -> delay equation.

Each step hands a frozen value to the next, and knows only the value before it:

    Machine --bearing_speed, preload, ring_growth--> BearingState
    --seat_stiffness, seat_turn, joints, gyroscopic_speed--> TipModes
    --tip_modes, cut_modes, linear_system--> LinearSystem
    Machine --engagement, teeth, force_coefficients--> CuttingGain --regeneration--> DelayEquation

The arrows are the functions of ``Stages``. A machine in the place of stages means those of the base model.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core import cutting, floquet, spindle, tip
from chatter_core.bearing import BearingState, SpeedLaw, state_along
from chatter_core.contact import Contact, KnownForces, forced_contact
from chatter_core.errors import InvalidInput
from chatter_core.following import follow_modes, path_to
from chatter_core.machine import Machine
from chatter_core.reading import shown
from chatter_core.stages import Stages, seat_stiffness, seat_turn, stages_of
from chatter_core.variables import MODAL_PARAMETERS, STRUCTURE

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Structure:
    """Everything that depends on spindle speed and preload alone.

    spindle_speed: (speed,) [rad/s]; bearing: state of one bearing over speed, None for a machine
    of measured tip modes; modes: as the tip feels them; cut_modes: those that act in the cut; solved:
    (speed,) False where the bearing has no equilibrium, and every value there is NaN.
    """

    spindle_speed: Array
    bearing: BearingState | None
    modes: tip.TipModes
    cut_modes: tip.TipModes
    solved: NDArray[np.bool_]

    def at(self, speeds: NDArray[np.intp]) -> "Structure":
        """Return the structure at some of the speeds."""
        return Structure(
            spindle_speed=self.spindle_speed[speeds],
            bearing=None if self.bearing is None else self.bearing.at(speeds),
            modes=self.modes.at(speeds),
            cut_modes=self.cut_modes.at(speeds),
            solved=self.solved[speeds],
        )


def structure(
    model: Machine | Stages,
    spindle_speed: Array,
    *,
    mode_count: int,
    modal_parameters: str = "dynamic",
    mode_selection: str = "up_to",
) -> Structure:
    """Return bearing state and tip modes at every speed (speed,) [rad/s].

    ``mode_count`` is the number of modes kept on each axis, or with ``mode_selection`` ``only`` the
    number of the one mode that is kept alone. ``modal_parameters`` is ``dynamic`` (bearings at the
    spindle's speed) or ``static`` (bearings at standstill, whatever the speed).

    Raises InvalidInput when the machine has fewer modes than asked for, for a number of modes that is none, and for
    parameters that are neither.

    See docs/physics.md#tool-tip.
    """
    if modal_parameters not in MODAL_PARAMETERS:
        allowed = ", ".join(MODAL_PARAMETERS)
        raise InvalidInput([f"modal_parameters: found {shown(modal_parameters)}, allowed: {allowed}"])
    if not isinstance(mode_count, int | np.integer) or mode_count < 1:
        raise InvalidInput([f"mode_count: found {mode_count}, allowed: whole numbers from 1"])
    stages = stages_of(model)
    with stages.blaming():
        return _structure(stages, spindle_speed, mode_count, modal_parameters, mode_selection)


def _structure(
    stages: Stages, spindle_speed: Array, mode_count: int, modal_parameters: str, mode_selection: str
) -> Structure:
    machine, bearing = stages.machine, None
    solved = np.ones(len(spindle_speed), dtype=bool)
    if machine.tip is not None:
        measured, measured_at = machine.tip, stages.bearing_speed(spindle_speed, modal_parameters)
        modes = stages.tip_modes(
            lambda count: tip.measured_modes(measured, measured_at, count), spindle_speed, mode_count
        )
    else:
        path, place, states = _bearings(stages, spindle_speed, modal_parameters)
        spin = stages.gyroscopic_speed(spindle_speed)
        modes = stages.tip_modes(
            lambda count: _spindle_modes(stages, path, states, count, place, spin), spindle_speed, mode_count
        )
        bearing, solved = states.at(place), states.solved[place]
    if mode_selection == "only":
        modes = modes.alone(mode_count)
    return Structure(
        spindle_speed=spindle_speed,
        bearing=bearing,
        modes=modes,
        cut_modes=stages.cut_modes(modes, spindle_speed),
        solved=solved,
    )


def unsolved_structure(spindle_speed: Array, *, mode_count: int) -> Structure:
    """Return what ``structure`` does where the bearings have an equilibrium at none of the speeds (speed,) [rad/s].

    See docs/physics.md#tool-tip.
    """
    nothing = np.full((len(spindle_speed), 2 * mode_count), np.nan)
    modes = tip.TipModes(
        axis=np.repeat([0, 1], mode_count),
        label=np.tile(np.arange(1, mode_count + 1), 2),
        natural_frequency=nothing,
        damping_ratio=nothing,
        modal_mass=nothing,
        tracking_confidence=nothing,
    )
    solved = np.zeros(len(spindle_speed), dtype=bool)
    return Structure(spindle_speed=spindle_speed, bearing=None, modes=modes, cut_modes=modes, solved=solved)


def _bearings(
    stages: Stages, spindle_speed: Array, modal_parameters: str
) -> tuple[Array, NDArray[np.intp], BearingState]:
    """Return a path of speeds from standstill, the place of each speed on it, and the bearing's state along it."""
    machine = stages.machine
    assert machine.bearing is not None
    assert machine.spindle is not None
    rotor = machine.spindle
    law = SpeedLaw(
        ball_speed=lambda speed: stages.bearing_speed(speed, modal_parameters),
        preload=lambda speed: stages.preload(rotor, speed),
        ring_growth=lambda speed: stages.ring_growth(rotor, speed),
    )
    felt = law.felt(spindle_speed)
    for joint in stages.joints(rotor):
        loosens = joint.loosening(spindle_speed) != joint.loosening(np.zeros(1))
        felt = np.where(loosens, spindle_speed, felt)
    # Whoever exchanges what the seats make of the bearings may have it hang on the speed.
    if stages.seat_stiffness is not seat_stiffness or stages.seat_turn is not seat_turn:
        felt = spindle_speed
    path, place = path_to(felt)
    return path, place, state_along(machine.bearing, law, path, rotor.preload_type)


def _spindle_modes(
    stages: Stages, path: Array, states: BearingState, mode_count: int, place: NDArray[np.intp], spin: Array
) -> tip.TipModes:
    """Return the spindle's modes on both axes at places of a path of speeds, each followed from standstill.

    spin: (place,) [rad/s], at which gyroscopic moments act there.
    """
    described = stages.machine.spindle
    assert described is not None
    rotor = spindle.reduced(described, stages.joints(described))
    if mode_count > rotor.mode_count:
        raise InvalidInput(
            [f"mode_count: found {mode_count}, allowed at most {rotor.mode_count} for this spindle model"]
        )
    solved = np.flatnonzero(states.solved)
    seats = stages.seat_stiffness(described, states)[:, solved]
    in_x = _followed(rotor, seats[0], path[solved], mode_count)
    in_y = in_x if np.array_equal(*seats) else _followed(rotor, seats[1], path[solved], mode_count)
    (x, sure_of_x), (y, sure_of_y) = in_x, in_y
    columns = np.full((3, len(path), 2 * mode_count), np.nan)
    columns[0, solved] = np.hstack([x.natural_frequency, y.natural_frequency])
    columns[1, solved] = 1.0 / np.hstack([x.tip_deflection, y.tip_deflection]) ** 2
    columns[2, solved] = np.hstack([sure_of_x, sure_of_y])
    frequency, mass, confident = columns[:, place]
    coupling = None
    if spin.any():
        polar = np.full((len(path), mode_count, mode_count), np.nan)
        polar[solved] = spindle.modal_gyroscopic(rotor, x, y)
        coupling = tip.between_axes(polar[place] * spin[:, None, None])
    return tip.TipModes(
        axis=np.repeat([0, 1], mode_count),
        label=np.tile(np.arange(1, mode_count + 1), 2),
        natural_frequency=frequency,
        damping_ratio=spindle.damping_ratios(described.damping, frequency),
        modal_mass=mass,
        tracking_confidence=confident,
        gyroscopic=coupling,
        turn=_turned(stages.seat_turn(described, states)[place], mode_count),
    )


def _turned(turn: Array, mode_count: int) -> Array | None:
    """Return by how much modes of both axes are turned (speed, mode) [rad] where seats are (speed,); None for none."""
    return np.repeat(turn[:, None], 2 * mode_count, axis=1) if turn.any() else None


def _followed(
    rotor: spindle.ReducedRotor, seat_stiffness: Array, path: Array, mode_count: int
) -> tuple[spindle.RotorModes, Array]:
    """Return one plane's modes along a path of speeds, and how sure it is that they stay the same (speed, mode)."""
    modes = spindle.supported_modes(rotor, seat_stiffness, path)
    followed, confidence = follow_modes(path, modes.shape, mode_count)
    return modes.taken(followed), confidence


def milling_equation(
    model: Machine | Stages, structure: Structure, speed_index: NDArray[np.intp], axial_depth: Array
) -> floquet.DelayEquation:
    """Return the delay equation of the cut at operating points.

    speed_index: (point,) index into the structure's speeds; axial_depth: (point,) [m], positive.

    See docs/physics.md#delay-equation.
    """
    stages = stages_of(model)
    gain, system, system_index = _gain(stages, structure, speed_index, axial_depth)
    met = _as_moved(stages, gain, system, system_index) if _forces_a_motion(stages) else None
    cut = stages.regeneration(gain if met is None else replace(gain, passages=met.passages))
    return floquet.DelayEquation(
        system=system,
        system_index=system_index,
        feedback=cut.feedback,
        velocity_gain=cut.velocity_gain,
        period=cut.period,
        breakpoints=cut.breakpoints,
        known=None if met is None else met.found,
    )


def repeating_forces(
    stages: Stages, structure: Structure, speed_index: NDArray[np.intp], axial_depth: Array
) -> KnownForces | None:
    """Return the forces that repeat with the revolution at operating points, as ``milling_equation`` has these.

    For stages that hardly differ, to begin from. None where teeth take like chips, or no motion is found.

    See docs/physics.md#forced-motion.
    """
    if not _forces_a_motion(stages):
        return None
    met = _as_moved(stages, *_gain(stages, structure, speed_index, axial_depth))
    if not met.found.any():
        return None
    return KnownForces(
        spindle_speed=structure.spindle_speed[speed_index][met.found],
        axial_depth=axial_depth[met.found],
        force=met.force[met.found],
    )


def _gain(
    stages: Stages, structure: Structure, speed_index: NDArray[np.intp], axial_depth: Array
) -> tuple[cutting.CuttingGain, floquet.LinearSystem, NDArray[np.intp]]:
    """Return what cuts at operating points, the systems that it moves, and which of them moves there (point,)."""
    machine, speed = stages.machine, structure.spindle_speed[speed_index]
    gain = cutting.CuttingGain(
        axial_depth=axial_depth,
        spindle_speed=speed,
        tool=machine.tool,
        coefficients=stages.force_coefficients(machine, speed),
        passages=stages.passages,
    )
    used, system_index = np.unique(speed_index, return_inverse=True)
    return gain, stages.linear_system(structure.cut_modes.at(used), structure.spindle_speed[used]), system_index


def _forces_a_motion(stages: Stages) -> bool:
    """Return whether teeth are moved unlike, and that counts."""
    return stages.forced_motion and stages.teeth(stages.machine.tool).repeat > 1


def _as_moved(
    stages: Stages, gain: cutting.CuttingGain, system: floquet.LinearSystem, system_index: NDArray[np.intp]
) -> Contact:
    """Return who cuts what on the motion that the cut forces."""
    teeth, process = stages.teeth(stages.machine.tool), stages.machine.process
    arc, feed = stages.engagement(process), process.feed_per_tooth
    return forced_contact(gain, teeth, arc, feed, system, system_index, stages.known_forces)


def structure_variables(
    model: Machine | Stages, spindle_speed: Array, *, mode_count: int, modal_parameters: str = "dynamic"
) -> dict[str, Array]:
    """Return the structure as the variables of ``variables.STRUCTURE``, in SI.

    Arrays are (speed,), (speed, axis, mode) or (speed, mode); NaN where a machine of measured
    modes has no bearing, or an axis has no such mode.

    See docs/physics.md#tool-tip.
    """
    result = structure(model, spindle_speed, mode_count=mode_count, modal_parameters=modal_parameters)
    # An effect may have added modes beyond those that were asked for; the table has no row for them.
    kept = np.flatnonzero(result.modes.label <= mode_count)
    arrays: dict[str, Array] = {}
    for name, variable in STRUCTURE.items():
        trailing = variable.dims[3:]
        if not trailing:
            nothing = np.full(len(spindle_speed), np.nan)
            arrays[name] = nothing if result.bearing is None else getattr(result.bearing, name)
        elif trailing == ("axis", "mode"):
            table = np.full((len(spindle_speed), 2, mode_count), np.nan)
            table[:, result.modes.axis[kept], result.modes.label[kept] - 1] = getattr(result.modes, name)[:, kept]
            arrays[name] = table
        else:
            # One number for both axes: the less sure one.
            table = np.full((len(spindle_speed), 2, mode_count), np.nan)
            table[:, result.modes.axis[kept], result.modes.label[kept] - 1] = getattr(result.modes, name)[:, kept]
            arrays[name] = np.fmin(table[:, 0], table[:, 1])
    return arrays
