"""The whole chain at one operating point, readable or as JSON."""

import json
import math
from typing import Any

import numpy as np

from chatter_core.chain import Structure, milling_equation, structure
from chatter_core.errors import InvalidInput
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import evaluate_to_tolerance, lobe_block
from chatter_core.machine import Machine
from chatter_core.stability import TOO_SLOW
from chatter_core.stages import Stages, stages_of
from chatter_core.tip import AXES, most_modes
from chatter_core.units import si_factor
from chatter_core.variables import BIFURCATION, STATUS
from pipeline.answer_folder import write_text
from pipeline.configuration import compose_settings, modal_parameters_of, words_for
from pipeline.errors import told_where
from pipeline.idle_effects import remark_idle
from pipeline.locking import make_folder
from pipeline.modes import modes_called
from pipeline.telling import complain, fact, say, wrote
from pipeline.verbs.studies import PointOptions

#: The part of the grid down to which limit depths are looked for.
DEPTHS = "grid.axial_depth_mm"
#: Modes kept on each axis of a spindle unless told otherwise.
USUAL_MODES = 4


def run(words: list[str]) -> int:
    """Answer one operating point; return the exit code."""
    sorted_words = words_for(PointOptions, words)
    _check_grid(sorted_words.values)
    options = PointOptions.read(sorted_words.options)
    if "base" in sorted_words.options:
        beside = [f"{key}={said}" for key, said in sorted_words.options.items() if key == "modal_parameters"]
        options = options.model_copy(update={"modal_parameters": modal_parameters_of(options.base, beside)})
    settings = compose_settings(sorted_words)
    machine, depths_mm = settings.machine, settings.grid.axial_depth_mm.points()
    if options.preload_n is not None:
        if machine.spindle is None:
            raise InvalidInput(["preload_n: not allowed for a machine of measured tip modes, which knows no preload"])
        if sorted_words.say_the_preload:
            raise InvalidInput(["preload_n: says the same as spindle.preload_n; say one of the two"])
        machine = machine.with_preload(options.preload_n)
    if options.output is not None:
        make_folder(options.output)
    at_rest, modes = options.modal_parameters == "static", _modes_kept(machine, options)
    remark_idle(settings.effects, at_rest=at_rest, modes=modes)
    with modes_called("modes"):
        answer = answer_point(settings.model(machine), options, settings.method, depths_mm)
    fact(**answer)
    say(_readable(answer, options, _searched(depths_mm, options, answer["status"])[-1]))
    if options.output is not None:
        file = options.output / "point.json"
        with told_where(file):
            write_text(file, json.dumps(answer, indent=2) + "\n")
        wrote([file])
    if answer["status"] != "ok":
        complain(f"no result at this point, status {answer['status']}: {answer['reason']}")
        return 1
    return 0


def _modes_kept(machine: Machine, options: PointOptions) -> int:
    """Return how many modes of an axis are kept: as many as are asked for, or as usual, or all that were measured."""
    return options.modes or (USUAL_MODES if machine.tip is None else most_modes(machine.tip))


def _check_grid(values: list[str]) -> None:
    """Raise InvalidInput for keys of the grid that say nothing here: of it the depths alone do."""
    keys = [word.partition("=")[0] for word in values]
    foreign = [key for key in keys if key.startswith("grid.") and not key.startswith(f"{DEPTHS}.") and key != DEPTHS]
    if foreign:
        own = "spindle_speed_rpm, preload_n, modes and modal_parameters are options of their own"
        raise InvalidInput([f"{key}: not for point, which takes {DEPTHS} alone; {own}" for key in foreign])


def answer_point(
    model: Machine | Stages, options: PointOptions, method: MethodSettings, depths_mm: np.ndarray
) -> dict[str, Any]:
    """Return what is known of an operating point, in the units of the keys.

    Limit depths are looked for down to the last of ``depths_mm``, or to a deeper one asked for that has a result.
    """
    stages = stages_of(model)
    machine = stages.machine
    speed = np.array([options.spindle_speed_rpm * si_factor("spindle_speed_rpm")])
    depth = np.array([options.axial_depth_mm * si_factor("axial_depth_mm")])
    count = _modes_kept(machine, options)
    built = structure(stages, speed, mode_count=count, modal_parameters=options.modal_parameters)
    stability, error = evaluate_to_tolerance(stages, built, depth, method)
    status = _name(STATUS, stability.status[0])
    block = lobe_block(
        stages,
        spindle_speed=speed,
        axial_depth=_searched(depths_mm, options, status) * si_factor("axial_depth_mm"),
        mode_count=count,
        modal_parameters=options.modal_parameters,
        method=method,
        cells="adaptive",
    )
    multiplier = complex(stability.multiplier[0])
    return {
        "bearings": _bearings(machine, built),
        "modes": _modes(built),
        "spectral_radius": _number(stability.spectral_radius[0]),
        "floquet_multiplier": [_number(multiplier.real), _number(multiplier.imag)],
        "bifurcation": _name(BIFURCATION, stability.bifurcation[0]),
        "chatter_frequency_hz": _number(stability.chatter_frequency[0] / si_factor("chatter_frequency_hz")),
        "limit_depths_mm": [
            float(f"{d / si_factor('depth_mm'):.6g}") for d in block.limit_depth[0] if math.isfinite(d)
        ],
        "limits_complete": bool(block.limits_complete[0]),
        "dominant_mode": int(stability.dominant_mode[0]) or None,
        "mode_shares": [_number(share) for share in stability.mode_share[0]],
        "method": method.name,
        "error_estimate": _number(error[0]),
        "status": status,
        "reason": _reason(stages, built, depth, status),
    }


def _searched(depths_mm: np.ndarray, options: PointOptions, status: str) -> np.ndarray:
    """Return depths (depth,) [mm] down to the one that is asked for: the boundary that it lies beyond is among them.

    One without a result would leave the search with nothing to hold on to, and is no part of it.
    """
    asked = [options.axial_depth_mm] if status == "ok" and options.axial_depth_mm > depths_mm[-1] else []
    return np.concatenate([depths_mm, asked])


def _reason(stages: Stages, built: Structure, depth: np.ndarray, status: str) -> str:
    """Return why a depth (1,) [m] has no result, and what to do; nothing where it has one."""
    if status == "ok":
        return ""
    if not built.solved[0]:
        return "the bearing has no equilibrium at this speed and preload; raise the preload or lower the speed"
    if status == "outside_validity":
        return TOO_SLOW
    forced_motion = milling_equation(stages, built, np.array([0]), depth).known
    if forced_motion is not None and not forced_motion[0]:
        return (
            "no motion that repeats with the revolution was found for these uneven teeth, as happens mostly far beyond "
            "the limit depth; try a smaller depth"
        )
    return "the Floquet analysis did not meet its tolerance; allow a larger method.tolerance"


def _bearings(machine: Machine, built: Structure) -> list[dict[str, float | None]]:
    if machine.spindle is None or built.bearing is None:
        return []
    state = built.bearing
    single = {
        "preload_n": _number(state.preload),
        "axial_load_n": _number(state.axial_load[0]),
        "inner_contact_angle_deg": _number(state.inner_contact_angle[0] / si_factor("angle_deg")),
        "outer_contact_angle_deg": _number(state.outer_contact_angle[0] / si_factor("angle_deg")),
        "radial_stiffness_n_um": _number(state.radial_stiffness[0] / si_factor("stiffness_n_um")),
        "axial_stiffness_n_um": _number(state.axial_stiffness[0] / si_factor("stiffness_n_um")),
        "centrifugal_force_n": _number(state.centrifugal_force[0]),
        "gyroscopic_moment_n_m": _number(state.gyroscopic_moment[0]),
    }
    return [{"position_mm": _number(seat.position / si_factor("x_mm")), **single} for seat in machine.spindle.bearings]


def _modes(built: Structure) -> list[dict[str, Any]]:
    modes = built.modes
    return [
        {
            "axis": AXES[modes.axis[i]],
            "natural_frequency_hz": _number(modes.natural_frequency[0, i] / si_factor("frequency_hz")),
            "damping_ratio": _number(modes.damping_ratio[0, i]),
            "modal_stiffness_n_um": _number(modes.modal_stiffness[0, i] / si_factor("stiffness_n_um")),
            "modal_mass_kg": _number(modes.modal_mass[0, i]),
        }
        for i in range(len(modes))
    ]


def _number(value: Any) -> float | None:
    """Return a plain number to ten digits, None for what is not known."""
    return float(f"{float(value):.10g}") if math.isfinite(value) else None


def _name(codes: dict[str, int], code: Any) -> str:
    return next(name for name, number in codes.items() if number == int(code))


def _limits(answer: dict[str, Any], deepest_mm: float) -> str:
    """Return limit depths in words, and what is known of others down to the deepest depth that was looked at."""
    found = ", ".join(f"{depth:.4g} mm" for depth in answer["limit_depths_mm"])
    if not answer["limits_complete"]:
        others = f"{found}, perhaps others" if found else "none found"
        return f"{others}: the search down to {deepest_mm:g} mm was not complete"
    stable = answer["spectral_radius"] < 1.0
    return found or (f"none down to {deepest_mm:g} mm" if stable else "shallower than all depths looked at")


def _readable(answer: dict[str, Any], options: PointOptions, deepest_mm: float) -> str:
    """Return the answer as text for a terminal; deepest_mm: down to which limit depths were looked for."""
    lines = [
        f"{options.spindle_speed_rpm:g} rpm, {options.axial_depth_mm:g} mm deep, {options.modal_parameters} parameters"
    ]
    if answer["bearings"]:
        lines += ["", "bearings (each single one)"]
        lines += [
            f"  at {b['position_mm']:g} mm: axial load {_show(b['axial_load_n'])} N, contact angles "
            f"{_show(b['inner_contact_angle_deg'])} deg inner, {_show(b['outer_contact_angle_deg'])} deg outer, "
            f"stiffness {_show(b['radial_stiffness_n_um'])} N/um radial, {_show(b['axial_stiffness_n_um'])} N/um axial"
            for b in answer["bearings"]
        ]
    lines += ["", "modes at the tool tip", "  axis   frequency Hz   damping ratio   stiffness N/um      mass kg"]
    lines += [
        f"  {m['axis']:4} {_show(m['natural_frequency_hz']):>14} {_show(m['damping_ratio']):>15} "
        f"{_show(m['modal_stiffness_n_um']):>16} {_show(m['modal_mass_kg']):>12}"
        for m in answer["modes"]
    ]
    if answer["status"] == "ok":
        verdict = "stable" if answer["spectral_radius"] < 1.0 else "chatter"
        lines += [
            "",
            f"{verdict}: spectral radius {answer['spectral_radius']:.6g} (error about {answer['error_estimate']:.1e}), "
            f"{answer['bifurcation']}",
            f"chatter frequency {answer['chatter_frequency_hz']:.5g} Hz, dominant mode {answer['dominant_mode']}",
            f"limit depths at this speed: {_limits(answer, deepest_mm)}",
        ]
    return "\n".join(lines)


def _show(value: float | None) -> str:
    return "-" if value is None else f"{value:.4g}"
