"""The words of a verb that looks at the folder of a study which is there already."""

from collections.abc import Mapping
from pathlib import Path

from chatter_core.errors import InvalidInput
from pipeline.configuration import sort_words
from pipeline.store import UNPACKED


def study_folder(
    words: list[str], verb: str, options: Mapping[str, tuple[str, ...]] | None = None
) -> tuple[Path, dict[str, str]]:
    """Return the folder that ``output=DIR`` names, and the values of the verb's other options, by default the first.

    options: what each may be; without a choice it may be anything, by default empty. Raises InvalidInput for words of
    another kind, and where the folder holds no study.
    """
    options = options or {}
    found = sort_words(words, ("output", *options))
    foreign = [*found.choices, *found.values, *(["machine"] if found.machine_file else [])]
    takes = " and ".join(
        ["output=DIR", *(f"{option}={'|'.join(values) or '...'}" for option, values in options.items())]
    )
    problems = [f"{word}: not for {verb}, which takes {takes} alone" for word in foreign]
    if "output" not in found.options:
        problems.append("output: missing; needed: the folder of a study")
    said = {option: found.options.get(option, values[0] if values else "") for option, values in options.items()}
    for option, values in options.items():
        if values and said[option] not in values:
            problems.append(f"{option}: found {said[option]!r}, allowed: {', '.join(values)}")
    if problems:
        raise InvalidInput(problems)
    output = Path(found.options["output"])
    if not any((output / name).is_dir() for name in ("lobes.zarr", UNPACKED)):
        raise InvalidInput([f"output: {output} holds no lobes.zarr; compute it with: python -m pipeline sweep"])
    return output, said
