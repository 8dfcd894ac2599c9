"""The five tables of a campaign, and what they hold once read: plain arrays in SI.

Speeds and frequencies are in rad/s, depths and displacements in m, forces in N. An array of words
holds the position of the word among the choices that stand beside it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.columns import Bounds, Column, Table, choices_of, column_like
from chatter_core.machine import Process, Spindle, TipMode
from chatter_core.tip import AXES
from chatter_core.units import si_factor

Array = NDArray[np.float64]
Codes = NDArray[np.int8]

#: Outcomes of a trial, from the quiet to the loud.
OUTCOMES = ("stable", "marginal", "chatter")
#: Kinds of milling that a trial may name.
DIRECTIONS = choices_of(Process.model_fields["direction"])

_RUNNING = Column(key="spindle_speed_rpm", doc="spindle speed", bounds=Bounds(ge=0.1, le=1e6))
_SPEED = column_like(TipMode, "spindle_speed", "spindle speed, 0 at standstill")
_STIFFNESS = Bounds(ge=1e-6, le=1e6)
_RECEPTANCE = Bounds(ge=-1e6, le=1e6)
_DEPTH = Bounds(ge=1e-6, le=1e4)

STABILITY = Table(
    file="stability.csv",
    doc="trial cuts: stable or chatter, and at which frequency",
    identity=("trial",),
    columns=(
        Column(key="trial", doc="number of the cut, in order of time", bounds=Bounds(ge=0, le=1e9), whole=True),
        _RUNNING,
        Column(key="axial_depth_mm", doc="axial depth of cut", bounds=_DEPTH),
        Column(key="outcome", doc="what the cut was judged to be", choices=OUTCOMES),
        Column(
            key="chatter_frequency_hz",
            doc="strongest line of the tip's motion once what repeats every tooth period or revolution is removed",
            bounds=Bounds(ge=0.1, le=1e6),
            optional=True,
        ),
        column_like(
            Spindle, "preload", "axial preload on every single bearing, where not the machine's", optional=True
        ),
        column_like(
            Process, "radial_immersion", "radial depth over tool diameter, where not the machine's", optional=True
        ),
        column_like(Process, "feed_per_tooth", "feed per tooth, where not the machine's", optional=True),
        column_like(Process, "direction", "kind of milling, where not the machine's", optional=True),
    ),
)
RECEPTANCE = Table(
    file="frf.csv",
    doc="receptance of the tool tip: displacement over force, exp(+i w t), taken before the trials",
    identity=("spindle_speed_rpm", "output_axis", "input_axis", "frequency_hz"),
    columns=(
        _SPEED,
        Column(key="frequency_hz", doc="frequency", bounds=Bounds(ge=0, le=1e6)),
        Column(key="output_axis", doc="direction of the displacement; x is the feed direction", choices=AXES),
        Column(key="input_axis", doc="direction of the force", choices=AXES),
        Column(key="real_um_n", doc="real part of the receptance", bounds=_RECEPTANCE),
        Column(key="imag_um_n", doc="imaginary part, negative at a resonance", bounds=_RECEPTANCE),
        column_like(Spindle, "preload", "axial preload that it was taken under: the machine's own", optional=True),
    ),
)
MODES = Table(
    file="modes.csv",
    doc="natural frequencies, at rest or running",
    identity=("spindle_speed_rpm", "mode"),
    columns=(
        _SPEED,
        Column(
            key="mode",
            doc="number of the mode, from 1 for the lowest; in x where x and y differ",
            bounds=Bounds(ge=1, le=1000),
            whole=True,
        ),
        column_like(TipMode, "natural_frequency", "natural frequency"),
        column_like(TipMode, "damping_ratio", "damping ratio, where it was identified", optional=True),
    ),
)
BEARING = Table(
    file="bearing.csv",
    doc="stiffness of a single bearing",
    identity=("spindle_speed_rpm", "preload_n"),
    columns=(
        _SPEED,
        column_like(Spindle, "preload", "axial preload on the bearing"),
        Column(key="radial_stiffness_n_um", doc="radial stiffness of the single bearing", bounds=_STIFFNESS),
        Column(
            key="axial_stiffness_n_um",
            doc="axial stiffness of the single bearing, where measured",
            bounds=_STIFFNESS,
            optional=True,
        ),
    ),
)
LIMITS = Table(
    file="limits.csv",
    doc="limiting depths, where lobes are known and not trials",
    identity=("spindle_speed_rpm",),
    columns=(
        _RUNNING,
        Column(key="limit_depth_mm", doc="axial depth at which chatter begins", bounds=_DEPTH),
        Column(key="uncertainty_mm", doc="standard uncertainty of that depth", bounds=Bounds(ge=1e-9, le=1e4)),
    ),
)
PLANNED = Table(
    file="trials",
    doc="cuts that are not judged yet",
    identity=("trial",),
    columns=tuple(column for column in STABILITY.columns if column.name not in ("outcome", "chatter_frequency")),
)
TABLES = (STABILITY, RECEPTANCE, MODES, BEARING, LIMITS)


@dataclass(frozen=True, kw_only=True)
class Trials:
    """Trial cuts in the order of time, all (trial,).

    trial: number; spindle_speed [rad/s]; axial_depth [m]; outcome: position in OUTCOMES;
    chatter_frequency [rad/s], NaN where not known. What differs from the machine's own, NaN or
    NO_WORD where it does not: preload [N], radial_immersion [-], feed_per_tooth [m], direction: position in
    DIRECTIONS. unknown: column -> cells, of columns that the program does not know.
    """

    trial: NDArray[np.int64]
    spindle_speed: Array
    axial_depth: Array
    outcome: Codes
    chatter_frequency: Array
    preload: Array
    radial_immersion: Array
    feed_per_tooth: Array
    direction: Codes
    unknown: dict[str, tuple[str, ...]]

    def __len__(self) -> int:
        return len(self.trial)

    def at(self, rows: NDArray[np.intp]) -> "Trials":
        """Return some of the trials."""
        numbers = {name: array[rows] for name, array in vars(self).items() if name != "unknown"}
        unknown = {key: tuple(cells[row] for row in rows) for key, cells in self.unknown.items()}
        return Trials(**numbers, unknown=unknown)


@dataclass(frozen=True, kw_only=True)
class Receptance:
    """A measured frequency response at the tool tip.

    source: file; spindle_speed [rad/s]; output_axis, input_axis: position in AXES; frequency
    [rad/s]: (line,), ascending; value [m/N]: (line,), displacement over force, exp(+i w t).
    """

    source: str
    spindle_speed: float
    output_axis: int
    input_axis: int
    frequency: Array
    value: NDArray[np.complex128]

    def __str__(self) -> str:
        rpm = self.spindle_speed / si_factor(_SPEED.key)
        return f"{AXES[self.output_axis]} over {AXES[self.input_axis]} at {rpm:.6g} rpm"

    @property
    def is_direct(self) -> bool:
        """Whether force and displacement are along one axis."""
        return self.output_axis == self.input_axis


def measuring_ranges(responses: Sequence[Receptance]) -> tuple[float, ...]:
    """Return the largest value that was measured along with each response [m/N], of which a share is noise.

    That of a direct response is its own. One across the axes may hold nothing but noise and what the sensors catch of
    the other axis: it has the geometric mean of both direct ones, at the nearest speed at which they were measured, or
    that of the only one. Where none was measured it has its own, by which noise alone would pass for a response.

    See docs/physics.md#likelihoods.
    """
    return tuple(_measuring_range(one, responses) for one in responses)


def _measuring_range(one: Receptance, responses: Sequence[Receptance]) -> float:
    beside = []
    for axis in () if one.is_direct else (one.output_axis, one.input_axis):
        direct = [other for other in responses if other.is_direct and other.output_axis == axis]
        beside += sorted(direct, key=lambda other: abs(other.spindle_speed - one.spindle_speed))[:1]
    largest = [float(np.abs(other.value).max()) for other in beside or [one]]
    return math.prod(largest) ** (1.0 / len(largest))


@dataclass(frozen=True, kw_only=True)
class Responses:
    """Receptances of one file.

    remarks: what is odd, left out or assumed; unknown_columns: file and name of the columns that the
    program does not know.
    """

    receptances: tuple[Receptance, ...]
    remarks: tuple[str, ...] = ()
    unknown_columns: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class NaturalFrequencies:
    """Natural frequencies, all (row,): spindle_speed, natural_frequency [rad/s]; mode; damping_ratio.

    damping_ratio is NaN where it was not identified.
    """

    spindle_speed: Array
    mode: NDArray[np.int64]
    natural_frequency: Array
    damping_ratio: Array


@dataclass(frozen=True, kw_only=True)
class BearingStiffness:
    """Stiffness of a single bearing, all (row,): spindle_speed [rad/s], preload [N], stiffnesses [N/m].

    axial_stiffness is NaN where it was not measured.
    """

    spindle_speed: Array
    preload: Array
    radial_stiffness: Array
    axial_stiffness: Array


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Limiting depths, all (row,): spindle_speed [rad/s], limit_depth and its standard uncertainty [m]."""

    spindle_speed: Array
    limit_depth: Array
    uncertainty: Array

    def __len__(self) -> int:
        return len(self.spindle_speed)

    def at(self, rows: NDArray[np.intp]) -> "Limits":
        """Return some of the rows."""
        return Limits(**{name: array[rows] for name, array in vars(self).items()})
