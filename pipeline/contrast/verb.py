"""The verb: two studies are read, held against each other, and the answer left in a folder."""

from pathlib import Path
from tempfile import TemporaryDirectory

from chatter_core.errors import InvalidInput
from pipeline.configuration import sort_words
from pipeline.contrast import figures, findings, page, tables
from pipeline.contrast.contrasted import Contrast, contrast
from pipeline.contrast.lines import read
from pipeline.locking import held_for_results
from pipeline.places import STORES, Place
from pipeline.settings import Margins
from pipeline.study_place import MARGINS, margins_in, study_in

#: Options that name the studies, each by its folder or its address.
STUDIES = ("first", "second")


def run(words: list[str]) -> int:
    """Hold two studies against each other; return the exit code."""
    found = sort_words(words, (*STUDIES, "output", *MARGINS))
    foreign = [*found.choices, *found.values, *(["machine"] if found.machine_file else [])]
    problems = [f"{word}: not for contrast, which takes first, second, output and margins alone" for word in foreign]
    missing = [name for name in STUDIES if name not in found.options]
    problems += [f"{name}: missing; needed: a study's folder, or s3://BUCKET/PREFIX" for name in missing]
    if problems:
        raise InvalidInput(problems)
    margins = Margins.model_validate(margins_in({name: found.options.get(name, "") for name in MARGINS}))
    places = [_study(name, found.options[name]) for name in STUDIES]
    output = Path(found.options.get("output", Path("results") / f"contrast-{'-'.join(map(_short, places))}"))
    _refuse_loss(output)
    both = contrast(*(read(place, margins.said) for place in places))
    with held_for_results(output):
        written = _write(both, margins, output)
    for sentence in findings.findings(both):
        print(sentence)
    for path in written:
        print(f"written: {path}")
    return 0


def _study(name: str, value: str) -> Place:
    return study_in({"store" if "://" in value else "output": value}, name)


def _short(place: Place) -> str:
    """Return the last part of a folder's path, or of an address."""
    return place.option.rstrip("/").replace("=", "/").rsplit("/", 1)[-1].strip(".") or "here"


def _refuse_loss(output: Path) -> None:
    """Raise InvalidInput where the answer would be written into the folder of a study."""
    if any((output / store).exists() for store in STORES):
        raise InvalidInput([f"output: {output} is the folder of a study; name another"])


def _write(found: Contrast, margins: Margins, output: Path) -> list[Path]:
    """Write everything beside its place, then move it; return the paths."""
    with TemporaryDirectory(prefix=".writing-", dir=output) as folder:
        beside = Path(folder)
        made = tables.write(found, beside / "tables")
        made += [*figures.write(found, beside / "figures"), page.write(beside / "report.html", found, margins, made)]
        names = [path.relative_to(beside) for path in made]
        for name in names:
            (output / name).parent.mkdir(exist_ok=True)
            (beside / name).replace(output / name)
    return [output / name for name in names]
