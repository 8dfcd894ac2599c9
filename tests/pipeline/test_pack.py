"""A finished store in few files: the same numbers, still checked, still repaired."""

from pathlib import Path

import pytest
import xarray as xr

from chatter_core.errors import InvalidInput
from chatter_core.variables import SWEEP
from pipeline import execution, metadata, report, status, store, verify
from pipeline.chunks import Chunk
from pipeline.command_line import main
from pipeline.pack import SHARD_BYTES, pack, shard_shape
from pipeline.places import Folder
from pipeline.places.folder import PACKING, UNPACKED
from pipeline.settings import Cluster

from tests.pipeline.studies import CHUNKS, journal, lobes, sweep as sweep_study  # isort: skip


@pytest.fixture(autouse=True)
def _without_report_and_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out tables and figures, and repair with the stand-in that the store was made with."""
    monkeypatch.setattr(report, "write", lambda output: [])
    carry_on = execution.carry_on
    monkeypatch.setattr(
        execution, "carry_on", lambda *a, **k: carry_on(*a, **{"kernel": "tests.pipeline.standins:plain", **k})
    )


@pytest.fixture
def output(tmp_path: Path) -> Path:
    assert sweep_study(tmp_path / "study") == 0
    return tmp_path / "study"


def test_a_packed_store_holds_the_same_in_few_files(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = lobes(output)
    assert main(["pack", f"output={output}"]) == 0
    assert "files, now" in capsys.readouterr().out
    xr.testing.assert_identical(lobes(output).drop_attrs(), before.drop_attrs())
    for name in (*SWEEP, "status"):
        assert len([file for file in (output / "lobes.zarr" / name / "c").rglob("*") if file.is_file()]) == 1
    assert not verify.damage(Folder(output))
    assert not {entry.name for entry in output.iterdir()} & {PACKING, f"{UNPACKED}lobes.zarr"}


def test_a_packed_study_has_all_its_chunks_and_no_rate(output: Path) -> None:
    pack(Folder(output))
    found = status.progress(Folder(output))
    assert (found.state, found.chunks_written, found.chunks) == ("complete", CHUNKS, CHUNKS)
    assert f"chunks: {CHUNKS} of {CHUNKS}" in status.text(found)
    # The times of its few files are those of packing.
    told = status.document(found)
    assert [told[key] for key in ("chunks_per_second", "last_chunk_seconds_ago", "seconds_left")] == [None] * 3


def test_packing_twice_changes_nothing_and_a_run_finds_nothing_to_do(output: Path) -> None:
    pack(Folder(output))
    before, after = pack(Folder(output))
    assert before == after
    assert sweep_study(output) == 0
    assert len(journal(output, "chunk")) == CHUNKS


@pytest.mark.parametrize("place", [-3, 40], ids=["index", "chunk"])
@pytest.mark.parametrize("name", ["spectral_radius", "status"])
def test_a_flipped_bit_in_a_shard_is_found_and_repaired(output: Path, name: str, place: int) -> None:
    before = lobes(output)
    pack(Folder(output))
    file = next(file for file in (output / "lobes.zarr" / name / "c").rglob("*") if file.is_file())
    content = bytearray(file.read_bytes())
    content[place] ^= 1
    file.write_bytes(content)
    found = verify.damage(Folder(output))
    assert found
    assert verify.repair(Folder(output), found, None, [], Cluster(kind="serial")) == 0
    assert not verify.damage(Folder(output))
    xr.testing.assert_identical(lobes(output).drop_attrs(), before.drop_attrs())


def test_an_unfinished_store_is_not_packed(output: Path) -> None:
    metadata.begin(Folder(output), "a run that was killed")
    store.mark_chunk(Folder(output), Chunk(outer=(0, 1, 0), first=2, last=4), 0)
    with pytest.raises(InvalidInput, match="1 chunks are not computed yet"):
        pack(Folder(output))


def test_packing_that_was_killed_at_its_last_step_is_taken_back(output: Path) -> None:
    before = lobes(output)
    (output / "lobes.zarr").rename(output / f"{UNPACKED}lobes.zarr")
    assert sweep_study(output) == 0
    xr.testing.assert_identical(lobes(output).drop_attrs(), before.drop_attrs())


@pytest.mark.parametrize(
    ("shape", "chunks", "expected"),
    [
        ((1, 2, 2, 6, 4), (1, 1, 1, 2, 4), (1, 2, 2, 6, 4)),
        ((2, 5, 4, 401, 100), (1, 1, 1, 15, 100), (2, 5, 4, 405, 100)),
        # 16.8 million elements of eight bytes fill a shard: 83 preloads of 2000 x 100 cells.
        ((2, 100, 1, 2000, 100), (1, 1, 1, 10, 100), (1, 83, 1, 2000, 100)),
    ],
)
def test_shards_are_whole_chunks_and_no_larger_than_they_may_be(
    shape: tuple[int, ...], chunks: tuple[int, ...], expected: tuple[int, ...]
) -> None:
    assert SHARD_BYTES == 2**27
    assert shard_shape(shape, chunks, 8) == expected
