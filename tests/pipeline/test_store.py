"""The store on disk: names, units, chunks and checksums."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr
from zarr.codecs import Crc32cCodec

from chatter_core.errors import InvalidInput
from chatter_core.variables import CELL_STATUS, STRUCTURE, SWEEP
from pipeline import report, store
from pipeline.places import Folder
from tests.pipeline.standins import plain
from tests.pipeline.studies import CELLS, CHUNKS, journal, lobes, study, sweep

LINE = ("modal_parameters", "preload", "mode_count", "spindle_speed")


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("template") / "lobes.zarr"
    store.create(Folder(path.parent), study(), ["a", "command"])
    return path


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("finished") / "study"
    assert sweep(output) == 0
    return output


def test_template_opens_in_xarray_with_every_variable_named_and_described(template: Path) -> None:
    with xr.open_zarr(template) as opened:
        assert set(opened.data_vars) == {*SWEEP, *STRUCTURE, "status"}
        for name, variable in {**SWEEP, **STRUCTURE, "status": CELL_STATUS}.items():
            assert opened[name].dims == variable.dims
            assert opened[name].attrs["units"] == variable.unit
            assert opened[name].attrs["long_name"] == variable.doc
            assert opened[name].dtype == np.dtype(variable.dtype)


def test_coordinates_are_in_the_users_units(template: Path) -> None:
    with xr.open_zarr(template) as opened:
        assert set(opened.coords) == {dim for one in (*SWEEP.values(), *STRUCTURE.values()) for dim in one.dims}
        assert opened["spindle_speed"].values.tolist() == [8000.0, 9000.0, 10000.0, 11000.0, 12000.0, 13000.0]
        assert opened["axial_depth"].values.tolist() == [0.5, 1.0, 1.5, 2.0]
        assert opened["preload"].values.tolist() == [100.0, 200.0]
        assert [str(name) for name in opened["modal_parameters"].values] == ["dynamic"]
        names = ("spindle_speed", "axial_depth", "preload", "multiplier_angle")
        units = {name: opened[name].attrs["units"] for name in names}
    assert units == {"spindle_speed": "rpm", "axial_depth": "mm", "preload": "N", "multiplier_angle": "rad"}


def test_a_fresh_template_is_pending_everywhere_and_holds_the_structure(template: Path) -> None:
    with xr.open_zarr(template) as opened:
        assert not opened["status"].values.any()
        assert np.isnan(opened["spectral_radius"].values).all()
        # 871 Hz to 2482 Hz: the range of the four modes of the reference machine at standstill.
        assert bool(((opened["natural_frequency"] > 300.0) & (opened["natural_frequency"] < 2600.0)).all())


def test_chunks_of_all_variables_are_aligned(template: Path) -> None:
    group = zarr.open_group(template, mode="r")
    for name, variable in {**SWEEP, "status": CELL_STATUS}.items():
        array = group[name]
        assert isinstance(array, zarr.Array)
        assert array.chunks[:4] == (1, 1, 1, 2)
        assert array.chunks[4:] == array.shape[4:]
        assert variable.dims[:4] == LINE
        assert array.shards is None


def test_a_checksum_is_the_last_codec_of_every_array(template: Path) -> None:
    group = zarr.open_group(template, mode="r")
    for _, array in group.arrays():
        assert isinstance(array.compressors[-1], Crc32cCodec)


def test_provenance_is_in_the_root_attributes(template: Path) -> None:
    attributes = zarr.open_group(template, mode="r").attrs.asdict()
    assert attributes["fingerprint"] == study().fingerprint()
    assert attributes["command"] == ["a", "command"]
    assert {"python", "numpy", "scipy", "dask", "zarr", "xarray"} <= set(attributes["versions"])
    assert attributes["settings"] == study().scientific()


def test_every_chunk_is_listed_once_and_covers_the_grid(template: Path) -> None:
    chunks = store.chunks(zarr.open_group(template, mode="r"))
    covered = {(chunk.outer, speed) for chunk in chunks for speed in range(chunk.first, chunk.last)}
    assert len(chunks) == CHUNKS
    assert len(covered) == 1 * 2 * 2 * 6


def test_values_are_stored_in_the_units_of_the_border(finished: Path) -> None:
    chosen = lobes(finished).sel(preload=200.0, mode_count=2, modal_parameters="dynamic")
    machine = study().machine.with_preload(200.0)
    expected = plain(
        machine,
        spindle_speed=chosen["spindle_speed"].values * 2.0 * np.pi / 60.0,
        axial_depth=chosen["axial_depth"].values * 1e-3,
        mode_count=2,
        modal_parameters="dynamic",
        method=None,
    )
    # 1e-8: speeds differ in the last place by the way they are converted, times the 3e5 under the sine.
    np.testing.assert_allclose(chosen["spectral_radius"], expected.spectral_radius, rtol=1e-8)
    np.testing.assert_allclose(chosen["chatter_frequency"], expected.chatter_frequency / (2.0 * np.pi), rtol=1e-8)
    np.testing.assert_allclose(chosen["limit_depth"], expected.limit_depth * 1e3, rtol=1e-8)
    assert (lobes(finished)["status"].values == 1).sum() == CELLS


@pytest.mark.parametrize("name", ["spectral_radius", "status", "preload"])
def test_a_flipped_bit_is_detected_on_reading(tmp_path: Path, name: str) -> None:
    output = tmp_path / "study"
    assert sweep(output) == 0
    chunk = file_of(output, name)
    damaged = bytearray(chunk.read_bytes())
    damaged[len(damaged) // 2] ^= 1
    chunk.write_bytes(damaged)
    with pytest.raises(ValueError, match=r"(?i)crc32c|checksum"):
        lobes(output)


def file_of(output: Path, name: str) -> Path:
    return sorted((output / "lobes.zarr" / name).glob("c.*"))[0]


@pytest.fixture
def copied(finished: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(finished, tmp_path / "study"))


@pytest.mark.parametrize("name", ["spectral_radius", "limit_depth", "status"])
def test_a_lost_chunk_is_computed_again(copied: Path, finished: Path, name: str) -> None:
    file_of(copied, name).unlink()
    assert sweep(copied) == 0
    xr.testing.assert_identical(lobes(copied).drop_attrs(), lobes(finished).drop_attrs())
    assert len(journal(copied, "chunk")) == CHUNKS + 1


def test_a_damaged_chunk_is_named_and_healed_by_the_next_run(copied: Path, finished: Path) -> None:
    file_of(copied, "spectral_radius").write_bytes(b"garbage")
    with pytest.raises(InvalidInput, match=r"1 chunks are damaged \(spectral_radius of speeds 0 to 1\)"):
        sweep(copied, report=True)
    assert sweep(copied) == 0
    xr.testing.assert_identical(lobes(copied).drop_attrs(), lobes(finished).drop_attrs())


def test_results_that_are_missing_are_not_reported(copied: Path) -> None:
    file_of(copied, "spectral_radius").unlink()
    with pytest.raises(InvalidInput, match="8 cells count as computed but hold no result"):
        report.write(Folder(copied))


@pytest.mark.parametrize(
    ("part", "content"),
    [
        ("zarr.json", ""),
        ("zarr.json", "[]"),
        ("zarr.json", "null"),
        ("status/zarr.json", None),
        ("spectral_radius/zarr.json", None),
        ("spindle_speed", None),
        ("preload/c.0", "garbage"),
    ],
)
def test_a_store_without_its_frame_is_refused_with_the_reason(copied: Path, part: str, content: str | None) -> None:
    damaged = copied / "lobes.zarr" / part
    if content is not None:
        damaged.write_text(content)
    elif damaged.is_dir():
        shutil.rmtree(damaged)
    else:
        damaged.unlink()
    for use in (sweep, lambda output: report.write(Folder(output))):
        with pytest.raises(
            InvalidInput, match=r"the store is damaged beyond its chunks: .* verify output=.* repair=true"
        ):
            use(copied)
