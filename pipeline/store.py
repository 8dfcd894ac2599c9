"""The Zarr store of a study: template, chunks, completion, provenance.

One task owns exactly one chunk of every variable: a block of entries along one dimension, one entry of those before it,
all of those behind. Its status is written last, so a chunk is complete when its status has no zero left; a chunk equal
to the fill value is never written, hence status 0 is pending.
"""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
import zarr
from zarr.codecs import Crc32cCodec, ZstdCodec
from zarr.errors import ZarrUserWarning

from chatter_core.errors import InvalidInput
from chatter_core.units import SUFFIXES
from chatter_core.variables import Variable
from pipeline import metadata
from pipeline.chunks import Chunk, Chunks, usual_cells
from pipeline.errors import Unreadable, is_damage
from pipeline.kinds import KINDS, Computed, Kind, kind_of
from pipeline.places import LOBES, Place
from pipeline.provenance import provenance
from pipeline.settings import Study
from pipeline.telling import command

#: What the functions here take that read.
Group = zarr.Group
#: Between the indices in the name of a chunk's file. With folders in their place there would be nearly as many of
#: them as files, each as costly; stores that were made so are read and continued as they are.
SEPARATOR = "."


def create(place: Place, settings: Study, argv: list[str]) -> None:
    """Write the template of a store, with what is known before its chunks, and provenance.

    Raises InvalidInput when the machine cannot give what is asked for.
    """
    kind = kind_of(place)
    # This comes first: what it refuses must not leave a store behind.
    values, wholes, more = kind.written_whole(settings)
    group = zarr.create_group(place.store(), overwrite=True)
    for name, points in values.items():
        suffix, doc = kind.coordinates[name]
        array = _array(group, name, (name,), points.shape, points.shape, points.dtype, _attributes(suffix, doc))
        write_whole(array, points)
    for name, variable in kind.wholes.items():
        shape = _shape(variable, values)
        write_whole(_variable(group, name, variable, shape, shape), wholes[name])
    block = block_of(kind, settings, values)
    for name, variable in {**kind.chunked, "status": kind.status}.items():
        shape = _shape(variable, values)
        before = variable.dims.index(kind.along)
        _variable(group, name, variable, shape, (*(1,) * before, block, *shape[before + 1 :]))
    with warnings.catch_warnings():
        # Not yet in Zarr's specification, but what xarray looks for first, and a copy of what the arrays say.
        warnings.simplefilter("ignore", ZarrUserWarning)
        zarr.consolidate_metadata(place.store())
    metadata.update(
        place,
        **{
            "Conventions": "CF-1.11",
            "title": kind.title(settings),
            "study": settings.study,
            "kind": kind.name,
            "fingerprint": settings.fingerprint(),
            "settings": settings.scientific(),
            "entries_per_chunk": block,
            "history": [],
            "complete": False,
            "margins": settings.margins.said,
            **more,
            **provenance(argv),
        },
    )


def block_of(kind: Kind, settings: Study, values: dict[str, np.ndarray]) -> int:
    """Return how many entries a chunk has."""
    shape = _shape(kind.status, values)
    wanted = settings.cluster.cells_per_task or usual_cells(math.prod(shape), *kind.cells_of_task)
    return max(1, min(shape[kind.outer], wanted // math.prod(shape[kind.outer + 1 :])))


def write_whole(array: zarr.Array[Any], values: np.ndarray) -> None:
    """Write an array in one piece, even where it is empty (a machine without bearings): a lost file is noticed."""
    array.with_config({"write_empty_chunks": True})[...] = values


def _attributes(suffix: str, doc: str) -> dict[str, Any]:
    return {"long_name": doc, **({"units": SUFFIXES[suffix][1]} if suffix else {})}


def _shape(variable: Variable, values: dict[str, np.ndarray]) -> tuple[int, ...]:
    return tuple(len(values[dim]) for dim in variable.dims)


def _variable(
    group: zarr.Group, name: str, variable: Variable, shape: tuple[int, ...], chunks: tuple[int, ...]
) -> zarr.Array[Any]:
    attributes = {"long_name": variable.doc, **({} if variable.unit is None else {"units": variable.unit})}
    return _array(group, name, variable.dims, shape, chunks, np.dtype(variable.dtype), attributes)


def _array(
    group: zarr.Group,
    name: str,
    dims: tuple[str, ...],
    shape: tuple[int, ...],
    chunks: tuple[int, ...],
    dtype: Any,
    attributes: dict[str, Any],
) -> zarr.Array[Any]:
    return group.create_array(
        name,
        shape=shape,
        chunks=chunks,
        dtype=dtype,
        fill_value=np.nan if np.dtype(dtype).kind == "f" else ("" if np.dtype(dtype).kind == "T" else 0),
        chunk_key_encoding={"name": "default", "separator": SEPARATOR},
        # The checksum is taken last, of what lies on the disk: without it a flipped bit is read silently.
        compressors=[ZstdCodec(level=1), Crc32cCodec()],
        dimension_names=dims,
        attributes=attributes,
    )


def kind_in(group: zarr.Group) -> Kind:
    """Return the kind of study that a store is of."""
    # Stores of earlier versions are all of sweeps, and do not say so.
    return KINDS[str(group.attrs.get("kind", LOBES))]


def chunks(group: zarr.Group) -> Chunks:
    """Return every chunk of a store."""
    shape, outer = array_of(group, "status").shape, kind_in(group).outer
    block = int(str(group.attrs.get("entries_per_chunk", group.attrs.get("speeds_per_chunk"))))
    return Chunks(outer=shape[:outer], entries=shape[outer], each=math.prod(shape[outer + 1 :]), block=block)


def status_of(group: zarr.Group, chunk: Chunk) -> np.ndarray:
    """Return the status of a chunk's cells (entry, ...)."""
    return _values(array_of(group, "status"), chunk.region)


def readable_status(group: zarr.Group, chunk: Chunk) -> np.ndarray:
    """Return the status of a chunk's cells (entry, ...), pending where it cannot be read."""
    try:
        return status_of(group, chunk)
    except Unreadable:
        behind = array_of(group, "status").shape[kind_in(group).outer + 1 :]
        return np.zeros((chunk.last - chunk.first, *behind), dtype=np.uint8)


def written_at(place: Place) -> np.ndarray:
    """Return when each chunk was written that is complete or marked (chunk,), ascending [s since 1970]."""
    found = (when for key, when in place.written(f"{place.root}/status") if not key.endswith(metadata.DOCUMENT))
    return np.sort(np.fromiter(found, dtype=float))


@lru_cache(maxsize=4)
def open_group(place: Place) -> zarr.Group:
    """Open a store for writing chunks; once a process, since opening costs more than a chunk."""
    return zarr.open_group(place.store(), mode="r+")


def write_chunk(place: Place, chunk: Chunk, computed: Computed, allowed: Callable[[], None]) -> None:
    """Write every variable of a chunk, its status last.

    allowed: raises where this process must not write any more; asked before anything is, and before the status, which
    makes what is there count.
    """
    arrays, variables = _arrays(place), kind_of(place).chunked

    def write(name: str) -> None:
        variable, values = variables[name], computed.arrays[name]
        arrays[name][chunk.region] = values / variable.si_factor if variable.suffix else values

    allowed()
    for _ in place.each(write, variables):
        pass
    allowed()
    arrays["status"][chunk.region] = computed.status


def without_result(place: Place, chunk: Chunk, code: int, why: str) -> Computed:
    """Return a chunk without results, every cell with one status."""
    group, kind = open_group(place), kind_of(place)

    def shape(name: str) -> tuple[int, ...]:
        return chunk.last - chunk.first, *array_of(group, name).shape[kind.outer + 1 :]

    return Computed(
        arrays={name: variable.without_result(shape(name)) for name, variable in kind.chunked.items()},
        status=np.full(shape("status"), code, dtype=np.uint8),
        errors=(why,),
    )


@lru_cache(maxsize=4)
def _arrays(place: Place) -> dict[str, zarr.Array[Any]]:
    """Return what is written chunk by chunk; once a process, since opening a dozen arrays costs as much as a chunk."""
    group = open_group(place)
    # Written even where it is empty (a speed without a limit depth), so that a lost file is noticed.
    arrays = {name: array_of(group, name).with_config({"write_empty_chunks": True}) for name in kind_of(place).chunked}
    return {**arrays, "status": array_of(group, "status")}


def forget() -> None:
    """Open stores anew when they are used next: one was exchanged for another."""
    open_group.cache_clear()
    _arrays.cache_clear()


def mark_chunk(place: Place, chunk: Chunk, code: int) -> None:
    """Give every cell of a chunk a status, without results."""
    array_of(open_group(place), "status")[chunk.region] = code


def check(place: Place) -> zarr.Group:
    """Open a store for reading and return it, when it has every array and attribute that its kind gives it.

    Raises InvalidInput, naming what is missing or damaged.
    """
    wrong = [f"{document} {why}" for document, why in metadata.problems(place).items()]
    if not wrong:
        group = zarr.open_group(place.store(), mode="r", use_consolidated=False)
        kind = kind_of(place)
        wrong = [f"{name} is missing" for name in lost_wholes(place, (*kind.coordinates, *kind.wholes))]
        wrong = wrong or _unusable_parts(group)
    if wrong:
        raise InvalidInput(
            [
                f"{place.where(place.root)}: the store is damaged beyond its chunks: {what}; restored by: "
                f"{command('verify', place.option, 'repair=true')}"
                for what in wrong
            ]
        )
    return group


def _unusable_parts(group: zarr.Group) -> list[str]:
    """Return what is wrong with the arrays of a store that are not written chunk by chunk, and which are missing."""
    kind, unreadable, sizes = kind_in(group), [], dict[str, int]()
    for name in (*kind.coordinates, *kind.wholes):
        try:
            sizes[name] = len(whole(group, name))
        except Unreadable as error:
            unreadable.append(str(error))
    if unreadable:
        return unreadable
    return [
        f"variable {name} is missing or not as it was written"
        for name, variable in {**kind.chunked, "status": kind.status}.items()
        if name not in group or array_of(group, name).shape != tuple(sizes[dim] for dim in variable.dims)
    ]


def whole(group: zarr.Group, name: str) -> np.ndarray:
    """Return an array, read in one piece; raise Unreadable naming it when that fails."""
    try:
        return _values(array_of(group, name), ...)
    except (Unreadable, KeyError, TypeError) as error:
        raise Unreadable(f"{name} cannot be read ({str(error).splitlines()[0]})") from None


def _values(array: zarr.Array[Any], region: Any) -> np.ndarray:
    """Return values of an array; raise Unreadable where they are not as they were written."""
    try:
        return np.asarray(array[region])
    except (ValueError, RuntimeError) as error:  # checksum, decompression
        raise Unreadable(str(error)) from error
    except OSError as error:
        if not is_damage(error):
            raise
        raise Unreadable(error.strerror) from error


def lost_wholes(place: Place, names: Iterable[str]) -> list[str]:
    """Return the arrays that are gone of those written in one piece: they would read as if nothing was known."""
    every = list(names)
    kept = place.each(partial(_holds_values, place), every)
    return [name for name, held in zip(every, kept, strict=True) if not held]


def _holds_values(place: Place, name: str) -> bool:
    return any(not key.endswith(metadata.DOCUMENT) for key, _ in place.written(f"{place.root}/{name}"))


def array_of(group: zarr.Group, name: str) -> zarr.Array[Any]:
    """Return an array of a store."""
    array = group[name]
    assert isinstance(array, zarr.Array)
    return array


def key_of(group: zarr.Group, chunk: Chunk, name: str) -> str:
    """Return the key under which a variable of a chunk is kept, that of its shard where the store is packed."""
    array = array_of(group, name)
    first = (*chunk.outer, chunk.first, *(0 for _ in array.shape[len(chunk.outer) + 1 :]))
    place = tuple(index // step for index, step in zip(first, array.shards or array.chunks, strict=True))
    return f"{kind_in(group).name}/{name}/{array.metadata.encode_chunk_key(place)}"


def unreadable_parts(group: zarr.Group, chunk: Chunk) -> list[str]:
    """Return the variables of a chunk that cannot be read back."""
    unreadable = []
    for name in (*kind_in(group).chunked, "status"):
        try:
            _values(array_of(group, name), chunk.region)
        except Unreadable:
            unreadable.append(name)
    return unreadable


def is_packed(group: zarr.Group) -> bool:
    """Return whether the chunks of a store stand in shards, of which each has one writer at a time."""
    return array_of(group, "status").shards is not None


def create_packed(path: Path, name: str, source: zarr.Array[Any], shard: tuple[int, ...]) -> zarr.Array[Any]:
    """Return an empty array like another, in a store that is there, whose chunks stand in shards."""
    group = zarr.open_group(path, mode="r+", use_consolidated=False)
    return group.create_array(
        name,
        shape=source.shape,
        chunks=source.chunks,
        shards=shard,
        dtype=source.dtype,
        fill_value=source.fill_value,
        compressors=[ZstdCodec(level=1), Crc32cCodec()],
        dimension_names=kind_in(group).dimensions(name),
        attributes=source.attrs.asdict(),
        config={"write_empty_chunks": True},
    )


def open_lobes(place: Place) -> xr.Dataset:
    """Open a store as a dataset whose values are read when they are asked for, as many chunks at once as that are."""
    lobes: xr.Dataset = xr.open_zarr(place.store(), consolidated=False, chunks=None)
    return lobes


@contextmanager
def readable(place: Place) -> Iterator[xr.Dataset]:
    """Give a store as ``open_lobes`` does; what cannot be read of it raises InvalidInput."""
    try:
        with open_lobes(place) as opened:
            yield opened
    except (ValueError, RuntimeError, KeyError, OSError) as error:
        if isinstance(error, OSError) and not is_damage(error):
            raise
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        where = place.where(place.root)
        raise InvalidInput([f"{where}: cannot be read, a part is missing or damaged: {reason}"]) from None
