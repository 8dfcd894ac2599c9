"""Where a study lies: in a folder, or under an address of an object store."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from chatter_core.errors import InvalidInput
from pipeline.places.address import address_in, bucket_and_prefix, default_output, lease_of
from pipeline.places.folder import UNPACKED, Folder
from pipeline.places.place import (
    CLOCK,
    DATASET,
    LOBES,
    LOCK,
    RECORD,
    STORES,
    Place,
    StillHeld,
    as_long_as_it_takes,
)

__all__ = [
    "CLOCK",
    "DATASET",
    "LOBES",
    "LOCK",
    "OPTIONS",
    "RECORD",
    "STORES",
    "Folder",
    "Place",
    "StillHeld",
    "as_long_as_it_takes",
    "place_of",
]

AnyPlace = TypeVar("AnyPlace", bound=Any)
#: Words of a command line that name a place.
OPTIONS = ("output", "store", "lease_s")


def place_of(options: Mapping[str, str], usual: Path | None = None, root: str | None = None) -> Place:
    """Return the place that the words of a command line name: an object store, or a folder.

    A folder in which a run has written what people read of an object store names that one. usual: folder where neither
    is named; root: name of the store, without it the one that is there. Raises InvalidInput for an address of another
    form, for a folder that belongs to another store, and where the library is missing.
    """
    named = Path(options["output"]) if "output" in options else None
    address = options.get("store", address_in(named) if named else None)
    if address is None:
        if "lease_s" in options:
            raise InvalidInput(["lease_s: for object stores alone (store=s3://BUCKET/PREFIX); a folder frees itself"])
        folder = named or usual
        assert folder is not None
        return _with_its_store(Folder(folder), root)
    bucket, prefix = bucket_and_prefix(address)
    address, output = f"s3://{bucket}/{prefix}", named or default_output(bucket, prefix)
    _require_own(output, address)
    try:
        from pipeline.places.objects import Objects
    except ModuleNotFoundError as error:
        if error.name != "obstore":
            raise
        needed = "python -m pip install --constraint constraints.txt --editable '.[s3]'"
        raise InvalidInput([f"store: object stores need the extra s3; in the program's folder: {needed}"]) from None
    return _with_its_store(Objects(address, output, lease_of(options)), root)


def _with_its_store(place: AnyPlace, root: str | None) -> AnyPlace:
    """Return a place with the store of this name, without a name with the one that it holds."""
    if root is None:
        held = place.names()
        root = next((name for name in STORES if {name, f"{UNPACKED}{name}"} & held), LOBES)
    return replace(place, root=root)


def _require_own(output: Path, address: str) -> None:
    """Raise InvalidInput where a folder holds something else than what belongs to an object store."""
    held = address_in(output)
    if held is None and output.is_dir() and any(output.iterdir()):
        raise InvalidInput([f"output: {output} holds files that do not belong to {address}; choose an empty folder"])
    if held not in (None, address):
        raise InvalidInput([f"output: {output} belongs to the store {held}, not to {address}; choose another folder"])
