"""A study in a folder: its pieces are files."""

import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path

from chatter_core.errors import InvalidInput
from pipeline.locking import locked, make_folder, remove_empty
from pipeline.places.place import LOBES, Found, Given, Place, StillHeld, as_long_as_it_takes

#: A store that is being packed, and what the one that it takes the place of is called before its own name.
PACKING, UNPACKED = "packing.zarr", "unpacked-"
#: Ending of files that are not whole yet; zarr's are named so too.
PARTIAL = ".partial"


@dataclass(frozen=True)
class Folder(Place):
    """A folder of this machine, or of a file system that it shares."""

    output: Path
    root: str = LOBES

    @property
    def option(self) -> str:
        """How a command line names the folder."""
        return f"output={self.output}"

    @property
    def opening(self) -> str:
        """What opens the store in Python, in this folder."""
        return f'xarray.open_zarr("{self.root}")'

    def __str__(self) -> str:
        return str(self.output)

    def where(self, key: str) -> str:
        """Return the path of a piece."""
        return str(self.output / key)

    def anywhere(self) -> "Folder":
        """Return the folder by its absolute path."""
        return replace(self, output=self.output.resolve())

    @contextmanager
    def held(self) -> Iterator[StillHeld]:
        """Hold the folder, made where it is missing, as long as this process lives."""
        existed = self.output.exists()
        make_folder(self.output)
        with locked(self.output):
            try:
                self._tidy()
                yield as_long_as_it_takes
            except InvalidInput:
                if not existed:
                    remove_empty(self.output)
                raise

    def make_output(self) -> Path:
        """Return the folder itself."""
        return self.output

    def store(self) -> Path:
        """Return the folder of the store."""
        return self.output / self.root

    def names(self) -> set[str]:
        """Return what is in the folder."""
        return {entry.name for entry in self.output.iterdir()} if self.output.is_dir() else set()

    def written(self, folder: str) -> Iterator[tuple[str, float]]:
        """Yield every file in a folder, and when it was written [s since 1970]; not what a lost machine left empty."""
        return ((key, seen.st_mtime) for key, seen in self._files(folder) if seen.st_size and not key.endswith(PARTIAL))

    def read(self, key: str) -> bytes:
        """Return the content of a file."""
        return (self.output / key).read_bytes()

    def write(self, key: str, content: bytes) -> None:
        """Write a file whole or not at all, and have it on the disk, since a machine may be lost too."""
        file = self.output / key
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_name(f"{file.name}{PARTIAL}")
        try:
            partial.write_bytes(content)
            settle(partial)
            os.replace(partial, file)
        finally:
            partial.unlink(missing_ok=True)

    def delete(self, key: str) -> None:
        """Remove a file."""
        (self.output / key).unlink(missing_ok=True)

    def each(self, function: Callable[[Given], Found], given: Iterable[Given]) -> Iterator[Found]:
        """Yield what a function returns, one after the other: a disk answers at once."""
        return map(function, given)

    def exchange(self) -> None:
        """Put the packed store in the place of the one that it was made from."""
        # The one that goes is the only other one.
        for path in (self.output / PACKING).rglob("*"):
            settle(path)
        (self.output / self.root).rename(self.output / f"{UNPACKED}{self.root}")
        (self.output / PACKING).rename(self.output / self.root)
        shutil.rmtree(self.output / f"{UNPACKED}{self.root}")

    def _tidy(self) -> None:
        """Bring back the store where packing was killed at its last step, and remove what is half-written."""
        unpacked = self.output / f"{UNPACKED}{self.root}"
        if not (self.output / self.root).exists() and unpacked.exists():
            unpacked.rename(self.output / self.root)
        # Of a packing that was killed while it removed what it had taken the place of, or before.
        for left in (unpacked, self.output / PACKING):
            shutil.rmtree(left, ignore_errors=True)
        for key in [key for key, _ in self._files(self.root) if key.endswith(PARTIAL)]:
            self.delete(key)

    def _files(self, folder: str) -> Iterator[tuple[str, os.stat_result]]:
        """Yield key and state of every file in a folder, and in those in it."""
        # What is just being written, or taken back, may be gone again.
        with suppress(FileNotFoundError, NotADirectoryError), os.scandir(self.output / folder) as entries:
            for entry in entries:
                key = f"{folder}/{entry.name}"
                if entry.is_dir():
                    yield from self._files(key)
                else:
                    with suppress(FileNotFoundError):
                        yield key, entry.stat()


def settle(path: Path) -> None:
    """Wait until a file or folder is on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
