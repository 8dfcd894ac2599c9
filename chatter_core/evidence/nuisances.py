"""What a data sheet and a sensor get wrong: every nuisance declared once, with prior and meaning.

A nuisance of the machine is the logarithm of a factor, 0 where the machine is as described. Which of them apply
follows from the machine and from what was measured.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from chatter_core.errors import InvalidInput
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.columns import bounds_of
from chatter_core.evidence.measured import OUTCOMES
from chatter_core.evidence.parameters import Array, Parameter, Touches
from chatter_core.machine import Description, Machine
from chatter_core.stages import Stages
from chatter_core.units import si_factor

D = TypeVar("D", bound=Description)

#: The fit keeps this far from the bounds of a described quantity: ln of a factor.
CLEARANCE = 1e-9
#: What the measured quantities' own errors look like where they are typical; their logarithms are fitted.
TYPICAL_MISLABELLED, TYPICAL_OUTCOME_WIDTH, TYPICAL_MARGINAL_WIDTH = 0.04, 0.06, 0.08
#: What errs in a response as a whole: name, unit, meaning, prior width; the model takes them in this order.
SENSOR = (
    ("gain", "ln", "factor of the sensor's gain", 0.03),
    ("phase", "rad", "phase that the sensor adds", 0.03),
    ("frequency", "ln", "factor of the frequency axis", 0.003),
)
#: Largest share of mislabelled trials: with more, labels say nothing.
MOST_MISLABELLED = 0.3


@dataclass(frozen=True, kw_only=True)
class Nuisance:
    """A described quantity that errs: ``change`` multiplies it in a machine by exp(value)."""

    parameter: Parameter
    change: Callable[[Machine, float], Machine]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The one parameter."""
        return (self.parameter,)

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages of the changed machine.

        Raises InvalidInput when a described quantity would leave its bounds.
        """
        (value,) = values
        # Left as it is at its null: exp and log would move its last digit.
        return replace(stages, machine=self.change(stages.machine, float(value))) if value else stages


def scaled(description: D, names: tuple[str, ...], logarithm: float) -> D:
    """Return a description with some attributes multiplied by exp(logarithm).

    Raises InvalidInput, with a sentence for each attribute that would leave the bounds of its key.

    See docs/physics.md#model-and-nuisances.
    """
    changed, problems = {}, []
    for name in names:
        field = type(description).model_fields[name]
        key, value = field.alias or name, getattr(description, name) * math.exp(logarithm)
        bounds, factor = bounds_of(field), si_factor(field.alias or name)
        if not bounds.inside(np.array([value / factor]))[0]:
            problems.append(
                f"{key}: a factor of {math.exp(logarithm):.6g} makes it {value / factor:g}, allowed {bounds}"
            )
        changed[name] = value
    if problems:
        raise InvalidInput(problems)
    return description.model_copy(update=changed)


def log_bounds(description: Description, names: tuple[str, ...]) -> tuple[float, float]:
    """Return between which logarithms of a factor all these attributes stay within the bounds of their keys.

    See docs/physics.md#model-and-nuisances.
    """
    lower, upper = -math.inf, math.inf
    for name in names:
        field = type(description).model_fields[name]
        bounds, value = bounds_of(field), getattr(description, name) / si_factor(field.alias or name)
        least = bounds.ge if bounds.ge is not None else bounds.gt
        most = bounds.le if bounds.le is not None else bounds.lt
        if least is not None and least > 0.0:
            lower = max(lower, math.log(least / value) + CLEARANCE)
        if most is not None:
            upper = min(upper, math.log(most / value) - CLEARANCE)
    return min(lower, 0.0), max(upper, 0.0)


def machine_nuisances(machine: Machine, preloads: Sequence[float] = ()) -> tuple[Nuisance, ...]:
    """Return the nuisances that apply to a machine: of its cut, and of its spindle or its measured modes.

    preloads: those [N] at which it was measured too; the factor of the preload keeps them all within their bounds.
    A quantity that is zero has no factor and no nuisance, nor has one whose bounds leave it no room.

    See docs/physics.md#model-and-nuisances.
    """
    others = [machine.with_preload(preload) for preload in preloads] if machine.spindle is not None else []
    found = []
    for row in _ROWS:
        parts = [part for one in (machine, *others) for part in row.scales(one) if part[1]]
        bounds = [log_bounds(*part) for part in parts]
        lower, upper = max((low for low, _ in bounds), default=0.0), min((high for _, high in bounds), default=0.0)
        if lower < upper:
            parameter = Parameter(
                name=row.name,
                unit="ln",
                doc=row.doc,
                prior_width=row.width,
                lower=lower,
                upper=upper,
                touches=row.touches,
            )
            found.append(Nuisance(parameter=parameter, change=row.change))
    return tuple(found)


@dataclass(frozen=True, kw_only=True)
class _Row:
    """Declaration of a nuisance: what it multiplies, (description, attributes) each, and how."""

    name: str
    doc: str
    width: float
    touches: Touches
    scales: Callable[[Machine], list[tuple[Description, tuple[str, ...]]]]
    change: Callable[[Machine, float], Machine]


def _cutting(name: str) -> Callable[[Machine], list[tuple[Description, tuple[str, ...]]]]:
    return lambda machine: [(machine.cutting, (name,) if getattr(machine.cutting, name) else ())]


def _change_cutting_energy(machine: Machine, value: float) -> Machine:
    return machine.model_copy(update={"cutting": scaled(machine.cutting, ("specific_cutting_energy",), value)})


def _change_kn(machine: Machine, value: float) -> Machine:
    return machine.model_copy(update={"cutting": scaled(machine.cutting, ("kn",), value)})


def _damping_keys(machine: Machine) -> tuple[str, ...]:
    """Return the attributes of the rotor's damping that are not zero."""
    assert machine.spindle is not None
    damping = machine.spindle.damping
    return tuple(n for n in ("mass_coefficient", "stiffness_coefficient", "ratio") if getattr(damping, n))


def _damping(machine: Machine) -> list[tuple[Description, tuple[str, ...]]]:
    if machine.spindle is None:
        return _tip_modes("damping_ratio")(machine)
    return [(machine.spindle.damping, _damping_keys(machine))]


def _change_damping(machine: Machine, value: float) -> Machine:
    if machine.spindle is None:
        return _changed_tip(machine, "damping_ratio", value)
    damping = scaled(machine.spindle.damping, _damping_keys(machine), value)
    return machine.model_copy(update={"spindle": machine.spindle.model_copy(update={"damping": damping})})


def _sections(machine: Machine) -> list[tuple[Description, tuple[str, ...]]]:
    sections = machine.spindle.sections if machine.spindle else ()
    return [(section, ("youngs_modulus",)) for section in sections]


def _change_shaft(machine: Machine, value: float) -> Machine:
    assert machine.spindle is not None
    sections = tuple(scaled(section, ("youngs_modulus",), value) for section in machine.spindle.sections)
    return machine.model_copy(update={"spindle": machine.spindle.model_copy(update={"sections": sections})})


def _preload(machine: Machine) -> list[tuple[Description, tuple[str, ...]]]:
    return [(machine.spindle, ("preload",))] if machine.spindle else []


def _change_preload(machine: Machine, value: float) -> Machine:
    assert machine.spindle is not None
    return machine.model_copy(update={"spindle": scaled(machine.spindle, ("preload",), value)})


def _tip_modes(name: str) -> Callable[[Machine], list[tuple[Description, tuple[str, ...]]]]:
    return lambda machine: [(mode, (name,)) for mode in (machine.tip.modes if machine.tip else ())]


def _changed_tip(machine: Machine, name: str, value: float) -> Machine:
    assert machine.tip is not None
    modes = tuple(scaled(mode, (name,), value) for mode in machine.tip.modes)
    return machine.model_copy(update={"tip": machine.tip.model_copy(update={"modes": modes})})


def _change_tip_frequency(machine: Machine, value: float) -> Machine:
    return _changed_tip(machine, "natural_frequency", value)


def _change_tip_stiffness(machine: Machine, value: float) -> Machine:
    return _changed_tip(machine, "stiffness", value)


_ROWS = (
    _Row(
        name="specific_cutting_energy",
        doc="factor of the specific cutting energy k_t",
        width=0.10,
        touches="cut",
        scales=_cutting("specific_cutting_energy"),
        change=_change_cutting_energy,
    ),
    _Row(
        name="kn",
        doc="factor of the normal force's share k_n",
        width=0.15,
        touches="cut",
        scales=_cutting("kn"),
        change=_change_kn,
    ),
    _Row(
        name="damping",
        doc="factor of the damping: both proportional coefficients, the modal ratio, or all measured ratios",
        width=0.20,
        touches="structure",
        scales=_damping,
        change=_change_damping,
    ),
    _Row(
        name="shaft_stiffness",
        doc="factor of Young's modulus of all sections of the rotor",
        width=0.03,
        touches="structure",
        scales=_sections,
        change=_change_shaft,
    ),
    _Row(
        name="preload",
        doc="factor of every stated axial preload, the machine's own and that of a trial",
        width=0.12,
        touches="structure",
        scales=_preload,
        change=_change_preload,
    ),
    _Row(
        name="tip_frequency",
        doc="factor of the measured natural frequencies, stiffnesses unchanged",
        width=0.01,
        touches="structure",
        scales=_tip_modes("natural_frequency"),
        change=_change_tip_frequency,
    ),
    _Row(
        name="tip_stiffness",
        doc="factor of the measured modal stiffnesses, frequencies unchanged",
        width=0.10,
        touches="structure",
        scales=_tip_modes("stiffness"),
        change=_change_tip_stiffness,
    ),
)


def measurement_parameters(campaign: Campaign) -> tuple[Parameter, ...]:
    """Return the parameters of the measurements themselves, which no machine knows.

    For each response its gain, phase and frequency scale; for trials the share of wrong labels, the width
    of the transition from stable to chatter in ln(depth), and that of what is called marginal.

    See docs/physics.md#model-and-nuisances.
    """
    return (*_receptance_parameters(len(campaign.receptances)), *_outcome_parameters(campaign))


def _receptance_parameters(responses: int) -> Iterator[Parameter]:
    for number in range(responses):
        for name, unit, doc, width in SENSOR:
            yield Parameter(
                name=f"receptance_{number + 1}_{name}",
                unit=unit,
                doc=f"{doc} in response {number + 1}",
                prior_width=width,
                touches="measurement",
            )


def _outcome_parameters(campaign: Campaign) -> Iterator[Parameter]:
    """Yield what concerns the labels; a factor of two or so is the prior's width of each."""
    if campaign.trials is None:
        return
    common: dict[str, Any] = {"unit": "ln", "touches": "measurement"}
    most = math.log(MOST_MISLABELLED / TYPICAL_MISLABELLED)
    yield Parameter(
        name="mislabelled",
        doc=f"factor of the share of wrong labels, typically {TYPICAL_MISLABELLED:g}",
        prior_width=0.5,
        upper=most,
        **common,
    )
    yield Parameter(
        name="outcome_width",
        doc=f"factor of the width in ln(depth) of the transition to chatter, typically {TYPICAL_OUTCOME_WIDTH:g}",
        prior_width=0.5,
        **common,
    )
    if (campaign.trials.outcome == OUTCOMES.index("marginal")).any():
        yield Parameter(
            name="marginal_width",
            doc=f"factor of the width in ln(depth) of what is called marginal, above the limit, typically "
            f"{TYPICAL_MARGINAL_WIDTH:g}",
            prior_width=0.7,
            **common,
        )
