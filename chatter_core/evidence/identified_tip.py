"""The ``tip`` section of a machine from measured receptances, for shops without a spindle drawing."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from pydantic import ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.evidence.identify import IdentifiedModes, continue_modes, identify_modes
from chatter_core.evidence.measured import Receptance
from chatter_core.machine import Tip
from chatter_core.reading import sentences
from chatter_core.tip import AXES
from chatter_core.units import si_factor

#: Standard deviations that no receptance shows by itself: of its gain and of its frequency scale.
GAIN_ERROR, FREQUENCY_ERROR = 0.03, 0.003


@dataclass(frozen=True, kw_only=True)
class IdentifiedTip:
    """Tool tip as its receptances show it.

    tip: modes with standard deviations, those of gain and frequency scale included; receptances and
    modes: (receptance,) in one order.
    """

    tip: Tip
    receptances: tuple[Receptance, ...]
    modes: tuple[IdentifiedModes, ...]


def identify_tip(receptances: Sequence[Receptance], *, mode_count: int | None = None) -> IdentifiedTip:
    """Identify the tip of a machine from direct receptances of its axes, at one speed or several.

    ``mode_count`` is the number of modes of every receptance. Without it each axis gets as many as
    its receptance that shows most; at the other speeds the missing ones are looked for where the
    nearest such speed has them, since modes between two speeds are interpolated one by one. To the
    deviations come those of gain and frequency scale, which all modes of a receptance share.

    Raises InvalidInput for a cross receptance, an axis that is measured twice at a speed, axes that are not
    measured at the same speeds, and for whatever ``identify_modes`` and ``continue_modes`` refuse, naming axes
    and speed.

    See docs/physics.md#modes-from-measurement.
    """
    ordered = sorted(receptances, key=lambda r: (r.output_axis, r.spindle_speed))
    _check_receptances(ordered)
    found: list[IdentifiedModes] = []
    for axis in sorted({r.output_axis for r in ordered}):
        of_axis = [r for r in ordered if r.output_axis == axis]
        alone = []
        for measured in of_axis:
            with _naming(measured):
                alone.append(identify_modes(measured.frequency, measured.value, mode_count=mode_count))
        most = max(len(modes) for modes in alone)
        speeds = np.array([r.spindle_speed for r in of_axis])
        rich = [place for place, modes in enumerate(alone) if len(modes) == most]
        for place, modes in enumerate(alone):
            nearest = rich[int(np.argmin(np.abs(speeds[rich] - speeds[place])))]
            with _naming(of_axis[place]):
                found.append(modes if place in rich else continue_modes(modes, alone[nearest]))
    return IdentifiedTip(tip=_tip(ordered, found), receptances=tuple(ordered), modes=tuple(found))


@contextmanager
def _naming(measured: Receptance) -> Iterator[None]:
    """Put axes and speed before every problem that is raised within."""
    try:
        yield
    except InvalidInput as error:
        raise InvalidInput([f"{measured}: {problem}" for problem in error.problems]) from None


def _tip(receptances: Sequence[Receptance], found: Sequence[IdentifiedModes]) -> Tip:
    """Return the described modes; raise InvalidInput where no machine can have them."""
    described = [
        mode for measured, modes in zip(receptances, found, strict=True) for mode in _described(measured, modes)
    ]
    try:
        return Tip.model_validate({"modes": described})
    except ValidationError as error:
        raise InvalidInput([f"identified {sentence}" for sentence in sentences(error, Tip)]) from None


def _described(measured: Receptance, modes: IdentifiedModes) -> list[dict[str, str | float]]:
    """Return the modes of one receptance in keys and units of the border."""
    frequency = np.hypot(modes.frequency_deviation, FREQUENCY_ERROR * modes.natural_frequency)
    stiffness = np.hypot(modes.stiffness_deviation, GAIN_ERROR * modes.modal_stiffness)
    columns = {
        "natural_frequency_hz": modes.natural_frequency,
        "natural_frequency_deviation_hz": frequency,
        "damping_ratio": modes.damping_ratio,
        "damping_ratio_deviation": modes.damping_deviation,
        "stiffness_n_um": modes.modal_stiffness,
        "stiffness_deviation_n_um": stiffness,
        "spindle_speed_rpm": np.full(len(modes), measured.spindle_speed),
    }
    return [
        {
            "axis": AXES[measured.output_axis],
            **{key: float(values[mode] / si_factor(key)) for key, values in columns.items()},
        }
        for mode in range(len(modes))
    ]


def _check_receptances(receptances: Sequence[Receptance]) -> None:
    problems = ["receptances: found none, needed: one direct receptance at least"] if not receptances else []
    problems += [
        f"receptance {r}: its axes differ; direct receptances alone show a tip's modes"
        for r in receptances
        if not r.is_direct
    ]
    names = [str(r) for r in receptances]
    problems += [f"receptance {name}: found twice" for name in sorted({n for n in names if names.count(n) > 1})]
    x, y = ({r.spindle_speed for r in receptances if r.output_axis == axis} for axis in range(len(AXES)))
    if x and y and x != y:
        alone = sorted(speed / si_factor("speed_rpm") for speed in x ^ y)
        problems.append(
            f"spindle_speed_rpm: {', '.join(f'{s:g}' for s in alone)} found in one axis alone; "
            "both are measured at the same speeds, or one axis is left out"
        )
    if problems:
        raise InvalidInput(problems)
