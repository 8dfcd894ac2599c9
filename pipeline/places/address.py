"""Addresses of object stores, and the folder on this machine that belongs to one."""

import re
from collections.abc import Mapping
from pathlib import Path

from chatter_core.errors import InvalidInput
from pipeline.verbs.options import LEASE, LONGEST, SHORTEST

#: File that names the object store to which a folder belongs.
POINTER = "object_store.txt"
#: Bucket and prefix, as every S3-speaking store allows them.
_ADDRESS = re.compile(r"s3://([a-z0-9][a-z0-9.-]{1,61}[a-z0-9])/((?:[\w.!*'()=+@-]+/)*[\w.!*'()=+@-]+)/?", re.ASCII)


def bucket_and_prefix(address: str) -> tuple[str, str]:
    """Return the parts of an address; raise InvalidInput where it is of another form."""
    found = _ADDRESS.fullmatch(address)
    if not found or {".", ".."} & set(found[2].split("/")):
        # Some write their credentials into an address: those are not repeated.
        secret = "@" in address.partition("://")[2].partition("/")[0]
        shown = "an address with credentials" if secret else repr(address[:200])
        allowed = "s3://BUCKET/PREFIX; a folder of this machine is named by output=DIR"
        allowed += "; buckets have 3 to 63 small letters, digits, dots and dashes"
        raise InvalidInput([f"store: found {shown}, allowed: {allowed}"])
    return found[1], found[2]


def default_output(bucket: str, prefix: str) -> Path:
    """Return the folder for what people read of a study that lies in an object store."""
    return Path("results") / "-".join([bucket, *prefix.split("/")])


def address_in(output: Path) -> str | None:
    """Return the address of the object store to which a folder belongs, None where it belongs to none."""
    try:
        return (output / POINTER).read_text(encoding="utf-8", errors="replace").strip()
    except (FileNotFoundError, NotADirectoryError):
        return None


def lease_of(options: Mapping[str, str]) -> float:
    """Return how long a run holds an object store without being heard of, as ``lease_s`` says [s].

    Raises InvalidInput where it says something else.
    """
    said = options.get("lease_s", str(LEASE))
    try:
        lease = float(said)
    except ValueError:
        lease = 0.0
    if not SHORTEST <= lease <= LONGEST:
        raise InvalidInput([f"lease_s: found {said!r}, allowed: {SHORTEST:g} to {LONGEST:g}"])
    return lease
