"""What is wrong with a file of a campaign, collected so that all is told at once."""

import os
from pathlib import Path
from typing import NoReturn

from chatter_core.errors import InvalidInput
from chatter_core.reading import near_path

#: Largest file of measurements that is read [bytes]; a million lines of frequency response take 40 million.
LARGEST_TABLE = 200_000_000
#: Findings that are told in words, for one file; the others are counted.
MOST_FINDINGS = 12


class Findings:
    """Findings of one file: the first dozen in words, the others counted."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.told: list[str] = []
        self.count = 0

    def add(self, sentence: str, *, line: int | None = None, column: str | None = None) -> None:
        """Add what is wrong at a place of the file."""
        self.count += 1
        if self.count <= MOST_FINDINGS:
            place = [str(self.path)]
            place += [f"line {line}"] if line is not None else []
            place += [f"column {column}"] if column is not None else []
            self.told.append(f"{', '.join(place)}: {sentence}")

    def stop(self, sentence: str, *, line: int | None = None) -> NoReturn:
        """Raise InvalidInput with a finding after which the file cannot be read on."""
        self.add(sentence, line=line)
        raise InvalidInput(self.sentences())

    def raise_any(self) -> None:
        """Raise InvalidInput when there are findings."""
        if self.told:
            raise InvalidInput(self.sentences())

    def sentences(self) -> list[str]:
        """Return the findings, at the end how many more there are."""
        more = self.count - MOST_FINDINGS
        return self.told + ([f"{self.path}: and {more} more findings"] if more > 0 else [])


def checked_file(path: Path) -> Path:
    """Return a file's path; raise InvalidInput when it is no file of its folder or cannot be read."""
    if not path.is_file():
        what = "is no file" if path.exists() or path.is_symlink() else f"no such file{near_path(path)}"
        raise InvalidInput([f"{path}: {what}"])
    if not path.resolve().is_relative_to(path.parent.resolve()):
        raise InvalidInput([f"{path}: leads out of its folder; put the file itself there"])
    if not os.access(path, os.R_OK):
        raise InvalidInput([f"{path}: cannot be read: Permission denied"])
    size = path.stat().st_size
    if size > LARGEST_TABLE:
        raise InvalidInput([f"{path}: found {size} bytes, allowed: at most {LARGEST_TABLE}; keep fewer lines"])
    return path
