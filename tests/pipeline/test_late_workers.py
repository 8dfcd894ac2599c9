"""Workers that were taken for dead and come back: what they were at must not harm what others have made since."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from distributed import Client
from zarr.storage import LocalStore

from pipeline import metadata, store
from pipeline.cluster import Workers, open_client
from pipeline.errors import StoreInUse
from pipeline.kinds import Lobes
from pipeline.pack import pack
from pipeline.places import Folder
from pipeline.settings import Cluster
from pipeline.stopping import Stopping
from pipeline.suspects import tried_alone
from pipeline.task import Record, Task, compute_chunk
from tests.pipeline import standins
from tests.pipeline.studies import lobes, sweep

PLAIN = "tests.pipeline.standins:plain"
OTHER = "grid.spindle_speed_rpm={start: 5000, stop: 7000, count: 4}"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Folder:
    """The small study, computed."""
    output = tmp_path_factory.mktemp("made") / "study"
    assert sweep(output) == 0
    return Folder(output)


@pytest.fixture
def place(made: Folder, tmp_path: Path) -> Folder:
    """A copy of it whose first chunk is pending."""
    copy = Folder(Path(shutil.copytree(made.output, tmp_path / "study")))
    store.mark_chunk(copy, first_chunk(copy), 0)
    for file in files_of(copy):
        file.unlink(missing_ok=True)
    return copy


def first_chunk(place: Folder) -> Any:
    return store.chunks(store.open_group(place))[0]


def files_of(place: Folder) -> list[Path]:
    """The files of the first chunk, its status last."""
    names = (*Lobes.chunked, "status")
    return [place.output / store.key_of(store.open_group(place), first_chunk(place), name) for name in names]


def task_of(place: Folder) -> Task:
    return Task(place=place, chunk=first_chunk(place), kernel=PLAIN, made=metadata.identity(place))


def alone(place: Folder) -> list[Record]:
    """Try the first chunk alone, as a run does whose worker died on it."""
    with open_client(Cluster(kind="threads", workers=1)) as client:
        assert isinstance(client, Client)
        return list(tried_alone([task_of(place)], client, Stopping(), Workers(client, 60.0)))


def content(folder: Path) -> dict[str, bytes]:
    return {str(f.relative_to(folder)): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()}


def test_a_lost_worker_that_writes_its_chunk_while_it_is_tried_alone_leaves_no_hole(
    made: Folder, place: Folder, monkeypatch: pytest.MonkeyPatch
) -> None:
    written, keys = LocalStore.set, list[str]()
    pairs = list(zip(files_of(made), files_of(place), strict=True))

    async def between(self: LocalStore, key: str, *arguments: Any, **options: Any) -> None:
        # What is being written was read before, if it was.
        if not keys:
            for back, late in pairs:
                shutil.copy(back, late)
        keys.append(key)
        await written(self, key, *arguments, **options)

    monkeypatch.setattr(LocalStore, "set", between)
    (record,) = alone(place)
    assert record.counts == {"ok": 8}
    assert lobes(place.output).equals(lobes(made.output))
    assert len(keys) == len(set(keys)) == len(pairs)


def made_anew(place: Folder) -> None:
    shutil.rmtree(place.output)
    assert sweep(place.output, OTHER) == 0
    store.mark_chunk(place, first_chunk(place), 0)


def packed(place: Folder) -> None:
    assert sweep(place.output) == 0
    with place.held():
        pack(place)


def taken_up_again(place: Folder) -> None:
    metadata.begin(place, "another run")


def removed(place: Folder) -> None:
    shutil.rmtree(place.output)


HAPPENS = pytest.mark.parametrize("happens", [made_anew, packed, taken_up_again, removed])


@HAPPENS
def test_an_old_task_that_comes_late_writes_nothing(place: Folder, happens: Callable[[Folder], None]) -> None:
    late = task_of(place)
    happens(place)
    before = content(place.output.parent)
    with pytest.raises(StoreInUse, match="was made anew, packed or taken up by another run"):
        compute_chunk(late)
    assert content(place.output.parent) == before


@HAPPENS
def test_an_old_task_in_whose_midst_that_happens_writes_nothing(
    place: Folder, monkeypatch: pytest.MonkeyPatch, happens: Callable[[Folder], None]
) -> None:
    plain, before = standins.plain, dict[str, bytes]()

    def meanwhile(model: Any, **cells: Any) -> Any:
        monkeypatch.setattr(standins, "plain", plain)
        happens(place)
        before.update(content(place.output.parent))
        return plain(model, **cells)

    monkeypatch.setattr(standins, "plain", meanwhile)
    with pytest.raises(StoreInUse, match="was made anew, packed or taken up by another run"):
        compute_chunk(task_of(place))
    assert before == content(place.output.parent)


def test_what_an_old_task_was_writing_does_not_count(place: Folder, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its variables are what anybody would write there; its status would make a result of what another has marked."""
    late, written = task_of(place), LocalStore.set

    async def meanwhile(self: LocalStore, *arguments: Any, **options: Any) -> None:
        monkeypatch.setattr(LocalStore, "set", written)
        metadata.begin(place, "another run")
        await written(self, *arguments, **options)

    monkeypatch.setattr(LocalStore, "set", meanwhile)
    with pytest.raises(StoreInUse):
        compute_chunk(late)
    assert not files_of(place)[-1].exists()
