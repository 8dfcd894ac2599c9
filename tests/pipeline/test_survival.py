"""What a long run lives through: studies made anew under its workers, schedulers that restart, lost machines."""

import shutil
import signal
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from distributed import Future
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from pipeline import metadata, store, verify
from pipeline.chunks import Chunk
from pipeline.cluster import open_client
from pipeline.dispatch import WINDOW, dispatched
from pipeline.pack import pack
from pipeline.places import Folder
from pipeline.provenance import code_version
from pipeline.settings import Cluster
from pipeline.stopping import Stopping
from pipeline.task import Task, compute_chunk
from tests.pipeline.studies import CHUNKS, PATIENCE, POLL, journal, lobes, study, sweep

OTHER = "grid.spindle_speed_rpm={start: 5000, stop: 7000, count: 4}"
PLAIN, SLOW = "tests.pipeline.standins:plain", "tests.pipeline.standins:slow"


@pytest.fixture(autouse=True)
def _without_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.report.write", lambda place: [])


def pending_tasks(output: Path, kernel: str) -> list[Task]:
    """Return the tasks of a study that has been made and of which nothing is computed."""
    sweep(output)
    place = Folder(output)
    every = store.chunks(store.open_group(place))
    for chunk in every:
        store.mark_chunk(place, chunk, 0)
    made = metadata.identity(place)
    return [Task(place=place, chunk=chunk, kernel=kernel, made=made) for chunk in every]


def await_written(place: Folder, chunks: list[Chunk]) -> None:
    """Wait until chunks are in their store."""
    end = time.monotonic() + PATIENCE
    while not all(store.status_of(store.check(place), chunk).all() for chunk in chunks):
        assert time.monotonic() < end
        time.sleep(POLL)


def test_a_study_made_anew_in_the_same_place_is_not_computed_by_what_lay_there_before(tmp_path: Path) -> None:
    place, reference = tmp_path / "place", tmp_path / "reference"
    sweep(place)
    shutil.rmtree(place)
    sweep(place, OTHER)
    sweep(reference, OTHER)
    assert lobes(place).equals(lobes(reference))


def test_a_worker_that_outlives_a_study_reads_the_next_one_in_its_place(tmp_path: Path) -> None:
    place = Folder(tmp_path / "place")
    sweep(tmp_path / "reference", OTHER)
    for settings in (study(), study(OTHER)):
        shutil.rmtree(place.output, ignore_errors=True)
        # As a run does: the order of summation, and so the last digit, stays the same.
        with threadpool_limits(1):
            store.create(place, settings, [])
        group = store.check(place)
        for chunk in store.chunks(group):
            compute_chunk(Task(place=place, chunk=chunk, kernel=PLAIN, made=metadata.identity(place)))
    assert lobes(place.output).equals(lobes(tmp_path / "reference"))


def test_results_without_their_record_are_not_written_over(tmp_path: Path) -> None:
    made, copied = tmp_path / "made", tmp_path / "copied"
    sweep(made)
    shutil.copytree(made / "lobes.zarr", copied / "lobes.zarr")
    # A report may stand beside it, too.
    (copied / "report.html").touch()
    with pytest.raises(InvalidInput, match=r"settings\.yaml is missing beside a store that holds results"):
        sweep(copied)
    assert lobes(copied).equals(lobes(made))
    assert verify.run([f"output={copied}", "repair=true"]) == 0
    assert sweep(copied) == 0
    assert not journal(copied, "chunk")


def test_chunks_that_a_restarted_scheduler_has_forgotten_are_handed_out_again(tmp_path: Path) -> None:
    tasks, found = pending_tasks(tmp_path, SLOW), list[Any]()
    with open_client(Cluster(kind="threads", workers=1)) as client:
        assert client is not None
        for record in dispatched(tasks, client, Stopping(), patience=60.0):
            if not found:
                # What becomes of futures when a scheduler restarts, or its connection is lost for a moment.
                client.cancel([Future(key, client) for key in list(client.futures)])
            found.append(record.chunk)
    assert sorted(found) == sorted(task.chunk for task in tasks)
    assert len(found) == CHUNKS
    assert (lobes(tmp_path)["status"] == 1).all()


def test_a_chunk_that_ended_while_it_was_taken_back_is_told_of(tmp_path: Path) -> None:
    """Otherwise the journal of a run that was stopped would lack what the store has."""
    tasks, found, stopping = pending_tasks(tmp_path, PLAIN), list[Any](), Stopping()
    begun = [task.chunk for task in tasks[: 1 + WINDOW]]
    with open_client(Cluster(kind="threads", workers=1)) as client:
        assert client is not None
        for record in dispatched(tasks, client, stopping, patience=60.0):
            if not found:
                await_written(Folder(tmp_path), begun)
                stopping.number = signal.SIGTERM
                client.cancel([Future(key, client) for key in list(client.futures)])
            found.append(record.chunk)
    assert sorted(found) == sorted(begun)


def test_a_file_that_a_lost_machine_left_empty_is_no_result(tmp_path: Path) -> None:
    sweep(tmp_path)
    whole = lobes(tmp_path)
    emptied = next((tmp_path / "lobes.zarr" / "limit_depth").glob("c.*"))
    emptied.write_bytes(b"")
    (tmp_path / "journal.jsonl").unlink()
    assert sweep(tmp_path) == 0
    assert len(journal(tmp_path, "chunk")) == 1
    assert lobes(tmp_path).equals(whole)


def test_what_packing_left_behind_when_it_was_killed_is_removed(tmp_path: Path) -> None:
    sweep(tmp_path)
    whole, place = lobes(tmp_path), Folder(tmp_path)
    shutil.copytree(tmp_path / "lobes.zarr", tmp_path / "unpacked-lobes.zarr")
    with place.held():
        pack(place)
    shutil.copytree(tmp_path / "lobes.zarr", tmp_path / "unpacked-lobes.zarr")
    (tmp_path / "packing.zarr").mkdir()
    with place.held():
        assert not {"unpacked-lobes.zarr", "packing.zarr"} & place.names()
    assert lobes(tmp_path).equals(whole)


def test_packed_files_are_on_the_disk_before_the_others_go(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep(tmp_path)
    settled, place = set[Path](), Folder(tmp_path)

    def settle(path: Path) -> None:
        assert (tmp_path / "lobes.zarr").exists()
        settled.add(path)

    monkeypatch.setattr("pipeline.places.folder.settle", settle)
    pack(place)
    packed = {tmp_path / "packing.zarr" / file.relative_to(place.store()) for file in place.store().rglob("*")}
    assert packed <= settled


def test_the_history_says_by_which_code_each_run_computed(tmp_path: Path) -> None:
    sweep(tmp_path)
    place = Folder(tmp_path)
    store.mark_chunk(place, store.chunks(store.open_group(place))[0], 0)
    sweep(tmp_path)
    history = np.asarray(lobes(tmp_path).attrs["history"])
    assert [line.partition(", code ")[2] for line in history] == [code_version()] * 2
