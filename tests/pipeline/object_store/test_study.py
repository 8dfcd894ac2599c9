"""Studies in an object store: the same store, taken up from anywhere, and repaired."""

from pathlib import Path

import obstore.store
import pytest
import xarray as xr
import zarr
from markupsafe import escape

from chatter_core.errors import InvalidInput
from pipeline import execution, report, store, sweep, verify
from pipeline.command_line import main
from pipeline.places import LOBES, Folder, Place, place_of
from pipeline.settings import Cluster
from tests.object_server.server import SECRET, USER, Buckets
from tests.pipeline.object_store.server_side import (
    ADDRESS,
    BUCKET,
    SHORT,
    STORE,
    age,
    assert_same_bytes,
    compute,
    flip,
    key,
    serving_again,
    start,
)
from tests.pipeline.studies import CHUNKS, PATIENCE, journal, run, wait_until


def test_a_study_in_objects_is_that_in_a_folder_bit_for_bit(
    endpoint: str, tmp_path: Path, buckets: Buckets, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = ["sweep", "study=smoke"]
    assert main([*study, "cluster=local", "cluster.workers=1", STORE, f"output={tmp_path / 'here'}"]) == 0
    monkeypatch.setattr(report, "write", lambda place: [])
    assert main([*study, "cluster=serial", f"output={tmp_path / 'folder'}"]) == 0
    there, folder = place_of({"output": str(tmp_path / "here")}), Folder(tmp_path / "folder")
    assert str(there) == ADDRESS
    assert_same_bytes(there, folder)
    with store.open_lobes(there) as one, store.open_lobes(folder) as other:
        xr.testing.assert_identical(one.load().drop_attrs(), other.load().drop_attrs())
    monkeypatch.setenv("AWS_ALLOW_HTTP", "true")
    assert escape(there.opening) in (tmp_path / "here" / "report.html").read_text()
    with eval(there.opening, {"xarray": xr, "zarr": zarr, "obstore": obstore}) as opened:
        assert opened.sizes == one.sizes
    assert there.names() == {LOBES, "metadata.json", "settings.yaml", "lock.json"}
    assert {entry.name for entry in (tmp_path / "here").iterdir()} == {
        *("object_store.txt", "journal.jsonl", "tables", "figures", "report.html")
    }
    # Nothing that is kept or written tells who was let in.
    secrets = [SECRET.encode(), USER.encode()]
    kept = [one.content for one in buckets.kept[BUCKET].values()]
    kept += [file.read_bytes() for file in (tmp_path / "here").rglob("*") if file.is_file()]
    assert not any(secret in content for secret in secrets for content in kept)


def test_the_verbs_that_look_at_a_study_find_it_by_address_and_by_folder(
    place: Place,
    reference: Folder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    # By its address alone, what people read of it goes into a folder beside.
    monkeypatch.chdir(tmp_path)
    assert compute(place) == 0
    assert_same_bytes(place, reference)
    for named in (STORE, f"output={place.output}"):
        assert main(["status", named]) == 0
        assert main(["verify", named]) == 0
        assert main(["report", named]) == 0
    told = capsys.readouterr().out
    assert told.count(f"chunks: {CHUNKS} of {CHUNKS}") == 2
    assert told.count(f"{ADDRESS}: every byte reads back as it was written") == 2
    assert main(["pack", STORE]) == 2
    assert f"error: {ADDRESS}: pack is for stores in folders" in capsys.readouterr().err


def test_a_killed_run_goes_on_from_another_machine_once_its_lease_is_over(
    place: Place, reference: Folder, buckets: Buckets, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    process = start(tmp_path / "killed")
    wait_until(lambda: len(journal(tmp_path / "killed", "chunk")) >= 2, process)
    process.kill()
    process.communicate()
    assert main_of_small_study(tmp_path / "elsewhere") == 3
    told = capsys.readouterr().err
    assert f"{ADDRESS}: in use by process {process.pid} on " in told
    assert "when it is not heard of for 3 s it counts as dead" in told
    assert not (tmp_path / "elsewhere").exists()
    age(buckets)
    done = len(journal(tmp_path / "killed", "chunk"))
    assert main_of_small_study(tmp_path / "elsewhere") == 0
    # The chunk that was in progress may have been written without being told of.
    assert CHUNKS - done - 1 <= len(journal(tmp_path / "elsewhere", "chunk")) <= CHUNKS - done
    assert_same_bytes(place, reference)


def main_of_small_study(output: Path) -> int:
    """Run the small study in the object store through the command line's own handling of errors."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sweep, "run", run)
        return main(["sweep", STORE, SHORT, f"output={output}"])


def test_a_store_of_other_settings_is_refused_with_the_keys(place: Place, tmp_path: Path) -> None:
    assert compute(place) == 0
    before = {key: place.read(key) for key, _ in place.written(LOBES)}
    with pytest.raises(InvalidInput, match=r"s3://lab/machines/first: holds a study with other settings.*tool\.teeth"):
        run([STORE, SHORT, f"output={tmp_path / 'other'}", "tool.teeth=3"])
    assert before == {key: place.read(key) for key, _ in place.written(LOBES)}


@pytest.fixture
def _repaired_with_the_stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    carry_on = execution.carry_on
    kernel = {"kernel": "tests.pipeline.standins:plain"}
    monkeypatch.setattr(execution, "carry_on", lambda *a, **k: carry_on(*a, **{**kernel, **k}))


@pytest.mark.usefixtures("_repaired_with_the_stand_in")
def test_what_is_damaged_or_missing_is_found_and_made_anew(
    place: Place, reference: Folder, buckets: Buckets, capsys: pytest.CaptureFixture[str]
) -> None:
    assert compute(place) == 0
    assert not verify.damage(place)
    damaged = f"{LOBES}/spectral_radius/c.0.1.0.1.0"
    gone = [f"{LOBES}/limit_depth/c.0.0.1.2.0", f"{LOBES}/preload/c.0", "settings.yaml"]
    flip(buckets, damaged)
    for one in gone:
        del buckets.kept[BUCKET][key(one)]
    assert main(["verify", STORE]) == 1
    told = capsys.readouterr()
    for sentence in (
        "damaged: preload: cannot be read",
        "damaged: spectral_radius: indices 0, 1, 0, speeds 2 to 3",
        "damaged: limit_depth: indices 0, 0, 1, speeds 4 to 5",
        "damaged: settings.yaml: is not what the store says",
    ):
        assert sentence in told.out
    assert f"made anew with: python -m pipeline verify {STORE} repair=true" in told.err
    assert verify.repair(place, verify.damage(place), None, [], Cluster(kind="serial")) == 0
    assert not verify.damage(place)
    assert_same_bytes(place, reference)


@pytest.mark.usefixtures("_repaired_with_the_stand_in")
@pytest.mark.parametrize("change", ["gone", "flipped"])
def test_a_root_document_is_restored_from_its_copy(place: Place, buckets: Buckets, change: str) -> None:
    assert compute(place) == 0
    root = place.read(f"{LOBES}/zarr.json")
    if change == "gone":
        del buckets.kept[BUCKET][key(f"{LOBES}/zarr.json")]
    else:
        flip(buckets, f"{LOBES}/zarr.json")
    with pytest.raises(InvalidInput, match=rf"restored by: python -m pipeline verify {STORE} repair=true"):
        compute(place)
    found = verify.damage(place)
    assert list(found.documents) == ["zarr.json"]
    assert verify.repair(place, found, None, [], Cluster(kind="serial")) == 0
    assert place.read(f"{LOBES}/zarr.json") == root


@pytest.mark.parametrize("cluster", [("cluster=serial",), ("cluster=local", "cluster.workers=1")])
def test_a_store_that_goes_away_ends_the_run_in_words_and_it_goes_on(
    buckets: Buckets,
    address: str,
    reference: Folder,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    cluster: tuple[str, ...],
) -> None:
    monkeypatch.setattr(report, "write", lambda place: [])
    with serving_again(buckets, address):
        process = start(tmp_path / "here", *cluster)
        wait_until(lambda: len(journal(tmp_path / "here", "chunk")) >= 2, process)
    _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 1, told
    assert "Traceback" not in told
    assert f"{address} (AWS_ENDPOINT_URL) cannot be used: " in told
    assert "what was computed is kept, the same command goes on once it answers" in told
    done = len(journal(tmp_path / "here", "chunk"))
    assert done < CHUNKS
    with serving_again(buckets, address):
        age(buckets)
        assert run([STORE, SHORT, f"output={tmp_path / 'here'}"]) == 0
        again = len(journal(tmp_path / "here", "chunk")) - done
        assert again <= CHUNKS - done
        assert_same_bytes(place_of({"output": str(tmp_path / "here")}), reference)
