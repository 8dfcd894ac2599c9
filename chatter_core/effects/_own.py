"""Effects of users' own: what their declarations must say."""

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, fields
from inspect import isabstract
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.own_laws import told
from chatter_core.parameters import Parameter, Touches
from chatter_core.reading import nearest
from chatter_core.stages import ARROWS, OF_THE_STRUCTURE
from chatter_core.units import SUFFIXES, split_key

if TYPE_CHECKING:
    from chatter_core.effects._base import Effect, Setting

#: Waves between two teeth that a scan may be told for.
MOST_WAVES = 1e6
#: Whole numbers of Python may be larger.
LARGEST = float(np.finfo(float).max)
#: What an effect may be said to change.
CHANGES = ("bearing", "modes", "cut")
#: What parameters may be called.
_NAME = re.compile(r"[a-z][a-z0-9_]*")


def require_complete(kind: "type[Effect]", file: Path) -> None:
    """Raise InvalidInput with everything that a user's class leaves out, or says so that it means nothing.

    See docs/physics.md#effects.
    """
    missing = [key for key in ("stage", "declared", "changes") if not hasattr(kind, key)]
    missing += ["transform"] if isabstract(kind) else []
    # What a class says may be anything, and looking at it may fail.
    problems = (
        [f"{kind.__name__} does not say {', '.join(missing)}"]
        if missing
        else told(file, lambda: list(_findings(kind)) or list(_findings_of_making(kind)))
    )
    if problems:
        raise InvalidInput([f"effects_path: {file}: {problem}" for problem in problems])


def _findings(kind: "type[Effect]") -> Iterator[str]:
    if kind.stage not in ARROWS:
        yield f"stage: found {kind.stage!r}; {nearest(str(kind.stage), list(ARROWS))}"
    yield from _findings_of_parameters(kind)
    names = list(_declared(kind))
    yield from _unknown("shapes", kind.shapes, names)
    yield from _unknown("heard", () if kind.heard is None else (kind.heard,), names)
    yield from _findings_of_scan(kind)
    yield from _unknown("needs", kind.needs, list(Machine.model_fields))
    yield from _unknown("changes", kind.changes, CHANGES)
    yield from _findings_of_settings(kind)


def _findings_of_parameters(kind: "type[Effect]") -> Iterator[str]:
    if not _is_tuple(kind.declared) or not kind.declared:
        yield f"declared: found {kind.declared!r}, allowed: a tuple of parameters, also of one: (Parameter(...),)"
        return
    named: list[str] = []
    for one in kind.declared:
        if not isinstance(one, Parameter):
            yield f"declared: found {one!r}, allowed: parameters"
            continue
        if not _NAME.fullmatch(str(one.name)):
            yield f"declared: found the name {one.name!r}, allowed: small letters, digits and _, a letter first"
        if one.name in named:
            yield f"declared: {one.name} stands twice"
        if (units := _units(one.name)) and one.unit not in units:
            yield f"declared: unit of {one.name}: found {one.unit!r}, needed, by its name: {' or '.join(units)}"
        if one.touches not in get_args(Touches):
            allowed = nearest(str(one.touches), list(get_args(Touches)))
            yield f"declared: touches of {one.name}: found {one.touches!r}; {allowed}"
        if not one.lower <= one.prior_mean <= one.upper:
            allowed = f"{one.lower:g} to {one.upper:g}"
            yield f"declared: prior_mean of {one.name}: found {one.prior_mean:g}, allowed: {allowed}"
        named.append(one.name)


def _units(name: str) -> list[str]:
    """Return how a unit in which a parameter's name ends is written, none where it ends in none."""
    suffix = split_key(str(name))[1]
    # n_m is newton metres or newtons per metre.
    return sorted({SUFFIXES[suffix][1], SUFFIXES[suffix][1].replace("N m", "N/m")}) if suffix else []


def _findings_of_scan(kind: "type[Effect]") -> Iterator[str]:
    scan = kind.scan
    declared = _declared(kind)
    if scan is None:
        return
    if isinstance(scan, type) or not hasattr(scan, "with_waves"):
        yield f"scan: found {scan!r}, allowed: Scan(parameter=..., values=...)"
    elif scan.parameter not in declared:
        yield f"scan: found {scan.parameter!r}; {nearest(str(scan.parameter), list(declared))}"
    elif not _is_tuple(scan.values) or not scan.values:
        yield f"scan: found {scan.values!r}, allowed: a tuple of values"
    elif not _is_tuple(scan.shapes) or (scan.shapes and (not kind.shapes or scan.parameter in kind.shapes)):
        allowed = "beside a strength that is scanned a tuple of values of the first of the effect's shapes, else none"
        yield f"scan: shapes: found {scan.shapes!r}, allowed: {allowed}"
    elif not (scan.waves is None or _is_number_of_waves(scan.waves)):
        yield f"scan: waves: found {scan.waves!r}, allowed: a number above 0, up to {MOST_WAVES:g}"
    else:
        yield from _beyond("scan", scan.values, declared[scan.parameter])
        first = next((one for one in kind.declared if one.name in kind.shapes), None)
        if first is not None:
            yield from _beyond("scan: shapes", scan.shapes, first)


def _beyond(key: str, values: tuple[float, ...], parameter: Parameter) -> Iterator[str]:
    """Yield what is no number among values, or the first one that lies outside of a parameter's bounds."""
    lower, upper = parameter.lower, parameter.upper
    real = int | float | np.integer | np.floating
    if odd := [value for value in values if isinstance(value, bool) or not isinstance(value, real)]:
        yield f"{key}: found {odd[0]!r}, allowed: numbers"
        return
    beyond = [value for value in values if not (lower <= value <= upper and abs(value) <= LARGEST)]
    yield from (f"{key}: found {str(value)[:20]}, allowed: {lower:g} to {upper:g}" for value in beyond[:1])


def _is_number_of_waves(found: object) -> bool:
    # What is too large for a float is compared all the same.
    if isinstance(found, bool) or not isinstance(found, int | float | np.integer):
        return False
    return bool(0.0 < found <= MOST_WAVES)


def _findings_of_settings(kind: "type[Effect]") -> Iterator[str]:
    if not _is_tuple(kind.settings):
        yield f"settings: found {kind.settings!r}, allowed: a tuple of settings, also of one: (Setting(...),)"
        return
    attributes = [field.name for field in fields(kind)]
    for one in kind.settings:
        if not all(hasattr(one, name) for name in ("name", "choices", "unused")):
            yield f"settings: found {one!r}, allowed: settings"
        elif one.name not in attributes:
            yield f"settings: {one.name} is no field of the class; needed: {one.name}: str, or int"
        elif not _is_tuple(one.choices) or not one.choices:
            yield f"settings: choices of {one.name}: found {one.choices!r}, allowed: a tuple of words or whole numbers"
        else:
            yield from _findings_of_unused(kind, one)


def _findings_of_unused(kind: "type[Effect]", setting: "Setting") -> Iterator[str]:
    key, unused = f"settings: unused of {setting.name}", setting.unused
    if not isinstance(unused, Mapping):
        yield f"{key}: found {unused!r}, allowed: a tuple of names by choice, {{choice: (name,)}}"
        return
    choices = [*map(str, setting.choices)]
    yield from (f"{key}: found {one!r}; {nearest(str(one), choices)}" for one in unused if one not in setting.choices)
    for names in unused.values():
        yield from _unknown(key, names, _declared(kind))


def _findings_of_making(kind: "type[Effect]") -> Iterator[str]:
    chosen = [setting.name for setting in kind.settings]
    for field in fields(kind):
        if field.init and field.name not in chosen and field.default is MISSING and field.default_factory is MISSING:
            yield f"{field.name}: a field that is no setting, needed: a value, {field.name} = ..."
            return
    for choices in itertools.product(*(setting.choices for setting in kind.settings)):
        effect = kind(**dict(zip(chosen, choices, strict=True)))
        if effect.acts_on not in ARROWS:
            yield f"acts_on: found {effect.acts_on!r}; {nearest(str(effect.acts_on), list(ARROWS))}"
            return
        if all(one.name in kind.shapes for one in effect.used):
            so = f" with {effect.what_is_chosen}" if effect.settings else ""
            yield f"declared: nothing says how strong it is{so}; needed: a parameter that is used and no shape"
            return
        yield from findings_of_touches(effect)


def findings_of_touches(effect: "Effect") -> Iterator[str]:
    """Yield which parameters of an effect say that less has to be computed again than their arrow changes.

    See docs/physics.md#effects.
    """
    of_structure = effect.acts_on in OF_THE_STRUCTURE
    allowed = ("structure",) if of_structure else ("structure", "cut")
    for one in effect.declared:
        if one.touches not in allowed:
            why = f"{effect.acts_on} {'belongs to the structure' if of_structure else 'changes the cut'}"
            yield f"declared: touches of {one.name}: found {one.touches!r}, allowed: {' or '.join(allowed)}: {why}"


def _unknown(key: str, found: Any, allowed: Iterable[str]) -> Iterator[str]:
    """Yield what a key names that there is not."""
    if not _is_tuple(found):
        yield f"{key}: found {found!r}, allowed: a tuple of names, also of one: (name,)"
        return
    known = list(allowed)
    yield from (f"{key}: found {name!r}; {nearest(str(name), known)}" for name in found if name not in known)


def _declared(kind: "type[Effect]") -> dict[str, Parameter]:
    """Return the parameters that a class declares, by name, as far as they are any."""
    return {one.name: one for one in kind.declared if isinstance(one, Parameter)} if _is_tuple(kind.declared) else {}


def _is_tuple(found: object) -> bool:
    return isinstance(found, tuple)
