"""Folders that hold an answer: whose they are, and how an answer takes the place of an earlier one.

An answer is written beside its place and then moved: a disk that fills up, or a signal, leaves what was there. One that
comes while files are moved waits for the last.
"""

import os
import shutil
from collections.abc import Callable, Collection, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory

from chatter_core.errors import InvalidInput
from pipeline.errors import told_where
from pipeline.locking import make_folder
from pipeline.places import STORES
from pipeline.places.address import POINTER
from pipeline.places.folder import UNPACKED
from pipeline.stopping import held_back

#: What every answer has for people.
PAGE = "report.html"
#: Beginning of the names of folders in which answers are written.
BESIDE = ".writing-"
#: Bytes of a first line that are looked at.
LONGEST_LINE = 10_000
#: What only the folder of a study holds.
OF_A_STUDY = (*STORES, *(f"{UNPACKED}{store}" for store in STORES), POINTER)


def refuse_foreign(output: Path, marks: Collection[str]) -> None:
    """Raise InvalidInput where a folder holds a study, or a page that is no earlier answer.

    marks: files, of which one lies beside the page of every answer that may stand there.
    """
    if any((output / name).exists() for name in OF_A_STUDY) or {*STORES} & {*output.resolve().parts}:
        raise InvalidInput([f"output: {output} is the folder of a study; name another"])
    if (output / PAGE).exists() and not any((output / mark).exists() for mark in marks):
        raise InvalidInput([f"output: {output} holds a {PAGE} that another verb has written; name another folder"])


def require_room(output: Path, names: Iterable[Path | str]) -> None:
    """Raise InvalidInput where something that is no file stands in the place of a file of an answer."""
    for place in [output / name for name in names]:
        if place.is_dir():
            raise InvalidInput([f"output: {place} is a folder, and a file of the answer is called so; name another"])
        if (
            place.parent != output
            and place.parent.exists()
            and (not place.parent.is_dir() or place.parent.is_symlink())
        ):
            found = "a link" if place.parent.is_symlink() else "no folder"
            raise InvalidInput(
                [f"output: {place.parent} is {found}, and a folder of the answer is called so; name another"]
            )


def refuse_unwritten(output: Path, names: Iterable[str]) -> None:
    """Raise InvalidInput where a folder without an earlier answer holds files that are called as those of one."""
    for name in names:
        if (output / name).exists():
            raise InvalidInput([f"output: {output} holds a {name} that no earlier answer has written; name another"])


def refuse_other_file(path: Path, named: str, is_answer: Callable[[str], bool]) -> None:
    """Raise InvalidInput where a file stands that no earlier answer is.

    named: by which word people named it; is_answer: whether a first line is that of an answer.
    """
    if not path.is_file():
        return
    with told_where(path, named), path.open("rb") as file:
        first = file.readline(LONGEST_LINE).decode("utf-8", "replace")
    if first and not is_answer(first):
        raise InvalidInput([f"{named}: {path} holds something that no earlier answer is; name another file"])


def write_text(path: Path, text: str) -> None:
    """Write a file beside its place and move it there: what fails halfway leaves what was there before."""
    if path.exists() and not path.is_file():
        # A pipe or a terminal; whatever else it is says so itself.
        path.write_text(text, encoding="utf-8")
        return
    place = path.resolve()
    # A name of its own: beside a long one a longer one may be too long.
    beside = place.with_name(f"{BESIDE}{os.getpid()}")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(place)
    finally:
        beside.unlink(missing_ok=True)


def write_whole(write: Callable[[Path], list[Path]], output: Path, earlier: Iterable[str] = ()) -> list[Path]:
    """Leave files in a folder that this run holds, all or none; return their paths.

    write: puts them into the folder it is given and returns their paths; earlier: names of files of an earlier answer,
    which go where they are not written anew. Raises InvalidInput where one has no room.
    """
    # Who cleared away the empty folder during the run has not meant its answer.
    make_folder(output)
    # What a run that was killed had begun; nobody else writes here now.
    for left in output.glob(f"{BESIDE}*"):
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left)
    with TemporaryDirectory(prefix=BESIDE, dir=output) as folder:
        beside = Path(folder)
        names = [path.relative_to(beside) for path in write(beside)]
        over = {*map(Path, earlier)} - {*names}
        require_room(output, [*names, *over])
        with held_back():
            # A folder may find no room, and nothing has been moved yet.
            for name in names:
                (output / name).parent.mkdir(exist_ok=True)
            for name in names:
                (beside / name).replace(output / name)
            for name in over:
                (output / name).unlink(missing_ok=True)
    return [output / name for name in names]
