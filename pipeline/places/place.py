"""What a study needs of the place where it lies, whatever kind of place that is."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TypeVar

from zarr.storage import StoreLike

#: The store of a sweep, that of a data set, and the readable record of what was asked, in their place.
LOBES, DATASET, RECORD = "lobes.zarr", "dataset.zarr", "settings.yaml"
STORES = (LOBES, DATASET)
#: Who holds a study; in an object store also what is written to read its clock.
LOCK, CLOCK = "lock.json", "lock.clock"

#: Says nothing as long as a place is held, and raises StoreInUse or StoreUnavailable once it is not.
StillHeld = Callable[[], None]
Given = TypeVar("Given")
Found = TypeVar("Found")


def as_long_as_it_takes() -> None:
    """Say that a place is held: the hold of a folder ends with its process alone."""


class Place(ABC):
    """Where a study lies, in pieces named by keys such as ``lobes.zarr/zarr.json``; the same in every process.

    output: folder on this machine for what people read; root: name of the store, one of STORES. What cannot be reached
    or written raises OSError, of StoreUnavailable where that says nothing of the piece that was asked for.
    """

    output: Path
    root: str

    @property
    @abstractmethod
    def option(self) -> str:
        """How a command line names the place."""

    @property
    @abstractmethod
    def opening(self) -> str:
        """What opens the store in Python, in the folder for what people read."""

    @abstractmethod
    def __str__(self) -> str: ...

    @abstractmethod
    def where(self, key: str) -> str:
        """Return how a piece is named to people."""

    @abstractmethod
    def anywhere(self) -> "Place":
        """Return the place as processes find it that were started in another folder."""

    @abstractmethod
    def held(self) -> AbstractContextManager[StillHeld]:
        """Hold the place for this run, and end what an earlier one left half done.

        Raises InvalidInput when it cannot be written, StoreInUse when another run holds it.
        """

    @abstractmethod
    def make_output(self) -> Path:
        """Return the folder for what people read, made where it is missing."""

    @abstractmethod
    def store(self) -> StoreLike:
        """Return the store of the study, as zarr takes it."""

    @abstractmethod
    def names(self) -> set[str]:
        """Return the first parts of all keys."""

    @abstractmethod
    def written(self, folder: str) -> Iterator[tuple[str, float]]:
        """Yield everything whose key begins with these parts, and when it was written [s since 1970]."""

    @abstractmethod
    def read(self, key: str) -> bytes:
        """Return a piece; raise FileNotFoundError when there is none."""

    @abstractmethod
    def write(self, key: str, content: bytes) -> None:
        """Write a piece, whole or not at all."""

    @abstractmethod
    def delete(self, key: str) -> None:
        """Remove a piece, if there is one."""

    @abstractmethod
    def each(self, function: Callable[[Given], Found], given: Iterable[Given]) -> Iterator[Found]:
        """Yield what a function that reads or writes here returns, in order, as many at a time as is good here."""
