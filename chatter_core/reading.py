"""Reading what a user wrote: yaml files, and validation findings as plain sentences."""

import difflib
import re
from pathlib import Path
from typing import Any

import yaml
from pydantic import BaseModel, ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine

#: Largest yaml file that is read [bytes]; a machine takes about 2000.
LARGEST_FILE = 1_000_000
#: Levels of lists and keys in one another; a machine has four.
DEEPEST = 20


class _PlainLoader(yaml.SafeLoader):
    """Safe loader for descriptions: words, numbers, true, false, null, lists and keys with values.

    What YAML 1.1 guesses beyond that (dates, sexagesimal and octal numbers, yes and no as truth
    values) stays a word. Tags, aliases, repeated keys and deep nesting are refused.
    """

    yaml_implicit_resolvers = {}  # noqa: RUF012  # what SafeLoader would guess
    depth = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        mark: Any = event.start_mark
        if isinstance(event, yaml.AliasEvent):
            raise yaml.MarkedYAMLError(problem="an alias (*name) is not allowed", problem_mark=mark)
        if getattr(event, "tag", None) is not None:
            raise yaml.MarkedYAMLError(problem=f"a tag ({event.tag}) is not allowed", problem_mark=mark)
        if self.depth >= DEEPEST:
            raise yaml.MarkedYAMLError(problem="nested too deeply", problem_mark=mark)
        self.depth += 1
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node

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


_DECIMAL = r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?"
for _tag, _pattern, _starts in (
    ("null", r"~|null|Null|NULL|", ["~", "n", "N", ""]),
    ("bool", r"true|True|TRUE|false|False|FALSE", list("tTfF")),
    ("int", r"[-+]?(0|[1-9][0-9]{0,17})", list("-+0123456789")),
    ("float", rf"{_DECIMAL}|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)", list("-+.0123456789")),
):
    _PlainLoader.add_implicit_resolver(f"tag:yaml.org,2002:{_tag}", re.compile(f"^(?:{_pattern})$"), _starts)


def load_value(text: str) -> Any:
    """Return the value that a piece of yaml says.

    Raises ValueError, in one sentence, when it is no plain yaml.
    """
    try:
        return yaml.load(text, _PlainLoader)
    except yaml.YAMLError as error:
        raise ValueError(getattr(error, "problem", None) or str(error).splitlines()[0]) from None


def load_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a yaml file.

    Raises InvalidInput, naming file and line, when it cannot be read or is no mapping.
    """
    try:
        if path.exists() and not path.is_file():
            inside = sorted(path.glob("*.yaml"))[:1]
            raise InvalidInput([f"{path}: is no file{''.join(f'; did you mean {one}?' for one in inside)}"])
        if path.stat().st_size > LARGEST_FILE:
            raise InvalidInput([f"{path}: larger than {LARGEST_FILE} bytes, which no description needs"])
        content = yaml.load(path.read_text(encoding="utf-8-sig"), _PlainLoader)
    except FileNotFoundError:
        raise InvalidInput([f"{path}: no such file{near_path(path)}"]) from None
    except UnicodeDecodeError as error:
        raise InvalidInput([f"{path}: is no UTF-8 text, byte {error.start} cannot be read"]) from None
    except OSError as error:
        raise InvalidInput([f"{path}: cannot be read: {error.strerror}"]) from None
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        line = f", line {mark.line + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise InvalidInput([f"{path}{line}: no valid yaml: {problem}"]) from None
    if not isinstance(content, dict):
        raise InvalidInput([f"{path}: expected keys and values, found {shown(content)}"])
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
    findings = error.errors()
    # A list counts as empty while its entries are wrong: that says nothing beside what is wrong with them.
    inner = {finding["loc"][:size] for finding in findings for size in range(len(finding["loc"]))}
    return [
        _sentence(dict(finding), model)
        for finding in findings
        if not (finding["type"] == "too_short" and finding["loc"] in inner)
    ]


def nearest(word: str, allowed: list[str]) -> str:
    """Return a hint at the nearest allowed word, or the list of all."""
    close = difflib.get_close_matches(word, allowed, n=1, cutoff=0.5)
    return f"did you mean {close[0]}?" if close else f"allowed: {', '.join(allowed)}"


def near_path(path: Path) -> str:
    """Return a hint, to be put behind a sentence, at what is there of a name near to that of a path that is not."""
    missing = next((one for one in reversed((path, *path.parents)) if not one.exists()), None)
    if missing is None:
        return ""
    try:
        names = sorted(entry.name for entry in missing.parent.iterdir() if entry != missing)
    except OSError:
        return ""
    close = difflib.get_close_matches(missing.name, names, n=1)
    return f"; did you mean {missing.parent / close[0] / path.relative_to(missing)}?" if close else ""


def _sentence(finding: dict[str, Any], model: type[BaseModel]) -> str:
    place, kind, context = finding["loc"], finding["type"], finding.get("ctx", {})
    where = _dotted(place)
    if kind == "extra_forbidden":
        return f"{where}: unknown key; {nearest(str(place[-1]), _keys_at(model, place[:-1]))}"
    if kind == "missing":
        return f"{where}: missing{_meaning(model, place)}"
    if kind == "value_error":
        told = str(context["error"])
        # A key of the place that it begins with is written whole, to be copied.
        joined = "." if told.partition(":")[0] in _keys_at(model, place) else ": "
        return f"{where}{joined}{told}" if where else told
    return f"{where}: found {shown(finding['input'])}, allowed: {_allowed(kind, context, finding['msg'])}"


def _allowed(kind: str, context: dict[str, Any], message: str) -> str:
    bounds = {
        "greater_than": ("more than", "gt"),
        "greater_than_equal": ("at least", "ge"),
        "less_than": ("less than", "lt"),
        "less_than_equal": ("at most", "le"),
        "too_short": ("at least", "min_length"),
        "too_long": ("at most", "max_length"),
        "literal_error": ("one of", "expected"),
    }
    if kind in ("too_short", "too_long"):
        words, key = bounds[kind]
        return f"{words} {context[key]} {'entry' if context[key] == 1 else 'entries'}"
    if kind in bounds:
        words, key = bounds[kind]
        return f"{words} {context[key]}"
    named = str(context.get("discriminator", "")).strip("'")
    if kind == "union_tag_invalid":
        return f"{named}: one of {context['expected_tags']}"
    if kind == "union_tag_not_found":
        return f"keys and values, {named} among them"
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
        name = part or "''"
        words += f"[{part}]" if isinstance(part, int) else (f".{name}" if words else str(name))
    return words


def printable(text: str) -> str:
    """Return text whose control characters, as a file's name may hold, do nothing to a terminal."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in text)


def shown(value: Any) -> str:
    """Return a value as messages show it, cut short where it is long."""
    text = repr(value) if isinstance(value, str) else str(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _field_at(model: type[BaseModel], place: tuple[Any, ...]) -> Any:
    """Return the model or the field at a place, None where the place leads nowhere."""
    here: Any = model
    for part in place:
        if isinstance(part, int):
            continue
        fields = getattr(inner_model(here), "model_fields", {})
        here = next((f for name, f in fields.items() if part in (name, f.alias)), None)
        if here is None:
            return None
    return here


def inner_model(field: Any) -> Any:
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
    inner = inner_model(_field_at(model, place)) if place else model
    return [field.alias or name for name, field in getattr(inner, "model_fields", {}).items()]


def _meaning(model: type[BaseModel], place: tuple[Any, ...]) -> str:
    description = getattr(_field_at(model, place), "description", None)
    return f"; needed: {description}" if description else ""
