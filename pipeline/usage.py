"""Help: what can be said to the program and to each verb, from their declarations in ``pipeline.verbs``."""

import platform
import textwrap
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from pydantic.fields import FieldInfo

from chatter_core.errors import InvalidInput
from chatter_core.reading import nearest
from pipeline import shipped
from pipeline.telling import command, program
from pipeline.verbs import ANSWERS, VERBS
from pipeline.verbs.options import Options

WIDTH = 118
HEAD = "Milling chatter from a bearing's data sheet."
#: What the numbers of a run depend on most, beside the program itself.
LIBRARIES = ("numpy", "scipy", "numba", "zarr", "xarray", "dask")
#: What the first column of a list of options takes.
COLUMN = 34
EXAMPLES = (
    "sweep study=smoke",
    "sweep machine=path/to/machine.yaml study=reference",
    "point spindle_speed_rpm=12000 axial_depth_mm=1",
    "compare campaign=my_campaign",
)
EXITS = (
    "exit codes: 0 all well, 1 some points failed and are marked, verify found damage, or no worker is left,\n"
    "2 bad input, 3 store in use, 129 stopped by the end of its terminal, 130 by Ctrl-C, 143 by SIGTERM"
)


def versions(words: list[str]) -> str:
    """Return the versions of the program and of what its numbers depend on."""
    try:
        own = version("milling-chatter")
    except PackageNotFoundError:
        own = "(not installed, run from its source folder)"
    found = [f"{name} {version(name)}" for name in LIBRARIES]
    return f"milling-chatter {own}\nPython {platform.python_version()}, {', '.join(found)}"


def help_on(words: list[str]) -> str:
    """Return help on a verb that is named, else on the program; raise InvalidInput for what is no verb."""
    if not words:
        return _general()
    if words[0] in VERBS:
        return _on_verb(words[0], VERBS[words[0]])
    if words[0] in ANSWERS:
        return _general()
    raise InvalidInput([f"{words[0]}: {no_verb(words[0], list(VERBS))}"])


def no_verb(word: str, allowed: list[str]) -> str:
    """Return what is to be said of a word that stands where a verb should."""
    if word.startswith("-"):
        return f"unknown; {nearest(word, ['--help', '--version'])}"
    if "=" in word:
        return f"expected a verb first; {command('help')} lists them"
    return f"unknown verb; {nearest(word, allowed)}"


def _general() -> str:
    verbs = [_entry(name, kind.summary(), 12) for name, kind in VERBS.items()]
    answers = [_entry(name, meaning, 12) for name, meaning in ANSWERS.items()]
    return "\n".join(
        [
            HEAD,
            f"\nusage: {program()} VERB [group=choice ...] [group.key=value ...] [option=value ...]",
            "\nverbs",
            *verbs,
            "",
            *answers,
            "\ngroups and their choices",
            *_groups(tuple(shipped.groups())),
            "\neffects, with the values of configs/effects",
            textwrap.fill(", ".join(shipped.effects()), WIDTH, initial_indent="  ", subsequent_indent="  "),
            "\noptions of every verb",
            *_options(Options, list(Options.fields())),
            "\nexamples",
            *(f"  {program()} {example}" for example in EXAMPLES),
            f"\n{EXITS}",
        ]
    )


def _on_verb(name: str, kind: type[Options]) -> str:
    own = [option for option in kind.fields() if option not in Options.fields()]
    words = " [group=choice ...] [group.key=value ...]" if kind.groups else ""
    parts = [
        *kind.explanation(),
        f"\nusage: {command(name)}{words} [option=value ...]",
        "\noptions",
        *_options(kind, own),
        *_options(kind, list(Options.fields())),
    ]
    if kind.groups:
        parts += ["\ngroups, their choices, and any of their keys by group.key=value", *_groups(kind.groups)]
    if "effects" in kind.fields():
        effects = f"effects: {', '.join(shipped.effects())}; one is changed by effects.NAME.KEY=VALUE"
        parts += ["", textwrap.fill(effects, WIDTH)]
    return "\n".join([*parts, "\nexamples", *(f"  {program()} {example}" for example in kind.examples), f"\n{EXITS}"])


def _groups(names: tuple[str, ...]) -> list[str]:
    choices = shipped.groups()
    return [_entry(name, ", ".join(choices[name]) + (", or FILE.yaml" * (name == "machine")), 12) for name in names]


def _options(kind: type[Options], names: list[str]) -> list[str]:
    fields = kind.fields()
    needed_first = sorted(names, key=lambda name: not fields[name].is_required())
    return [_entry(f"{name}={kind.shape_of(name)}", meaning(fields[name]), COLUMN) for name in needed_first]


def meaning(field: FieldInfo) -> str:
    """Return meaning, bounds and default of an option."""
    words = [field.description or "", *_bounds(field)]
    if field.is_required():
        words.append("needed")
    elif field.default is not None:
        words.append(f"default {_shown(field.default)}")
    return "; ".join(words)


def _bounds(field: FieldInfo) -> list[str]:
    found = []
    for attribute, words in (("gt", "more than"), ("ge", "at least"), ("lt", "less than"), ("le", "at most")):
        limits = [getattr(one, attribute) for one in field.metadata if getattr(one, attribute, None) is not None]
        found += [f"{words} {limit:g}" for limit in limits]
    return [", ".join(found)] if found else []


def _shown(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _entry(name: str, meaning: str, width: int) -> str:
    """Return a line of a list, as many lines as it takes."""
    indent = " " * (width + 2)
    first = f"  {name:{width}}" if len(name) < width else f"  {name}\n{indent}"
    rest = textwrap.fill(meaning, WIDTH, initial_indent=indent, subsequent_indent=indent).lstrip()
    return f"{first}{rest}"
