"""From the words of a command line to validated settings.

Hydra composes the configs that are shipped; nothing of it is ever instantiated. A ``machine`` that
looks like a path replaces the machine's parts by the content of that file.
"""

import difflib
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar, overload

from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import OmegaConf
from pydantic import ValidationError
from yaml import YAMLError

from chatter_core.effects import effect_names, own_effects
from chatter_core.errors import InvalidInput
from chatter_core.machine import MACHINE_FILE
from chatter_core.reading import load_value, load_yaml, nearest, sentences, shown
from pipeline import shipped
from pipeline.keys import put
from pipeline.settings import Settings, Study
from pipeline.shipped import CONFIGS, EFFECTS, groups
from pipeline.telling import command
from pipeline.verbs.options import Options, no_address

Composed = TypeVar("Composed", bound=Study)

#: Parts of a machine, each a key at the root of the config and in a machine.yaml.
MACHINE_KEYS = ("bearing", "spindle", "tip", "tool", "cutting", "process")
#: Those of a machine that is built from its drawing, and the machine in which measured tip modes stand in their place.
BUILT_KEYS = ("bearing", "spindle")
MEASURED_TIP = "a machine of measured tip modes, which has no bearing and spindle"
#: Parts of the config that one kind of study has alone, and the verb that computes it.
PARTS_OF_KINDS = {"grid": "sweep", "design": "dataset"}
#: Option that names a folder with effects of the user's own. No yaml can: what it names is run.
EFFECTS_PATH = "effects_path"
#: Parts of the settings that have no keys of their own.
WITHOUT_KEYS = ("study", EFFECTS_PATH)
#: Names so much alike are one with a letter slipped.
SLIP = 0.8
#: Base models by name, and where they take the bearings' stiffness.
BASES = {"full": "dynamic", "static_bearing": "static"}


@dataclass(frozen=True, kw_only=True)
class Words:
    """Words of a command line, sorted: a verb's own options, group choices, and values of keys.

    taken: groups that the verb takes, for hints at what is allowed.
    """

    options: dict[str, str]
    choices: dict[str, str]
    values: list[str]
    machine_file: Path | None
    taken: tuple[str, ...]

    @property
    def of_machine(self) -> list[str]:
        """Words that say something of machine, grid, method, cluster or study."""
        return [*self.choices, *self.values, *(["machine"] if self.machine_file else [])]

    @property
    def say_the_preload(self) -> bool:
        """Whether they say the machine's own preload."""
        return any(word.startswith("spindle.preload_n=") for word in self.values)

    @property
    def name_the_preload(self) -> bool:
        """Whether the machine's own preload is named by the user, and no preloads of the grid are."""
        named = self.machine_file is not None or self.say_the_preload
        return named and not any(word.startswith("grid.preload_n") for word in self.values)


def words_for(kind: type[Options], words: list[str]) -> Words:
    """Sort the words of a verb's command line, as ``sort_words`` does."""
    return sort_words(words, kind.fields(), kind.groups, kind.instead)


def sort_words(
    words: list[str],
    options: Iterable[str],
    taken: Iterable[str] | None = None,
    instead: Mapping[str, str] = MappingProxyType({}),
) -> Words:
    """Sort the words of a command line; ``options`` are the verb's own keys.

    taken: groups that hints may name, without it all; instead: what is to be said of keys that are none. Raises
    InvalidInput with every word that is not understood.
    """
    options, known, problems = list(options), groups(), repeated(words)
    taken = tuple(known if taken is None else taken)
    found: dict[str, str] = {}
    choices: dict[str, str] = {}
    values: list[str] = []
    machine_file = None
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key or key.strip("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.[]"):
            problems.append(f"{word}: {_no_pair(word, options, known)}")
        elif key in options:
            found[key] = value
        elif key == "machine" and (value.endswith((".yaml", ".yml")) or "/" in value):
            problems += no_address(key, value)
            machine_file = Path(value)
        elif key in known:
            if value in known[key]:
                choices[key] = value
            else:
                problems.append(f"{key}: found {value!r}; {_near_choice(key, value, known[key])}")
        elif "." in key:
            values.append(word)
        else:
            said = instead.get(key) or f"unknown key; {_near_key(key, options, taken)}"
            problems.append(f"{key}: {said}")
    if problems:
        raise InvalidInput(problems)
    return Words(options=found, choices=choices, values=values, machine_file=machine_file, taken=taken)


def _near_choice(key: str, value: str, choices: list[str]) -> str:
    """Return a hint at the choice that may be meant; a machine may stand in a file, too, in a campaign's folder say."""
    if key != "machine":
        return nearest(value, choices)
    file = Path(value) / MACHINE_FILE
    # What is too long for a path, or may not be looked into, is none.
    return f"did you mean {file}?" if os.path.isfile(file) else f"{nearest(value, choices)}, or FILE.yaml"


def repeated(words: list[str]) -> list[str]:
    """Return what is to be said of options and groups that words give different values: which counts nobody would see.

    Of dotted keys the last word counts, so that what a script says can be changed behind it.
    """
    said: dict[str, list[str]] = {}
    for key, equals, value in (word.partition("=") for word in words):
        if key and equals and "." not in key and value not in said.setdefault(key, []):
            said[key].append(value)
    return [
        f"{key}: found {' and '.join(map(shown, values))}, allowed: one of them"
        for key, values in said.items()
        if len(values) > 1
    ]


def _no_pair(word: str, options: list[str], known: Mapping[str, list[str]]) -> str:
    """Return what to say of a word that is no key=value: options of other programs begin with dashes."""
    plain = word.lstrip("-")
    key = plain.partition("=")[0]
    meant = [f"{group}={plain}" for group in ("study", *known) if plain in known[group]]
    if word != plain and key in (*options, *known):
        meant = [plain if "=" in plain else f"{key}=..."]
    return f"expected key=value{f'; did you mean {meant[0]}?' if meant else ''}"


def _near_key(key: str, options: list[str], taken: tuple[str, ...]) -> str:
    """Return a hint at the key that may be meant: one of a group, written without it, or one that is alike."""
    whole = [dotted for group in taken for dotted in shipped.keys(group) if dotted.endswith(f".{key}")]
    return f"did you mean {' or '.join(sorted(whole, key=len)[:2])}?" if whole else nearest(key, [*options, *taken])


@overload
def compose_settings(words: Words) -> Settings: ...


@overload
def compose_settings(
    words: Words, kind: type[Composed], changes: Mapping[str, Any] = ..., change: Callable[[dict[str, Any]], None] = ...
) -> Composed: ...


def compose_settings(
    words: Words,
    kind: type[Study] = Settings,
    changes: Mapping[str, Any] = MappingProxyType({}),
    change: Callable[[dict[str, Any]], None] = lambda data: None,
) -> Study:
    """Compose and validate the settings of a kind of study.

    changes: parts in the place of shipped ones; change: what else is changed in the composed data, before the values of
    the command line are put in. Raises InvalidInput with every finding at once, each naming the key as it is written.
    """
    data = {**_compose(words), **changes}
    data = _of_kind(data, words, kind)
    if words.machine_file is not None:
        # A part that is chosen by name stays chosen.
        data = {key: value for key, value in data.items() if key not in MACHINE_KEYS or key in words.choices}
        described = load_yaml(words.machine_file)
        foreign = [key for key in described if key not in MACHINE_KEYS]
        if foreign:
            raise InvalidInput(
                [f"{words.machine_file}: {key}: unknown key; {nearest(key, list(MACHINE_KEYS))}" for key in foreign]
            )
        data |= {key: value for key, value in described.items() if key not in words.choices}
        if described.get("tip") is not None and (chosen := [key for key in BUILT_KEYS if key in words.choices]):
            raise InvalidInput([f"{key}={words.choices[key]}: has no meaning for {MEASURED_TIP}" for key in chosen])
    change(data)
    _check_preloads(words)
    if words.name_the_preload and "grid" in data:
        # It takes the place of a shipped grid's list, which would hide it.
        data["grid"].pop("preload_n", None)
    own = _own_folder(words)
    said = words.options.get(EFFECTS, json.dumps(data.get(EFFECTS) or []))
    named = named_effects(said, own)
    data[EFFECTS] = {name: configured_values(name, own) for name in named}
    data[EFFECTS_PATH] = own
    data = _with_values(data, words.values)
    off = [name for name in data[EFFECTS] if name not in named]
    if off:
        raise InvalidInput([f"effects.{name}: {_why_off(name, effect_names(own))}" for name in off])
    roots = [*MACHINE_KEYS, *(key for key in kind.model_fields if key != "machine")]
    problems = [f"{key}: unknown key; {_near_root(key, roots, words)}" for key in data if key not in roots]
    machine = {key: data[key] for key in MACHINE_KEYS if data.get(key) is not None}
    rest = {key: data[key] for key in kind.model_fields if key in data}
    try:
        settings = kind.model_validate({**rest, "machine": machine})
    except ValidationError as error:
        problems += [_as_written(sentence, words.machine_file) for sentence in sentences(error, kind)]
    if problems:
        raise InvalidInput(problems)
    return settings


def _check_preloads(words: Words) -> None:
    """Raise InvalidInput where both the machine's preload and those of the grid are named: the former says nothing."""
    of_grid = [word for word in words.values if re.match(r"grid\.preload_n(=|\.|\[)", word) and not _is_null(word)]
    if words.say_the_preload and of_grid:
        raise InvalidInput([f"spindle.preload_n: says nothing beside {of_grid[0]}; say one of the two"])


def _is_null(word: str) -> bool:
    try:
        return load_value(word.partition("=")[2]) is None
    except ValueError:
        return False


def _near_root(key: str, roots: list[str], words: Words) -> str:
    """Return a hint at the first part of a key that may be meant, of those that the verb takes."""
    refused = ({*groups()} - {*words.taken}) | {*WITHOUT_KEYS}
    return nearest(key, [root for root in roots if root not in refused])


def modal_parameters_of(base: str, beside: Iterable[str]) -> str:
    """Return where a base model takes the bearings' stiffness, with words ``key=value`` beside it that say so, too.

    Raises InvalidInput for every one of these that says something else.
    """
    held, problems = BASES[base], []
    for word in beside:
        try:
            agrees = load_value(word.partition("=")[2]) in (held, [held])
        except ValueError:
            agrees = False
        if not agrees:
            problems.append(f"base: found {base}, which holds {held} parameters, beside {word}; say one of the two")
    if problems:
        raise InvalidInput(problems)
    return held


def _own_folder(words: Words) -> Path | None:
    """Return the folder of effects that words name; raise InvalidInput where it is none, whether one is on or not."""
    if EFFECTS_PATH not in words.options:
        return None
    folder = Path(words.options[EFFECTS_PATH]).resolve()
    own_effects(folder)
    return folder


def _why_off(name: str, known: tuple[str, ...]) -> str:
    if name not in known:
        return f"unknown effect; {nearest(name, list(known))}"
    return f"the effect is not on; say effects=[{name}]"


def _of_kind(data: dict[str, Any], words: Words, kind: type[Study]) -> dict[str, Any]:
    """Return composed data without what another kind of study has; raise InvalidInput where that was asked for."""
    foreign = [key for key in PARTS_OF_KINDS if key not in kind.model_fields]
    asked = [word for word in (*words.choices, *words.values) if word.partition(".")[0].partition("=")[0] in foreign]
    problems = [f"{word}: not for this verb" for word in asked]
    for key, verb in PARTS_OF_KINDS.items():
        if key in kind.model_fields and data.get(key) is None:
            other = [command(of, f"study={data['study']}") for part, of in PARTS_OF_KINDS.items() if data.get(part)]
            problems.append(f"{key}: missing; study {data['study']} has none; compute it with: {' or '.join(other)}")
        elif key not in kind.model_fields and key == "design" and data.get(key) is not None and not asked:
            computed = command(verb, f"study={data['study']}")
            problems.append(f"study {data['study']} is a data set; compute it with: {computed}")
    if problems:
        raise InvalidInput(problems)
    return {key: value for key, value in data.items() if key not in foreign}


def configured_values(name: str, own: Path | None = None) -> dict[str, Any]:
    """Return the configured values of an effect, the program's or one of a user's ``own`` folder."""
    folder = own if own is not None and name in own_effects(own) else CONFIGS / EFFECTS
    return load_yaml(folder / f"{name}.yaml")


def named_effects(text: str, own: Path | None = None) -> list[str]:
    """Return the effects that ``effects=[a,b]`` names, of a user's ``own`` folder too.

    Raises InvalidInput for what is no list of names, for an unknown one, with the nearest, and for one named twice.
    """
    try:
        found = load_value(text)
    except ValueError:
        found = None
    names = [found] if isinstance(found, str) else found
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise InvalidInput([f"effects: found {shown(text)}, allowed: a list of names, effects=[a,b]"])
    problems = [_unknown_effect(name, own) for name in names if name not in effect_names(own)]
    problems += [f"effects: {name} stands twice" for name in sorted(set(names)) if names.count(name) > 1]
    if problems:
        raise InvalidInput(problems)
    return names


def _unknown_effect(name: str, own: Path | None) -> str:
    """Return a sentence about a name that no effect has: with the nearest, and where one of the user's own would be."""
    names = list(effect_names(own))
    said = f"effects: found {name!r}; {nearest(name, names)}"
    if difflib.get_close_matches(name, names, cutoff=SLIP):
        return said
    asked_for = f"yours are looked for in the folder that {EFFECTS_PATH}=DIR names"
    return f"{said} ({asked_for if own is None else f'nor is it in {own}'})"


def _as_written(sentence: str, machine_file: Path | None) -> str:
    """Return a sentence with the key as the user writes it: a machine's parts stand at the root."""
    if not sentence.startswith("machine"):
        return sentence
    rest = sentence.removeprefix("machine").lstrip(".: ")
    return f"{machine_file}: {rest}" if machine_file else rest


def _compose(words: Words) -> dict[str, Any]:
    """Return the configs as the choices compose them; raise InvalidInput where a file of theirs cannot be composed."""
    try:
        with initialize_config_dir(str(CONFIGS), version_base=None):
            composed = compose("config", [f"{key}={value}" for key, value in words.choices.items()])
    except (YAMLError, HydraException, ValueError) as error:
        for group, choice in words.choices.items():
            load_yaml(CONFIGS / group / f"{choice}.yaml")
        told = str(error) or str(error.__cause__) or type(error).__name__
        raise InvalidInput([f"{CONFIGS}: cannot be composed: {told.strip().splitlines()[0]}"]) from None
    data = OmegaConf.to_container(composed, resolve=False)
    assert isinstance(data, dict)
    return {str(key): value for key, value in data.items()}


def _has_measured_tip_alone(data: dict[str, Any]) -> bool:
    return data.get("tip") is not None and all(data.get(key) is None for key in BUILT_KEYS)


def _with_values(data: dict[str, Any], values: list[str]) -> dict[str, Any]:
    """Return the data with ``key=value`` words put in; whether a key exists is for validation to say."""
    changed, problems = deepcopy(data), []
    for word in values:
        key, _, text = word.partition("=")
        if key.partition(".")[0] in BUILT_KEYS and _has_measured_tip_alone(data):
            problems.append(f"{key}: has no meaning for {MEASURED_TIP}")
            continue
        try:
            put(changed, key, load_value(text))
        except ValueError as error:
            problems.append(f"{key}: {shown(text)} cannot be put there: {error}")
    if problems:
        raise InvalidInput(problems)
    return changed
