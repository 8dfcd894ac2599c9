"""What a run tells, and where: text for people, how far it is, errors, and one JSON object for scripts.

Nothing else writes to standard output or standard error, but the entry before this is loaded. As text, people's text
goes to the first, the rest to the second; with ``format=json`` the first holds the object alone; with ``quiet=true``
nothing is told but errors.
"""

import json
import math
import os
import re
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from chatter_core.reading import printable

#: Letters of a word that an error repeats; paths of files are shorter, mostly.
LONGEST_WORD = 300
_ENDLESS = re.compile(rf"\S{{{LONGEST_WORD + 1},}}")


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
    if _now.as_json:
        note(text)
    elif not _now.quiet:
        _answer(text)


def note(text: str) -> None:
    """Tell people how far something is, or what is done meanwhile."""
    if not _now.quiet:
        _aside(text)


def _answer(text: str) -> None:
    """Write to standard output; raise OSError where that cannot be written, BrokenPipeError where nobody reads it."""
    try:
        _put(text, sys.stdout)
    except BrokenPipeError:
        raise
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from None


def _aside(text: str) -> None:
    """Write to standard error; where nobody can hear it, that is no reason for a run to end."""
    with suppress(OSError):
        _put(text, sys.stderr)


def _put(text: str, stream: TextIO | None) -> None:
    """Write text, letters that the stream does not have by their numbers; a stream that was closed is none."""
    if stream is not None:
        encoding = getattr(stream, "encoding", None) or "utf-8"
        print(text.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)


def remark(text: str) -> None:
    """Tell something odd in what was read, which is no error."""
    _now.remarks.append(text)
    say(text)


def complain(text: str) -> None:
    """Tell an error; endless words are cut short, and control characters in a file's name do nothing to a terminal."""
    told = _ENDLESS.sub(lambda word: f"{word[0][:LONGEST_WORD]}...", text)
    _now.errors.append(told)
    _aside(f"error: {printable(told)}")


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
    return sys.stderr is not None and sys.stderr.isatty() and not _now.quiet


@contextmanager
def alone(telling: Telling) -> Iterator[None]:
    """Keep standard output for the JSON object where one is asked for.

    What others print meanwhile, a law of the user's own or a worker that it runs on, goes to standard error.
    """
    if not telling.as_json or sys.stdout is None or sys.stderr is None:
        yield
        return
    with redirect_stdout(sys.stderr), _inherited_aside(sys.__stdout__, sys.__stderr__):
        yield


@contextmanager
def _inherited_aside(answer: TextIO | None, aside: TextIO | None) -> Iterator[None]:
    """Have processes that are started meanwhile write to ``aside`` what they write to ``answer``."""
    if answer is None or aside is None:
        yield
        return
    answer.flush()
    number = answer.fileno()
    kept = os.dup(number)
    try:
        os.dup2(aside.fileno(), number)
        yield
    finally:
        os.dup2(kept, number)
        os.close(kept)


def leave_telling() -> None:
    """Leave the JSON object to another process of this run."""
    _now.as_json = False


def finish(telling: Telling, verb: str, code: int) -> int:
    """Write the JSON object where one was asked for; return the exit code."""
    if telling.as_json:
        ends = {"written": telling.written, "remarks": telling.remarks, "errors": telling.errors, "exit_code": code}
        _answer(json.dumps(plain({"verb": verb, **telling.facts, **ends}), indent=2, allow_nan=False))
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
