"""The whole chain on one screen: bearing -> spindle -> tip -> cutting -> delay equation.

Each step hands a frozen value to the next, and knows only the value before it:

    Machine --axisymmetric_state--> BearingState --supported_modes--> TipModes --state_space-->
    StateSpace --with CuttingGain--> DelayEquation --analyse--> FloquetSolution
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core import cutting, floquet, spindle, tip
from chatter_core.bearing import BearingState, axisymmetric_state
from chatter_core.errors import InvalidInput
from chatter_core.following import follow_modes, path_to
from chatter_core.machine import Machine, Spindle
from chatter_core.variables import STRUCTURE

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Structure:
    """Everything that depends on spindle speed and preload alone.

    spindle_speed: (speed,) [rad/s]; bearing: state of one bearing over speed, None for a machine
    of measured tip modes; modes: as the tip feels them; solved: (speed,) False where the bearing
    has no equilibrium, and every value there is NaN.
    """

    spindle_speed: Array
    bearing: BearingState | None
    modes: tip.TipModes
    solved: NDArray[np.bool_]


def structure(
    machine: Machine,
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

    Raises InvalidInput when the machine has fewer modes than asked for.

    See docs/physics.md#tool-tip.
    """
    bearing_speed = spindle_speed if modal_parameters == "dynamic" else np.zeros_like(spindle_speed)
    bearing, solved = None, np.ones(len(spindle_speed), dtype=bool)
    if machine.tip is not None:
        modes = tip.measured_modes(machine.tip, bearing_speed, mode_count)
    else:
        assert machine.bearing is not None
        assert machine.spindle is not None
        path, place = path_to(bearing_speed)
        states = axisymmetric_state(machine.bearing, machine.spindle.preload, path, machine.spindle.preload_type)
        modes = _spindle_modes(machine.spindle, path, states, mode_count).at(place)
        bearing, solved = states.at(place), states.solved[place]
    if mode_selection == "only":
        modes = modes.alone(mode_count)
    return Structure(spindle_speed=spindle_speed, bearing=bearing, modes=modes, solved=solved)


def _spindle_modes(described: Spindle, path: Array, states: BearingState, mode_count: int) -> tip.TipModes:
    """Return the spindle's modes on both axes along a path of speeds, each followed from standstill."""
    rotor = spindle.reduce_rotor(spindle.assemble(described))
    # As many shapes of the reduction as there are seats carry the rest of the rotor and are no modes.
    available = len(rotor.tip) - len(rotor.seat)
    if mode_count > available:
        raise InvalidInput([f"mode_count: found {mode_count}, allowed at most {available} for this spindle model"])
    counts = np.array([seat.count for seat in described.bearings])
    solved = np.flatnonzero(states.solved)
    modes = spindle.supported_modes(rotor, states.radial_stiffness[solved, None] * counts)
    followed, confidence = follow_modes(path[solved], modes.shape, mode_count)
    rows = np.arange(len(solved))[:, None]
    columns = np.full((3, len(path), mode_count), np.nan)
    columns[0, solved] = modes.natural_frequency[rows, followed]
    columns[1, solved] = 1.0 / modes.tip_deflection[rows, followed] ** 2
    columns[2, solved] = confidence
    frequency, mass, confident = np.concatenate([columns, columns], axis=-1)  # x and y alike
    return tip.TipModes(
        axis=np.repeat([0, 1], mode_count),
        label=np.tile(np.arange(1, mode_count + 1), 2),
        natural_frequency=frequency,
        damping_ratio=spindle.damping_ratios(described.damping, frequency),
        modal_mass=mass,
        tracking_confidence=confident,
    )


def milling_equation(
    machine: Machine, structure: Structure, speed_index: NDArray[np.intp], axial_depth: Array
) -> floquet.DelayEquation:
    """Return the delay equation of the cut at operating points.

    speed_index: (point,) index into the structure's speeds; axial_depth: (point,) [m], positive.

    See docs/physics.md#delay-equation.
    """
    gain = cutting.CuttingGain(
        axial_depth=axial_depth,
        spindle_speed=structure.spindle_speed[speed_index],
        tool=machine.tool,
        coefficients=cutting.force_coefficients(machine.cutting, machine.tool),
        engagement=cutting.engagement(machine.process),
    )
    used, system_index = np.unique(speed_index, return_inverse=True)
    space = tip.state_space(structure.modes.at(used))
    return floquet.DelayEquation(
        system=floquet.LinearSystem(
            state_matrix=space.state_matrix,
            input_matrix=space.input_matrix,
            output_matrix=space.output_matrix,
            known_spectrum=floquet.Spectrum(poles=space.poles, modes=space.eigenvectors, inverse=space.inverse),
        ),
        system_index=system_index,
        feedback=(floquet.DelayedFeedback(gain=gain, delay=gain.tooth_period),),
        period=gain.tooth_period,
        breakpoints=gain.breakpoints(),
    )


def structure_variables(
    machine: Machine, spindle_speed: Array, *, mode_count: int, modal_parameters: str = "dynamic"
) -> dict[str, Array]:
    """Return the structure as the variables of ``variables.STRUCTURE``, in SI.

    Arrays are (speed,), (speed, axis, mode) or (speed, mode); NaN where a machine of measured
    modes has no bearing, or an axis has no such mode.

    See docs/physics.md#tool-tip.
    """
    result = structure(machine, spindle_speed, mode_count=mode_count, modal_parameters=modal_parameters)
    arrays: dict[str, Array] = {}
    for name, variable in STRUCTURE.items():
        trailing = variable.dims[3:]
        if not trailing:
            nothing = np.full(len(spindle_speed), np.nan)
            arrays[name] = nothing if result.bearing is None else getattr(result.bearing, name)
        elif trailing == ("axis", "mode"):
            table = np.full((len(spindle_speed), 2, mode_count), np.nan)
            table[:, result.modes.axis, result.modes.label - 1] = getattr(result.modes, name)
            arrays[name] = table
        else:
            first = result.modes.axis == result.modes.axis[0]
            arrays[name] = getattr(result.modes, name)[:, first]
    return arrays
