"""What the tests of object stores share: where their study lies, and what the server does to it."""

import subprocess
from contextlib import AbstractContextManager
from dataclasses import replace
from datetime import timedelta
from pathlib import Path

from pipeline.places import LOBES, Place
from tests.object_server.server import Buckets, serving
from tests.pipeline.studies import run, sweep_process

BUCKET = "lab"
ADDRESS = f"s3://{BUCKET}/machines/first"
STORE = f"store={ADDRESS}"
#: The shortest lease [s]: what does not answer is given up in half of it.
SHORT = "lease_s=3"


def serving_again(buckets: Buckets, address: str) -> AbstractContextManager[str]:
    """Serve where a server was before."""
    return serving(buckets, int(address.rpartition(":")[2]))


def compute(place: Place) -> int:
    return run([place.option, f"output={place.output}", SHORT])


def assert_same_bytes(one: Place, other: Place) -> None:
    """Compare all stored pieces but the root document, which says when and by which command it was made."""
    keys = dict(one.written(LOBES)).keys()
    assert keys == dict(other.written(LOBES)).keys()
    assert [key for key in keys if key != f"{LOBES}/zarr.json" and one.read(key) != other.read(key)] == []


def key(of: str) -> str:
    """Return a key of the study as the server has it."""
    return f"{ADDRESS.removeprefix(f's3://{BUCKET}/')}/{of}"


def age(buckets: Buckets, of: str = "lock.json") -> None:
    """Have an object be written an hour ago."""
    objects = buckets.kept[BUCKET]
    objects[key(of)] = replace(objects[key(of)], written=objects[key(of)].written - timedelta(hours=1))


def flip(buckets: Buckets, of: str) -> None:
    """Damage an object."""
    found = buckets.kept[BUCKET][key(of)]
    content = bytearray(found.content)
    content[len(content) // 2] ^= 1
    buckets.kept[BUCKET][key(of)] = replace(found, content=bytes(content))


def start(output: Path, *words: str, kernel: str = "slow") -> subprocess.Popen[str]:
    """Begin the small study in the object store, slowly, in a process of its own."""
    return sweep_process(output, STORE, SHORT, *words, kernel=kernel)
