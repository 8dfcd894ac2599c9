"""What a run tells, and where: text for people, how far it is, errors, and one JSON object for scripts.

Nothing else writes to standard output or standard error. As text, people's text goes to the first, the rest to the
second; with ``format=json`` the first holds the object alone; with ``quiet=true`` nothing is told but errors.
"""

import json
import math
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from chatter_core.reading import printable


@dataclass(kw_only=True)
class Telling:
    """How a run tells, and what it has told so far."""

    as_json: bool = False
    quiet: bool = False
    facts: dict[str, Any] = field(default_factory=dict)
    written: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)


_now = Telling()


@contextmanager
def told(words: Iterable[str]) -> Iterator[Telling]:
    """Have everything told as the words ask for, ``format=json`` and ``quiet=true`` among them.

    What other values they have is for the verb to refuse.
    """
    global _now
    said = dict(word.split("=", 1) for word in words if "=" in word)
    before, _now = _now, Telling(as_json=said.get("format") == "json", quiet=said.get("quiet", "").lower() == "true")
    try:
        yield _now
    finally:
        _now = before


def say(text: str) -> None:
    """Tell people an answer."""
    if not _now.quiet:
        print(text, file=sys.stderr if _now.as_json else sys.stdout, flush=True)


def note(text: str) -> None:
    """Tell people how far something is, or what is done meanwhile."""
    if not _now.quiet:
        print(text, file=sys.stderr, flush=True)


def remark(text: str) -> None:
    """Tell something odd in what was read, which is no error."""
    _now.remarks.append(text)
    say(text)


def complain(text: str) -> None:
    """Tell an error; control characters, as a file's name may hold, do nothing to a terminal."""
    _now.errors.append(text)
    print(f"error: {printable(text)}", file=sys.stderr, flush=True)


def wrote(paths: Iterable[Path]) -> None:
    """Tell what was written."""
    for path in paths:
        _now.written.append(str(path))
        say(f"written: {path}")


def fact(**facts: Any) -> None:
    """Add to the JSON object; people are not told."""
    _now.facts.update(facts)


def bars() -> bool:
    """Return whether a bar may show how far something is: on a terminal that can go back in a line, to people."""
    return sys.stderr.isatty() and not _now.quiet


def leave_telling() -> None:
    """Leave the JSON object to another process of this run."""
    _now.as_json = False


def finish(telling: Telling, verb: str, code: int) -> int:
    """Write the JSON object where one was asked for; return the exit code."""
    if telling.as_json:
        ends = {"written": telling.written, "remarks": telling.remarks, "errors": telling.errors, "exit_code": code}
        print(json.dumps(plain({"verb": verb, **telling.facts, **ends}), indent=2, allow_nan=False), flush=True)
    return code


def program() -> str:
    """Return how people have called the program."""
    return "chatter" if Path(sys.argv[0]).stem == "chatter" else "python -m pipeline"


def command(*words: str) -> str:
    """Return a command that people can type."""
    return f"{program()} {shlex.join(words)}"


def plain(value: Any) -> Any:
    """Return a value as JSON holds it: what is not a finite number is null, an array is a list, a path a word."""
    if isinstance(value, dict):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if hasattr(value, "tolist"):
        # Of numpy, which need not be there yet.
        return plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return str(value) if isinstance(value, Path) else value
