"""The words of a verb that looks at a study which is there already."""

from collections.abc import Mapping

from pydantic import ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.reading import sentences
from pipeline.configuration import sort_words
from pipeline.places import OPTIONS, STORES, Place, place_of
from pipeline.places.folder import UNPACKED
from pipeline.settings import Margins

#: Options that say how far recommended cuts keep from their boundary, as settings of a study do.
MARGINS = {f"margins.{field.alias}": tuple[str, ...]() for field in Margins.model_fields.values()}


def margins_in(options: Mapping[str, str]) -> dict[str, float]:
    """Return the margins that options say, by their keys; raise InvalidInput for what are none."""
    said = {option.partition(".")[2]: options[option] for option in MARGINS if options[option]}
    try:
        return {key: Margins.model_validate(said).said[key] for key in said}
    except ValidationError as error:
        raise InvalidInput([f"margins.{one}" for one in sentences(error, Margins)]) from None


def study_place(
    words: list[str], verb: str, options: Mapping[str, tuple[str, ...]] | None = None
) -> tuple[Place, dict[str, str]]:
    """Return the place that ``output=DIR`` or ``store=ADDRESS`` names, and the values of the verb's other options.

    options: what each may be, the first by default; without a choice it may be anything, by default empty. Raises
    InvalidInput for words of another kind, and where the place holds no study.
    """
    options = options or {}
    found = sort_words(words, (*OPTIONS, *options))
    foreign = [*found.choices, *found.values, *(["machine"] if found.machine_file else [])]
    own = [f"{option}={'|'.join(values) or '...'}" for option, values in options.items()]
    takes = " and ".join(["output=DIR or store=ADDRESS", *own])
    problems = [f"{word}: not for {verb}, which takes {takes} alone" for word in foreign]
    if not {"output", "store"} & set(found.options):
        problems.append("output: missing; needed: the folder of a study, or store=s3://BUCKET/PREFIX")
    said = {option: found.options.get(option, values[0] if values else "") for option, values in options.items()}
    for option, values in options.items():
        if values and said[option] not in values:
            problems.append(f"{option}: found {said[option]!r}, allowed: {', '.join(values)}")
    if problems:
        raise InvalidInput(problems)
    return study_in(found.options, "store" if "store" in found.options else "output"), said


def study_in(options: Mapping[str, str], named: str) -> Place:
    """Return the place that ``output`` or ``store`` of some options names; named: by which word people named it.

    Raises InvalidInput where the place holds no study.
    """
    place = place_of(options)
    if not {place.root, f"{UNPACKED}{place.root}"} & place.names():
        value = place.option.partition("=")[2]
        raise InvalidInput(
            [f"{named}: {value} holds no {' or '.join(STORES)}; compute it with: python -m pipeline sweep (or dataset)"]
        )
    return place
