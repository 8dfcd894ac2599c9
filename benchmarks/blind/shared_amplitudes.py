"""Amplitudes that the hidden laws and the fitted ones share, so that an interval can hold the truth or miss it.

Left out are effects whose laws differ but in size: thermal preload, drawbar, damping and cutting coefficient over
speed, process damping, chip thickness (other functions); housing and asymmetry (one compliance for all seats against
one each, a ratio of stiffnesses against a compliance); an immersion that falls with depth.
"""

import cmath
import math
from typing import Any

Truth = dict[str, Any]

#: Speed at which laws of speed are stated [rad/s]: 10 000 rpm.
STATED_AT = 10000.0 * math.pi / 30.0
AXES, JOINTS = ("x", "y"), ("tool/holder", "holder/shaft")


def true_amplitudes(truth: Truth, settings: dict[str, Any]) -> dict[str, float]:
    """Return the true values of the parameters that the only hidden effect shares with the program, by their names.

    truth: truth.json; settings: of the fitted variant. One of another axis or joint shares nothing. Campaigns of the
    program's own model share everything.
    """
    (name,) = truth["effect_names"]
    if "parameters" in truth:
        first = f"{name}."
        own = {key.removeprefix(first): value for key, value in truth["parameters"].items() if key.startswith(first)}
        return own if truth["settings"][name] == settings else {}
    hidden, machine = truth["hidden"], truth["machine"]
    if name == "gyroscopic_coupling":
        return {"share": hidden["gyroscopic"]}
    if name == "ring_expansion":
        return {"growth_um": 1e6 * hidden["ring_growth"] * free_ring(machine["bearing"])}
    if name == "tool_runout":
        return {"runout_um": 2e6 * hidden["runout_m"]}
    # With more than three teeth the hidden pattern is another than those of the program.
    if name == "variable_pitch" and len(hidden["pitch_errors_deg"]) == 2:
        return {"variation": variation(hidden["pitch_errors_deg"])}
    if name == "variable_pitch" and len(hidden["pitch_errors_deg"]) == 3 and settings.get("pattern") == "sinusoidal":
        # Which tooth is called the first does not matter, so that the phase is any of three.
        return {"variation": cosine(hidden["pitch_errors_deg"])["variation"]}
    if name == "radial_immersion_error" and "immersion_offset" in hidden:
        offset = hidden["immersion_offset"]
        # Kept answers of earlier programs have it over the nominal immersion.
        return {"offset": offset, "error": offset / machine["process"]["radial_immersion"]}
    if name == "workpiece_mode":
        return workpiece(hidden["foreign_modes"][0], settings)
    if name == "holder_joint" and settings.get("joint") == JOINTS[hidden.get("joint_border", 0)]:
        return {
            "lateral_compliance_um_n": 1e6 * hidden["joint_lateral_m_n"],
            "rotational_compliance_urad_n_m": 1e6 * hidden["joint_rotational_rad_nm"],
        }
    return {}


def free_ring(bearing: Truth) -> float:
    """Return the growth of a free inner ring at STATED_AT [m], u = rho w^2 r^3 / E."""
    radius = 0.5 * (bearing["pitch_diameter_m"] - bearing["ball_diameter_m"])
    return float(bearing["ring"]["density_kg_m3"] * STATED_AT**2 * radius**3 / bearing["ring"]["modulus_pa"])


def variation(errors_deg: list[float]) -> float:
    """Return the widest pitch less the narrowest over the mean one, of teeth displaced by so much."""
    pitches = _pitches(errors_deg)
    return max(pitches) - min(pitches)


def cosine(errors_deg: list[float]) -> dict[str, float]:
    """Return variation and phase of the cosine once around that is in the pitches of teeth displaced by so much."""
    pitches = _pitches(errors_deg)
    angles = [2.0 * math.pi * tooth / len(pitches) for tooth in range(len(pitches))]
    harmonic = sum(pitch * cmath.exp(-1j * angle) for pitch, angle in zip(pitches, angles, strict=True)) / len(pitches)
    return {"variation": 4.0 * abs(harmonic), "phase_deg": math.degrees(cmath.phase(harmonic))}


def _pitches(errors_deg: list[float]) -> list[float]:
    """Return each tooth's pitch to the one ahead, over the mean one."""
    teeth = len(errors_deg)
    return [1.0 + (errors_deg[(one + 1) % teeth] - errors_deg[one]) * teeth / 360.0 for one in range(teeth)]


def workpiece(mode: Truth, settings: dict[str, Any]) -> dict[str, float]:
    """Return the parameters of a mode of the workpiece, none where settings say another axis."""
    if settings.get("axis") != AXES[mode["axis"]]:
        return {}
    stiffness = mode["mass_kg"] * (2.0 * math.pi * mode["frequency_hz"]) ** 2
    return {
        "compliance_um_n": 1e6 / stiffness,
        "natural_frequency_hz": mode["frequency_hz"],
        "damping_ratio": mode["damping_ratio"],
    }


def covered(truth: Truth, entry: dict[str, Any]) -> dict[str, bool]:
    """Return whether each shared amplitude's interval holds the truth; entry: the effect's own of the ranking."""
    (name,) = truth["effect_names"]
    true = true_amplitudes(truth, entry["settings"].get(name, {}))
    told = entry["parameters"]
    return {key: told[key]["low"] <= value <= told[key]["high"] for key, value in true.items() if key in told}
