"""What the chain can use of what its arrows return: asked of users' laws alone, the program's own are tested."""

import math
from collections.abc import Callable, Iterator
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np

from chatter_core.cutting import ForceCoefficients
from chatter_core.floquet import DelayedFeedback, LinearSystem
from chatter_core.joint import Joint
from chatter_core.machine import Spindle
from chatter_core.parameters import Array
from chatter_core.stages import Regeneration, Stages
from chatter_core.teeth import Engagement, Teeth
from chatter_core.tip import OVER_SPEED, TipModes

#: How far the mean pitch may be from 1, a delay beyond the period and a known spectrum off its matrix: rounding.
ROUNDING = 1e-6
#: Parts of the period at which gains are tried.
TRIED = (0.0, 0.21, 0.5, 0.83)


#: What is longer is told by its class.
LONGEST = 60


def wrong(arrow: str, found: Any, arguments: tuple[Any, ...], before: Callable[..., Any]) -> str | None:
    """Return what no chain could use about what a law returned for an arrow, None where nothing is.

    before: the arrow as it was, which is asked where what is allowed hangs on it.

    See docs/physics.md#effects.
    """
    kind = _returned(arrow)
    if not isinstance(found, kind):
        return f"{_told(found)}, needed: {kind.__name__}"
    if isinstance(found, np.ndarray):
        return next(_of_array(arrow, found, before(*arguments)), None)
    what, findings = _CHECKS[kind]
    problem = next(findings(found, arguments, before), None)
    return None if problem is None else f"{what} whose {problem}"


def _told(found: Any) -> str:
    """Return what was found in place of something else: short things as they are, others by their class."""
    text = repr(found)
    return text if len(text) <= LONGEST and "\n" not in text else f"one of class {type(found).__name__}"


def _returned(arrow: str) -> type:
    """Return the class of what an arrow of the chain returns."""
    annotated = get_args(get_type_hints(Stages)[arrow])[-1]
    kind: type = get_origin(annotated) or annotated
    return kind


def _of_array(arrow: str, found: Array, before: Array) -> Iterator[str]:
    if found.dtype != before.dtype:
        yield f"an array of {found.dtype}, needed: {before.dtype}"
    if found.shape != before.shape:
        yield f"an array of shape {found.shape}, needed: {before.shape}"
    if np.any(np.isfinite(before) & ~np.isfinite(found)):
        yield "an array that is not finite where it was"
    if arrow in ("preload", "seat_stiffness") and np.any(found <= 0.0):
        yield f"{found[found <= 0.0][0]:g}, allowed: above 0"


def _of_modes(found: TipModes, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    for name in ("axis", "label"):
        if not isinstance(getattr(found, name), np.ndarray) or getattr(found, name).dtype.kind != "i":
            yield f"{name} is no array of whole numbers"
    for name in OVER_SPEED:
        yield from _not_floating(name, getattr(found, name))
    speeds, modes = len(arguments[1]), found.axis.size
    shapes = {name: getattr(found, name).shape for name in OVER_SPEED}
    for name, shape in shapes.items():
        if len(shape) != 2 or shape[1] != modes or not modes:
            yield f"{name} has the shape {shape}, needed: (speed, {modes or 'mode'})"
    if len({*shapes.values()}) > 1:
        yield f"arrays are of unlike numbers of speeds: {shapes}"
    yield from _unlike("arrays over speed", found.natural_frequency, (speeds, modes))
    if found.label.shape != found.axis.shape or not np.isin(found.axis, (0, 1)).all():
        yield "axis and label are not (mode,) each, or axis is neither 0 nor 1"
    if np.any(found.label < 1):
        yield f"label is {found.label.min()}, allowed: from 1"
    yield from _of_numbers_of_modes(found, arguments, before)


def _of_numbers_of_modes(found: TipModes, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    for name in ("natural_frequency", "modal_mass"):
        if np.any(getattr(found, name) <= 0.0):
            yield f"{name} is not positive"
    if np.any(found.damping_ratio < 0.0):
        yield f"damping_ratio is {found.damping_ratio[found.damping_ratio < 0.0][0]:g}, allowed: from 0"
    if found.gyroscopic is not None:
        yield from _unlike("gyroscopic", found.gyroscopic, (*found.natural_frequency.shape, len(found)))
    if found.turn is not None:
        yield from _unlike("turn", found.turn, found.natural_frequency.shape)
    names = [*OVER_SPEED, *(name for name in ("gyroscopic", "turn") if getattr(found, name) is not None)]
    unknown = {name: ~np.isfinite(getattr(found, name)).reshape(len(arguments[1]), -1).all(axis=1) for name in names}
    if not any(lost.any() for lost in unknown.values()):
        return
    # Where the bearings have no equilibrium there are no modes.
    known = np.isfinite(before(*arguments).natural_frequency).all(axis=1)
    yield from (f"{name} is not finite" for name, lost in unknown.items() if np.any(lost & known))


def _of_joints(found: tuple[Any, ...], arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    spindle: Spindle = arguments[0]
    for one in found:
        if not isinstance(one, Joint):
            yield f"parts are {one!r}, needed: Joint"
            return
        for name in ("position", "lateral_compliance", "rotational_compliance"):
            yield from _no_number(name, getattr(one, name))
        yield from _beyond("position", one.position, 0.0 < one.position < spindle.length, f"0 to {spindle.length:g} m")
        for name in ("lateral_compliance", "rotational_compliance"):
            value = getattr(one, name)
            yield from _beyond(name, value, 0.0 <= value < math.inf, "from 0")
        factor = one.loosening(np.zeros(1))
        yield from _unlike("loosening", factor, (1,))
        yield from _beyond("loosening", factor[0], 0.0 <= factor[0] < math.inf, "from 0")


def _of_system(found: LinearSystem, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    state = found.state_matrix
    if not isinstance(state, np.ndarray) or state.ndim != 3:
        yield "state_matrix is no array (system, state, state)"
    systems, size = len(arguments[1]), state.shape[1]
    yield from _unlike("state_matrix", state, (systems, size, size))
    yield from _unlike("input_matrix", found.input_matrix, (systems, size, 2))
    yield from _unlike("output_matrix", found.output_matrix, (systems, 2, size))
    for name in ("state_matrix", "input_matrix", "output_matrix"):
        yield from _infinite(name, getattr(found, name))
    known = found.known_spectrum
    if known is None:
        return
    off = np.abs(state @ known.modes - known.modes * known.poles[:, None, :])
    if np.any(off > ROUNDING * np.abs(known.poles).max()):
        yield "known_spectrum is not that of state_matrix; where you change this, leave it out: known_spectrum=None"


def _of_engagement(found: Engagement, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    for name in ("entry", "exit"):
        yield from _no_number(name, getattr(found, name))
    if not 0.0 <= found.entry < found.exit <= math.pi:
        yield f"entry is {found.entry:g} and exit {found.exit:g}, allowed: 0 <= entry < exit <= pi [rad]"


def _of_teeth(found: Teeth, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    for name in ("pitch", "radius"):
        yield from _unlike(name, getattr(found, name), (arguments[0].teeth,))
        yield from _infinite(name, getattr(found, name))
    yield from _beyond("pitch", found.pitch.min(), found.pitch.min() > 0.0, "above 0")
    mean = found.pitch.mean()
    yield from _beyond("mean pitch", mean, abs(mean - 1.0) <= ROUNDING, "1")


def _of_coefficients(found: ForceCoefficients, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    for name in ("tangential", "radial"):
        value = getattr(found, name)
        is_array = isinstance(value, np.ndarray)
        yield from _unlike(name, value, arguments[1].shape) if is_array else _no_number(name, value)
        yield from _infinite(name, value)
    least = np.min(found.tangential)
    yield from _beyond("tangential", least, least > 0.0, "above 0")


def _of_regeneration(found: Regeneration, arguments: tuple[Any, ...], before: Callable[..., Any]) -> Iterator[str]:
    shape = arguments[0].axial_depth.shape
    yield from _unlike("period", found.period, shape)
    yield from _infinite("period", found.period)
    yield from _beyond("period", found.period.min(), found.period.min() > 0.0, "above 0")
    if not isinstance(found.breakpoints, np.ndarray) or found.breakpoints.ndim != 2:
        yield "breakpoints are no array (point, breakpoint)"
    yield from _unlike("breakpoints", found.breakpoints, (*shape, found.breakpoints.shape[1]))
    yield from _infinite("breakpoints", found.breakpoints)
    if not isinstance(found.feedback, tuple) or not found.feedback or not isinstance(found.velocity_gain, tuple):
        yield "feedback is no tuple with something in it, or velocity_gain none"
    for term in found.feedback:
        if not isinstance(term, DelayedFeedback):
            yield f"feedback has {term!r}, needed: DelayedFeedback"
        yield from _unlike("delay", term.delay, shape)
        within = (term.delay > 0.0) & (term.delay <= found.period * (1.0 + ROUNDING))
        yield from _beyond("delay", term.delay[~within][:1], within.all(), "above 0 s, up to the period")
    time = found.period[:, None] * np.array(TRIED)
    for gain in (*(term.gain for term in found.feedback), *found.velocity_gain):
        answer = gain(time)
        yield from _unlike("gain", answer, (*time.shape, 2, 2))
        yield from _infinite("gain", answer)


def _not_floating(name: str, found: Any) -> Iterator[str]:
    if not isinstance(found, np.ndarray) or found.dtype != np.float64:
        yield f"{name} is no array of floating-point numbers (float64)"


def _no_number(name: str, found: Any) -> Iterator[str]:
    if isinstance(found, bool) or not isinstance(found, int | float):
        yield f"{name} is {found!r}, needed: a number"


def _unlike(name: str, found: Any, shape: tuple[int, ...]) -> Iterator[str]:
    yield from _not_floating(name, found)
    if found.shape != shape:
        yield f"{name} has the shape {found.shape}, needed: {shape}"


def _infinite(name: str, found: Any) -> Iterator[str]:
    if not np.isfinite(found).all():
        yield f"{name} is not finite"


def _beyond(name: str, found: Any, within: Any, allowed: str) -> Iterator[str]:
    if not within:
        yield f"{name} is {found}, allowed: {allowed}"


#: What the value of each class is called, and what looks at it.
_CHECKS: dict[type, tuple[str, Callable[..., Iterator[str]]]] = {
    TipModes: ("modes", _of_modes),
    tuple: ("joints", _of_joints),
    LinearSystem: ("a system", _of_system),
    Engagement: ("an engagement", _of_engagement),
    Teeth: ("teeth", _of_teeth),
    ForceCoefficients: ("coefficients", _of_coefficients),
    Regeneration: ("a feedback", _of_regeneration),
}
