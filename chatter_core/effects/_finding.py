"""Finding effects: a Python file of a folder is an effect, and its name is the file's. There is no list to edit.

Only files of the folder are ever imported; what a yaml says is looked up among their names and never run.
"""

from functools import cache
from importlib import import_module
from inspect import getmembers, isclass
from pathlib import Path

from chatter_core.effects._base import Effect
from chatter_core.errors import InvalidInput
from chatter_core.reading import nearest

FOLDER = Path(__file__).parent


@cache
def effect_names() -> tuple[str, ...]:
    """Return the names of all effects, in alphabetical order.

    See docs/physics.md#effects.
    """
    return tuple(sorted(file.stem for file in FOLDER.glob("*.py") if not file.stem.startswith("_")))


@cache
def effect_class(name: str) -> type[Effect]:
    """Return the class of an effect.

    Raises InvalidInput for an unknown name, with the nearest, and for a file that does not hold exactly one effect.

    See docs/physics.md#effects.
    """
    if name not in effect_names():
        raise InvalidInput([f"effects: found {name!r}; {nearest(name, list(effect_names()))}"])
    module = import_module(f"{__package__}.{name}")
    found = [
        member
        for _, member in getmembers(module, isclass)
        if issubclass(member, Effect) and member.__module__ == module.__name__
    ]
    if len(found) != 1:
        raise InvalidInput([f"effects: {name}.py holds {len(found)} effects, allowed: exactly one"])
    return found[0]
