"""A store read back: every flipped bit is found, and what it damaged is computed again."""

import errno
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from chatter_core.errors import InvalidInput
from pipeline import execution, metadata, report, store, verify
from pipeline.command_line import main
from pipeline.kinds import Lobes
from pipeline.places import Folder
from pipeline.settings import Cluster

from tests.pipeline.studies import CHUNKS, journal, lobes, study, sweep as sweep_study  # isort: skip

#: Bits that are flipped one after the other, each of which costs a reading of the store; more by the environment, as
#: ``make soak`` has. Files that are damaged at once.
FLIPS, DAMAGED = int(os.environ.get("FLIPS", "25")), 100


@pytest.fixture(autouse=True)
def _without_report_and_physics(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave out tables and figures, and compute with the stand-in that the store was made with."""
    monkeypatch.setattr(report, "write", lambda output: [])
    monkeypatch.setattr(Lobes, "kernel", "tests.pipeline.standins:plain")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The small study, computed."""
    output = tmp_path_factory.mktemp("made") / "study"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "write", lambda output: [])
        assert sweep_study(output) == 0
    return output


@pytest.fixture
def output(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "study")


def repaired(output: Path) -> int:
    return verify.repair(Folder(output), verify.damage(Folder(output)), None, [], Cluster(kind="serial"))


def flip(file: Path, bit: int) -> None:
    content = bytearray(file.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    file.write_bytes(content)


def files_of(output: Path) -> list[Path]:
    """All files of the store, and what stands beside it to restore it."""
    kept = sorted(file for file in (output / "lobes.zarr").rglob("*") if file.is_file())
    return [*kept, *(output / name for name in ("settings.yaml", "metadata.json", "journal.jsonl"))]


def test_a_store_as_it_was_written_has_no_damage(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", f"output={output}"]) == 0
    assert "every byte reads back as it was written" in capsys.readouterr().out


def test_every_one_of_many_random_bit_flips_is_found(output: Path) -> None:
    random, files = np.random.default_rng(20261122), files_of(output)
    sizes = np.array([file.stat().st_size for file in files])
    for _ in range(FLIPS):
        # Every file is as likely as any other: the few documents would hardly be met by their share of the bytes.
        which = int(random.integers(len(files)))
        bit = int(random.integers(8 * sizes[which]))
        flip(files[which], bit)
        assert verify.damage(Folder(output)), f"bit {bit} of {files[which]}"
        flip(files[which], bit)
    assert not verify.damage(Folder(output))


@pytest.mark.parametrize("text", ["", "[]", "5", "[" * 100_000])
def test_a_document_that_is_another_one_altogether_is_damage_and_is_restored(output: Path, text: str) -> None:
    for name in ("lobes.zarr/zarr.json", "journal.jsonl"):
        (output / name).write_text(text)
    with (output / "journal.jsonl").open("a") as lines:
        lines.write('\n{"time": "' + "2026" + '", "event": ' + "[" * 100_000)
    assert verify.damage(Folder(output))
    assert repaired(output) == 0
    assert not verify.damage(Folder(output)).mendable


def test_what_many_flips_at_once_have_damaged_is_made_as_it_was(output: Path, made: Path) -> None:
    random, files = np.random.default_rng(20261123), files_of(output)
    for which in random.choice(len(files), DAMAGED, replace=False):
        flip(files[which], int(random.integers(8 * files[which].stat().st_size)))
    assert verify.damage(Folder(output))
    assert repaired(output) == 0
    assert not verify.damage(Folder(output)).mendable
    xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(made).drop_attrs())


def test_only_what_is_damaged_is_computed_again(output: Path) -> None:
    flip(output / "lobes.zarr/spectral_radius/c.0.1.0.1.0", 33)
    (output / "lobes.zarr/limit_depth/c.0.0.1.2.0").unlink()
    assert repaired(output) == 0
    again = [(event["outer"], event["speeds"]) for event in journal(output, "chunk")][CHUNKS:]
    assert again == [([0, 0, 1], [4, 6]), ([0, 1, 0], [2, 4])]


def test_a_status_that_is_gone_of_a_complete_store_is_damage(output: Path, made: Path) -> None:
    (output / "lobes.zarr/status/c.0.1.0.1.0").unlink()
    found = verify.damage(Folder(output))
    assert found.sentences() == ["status: indices 0, 1, 0, speeds 2 to 3"]
    assert repaired(output) == 0
    xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(made).drop_attrs())


def test_what_was_never_computed_is_no_damage(output: Path) -> None:
    (output / "lobes.zarr/status/c.0.1.0.1.0").unlink()
    metadata.begin(Folder(output), "a run that was killed")
    assert not verify.damage(Folder(output))


@pytest.mark.parametrize("place", ["zarr.json", "status/zarr.json", "preload/c.0", "natural_frequency/c.0.0.0.0.0"])
def test_documents_and_coordinates_are_restored(output: Path, made: Path, place: str) -> None:
    (output / "lobes.zarr" / place).write_bytes(b"nothing that was ever written")
    assert repaired(output) == 0
    assert (output / "lobes.zarr" / place).read_bytes() == (made / "lobes.zarr" / place).read_bytes()


@pytest.mark.parametrize("place", ["preload/c.0", "natural_frequency/c.0.0.0.0.0"])
def test_coordinates_that_are_gone_are_noticed_and_restored(output: Path, made: Path, place: str) -> None:
    (output / "lobes.zarr" / place).unlink()
    assert verify.damage(Folder(output)).fixed == [place.partition("/")[0]]
    assert repaired(output) == 0
    assert (output / "lobes.zarr" / place).read_bytes() == (made / "lobes.zarr" / place).read_bytes()


def test_a_coordinate_that_is_gone_stops_a_sweep(output: Path) -> None:
    (output / "lobes.zarr/preload/c.0").unlink()
    with pytest.raises(InvalidInput, match=r"preload is missing; restored by: python -m pipeline verify output="):
        execution.execute(study(), Folder(output))


def test_a_machine_of_measured_modes_lacks_nothing(tmp_path: Path) -> None:
    """Nothing is known of its bearings, and that is written."""
    machine = tmp_path / "machine.yaml"
    machine.write_text("tip: {modes: [{axis: x, natural_frequency_hz: 922, damping_ratio: 0.011, stiffness_n_um: 1}]}")
    words = (f"machine={machine}", "tool=endmill_4x16", "cutting=cast_iron", "process=down_40")
    assert sweep_study(tmp_path / "tip", *words, "grid.preload_n=null", "grid.mode_count=[1]") == 0
    assert not verify.damage(Folder(tmp_path / "tip"))


def test_a_store_whose_root_and_its_copy_are_damaged_is_given_up_in_words(output: Path) -> None:
    for file in (output / "lobes.zarr" / metadata.DOCUMENT, output / metadata.COPY):
        file.write_bytes(b"{}")
    with pytest.raises(InvalidInput, match=r"zarr.json is damaged, and so is its copy"):
        repaired(output)


@pytest.mark.parametrize("content", [b"{}", None])
def test_the_copy_of_the_root_is_restored(output: Path, content: bytes | None) -> None:
    copy = output / metadata.COPY
    copy.unlink() if content is None else copy.write_bytes(content)
    assert list(verify.damage(Folder(output)).beside) == [metadata.COPY]
    assert repaired(output) == 0
    assert copy.read_bytes() == (output / "lobes.zarr" / metadata.DOCUMENT).read_bytes()
    assert len(journal(output, "chunk")) == CHUNKS


def test_torn_lines_of_the_journal_are_told_and_left(output: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = output / "journal.jsonl"
    torn = file.read_bytes()[:-9]
    file.write_bytes(torn)
    assert main(["verify", f"output={output}"]) == 0
    told = capsys.readouterr().out
    assert "journal.jsonl: 1 lines are not as they were written; they stay, no result is in them" in told
    assert "every byte of the store reads back as it was written" in told
    # What is written next stands in a line of its own.
    assert sweep_study(output) == 0
    assert file.read_bytes().startswith(torn + b"\n")
    assert verify.damage(Folder(output)).torn == 1


def test_a_store_of_folders_is_continued_and_repaired_as_it_is(
    tmp_path: Path, made: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Earlier versions made a folder of each index of a chunk."""
    output = tmp_path / "study"
    with monkeypatch.context() as earlier:
        earlier.setattr(store, "SEPARATOR", "/")
        assert sweep_study(output) == 0
    flip(output / "lobes.zarr/status/c/0/1/0/1/0", 33)
    (output / "lobes.zarr/limit_depth/c/0/0/1/2/0").unlink()
    flip(output / "lobes.zarr/preload/c/0", 33)
    assert repaired(output) == 0
    assert not verify.damage(Folder(output))
    assert not list(output.rglob("c.*"))
    xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(made).drop_attrs())


@pytest.mark.parametrize(
    ("key", "told"),
    [
        ("spectral_radius/c.0.1.0.1.0", "spectral_radius: indices 0, 1, 0, speeds 2 to 3"),
        ("status/c.0.1.0.1.0", "status: indices 0, 1, 0, speeds 2 to 3"),
        ("preload/c.0", "preload: cannot be read"),
        ("zarr.json", "zarr.json: does not bear its checksum"),
    ],
)
def test_a_file_of_which_the_disk_has_lost_a_sector_is_named_and_written_elsewhere(
    output: Path, made: Path, monkeypatch: pytest.MonkeyPatch, key: str, told: str
) -> None:
    flip(output / "lobes.zarr/limit_depth/c.0.0.1.2.0", 33)
    whole = Path.read_bytes
    # As long as it is open no other file is given its place on the disk.
    with (output / "lobes.zarr" / key).open("rb") as ill:
        lost = os.fstat(ill.fileno())

        def read_bytes(path: Path) -> bytes:
            if path.exists() and os.path.samestat(path.stat(), lost):
                raise OSError(errno.EIO, os.strerror(errno.EIO), str(path))
            return whole(path)

        monkeypatch.setattr(Path, "read_bytes", read_bytes)
        assert told in verify.damage(Folder(output)).sentences()
        assert repaired(output) == 0
        assert not verify.damage(Folder(output))
        xr.testing.assert_identical(lobes(output).drop_attrs(), lobes(made).drop_attrs())


def test_a_disk_that_cannot_be_read_at_all_is_no_damage(output: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def read_bytes(path: Path) -> bytes:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE), str(path))

    group = store.open_group(Folder(output))
    monkeypatch.setattr(Path, "read_bytes", read_bytes)
    with pytest.raises(OSError, match="Too many open files"):
        store.unreadable_parts(group, store.chunks(group)[0])


def test_damage_is_told_by_place_with_the_command_that_repairs_it(
    output: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flip(output / "lobes.zarr/spectral_radius/c.0.1.0.1.0", 33)
    assert main(["verify", f"output={output}"]) == 1
    told = capsys.readouterr()
    assert "damaged: spectral_radius: indices 0, 1, 0, speeds 2 to 3" in told.out
    assert f"python -m pipeline verify output={output} repair=true" in told.err


def test_a_damaged_root_stops_a_sweep_with_the_command_that_repairs_it(output: Path) -> None:
    flip(output / "lobes.zarr" / metadata.DOCUMENT, 4001)
    with pytest.raises(InvalidInput, match=r"python -m pipeline verify output=.* repair=true"):
        execution.execute(study(), Folder(output))
