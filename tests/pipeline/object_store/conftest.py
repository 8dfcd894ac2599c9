"""A server of the tests, a place in it, and the same study in a folder."""

import os
from collections.abc import Iterator
from pathlib import Path

import pytest

from pipeline import report, store, task
from pipeline.places import Folder, Place, place_of, s3
from tests.object_server.server import Buckets, environment, serving
from tests.pipeline.object_store.server_side import ADDRESS, BUCKET, serving_again
from tests.pipeline.studies import run


@pytest.fixture
def buckets() -> Buckets:
    return Buckets({BUCKET: {}})


@pytest.fixture
def address(buckets: Buckets, monkeypatch: pytest.MonkeyPatch) -> str:
    """Where a server listens now and then, which this process and its children use."""
    for name in [name for name in os.environ if name.startswith("AWS_")]:
        monkeypatch.delenv(name)
    with serving(buckets) as address:
        for name, value in environment(address).items():
            monkeypatch.setenv(name, value)
    # What a process keeps open is of the server of an earlier test.
    for keeping in (s3.opened, store.open_group, task._described):
        keeping.cache_clear()
    return address


@pytest.fixture
def endpoint(buckets: Buckets, address: str) -> Iterator[str]:
    """A server that listens all the time."""
    with serving_again(buckets, address):
        yield address


@pytest.fixture
def place(endpoint: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Place:
    """An empty place in the object store; tables and figures are left out."""
    monkeypatch.setattr(report, "write", lambda place: [])
    return place_of({"store": ADDRESS, "output": str(tmp_path / "here"), "lease_s": "3"})


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """The small study in a folder."""
    output = tmp_path_factory.mktemp("reference") / "study"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "write", lambda place: [])
        assert run([f"output={output}"]) == 0
    return Folder(output)
