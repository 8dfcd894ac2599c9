"""The stages of the chain as values that can be exchanged, and what exchanges them.

A model is the described machine, with the stages that compute from it, seen through terms one after the
other: a nuisance changes the machine, an effect wraps or replaces a stage. Either brings its own parameters.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chatter_core import chain, stability, tip
from chatter_core.chain import Structure
from chatter_core.evidence.parameters import Array, Parameter
from chatter_core.floquet import MethodSettings
from chatter_core.machine import Machine
from chatter_core.stability import Stability

ComplexArray = NDArray[np.complex128]
Indices = NDArray[np.intp]


class StructureStage(Protocol):
    """Bearings and modes over speed, as ``chain.structure``."""

    def __call__(self, machine: Machine, spindle_speed: Array, *, mode_count: int) -> Structure:
        """Return the structure at speeds (speed,) [rad/s]."""


@dataclass(frozen=True, kw_only=True)
class Stages:
    """A machine and the functions that follow from it, each with the arguments of its default.

    structure: machine, speeds -> Structure; multipliers: operating points -> critical multipliers;
    stability: the same -> Stability; receptance: modes, frequencies -> receptance.
    """

    machine: Machine
    structure: StructureStage = chain.structure
    multipliers: Callable[[Machine, Structure, Indices, Array, MethodSettings, Array], ComplexArray] = (
        stability.critical_multipliers
    )
    stability: Callable[[Machine, Structure, Indices, Array, MethodSettings, Array], Stability] = stability.evaluate
    receptance: Callable[[tip.TipModes, Array], ComplexArray] = tip.receptance


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
