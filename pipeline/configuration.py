"""From the words of a command line to validated settings.

Hydra composes the configs that are shipped; nothing of it is ever instantiated. A ``machine`` that
looks like a path replaces the machine's parts by the content of that file.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from pydantic import ValidationError

import configs
from chatter_core.errors import InvalidInput
from chatter_core.reading import load_yaml, nearest, sentences
from pipeline.settings import Settings

CONFIGS = Path(next(iter(configs.__path__)))
#: Parts of a machine, each a key at the root of the config and in a machine.yaml.
MACHINE_KEYS = ("bearing", "spindle", "tip", "tool", "cutting", "process")


@dataclass(frozen=True, kw_only=True)
class Words:
    """Words of a command line, sorted: a verb's own options, group choices, and values of keys."""

    options: dict[str, str]
    choices: dict[str, str]
    values: list[str]
    machine_file: Path | None


def groups() -> dict[str, list[str]]:
    """Return the shipped groups and the choices in each."""
    return {
        folder.name: sorted(file.stem for file in folder.glob("*.yaml"))
        for folder in sorted(CONFIGS.iterdir())
        if folder.is_dir() and any(folder.glob("*.yaml"))
    }


def sort_words(words: list[str], options: tuple[str, ...]) -> Words:
    """Sort the words of a command line; ``options`` are the verb's own keys.

    Raises InvalidInput with every word that is not understood.
    """
    known, problems = groups(), []
    found: dict[str, str] = {}
    choices: dict[str, str] = {}
    values: list[str] = []
    machine_file = None
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key or key.strip("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_.[]"):
            problems.append(f"{word}: expected key=value")
        elif key in options:
            found[key] = value
        elif key == "machine" and (value.endswith((".yaml", ".yml")) or "/" in value):
            machine_file = Path(value)
        elif key in known:
            if value in known[key]:
                choices[key] = value
            else:
                problems.append(f"{key}: found {value!r}; {nearest(value, known[key])}")
        elif "." in key:
            values.append(word)
        else:
            problems.append(f"{key}: unknown key; {nearest(key, [*options, *known, 'machine'])}")
    if problems:
        raise InvalidInput(problems)
    return Words(options=found, choices=choices, values=values, machine_file=machine_file)


def compose_settings(words: Words) -> Settings:
    """Compose and validate the settings.

    Raises InvalidInput with every finding at once, each naming the key as it is written.
    """
    data = _compose(words)
    machine: dict[str, Any] = {key: data.pop(key) for key in MACHINE_KEYS if key in data}
    if words.machine_file is not None:
        machine = load_yaml(words.machine_file)
        machine = _with_values(machine, words.values)
        # What a shipped grid says of preloads does not concern a machine that knows none.
        if "tip" in machine and not any(word.startswith("grid.preload_n") for word in words.values):
            data["grid"].pop("preload_n", None)
    try:
        return Settings.model_validate({**data, "machine": machine})
    except ValidationError as error:
        raise InvalidInput([_as_written(s, words.machine_file) for s in sentences(error, Settings)]) from None


def _as_written(sentence: str, machine_file: Path | None) -> str:
    """Return a sentence with the key as the user writes it: a machine's parts stand at the root."""
    if not sentence.startswith("machine"):
        return sentence
    rest = sentence.removeprefix("machine").lstrip(".: ")
    return f"{machine_file}: {rest}" if machine_file else rest


def _compose(words: Words) -> dict[str, Any]:
    overrides = [f"{key}={value}" for key, value in words.choices.items()]
    foreign = words.machine_file is not None
    # Added by force: whether a key exists is for validation to say, with all other findings.
    overrides += [f"++{v}" for v in words.values if not (foreign and v.split(".")[0] in MACHINE_KEYS)]
    try:
        with initialize_config_dir(str(CONFIGS), version_base=None):
            composed = OmegaConf.to_container(compose("config", overrides), resolve=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise InvalidInput([f"{' '.join(words.values) or 'configs'}: {str(error).splitlines()[0]}"]) from None
    assert isinstance(composed, dict)
    return {str(key): value for key, value in composed.items()}


def _with_values(machine: dict[str, Any], values: list[str]) -> dict[str, Any]:
    """Return a machine file's content with the values of the command line put in."""
    mine = [word for word in values if word.split(".")[0] in MACHINE_KEYS]
    if not mine:
        return machine
    try:
        base = OmegaConf.create(machine)
        for word in mine:
            key, _, value = word.partition("=")
            OmegaConf.update(base, key, OmegaConf.create({"value": 0}) if value == "" else _parsed(value))
        merged = OmegaConf.to_container(base)
    except (OmegaConfBaseException, ValueError, IndexError, TypeError) as error:
        raise InvalidInput([f"{' '.join(mine)}: {str(error).splitlines()[0]}"]) from None
    assert isinstance(merged, dict)
    return {str(key): value for key, value in merged.items()}


def _parsed(value: str) -> Any:
    return OmegaConf.create([value]) if value.startswith("${") else OmegaConf.from_dotlist([f"value={value}"]).value
