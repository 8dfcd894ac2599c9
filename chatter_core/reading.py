"""Reading what a user wrote: yaml files, and validation findings as plain sentences."""

import difflib
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine

#: Largest yaml file that is read [bytes]; a machine takes about 2000.
LARGEST_FILE = 1_000_000


class _PlainLoader(yaml.SafeLoader):
    """Safe loader that refuses what has no place in a description: aliases and duplicated keys."""

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise yaml.MarkedYAMLError(problem="an alias (*name) is not allowed", problem_mark=mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
        seen: set[Any] = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise yaml.MarkedYAMLError(
                    problem=f"a key must be a word, found {key}", problem_mark=key_node.start_mark
                )
            if key in seen:
                raise yaml.MarkedYAMLError(problem=f"key '{key}' stands twice", problem_mark=key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep=deep)


def load_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a yaml file.

    Raises InvalidInput, naming file and line, when it cannot be read or is no mapping.
    """
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise InvalidInput([f"{path}: larger than {LARGEST_FILE} bytes, which no description needs"])
        content = yaml.load(path.read_text(encoding="utf-8-sig"), _PlainLoader)
    except FileNotFoundError:
        raise InvalidInput([f"{path}: no such file{_near_file(path)}"]) from None
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput([f"{path}: cannot be read: {error}"]) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise InvalidInput([f"{path}{line}: no valid yaml: {problem}"]) from None
    except RecursionError:
        raise InvalidInput([f"{path}: nested too deeply"]) from None
    if not isinstance(content, dict):
        raise InvalidInput([f"{path}: expected keys and values, found {_shown(content)}"])
    return content


def read_machine(path: str | Path) -> Machine:
    """Return the machine that a machine.yaml describes.

    Raises InvalidInput with every finding, each naming file and key.
    """
    path = Path(path)
    try:
        return Machine.model_validate(load_yaml(path))
    except ValidationError as error:
        raise InvalidInput([f"{path}: {sentence}" for sentence in sentences(error, Machine)]) from None


def sentences(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Return one sentence for each finding: where, what was found, what is allowed."""
    return [_sentence(dict(finding), model) for finding in error.errors()]


def nearest(word: str, allowed: list[str]) -> str:
    """Return a hint at the nearest allowed word, or the list of all."""
    close = difflib.get_close_matches(word, allowed, n=1, cutoff=0.5)
    return f"did you mean {close[0]}?" if close else f"allowed: {', '.join(allowed)}"


def _near_file(path: Path) -> str:
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return ""
    close = difflib.get_close_matches(path.name, names, n=1)
    return f"; did you mean {path.parent / close[0]}?" if close else ""


def _sentence(finding: dict[str, Any], model: type[BaseModel]) -> str:
    place, kind, context = finding["loc"], finding["type"], finding.get("ctx", {})
    where = _dotted(place)
    if kind == "extra_forbidden":
        return f"{where}: unknown key; {nearest(str(place[-1]), _keys_at(model, place[:-1]))}"
    if kind == "missing":
        return f"{where}: missing{_meaning(model, place)}"
    if kind == "value_error":
        return f"{where}: {context['error']}" if where else str(context["error"])
    return f"{where}: found {_shown(finding['input'])}, allowed: {_allowed(kind, context, finding['msg'])}"


def _allowed(kind: str, context: dict[str, Any], message: str) -> str:
    bounds = {
        "greater_than": ("more than", "gt"),
        "greater_than_equal": ("at least", "ge"),
        "less_than": ("less than", "lt"),
        "less_than_equal": ("at most", "le"),
        "too_short": ("at least, entries:", "min_length"),
        "too_long": ("at most, entries:", "max_length"),
        "literal_error": ("one of", "expected"),
    }
    if kind in bounds:
        words, key = bounds[kind]
        return f"{words} {context[key]}"
    if kind.startswith("int"):
        return "a whole number"
    if kind.startswith(("float", "finite")):
        return "a finite number, in the unit that the key names"
    if kind in ("model_type", "dict_type", "model_attributes_type"):
        return "keys and values"
    if kind in ("tuple_type", "list_type"):
        return "a list"
    if kind == "string_type":
        return "a word"
    return message


def _dotted(place: tuple[Any, ...]) -> str:
    words = ""
    for part in place:
        words += f"[{part}]" if isinstance(part, int) else (f".{part}" if words else str(part))
    return words


def _shown(value: Any) -> str:
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _field_at(model: type[BaseModel], place: tuple[Any, ...]) -> Any:
    """Return the model or the field at a place, None where the place leads nowhere."""
    here: Any = model
    for part in place:
        if isinstance(part, int):
            continue
        fields = getattr(_inner_model(here), "model_fields", {})
        here = next((f for name, f in fields.items() if part in (name, f.alias)), None)
        if here is None:
            return None
    return here


def _inner_model(field: Any) -> Any:
    """Return the model that a field holds, alone, optional or in a list."""
    if isinstance(field, type):
        return field
    pending = [getattr(field, "annotation", None)]
    while pending:
        kind = pending.pop()
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            return kind
        pending.extend(getattr(kind, "__args__", ()))
    return None


def _keys_at(model: type[BaseModel], place: tuple[Any, ...]) -> list[str]:
    inner = _inner_model(_field_at(model, place)) if place else model
    return [field.alias or name for name, field in getattr(inner, "model_fields", {}).items()]


def _meaning(model: type[BaseModel], place: tuple[Any, ...]) -> str:
    description = getattr(_field_at(model, place), "description", None)
    return f"; needed: {description}" if description else ""
