"""The verb: two studies are read, held against each other, and the answer left in a folder."""

from pathlib import Path

from chatter_core.errors import InvalidInput
from pipeline.answer_folder import PAGE, refuse_foreign, refuse_unwritten, write_whole
from pipeline.configuration import words_for
from pipeline.contrast import figures, findings, page, tables
from pipeline.contrast.contrasted import Contrast, contrast
from pipeline.contrast.lines import STUDIES, read
from pipeline.locking import held_for_results
from pipeline.places import Place
from pipeline.settings import Margins
from pipeline.study_place import foreign_words, study_in
from pipeline.telling import fact, say, wrote
from pipeline.verbs.stores import ContrastOptions

#: Files of an answer: its page, folders, and the file that no other verb's answer has.
TABLES, FIGURES = "tables", "figures"
MARK = f"{FIGURES}/{figures.NAME}"


def run(words: list[str]) -> int:
    """Hold two studies against each other; return the exit code."""
    found = words_for(ContrastOptions, words)
    problems = foreign_words(found, ContrastOptions)
    try:
        options = ContrastOptions.read(found.options)
    except InvalidInput as error:
        raise InvalidInput([*problems, *error.problems]) from None
    if problems:
        raise InvalidInput(problems)
    margins = Margins.model_validate(options.margins)
    places = [_study(name, getattr(options, name)) for name in STUDIES]
    output = options.output or Path("results") / f"contrast-{'-'.join(map(_short, places))}"
    _refuse_loss(output)
    both = contrast(*(read(place, margins.said) for place in places))
    with held_for_results(output):
        written = write_whole(lambda folder: _write(both, margins, folder), output)
    told = findings.findings(both)
    fact(findings=told)
    for sentence in told:
        say(sentence)
    wrote(written)
    return 0


def _refuse_loss(output: Path) -> None:
    """Raise InvalidInput where the answer would take the place of something that no earlier one has written."""
    refuse_foreign(output, [MARK])
    own = [PAGE, MARK, *(f"{TABLES}/{name}.csv" for name in tables.TABLES)]
    if not all((output / name).exists() for name in (PAGE, MARK)):
        refuse_unwritten(output, own)


def _study(name: str, value: str) -> Place:
    return study_in({"store" if "://" in value else "output": value}, name)


def _short(place: Place) -> str:
    """Return the last part of a folder's path, or of an address."""
    return place.option.rstrip("/").replace("=", "/").rsplit("/", 1)[-1].strip(".") or "here"


def _write(found: Contrast, margins: Margins, output: Path) -> list[Path]:
    made = tables.write(found, output / TABLES) + figures.write(found, output / FIGURES)
    return [*made, page.write(output / PAGE, found, margins, made)]
