"""A finished store in few files: its chunks side by side in shards, each still with its own checksum."""

import math
import shutil
from pathlib import Path

import numpy as np

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS
from pipeline import metadata, store, survey
from pipeline.places import Folder
from pipeline.places.folder import PACKING
from pipeline.progress import Meter
from pipeline.provenance import now
from pipeline.study_place import study_place
from pipeline.telling import command, fact, say
from pipeline.verbs.stores import PackOptions

#: What a shard holds at most, uncompressed [bytes]: it is written in one piece.
SHARD_BYTES = 128 * 1024**2


def run(words: list[str]) -> int:
    """Pack the store of a finished study."""
    place, _ = study_place(words, PackOptions)
    if not isinstance(place, Folder):
        raise InvalidInput(
            [f"{place}: pack is for stores in folders; copy this one into a folder of this machine and pack it there"]
        )
    with place.held():
        before, after = pack(place)
    say(f"{place.where(place.root)}: {before} files, now {after}")
    fact(store=place.where(place.root), files_before=before, files_now=after)
    return 0


def pack(place: Folder) -> tuple[int, int]:
    """Pack the store of a study, whose folder is held; return how many files it was and is.

    Raises InvalidInput for a store that is not finished, or damaged.
    """
    path, packing = place.output / place.root, place.output / PACKING
    group = store.check(place)
    chunked = {*store.kind_in(group).chunked, "status"}
    files = _files(path)
    if store.is_packed(group):
        return files, files
    _require_finished(place)
    shutil.rmtree(packing, ignore_errors=True)
    # Without the chunk files: what stands in single pieces is taken as it is.
    shutil.copytree(path, packing, ignore=lambda folder, names: _of_chunks(path, folder, names, chunked))
    with Meter(len(chunked), 0, "variables") as meter:
        for name in chunked:
            _pack_variable(group, packing, name)
            meter.advance(1)
    metadata.reseal(place, PACKING, packed=now())
    place.exchange()
    store.forget()
    metadata.refresh_copy(place)
    return files, _files(path)


def shard_shape(shape: tuple[int, ...], chunks: tuple[int, ...], item: int) -> tuple[int, ...]:
    """Return a shard of whole chunks, as large as SHARD_BYTES allows: the last dimensions first.

    shape: of the array; chunks: of a chunk; item: bytes of an element.
    """
    shard = list(chunks)
    for axis in reversed(range(len(shape))):
        others = item * math.prod(shard) // shard[axis]
        most = max(1, SHARD_BYTES // (others * chunks[axis]))
        needed = math.ceil(shape[axis] / chunks[axis])
        shard[axis] = chunks[axis] * min(most, needed)
        if most < needed:
            break
    return tuple(shard)


def _require_finished(place: Folder) -> None:
    where = place.where(place.root)
    damaged = sum(len(found) for _, found in survey.damaged(place))
    if damaged:
        first = command("verify", place.option, "repair=true")
        raise InvalidInput([f"{where}: {damaged} chunks are damaged; first: {first}"])
    pending = sum(int((tally[:, STATUS["pending"]] > 0).sum()) for _, tally in survey.tallies(place))
    if pending:
        raise InvalidInput([f"{where}: {pending} chunks are not computed yet; a store is packed when it is finished"])


def _pack_variable(group: store.Group, packing: Path, name: str) -> None:
    """Write a variable anew, shard by shard, and compare what then reads back."""
    source = store.array_of(group, name)
    shutil.rmtree(packing / name)
    shard = shard_shape(source.shape, source.chunks, source.dtype.itemsize)
    target = store.create_packed(packing, name, source, shard)
    for first in np.ndindex(*(math.ceil(size / step) for size, step in zip(source.shape, shard, strict=True))):
        region = tuple(slice(i * step, (i + 1) * step) for i, step in zip(first, shard, strict=True))
        values = np.asarray(source[region])
        target[region] = values
        if not np.array_equal(np.asarray(target[region]), values, equal_nan=values.dtype.kind == "f"):
            raise OSError(0, "does not read back as it was written", str(packing / name))


def _of_chunks(path: Path, folder: str, names: list[str], chunked: set[str]) -> list[str]:
    """Return which of the names in a folder are of files that are written chunk by chunk."""
    of_variable = Path(folder).parent == path and Path(folder).name in chunked
    return [name for name in names if of_variable and name.partition(".")[0] == "c"]


def _files(path: Path) -> int:
    return sum(file.is_file() for file in path.rglob("*"))
