"""Answers in one file, to go on with elsewhere: python -m benchmarks.blind.archive {pack,unpack} FOLDER FILE.tar.xz.

What diagnoses answered and what their models predicted is kept; campaigns and truths are made again from their seeds,
and an answer holds only for the campaign and the program that it was computed with.
"""

import argparse
import io
import lzma
import tarfile
from pathlib import Path

from benchmarks.blind import kept

#: Folders of a run whose files are kept, by how they end.
FOLDERS, ENDING = ("diagnoses", "predictions"), ".json"


def pack(root: Path, file: Path) -> int:
    """Write the answers of a folder into a file, the same answers into the same bytes; return how many they are."""
    paths = sorted(path for name in FOLDERS for path in (root / name).rglob(f"*{ENDING}"))
    beside = file.with_name(f"{file.name}.draft")
    with lzma.open(beside, "wb", preset=9) as packed, tarfile.open(fileobj=packed, mode="w") as archive:
        for path in paths:
            content = path.read_bytes()
            entry = tarfile.TarInfo(path.relative_to(root).as_posix())
            entry.size = len(content)
            archive.addfile(entry, io.BytesIO(content))
    beside.replace(file)
    return len(paths)


def unpack(file: Path, root: Path) -> int:
    """Write the answers of a file into a folder, but for those that are there already; return how many were written.

    Raises ValueError where something else is in the file.
    """
    written = 0
    with tarfile.open(file, "r:xz") as archive:
        for entry in archive:
            place = Path(entry.name)
            if not entry.isfile() or place.is_absolute() or ".." in place.parts or place.parts[0] not in FOLDERS:
                raise ValueError(f"{file}: {entry.name} is no answer of a diagnosis")
            content = archive.extractfile(entry)
            assert content is not None
            if not (root / place).exists():
                kept.write_bytes(root / place, content.read())
                written += 1
    return written


def main() -> int:
    """Pack or unpack, and say how many."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind.archive", description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("pack", "unpack"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("file", type=Path)
    said = parser.parse_args()
    count = pack(said.folder, said.file) if said.what == "pack" else unpack(said.file, said.folder)
    print(f"{count} answers {said.what}ed")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
