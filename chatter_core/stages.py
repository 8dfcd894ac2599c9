"""The arrows of the chain, each a function that can be exchanged.

``Stages`` holds a described machine and, in the order of the chain, the functions that lead from one value to
the next. Whoever wants another law for one of them (an effect, a nuisance, a fit) returns the stages with that
one wrapped or replaced; the chain asks nothing about it. The functions below are the base model's.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chatter_core import cutting, floquet, tip
from chatter_core.bearing import BearingState
from chatter_core.contact import KnownForces
from chatter_core.cutting import CuttingGain, ForceCoefficients
from chatter_core.errors import InvalidInput
from chatter_core.joint import Joint
from chatter_core.machine import Machine, Process, Spindle, Tool
from chatter_core.own_laws import blaming
from chatter_core.parameters import Array, Parameter
from chatter_core.reading import shown
from chatter_core.teeth import Engagement, Passages, Teeth, equal_teeth, passages
from chatter_core.tip import TipModes

ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.intp]
#: Number of modes kept on each axis -> the tip's modes, computed or measured.
KnownModes = Callable[[int], TipModes]


@dataclass(frozen=True, kw_only=True)
class Regeneration:
    """How the cut feeds back: delayed and velocity terms, period (point,) [s], breakpoints (point, n) [s]."""

    feedback: tuple[floquet.DelayedFeedback, ...]
    velocity_gain: tuple[floquet.Gain, ...]
    period: Array
    breakpoints: Array


def bearing_speed(spindle_speed: Array, modal_parameters: str) -> Array:
    """Return the speed (speed,) [rad/s] at which the balls' inertia acts: the spindle's, or none for ``static``.

    See docs/physics.md#static-and-dynamic-parameters.
    """
    return spindle_speed if modal_parameters == "dynamic" else np.zeros_like(spindle_speed)


def preload(spindle: Spindle, spindle_speed: Array) -> Array:
    """Return the axial preload on every single bearing (speed,) [N]: as set, whatever the speed.

    See docs/physics.md#preloaded-bearing.
    """
    return np.full_like(spindle_speed, spindle.preload)


def ring_growth(spindle: Spindle, spindle_speed: Array) -> Array:
    """Return what the inner rings' grooves have moved outwards by (speed,) [m]: nothing.

    See docs/physics.md#preloaded-bearing.
    """
    return np.zeros_like(spindle_speed)


def seat_stiffness(spindle: Spindle, state: BearingState) -> Array:
    """Return the radial stiffness of every seat (axis, speed, seat) [N/m]: bearings side by side, a rigid housing.

    Axes: x and y, as ``seat_turn`` turns them; here alike.

    See docs/physics.md#rotor.
    """
    counts = np.array([seat.count for seat in spindle.bearings])
    stiffness = state.radial_stiffness[:, None] * counts
    return np.stack([stiffness, stiffness])


def seat_turn(spindle: Spindle, state: BearingState) -> Array:
    """Return by which angle the seats' principal axes are turned from x and y, from x towards y (speed,) [rad]: none.

    See docs/physics.md#directional-asymmetry.
    """
    return np.zeros_like(state.radial_stiffness)


def joints(spindle: Spindle) -> tuple[Joint, ...]:
    """Return the joints of the rotor: none, it is of one piece.

    See docs/physics.md#rotor.
    """
    return ()


def gyroscopic_speed(spindle_speed: Array) -> Array:
    """Return the speed (speed,) [rad/s], from x towards y, at which the rotor's gyroscopic moments act: none.

    See docs/physics.md#rotor.
    """
    return np.zeros_like(spindle_speed)


def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
    """Return the modes at the tool tip over speed, as they are known.

    See docs/physics.md#tool-tip.
    """
    return known(mode_count)


def cut_modes(modes: TipModes, spindle_speed: Array) -> TipModes:
    """Return the modes that act in the cut: the tip's.

    See docs/physics.md#tool-tip.
    """
    return modes


def linear_system(modes: TipModes, spindle_speed: Array) -> floquet.LinearSystem:
    """Return A, B, C of the modes that act in the cut, one system for each speed.

    See docs/physics.md#delay-equation.
    """
    space = tip.state_space(modes)
    known = space.eigensystem
    return floquet.LinearSystem(
        state_matrix=space.state_matrix,
        input_matrix=space.input_matrix,
        output_matrix=space.output_matrix,
        known_spectrum=None
        if known is None
        else floquet.Spectrum(poles=known.poles, modes=known.eigenvectors, inverse=known.inverse),
    )


def teeth(tool: Tool) -> Teeth:
    """Return the teeth of a cutter: all alike.

    See docs/physics.md#teeth.
    """
    return equal_teeth(tool.teeth)


def force_coefficients(machine: Machine, spindle_speed: Array) -> ForceCoefficients:
    """Return the force coefficients at operating points (point,): the same at every speed.

    See docs/physics.md#cutting.
    """
    found = cutting.force_coefficients(machine.cutting, machine.tool)
    return ForceCoefficients(
        tangential=np.full_like(spindle_speed, found.tangential), radial=np.full_like(spindle_speed, found.radial)
    )


def regeneration(gain: CuttingGain) -> Regeneration:
    """Return the feedback of the cut: each tooth cuts what another left, at equal teeth a tooth period ago.

    See docs/physics.md#delay-equation.
    """
    return Regeneration(
        feedback=tuple(floquet.DelayedFeedback(gain=part, delay=delay) for part, delay in gain.by_delay()),
        velocity_gain=(),
        period=gain.period,
        breakpoints=gain.breakpoints(),
    )


#: Arrows before the cut: bearings, modes and receptances are computed anew when one of them changes.
OF_THE_STRUCTURE = (
    "bearing_speed",
    "preload",
    "ring_growth",
    "seat_stiffness",
    "seat_turn",
    "joints",
    "gyroscopic_speed",
    "tip_modes",
    "receptance",
    "cut_modes",
)


@dataclass(frozen=True, kw_only=True)
class Stages:
    """A machine and the arrows of its chain, in their order; each with the arguments of its default.

    forced_motion: whether teeth that take unlike chips are met on the motion that these force, or as if nothing moved;
    known_forces: that repeat in a machine that hardly differs, from which this one's are found; own_files: of the
    user's own laws among the arrows.
    """

    machine: Machine
    bearing_speed: Callable[[Array, str], Array] = bearing_speed
    preload: Callable[[Spindle, Array], Array] = preload
    ring_growth: Callable[[Spindle, Array], Array] = ring_growth
    seat_stiffness: Callable[[Spindle, BearingState], Array] = seat_stiffness
    seat_turn: Callable[[Spindle, BearingState], Array] = seat_turn
    joints: Callable[[Spindle], tuple[Joint, ...]] = joints
    gyroscopic_speed: Callable[[Array], Array] = gyroscopic_speed
    tip_modes: Callable[[KnownModes, Array, int], TipModes] = tip_modes
    receptance: Callable[[TipModes, Array], ComplexArray] = tip.receptance
    cut_modes: Callable[[TipModes, Array], TipModes] = cut_modes
    linear_system: Callable[[TipModes, Array], floquet.LinearSystem] = linear_system
    engagement: Callable[[Process], Engagement] = cutting.engagement
    teeth: Callable[[Tool], Teeth] = teeth
    force_coefficients: Callable[[Machine, Array], ForceCoefficients] = force_coefficients
    regeneration: Callable[[CuttingGain], Regeneration] = regeneration
    forced_motion: bool = True
    known_forces: KnownForces | None = None
    own_files: tuple[Path, ...] = ()

    def blaming(self) -> AbstractContextManager[None]:
        """Tell what goes wrong meanwhile as the doing of the user's own laws, where there are any."""
        return blaming(self.own_files)

    @cached_property
    def passages(self) -> Passages:
        """Which tooth cuts at which angles."""
        process = self.machine.process
        return passages(self.teeth(self.machine.tool), self.engagement(process), process.feed_per_tooth)


#: What stages have besides, and all arrows, in the order of the chain.
NO_ARROWS = ("machine", "forced_motion", "known_forces", "own_files")
ARROWS = tuple(field.name for field in fields(Stages) if field.name not in NO_ARROWS)


def stages_of(model: Machine | Stages) -> Stages:
    """Return the stages of a model: of a machine alone those of the base model.

    Raises InvalidInput for what is neither.

    See docs/physics.md#model-and-nuisances.
    """
    if isinstance(model, Machine):
        return Stages(machine=model)
    if not isinstance(model, Stages):
        raise InvalidInput([f"machine: found {shown(model)}, allowed: a machine, as read_machine(FILE) returns it"])
    return model


class Term(Protocol):
    """Something that may be true of a machine, with parameters of its own: a nuisance, or an effect."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Its parameters, in the order in which ``apply`` takes their values."""

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages as they are with these values (parameter,); at the nulls, as they were."""


def apply_terms(machine: Machine, terms: Sequence[Term], values: Array) -> Stages:
    """Return the stages of a machine as all terms make them, one after the other.

    values: (parameter,), those of the first term first.

    See docs/physics.md#model-and-nuisances.
    """
    stages, first = Stages(machine=machine), 0
    for term in terms:
        last = first + len(term.parameters)
        stages = term.apply(stages, values[first:last])
        first = last
    return stages
