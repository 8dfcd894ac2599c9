"""Completion on a command line: what may follow, for bash, zsh and fish.

A shell asks by ``chatter completion words LINE``, LINE up to the cursor, and gets a line for each word that may stand
there: the word, a tab, what it means. Nothing that computes is imported, and no more yaml is read than a word needs.
"""

import shlex
from collections.abc import Iterator
from importlib.resources import files
from os.path import isdir
from pathlib import Path

from chatter_core.errors import InvalidInput
from chatter_core.reading import nearest
from pipeline import shipped
from pipeline.verbs import ANSWERS, VERBS
from pipeline.verbs.options import MACHINE, Options
from pipeline.verbs.studies import FORMULA, VARY

SHELLS = ("bash", "zsh", "fish")

#: A word that may stand on the line, and what it means.
Proposal = tuple[str, str]


def answer(words: list[str]) -> str:
    """Return what makes a shell complete, or, asked by one, what may follow; raise InvalidInput for another shell."""
    if words[:1] == ["words"]:
        return "\n".join(f"{word}\t{meaning}" for word, meaning in proposals(" ".join(words[1:])))
    shell = words[0] if words else ""
    if shell not in SHELLS:
        raise InvalidInput([f"completion: found {shell!r}; {nearest(shell, list(SHELLS))}"])
    return (files("pipeline") / "templates" / f"completion.{shell}").read_text(encoding="utf-8").rstrip()


def proposals(line: str) -> list[Proposal]:
    """Return what the last word of a line may become; the line begins with the program's name."""
    *before, last = _words(line)
    verb = before[1] if len(before) > 1 else None
    if verb is None or (verb == "help" and len(before) == 2):
        found = _verbs(with_answers=verb is None)
    elif verb == "completion":
        found = ((shell, "") for shell in SHELLS)
    elif verb in VERBS:
        found = _of_verb(verb, VERBS[verb], last)
    else:
        return []
    said = {word.partition("=")[0] for word in before}
    return [(word, meaning) for word, meaning in found if word.startswith(last) and word.rstrip("=") not in said]


def _words(line: str) -> list[str]:
    """Return the words of a line, the last one as far as it is written, without the quotes that it began with."""
    for closing in ("", "'", '"'):
        try:
            words = shlex.split(line + closing)
        except ValueError:
            continue
        return [*words, ""] if line[-1:].isspace() and not closing else words or [""]
    return [""]


def _verbs(with_answers: bool) -> Iterator[Proposal]:
    for verb, kind in VERBS.items():
        yield verb, kind.summary()
    if with_answers:
        yield from ANSWERS.items()


def _of_verb(verb: str, kind: type[Options], word: str) -> Iterator[Proposal]:
    """Yield words of a verb: keys, or once there is a = values of the key."""
    key, equals, value = word.partition("=")
    if equals:
        yield from ((f"{key}={one}", "") for one in _values(kind, key, value))
    elif verb == "dataset" and word.startswith((VARY, FORMULA)):
        first = VARY if word.startswith(VARY) else FORMULA
        yield from ((f"{first}{one}=", "") for group in MACHINE[1:] for one in shipped.keys(group))
    elif "." in word:
        yield from ((one if one.endswith(".") else f"{one}=", "") for one in _dotted(kind, word))
    else:
        yield from ((f"{name}=", field.description or "") for name, field in kind.fields().items())
        for group in kind.groups:
            yield f"{group}=", f"a choice of configs/{group}"
            if group not in shipped.CHOOSING:
                yield f"{group}.", f"a key of {group}"
        if "effects" in kind.fields():
            yield f"{shipped.EFFECTS}.", "a value of an effect that is on"
        if verb == "dataset":
            yield VARY, "a key that varies"
            yield FORMULA, "a key that follows from others"


def _dotted(kind: type[Options], word: str) -> list[str]:
    """Return dotted keys of the group, or the effect, that a word begins with."""
    group, _, rest = word.partition(".")
    if group in kind.groups:
        return shipped.keys(group)
    if group == shipped.EFFECTS and "effects" in kind.fields():
        effect, dot, _ = rest.partition(".")
        return shipped.effect_keys(effect) if dot else [f"{group}.{one}." for one in shipped.effects()]
    return []


def _values(kind: type[Options], key: str, value: str) -> Iterator[str]:
    """Yield values of a key: choices, names of effects, files."""
    if key in kind.groups:
        yield from shipped.groups()[key]
    if key == shipped.EFFECTS:
        # The last of a list is completed, the others stay.
        begun = value[: max(value.rfind("["), value.rfind(",")) + 1]
        yield from (f"{begun}{one}" for one in shipped.effects())
    field = kind.fields().get(key)
    choices = kind.choices_of(key) if field else ()
    yield from choices
    if key in ("machine", "design") or (field and kind.is_path(key)):
        yield from _paths(value)


def _paths(begun: str) -> Iterator[str]:
    """Yield files and folders whose path begins so; a folder ends in a slash."""
    folder, slash, name = begun.rpartition("/")
    try:
        entries = sorted(Path(folder + slash or ".").iterdir())
    except OSError:
        return
    for entry in entries:
        if entry.name.startswith(name) and (name.startswith(".") or not entry.name.startswith(".")):
            # Unlike Path.is_dir it says no where we may not look.
            yield f"{folder}{slash}{entry.name}{'/' * isdir(entry)}"
