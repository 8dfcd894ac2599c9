"""The words of a verb that looks at a study which is there already."""

from collections.abc import Mapping
from typing import TypeVar

from chatter_core.errors import InvalidInput
from chatter_core.reading import near_path
from pipeline.configuration import Words, words_for
from pipeline.places import STORES, Folder, Place, place_of
from pipeline.places.folder import UNPACKED
from pipeline.telling import program
from pipeline.verbs.options import Options, PlaceOptions

Asked = TypeVar("Asked", bound=PlaceOptions)


def study_place(words: list[str], kind: type[Asked]) -> tuple[Place, Asked]:
    """Return the place that ``output=DIR`` or ``store=ADDRESS`` names, and the verb's options.

    Raises InvalidInput for words of another kind, and where the place holds no study.
    """
    found = words_for(kind, words)
    problems = foreign_words(found, kind)
    if not {"output", "store"} & set(found.options):
        problems.append("output: missing; needed: the folder of a study, or store=s3://BUCKET/PREFIX")
    if problems:
        raise InvalidInput(problems)
    options = kind.read(found.options)
    return study_in(found.options, "store" if "store" in found.options else "output"), options


def foreign_words(found: Words, kind: type[Options]) -> list[str]:
    """Return what is to be said of words that a verb without a machine does not take."""
    takes = ", ".join(f"{option}=..." for option in kind.fields() if option not in Options.fields())
    return [f"{word}: not for {kind.verb()}, which takes {takes} alone" for word in found.of_machine]


def study_in(options: Mapping[str, str], named: str) -> Place:
    """Return the place that ``output`` or ``store`` of some options names; named: by which word people named it.

    Raises InvalidInput where the place holds no study.
    """
    place = place_of(options)
    if not {place.root, f"{UNPACKED}{place.root}"} & place.names():
        value = place.option.partition("=")[2]
        near = near_path(place.output) if isinstance(place, Folder) else ""
        computed = f"; compute it with: {program()} sweep (or dataset)"
        raise InvalidInput([f"{named}: {value} holds no {' or '.join(STORES)}{near or computed}"])
    return place
