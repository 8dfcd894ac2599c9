"""A study in an S3-speaking object store: its pieces are objects. Credentials and endpoint are the environment's."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

import obstore
from obstore.store import S3Store

from pipeline.locking import make_folder
from pipeline.places.address import POINTER, address_in
from pipeline.places.lease import Lease
from pipeline.places.place import LOBES, Found, Given, Place, StillHeld
from pipeline.places.s3 import ClearStore, clear_words, opened
from pipeline.verbs.options import LEASE

#: Objects that are asked for or written at a time: an answer takes tens of milliseconds, whatever is asked.
AT_ONCE = 16
#: Share of its lease for which a run asks a store again that does not answer: it must know before others may take over.
PATIENCE = 0.5


@dataclass(frozen=True)
class Objects(Place):
    """Objects under an address, ``s3://BUCKET/PREFIX``.

    lease: seconds after which a run that is not heard of holds them no longer.
    """

    address: str
    output: Path
    lease: float = LEASE
    root: str = LOBES

    @property
    def option(self) -> str:
        """How a command line names the place."""
        return f"store={self.address}"

    @property
    def opening(self) -> str:
        """What opens the store in Python, anywhere."""
        return f'xarray.open_zarr(zarr.storage.ObjectStore(obstore.store.from_url("{self.where(self.root)}")))'

    def __str__(self) -> str:
        return self.address

    def where(self, key: str) -> str:
        """Return the address of an object."""
        return f"{self.address}/{key}"

    def anywhere(self) -> "Objects":
        """Return the place itself: an address is the same everywhere."""
        return self

    def held(self) -> AbstractContextManager[StillHeld]:
        """Hold the objects by a lease, renewed as long as this process lives."""
        return Lease(self.objects, self.address, self.lease).held()

    def make_output(self) -> Path:
        """Return the folder for what people read, which says to which address it belongs."""
        make_folder(self.output)
        if address_in(self.output) is None:
            (self.output / POINTER).write_text(f"{self.address}\n", encoding="utf-8")
        return self.output

    def store(self) -> ClearStore:
        """Return the store of the study, whose errors speak of its address."""
        return ClearStore(opened(self.where(self.root), PATIENCE * self.lease))

    def names(self) -> set[str]:
        """Return the first parts of all keys."""
        with clear_words(self.address):
            found = obstore.list_with_delimiter(self.objects)
        return {*found["common_prefixes"], *(entry["path"] for entry in found["objects"])}

    def written(self, folder: str) -> Iterator[tuple[str, float]]:
        """Yield every object whose key begins so, and when it was written, by the clock of the object store."""
        with clear_words(self.address):
            for batch in obstore.list(self.objects, prefix=folder):
                yield from ((entry["path"], entry["last_modified"].timestamp()) for entry in batch)

    def read(self, key: str) -> bytes:
        """Return the content of an object."""
        with clear_words(self.where(key)):
            return bytes(obstore.get(self.objects, key).bytes())

    def write(self, key: str, content: bytes) -> None:
        """Write an object; one is always whole."""
        with clear_words(self.address):
            obstore.put(self.objects, key, content)

    def delete(self, key: str) -> None:
        """Remove an object."""
        with clear_words(self.address):
            obstore.delete(self.objects, key)

    def each(self, function: Callable[[Given], Found], given: Iterable[Given]) -> Iterator[Found]:
        """Yield what a function returns, in order, while others are on their way."""
        pool = ThreadPoolExecutor(AT_ONCE, thread_name_prefix="objects")
        try:
            yield from pool.map(function, given)
        finally:
            pool.shutdown(cancel_futures=True)

    @property
    def objects(self) -> S3Store:
        """What is under the address, as obstore has it."""
        return opened(self.address, PATIENCE * self.lease)
