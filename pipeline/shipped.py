"""What the configs folder holds: groups, their choices and keys, and effects; read as it stands, nothing composed.

Imports nothing heavy: completion on a command line has the time of a key stroke.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

import configs

CONFIGS = Path(next(iter(configs.__path__)))
#: Folder with the configured values of every effect: no group, since effects add up.
EFFECTS = "effects"
#: Groups that choose of other groups, and have no keys of their own.
CHOOSING = ("machine", "study")


def groups() -> dict[str, list[str]]:
    """Return the shipped groups and the choices in each."""
    return {
        folder.name: _stems(folder)
        for folder in sorted(CONFIGS.iterdir())
        if folder.is_dir() and folder.name != EFFECTS and _stems(folder)
    }


def effects() -> list[str]:
    """Return the names of the shipped effects."""
    return _stems(CONFIGS / EFFECTS)


def keys(group: str) -> list[str]:
    """Return the dotted keys of a group, all that one of its choices has: ``grid.spindle_speed_rpm.count``."""
    files = [] if group in CHOOSING else sorted((CONFIGS / group).glob("*.yaml"))
    found = (f"{group}.{key}" for file in files for key in _dotted(_content(file)))
    return list(dict.fromkeys(found))


def effect_keys(effect: str) -> list[str]:
    """Return the dotted keys of an effect, none for an unknown one: ``effects.process_damping.coefficient_n_m``."""
    file = CONFIGS / EFFECTS / f"{effect}.yaml"
    return [f"{EFFECTS}.{effect}.{key}" for key in _dotted(_content(file))] if file.is_file() else []


def _stems(folder: Path) -> list[str]:
    return sorted(file.stem for file in folder.glob("*.yaml"))


def _content(file: Path) -> dict[str, Any]:
    found = yaml.safe_load(file.read_text(encoding="utf-8"))
    return found if isinstance(found, dict) else {}


def _dotted(data: dict[str, Any]) -> Iterator[str]:
    """Yield the dotted key of everything below."""
    for key, value in data.items():
        yield key
        if isinstance(value, dict):
            yield from (f"{key}.{below}" for below in _dotted(value))
