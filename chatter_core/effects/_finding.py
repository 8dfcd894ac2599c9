"""Finding effects: a Python file of a folder is an effect, and its name is the file's. There is no list to edit.

Beside the program's own folder a user may name one more, whose effects each are a Python file and a yaml of the same
stem. Only files of these two folders are ever loaded; what a yaml says is looked up among their names and never run.
"""

import copyreg
import hashlib
import re
import sys
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from inspect import getmembers, isclass
from pathlib import Path
from types import ModuleType
from typing import Any

from chatter_core.effects._base import Effect
from chatter_core.effects._own import require_complete
from chatter_core.errors import InvalidInput
from chatter_core.own_laws import in_words
from chatter_core.reading import near_path, nearest

FOLDER = Path(__file__).parent
#: What a file must be called: its stem is the effect's name.
_NAME = re.compile(r"[a-z][a-z0-9_]*")
#: What a ranking calls a model that lacks nothing.
NO_EFFECT = "none"


@cache
def effect_names(own: Path | None = None) -> tuple[str, ...]:
    """Return the names of all effects, those of a user's ``own`` folder among them, in alphabetical order.

    Raises InvalidInput as ``own_effects`` does.

    See docs/physics.md#effects.
    """
    return tuple(sorted({*_stems(FOLDER, "py"), *(own_effects(own) if own is not None else ())}))


def own_effects(folder: Path) -> tuple[str, ...]:
    """Return the names of the effects in a user's folder; none of its files is loaded.

    Raises InvalidInput with every finding: no folder, one that cannot be read or holds no effect, a class without its
    yaml or a yaml without its class, a name that the program's own effects have or that cannot be one.

    See docs/physics.md#effects.
    """
    try:
        return _own_effects(folder)
    except OSError as error:
        raise InvalidInput([f"effects_path: {error.filename or folder} cannot be read: {error.strerror}"]) from None


def _own_effects(folder: Path) -> tuple[str, ...]:
    if not folder.is_dir():
        raise InvalidInput([f"effects_path: {folder} is not a folder{near_path(folder)}"])
    classes, values, taken = (_stems(folder, "py"), _stems(folder, "yaml"), _stems(FOLDER, "py"))
    if not classes | values:
        raise InvalidInput([f"effects_path: {folder} holds no effect, needed: a .py and a .yaml of the same name"])
    problems = [
        f"{folder / name}.py: {name}.yaml is missing beside it{_yml(folder, name)}" for name in sorted(classes - values)
    ]
    problems += [f"{folder / name}.yaml: {name}.py is missing beside it" for name in sorted(values - classes)]
    if problems:
        problems.append(f"{folder}: every .py and .yaml file in it is taken for an effect's; keep all others elsewhere")
    for name in sorted(classes):
        if name in taken:
            problems.append(f"{folder / name}.py: the program has an effect of this name; give yours another")
        if name == NO_EFFECT:
            problems.append(
                f"{folder / name}.py: {name} is the answer where nothing is missing; give yours another name"
            )
        if not _NAME.fullmatch(name):
            problems.append(f"{folder / name}.py: an effect's name has small letters, digits and _, a letter first")
        if not (folder / f"{name}.py").is_file():
            problems.append(f"{folder / name}.py: is no file that can be read")
    if problems:
        raise InvalidInput([f"effects_path: {problem}" for problem in problems])
    return tuple(sorted(classes))


def _yml(folder: Path, name: str) -> str:
    return f"; rename {name}.yml" if (folder / f"{name}.yml").exists() else ""


def own_digest(name: str, folder: Path) -> str:
    """Return a digest of the Python file of a user's effect, by which a record tells whether it was changed.

    See docs/physics.md#effects.
    """
    return hashlib.sha256((folder / f"{name}.py").read_bytes()).hexdigest()[:16]


@cache
def effect_class(name: str, own: Path | None = None) -> type[Effect]:
    """Return the class of an effect, of the program's or of a user's ``own`` folder.

    Raises InvalidInput for an unknown name, with the nearest, for a file that does not hold exactly one effect,
    and for a user's file that cannot be loaded or leaves out what an effect must say.

    See docs/physics.md#effects.
    """
    if name not in effect_names(own):
        raise InvalidInput([f"effects: found {name!r}; {nearest(name, list(effect_names(own)))}"])
    if own is None or name in _stems(FOLDER, "py"):
        return _only_class(name, import_module(f"{__package__}.{name}"))
    kind = _only_class(name, _load(name, own))
    require_complete(kind, own / f"{name}.py")
    kind.own_file = (own / f"{name}.py").resolve()
    # Whoever gets a copy of it in another process loads the class there, from the same file.
    copyreg.pickle(kind, _copied)
    return kind


def _stems(folder: Path, ending: str) -> set[str]:
    # A pattern would find nothing in a folder that cannot be read, and say nothing.
    return {file.stem for file in folder.iterdir() if file.suffix == f".{ending}" and not file.stem.startswith("_")}


def _only_class(name: str, module: ModuleType) -> type[Effect]:
    """Return the one effect that a module defines."""
    found = [
        member
        for _, member in getmembers(module, isclass)
        if issubclass(member, Effect) and member.__module__ == module.__name__
    ]
    if len(found) != 1:
        raise InvalidInput(
            [f"effects: {module.__file__} holds {len(found)} effects, allowed: exactly one class derived from Effect"]
        )
    return found[0]


def _load(name: str, folder: Path) -> ModuleType:
    """Run a user's Python file as a module of its own."""
    file = (folder / f"{name}.py").resolve()
    spec = spec_from_file_location(
        f"own_effects_{hashlib.sha256(str(file.parent).encode()).hexdigest()[:8]}.{name}", file
    )
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:
        del sys.modules[spec.name]
        raise InvalidInput([f"effects_path: {file} cannot be loaded: {in_words(error)}"]) from error
    return module


def _copied(effect: Effect) -> tuple[Callable[..., Effect], tuple[Any, ...]]:
    """Return how a copy of a user's effect is made in another process."""
    file = sys.modules[type(effect).__module__].__file__
    assert file is not None
    settings = {setting.name: getattr(effect, setting.name) for setting in effect.settings}
    return _restored, (effect.name(), Path(file).parent, settings)


def _restored(name: str, folder: Path, settings: dict[str, Any]) -> Effect:
    return effect_class(name, folder)(**settings)
