"""What docs/reference/answers.md says of the keys and columns of answers, to hold answers to it."""

import re
from collections.abc import Iterable, Iterator

from tests.documentation.commands import ROOT

PAGE = ROOT / "docs" / "reference" / "answers.md"
_SECTION = re.compile(r"^##+ (?P<title>.+?)\n(?P<text>.*?)(?=^##|\Z)", re.MULTILINE | re.DOTALL)
_ROW = re.compile(r"^\| (?P<keys>`.*?`) \| ?(?P<text>.*?) ?\|$", re.MULTILINE)
_KEY = re.compile(r"`(.+?)`")
_PART = re.compile(r"\[[^\]]*\]\(#(.+?)\)")

#: A place in an answer: keys on the way to it, "[]" for every entry of a list; in capitals, a name that data give.
Place = tuple[str, ...]


def sections() -> dict[str, str]:
    """Return the sections of the page by what links to them say."""
    found = _SECTION.finditer(PAGE.read_text(encoding="utf-8"))
    return {one["title"].lower().replace(" ", "-"): one["text"] for one in found}


def documented(title: str) -> Iterator[Place]:
    """Yield every place that a section has, those of its parts included."""
    text = sections()[title]
    for row in _ROW.finditer(text):
        part = _PART.search(row["text"])
        for key in _KEY.findall(row["keys"]):
            place = tuple(key.replace("[]", ".[]").split("."))
            yield place
            if part is not None:
                yield from ((*place, *rest) for rest in documented(part[1]))


def places(answer: object, here: Place = ()) -> Iterator[tuple[Place, bool]]:
    """Yield every place of an answer that ends there, and whether it holds a value or nothing."""
    entries: list[tuple[str, object]] = []
    if isinstance(answer, dict):
        entries = list(answer.items())
    elif isinstance(answer, list):
        entries = [("[]", entry) for entry in answer]
    for key, value in entries:
        yield from places(value, (*here, key))
    if not entries:
        yield here, answer not in (None, [], {})


def undocumented(answer: object, title: str, *, but: Iterable[str] = ()) -> set[Place]:
    """Return the places of an answer that a section does not have; but: keys whose content is told elsewhere.

    Where an answer holds nothing, as a list without entries, the section may say what it else would.
    """
    meant = set(documented(title))
    return {
        place
        for place, known in places(answer)
        if place[0] not in but and not any(_is(place, one if known else one[: len(place)]) for one in meant)
    }


def unseen(answer: object, title: str) -> set[Place]:
    """Return the places of a section that an answer does not have, nor anything in which they would lie."""
    seen = list(places(answer))
    return {
        meant
        for meant in documented(title)
        if not any(
            _is(place[: len(meant)], meant) or (not known and _is(place, meant[: len(place)])) for place, known in seen
        )
    }


def undocumented_columns(columns: Iterable[str], title: str) -> set[str]:
    """Return the columns of a table that a section does not have."""
    meant = [re.sub("[A-Z]+", "[a-z_]+", key) for (key, *_) in documented(title)]
    return {column for column in columns if not any(re.fullmatch(one, column) for one in meant)}


def _is(place: Place, meant: Place) -> bool:
    """Return whether a place is one that is documented."""
    return len(place) == len(meant) and all(
        key == word or (word.isupper() and key != "[]") for key, word in zip(place, meant, strict=True)
    )
