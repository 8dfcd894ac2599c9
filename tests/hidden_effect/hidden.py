"""What a machine may hide, and the laws by which it acts.

Every field is zero, or empty, where nothing is hidden. The laws are not those that one would fit: they
saturate, lag, act by halves or through another part than the textbook's.
"""

import math
from dataclasses import dataclass

from tests.hidden_effect.machine import Machine

#: Speed that speed laws are written in [rad/s]: 10 000 rpm.
UNIT_SPEED = 10000.0 * math.pi / 30.0


@dataclass(frozen=True, kw_only=True)
class ForeignMode:
    """A mode of the workpiece or its fixture."""

    axis: int
    frequency_hz: float
    damping_ratio: float
    mass_kg: float


@dataclass(frozen=True, kw_only=True)
class Hidden:
    """True parameters of all effects; which of them are on is seen by what is not zero."""

    # Structure.
    gyroscopic: float = 0.0  # share of the shaft's gyroscopic moment that acts
    thermal_rise: float = 0.0  # of the preload at UNIT_SPEED, were there no saturation
    thermal_saturation: float = 3.0  # rise that is never exceeded
    thermal_lag_trials: float = 0.0  # trials after which 63 % of a change has come
    ring_growth: float = 0.0  # times the free ring's
    front_seat_m_n: float = 0.0  # compliance of the housing at the first seat
    rear_seat_m_n: float = 0.0
    front_seat_y_m_n: float = 0.0  # compliance of the first seat in y alone
    rear_seat_y_share: float = 1.0  # the same of the others, over it
    y_turn_rad: float = 0.0  # from y towards x, of the direction in which they give so
    joint_border: int = 0  # number of the section before the joint
    joint_lateral_m_n: float = 0.0  # compliances of the joint at any speed
    joint_rotational_rad_nm: float = 0.0
    drawbar_rotational_rad_nm: float = 0.0  # compliance that the joint gains up to UNIT_SPEED
    damping_rise: float = 0.0  # of all damping, approached at high speed
    damping_half_rpm: float = 9000.0  # speed of half the rise
    foreign_modes: tuple[ForeignMode, ...] = ()
    # Cutting.
    ploughing_n_m: float = 0.0  # slope of the indentation force, over depth and v'/v, while the flank presses
    ploughing_slope: float = 0.05  # slope of the wave at which half of the indentation is lost
    speed_softening: float = 0.0  # share of the force that is lost to cutting speed
    softening_speed_m_min: float = 150.0
    size_effect: float = 0.0  # relative rise of the force at vanishing chip
    size_chip_m: float = 2e-5
    runout_m: float = 0.0  # amplitude of the teeth's radii
    runout_phase: float = 0.0
    pitch_errors_deg: tuple[float, ...] = ()
    immersion_offset: float = 0.0  # on radial depth over diameter
    immersion_per_depth_1_m: float = 0.0  # loss by deflection, in proportion to axial depth
    # In nobody's library.
    wear_per_trial: float = 0.0  # of the cutting force
    clamp_per_trial: float = 0.0  # of the shaft's bending stiffness lost at the joint
    clamp_rad_nm: float = 0.0
    warm_up: float = 0.0  # of the preload, approached with the trials
    warm_up_trials: float = 40.0
    ripple: float = 0.0  # relative amplitude of the spindle's speed
    ripple_per_revolution: float = 0.25
    damping_loss: float = 0.0  # share of the damping lost at large amplitude
    damping_loss_m: float = 5e-6  # amplitude at which half of it is lost


def thermal_target(hidden: Hidden, speed: float) -> float:
    """Return the factor on preload that a running speed [rad/s] ends at: power 1.7, saturating."""
    wanted = hidden.thermal_rise * (speed / UNIT_SPEED) ** 1.7
    return 1.0 + wanted / (1.0 + wanted / hidden.thermal_saturation)


def thermal_history(hidden: Hidden, speeds: list[float]) -> list[float]:
    """Return the factor on preload of every trial, in their order, with the lag of the heat."""
    factor, history = 1.0, []
    follow = 1.0 if hidden.thermal_lag_trials == 0.0 else 1.0 - math.exp(-1.0 / hidden.thermal_lag_trials)
    for order, speed in enumerate(speeds):
        factor += follow * (thermal_target(hidden, speed) - factor)
        warm = 1.0 + hidden.warm_up * (1.0 - math.exp(-order / hidden.warm_up_trials))
        history.append(factor * warm)
    return history


def ring_growth(hidden: Hidden, machine: Machine, speed: float) -> float:
    """Return the growth of the inner ring's radius [m]: a thin ring under its own weight, u = rho w^2 r^3 / E."""
    bearing = machine.bearing
    radius = 0.5 * (bearing.pitch_diameter_m - bearing.ball_diameter_m)
    return hidden.ring_growth * bearing.ring.density_kg_m3 * speed**2 * radius**3 / bearing.ring.modulus_pa


def joint_compliances(hidden: Hidden, speed: float, order: int) -> tuple[float, float]:
    """Return lateral [m/N] and rotational [rad/(N m)] compliance of the joint.

    A drawbar holds until a quarter of UNIT_SPEED and then lets go with power 1.5; a clamp comes loose cut by cut.
    """
    gone = max(0.0, speed / UNIT_SPEED - 0.25) / 0.75
    rotational = hidden.joint_rotational_rad_nm + hidden.drawbar_rotational_rad_nm * gone**1.5
    return hidden.joint_lateral_m_n, rotational + hidden.clamp_rad_nm * hidden.clamp_per_trial * order


def has_joint(hidden: Hidden) -> bool:
    """Return whether the shaft is parted at all."""
    compliances = (hidden.joint_lateral_m_n, hidden.joint_rotational_rad_nm)
    return any(compliances) or hidden.drawbar_rotational_rad_nm > 0.0 or hidden.clamp_rad_nm > 0.0


def damping_factor(hidden: Hidden, speed: float) -> float:
    """Return the factor on all damping at a speed [rad/s]: n^2 / (n^2 + half^2)."""
    half = hidden.damping_half_rpm * math.pi / 30.0
    return 1.0 + hidden.damping_rise * speed**2 / (speed**2 + half**2)


def force_factor(hidden: Hidden, machine: Machine, speed: float, order: int) -> float:
    """Return the factor on the cutting force: softening with cutting speed (exponential), wear with the trials.

    The softening is none at UNIT_SPEED, where the described coefficient belongs.
    """

    def softened(at: float) -> float:
        metres_per_minute = at * machine.tool.diameter_m / 2.0 * 60.0
        return 1.0 - hidden.speed_softening * (1.0 - math.exp(-metres_per_minute / hidden.softening_speed_m_min))

    return softened(speed) / softened(UNIT_SPEED) * (1.0 + hidden.wear_per_trial * order)


def true_immersion(hidden: Hidden, nominal: float, depth: float) -> float:
    """Return radial depth over diameter as it is cut at an axial depth [m]."""
    wanted = nominal + hidden.immersion_offset - hidden.immersion_per_depth_1_m * depth
    return min(max(wanted, 0.3 * nominal, 0.02), 1.0)
