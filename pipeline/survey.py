"""What a store holds of its chunks: files are listed and not opened, statuses read many chunks at once.

Whatever number of chunks there is, nothing is held of each but a byte or two.
"""

import re
from collections import Counter
from collections.abc import Iterator
from functools import partial

import numpy as np

from chatter_core.variables import FAILED, STATUS, WITH_RESULT
from pipeline import metadata, store
from pipeline.chunks import Chunk, Chunks
from pipeline.errors import Unreadable
from pipeline.places import Place

#: Key of a chunk's file below its variable, with folders for its indices or without.
_KEY = re.compile(r"c[./](\d+(?:[./]\d+)*)")


def tallies(place: Place) -> Iterator[tuple[slice, np.ndarray]]:
    """Yield how many cells of which chunks have each status (chunk, status), piece by piece, with their numbers.

    A chunk whose status cannot be read counts as pending.
    """
    group = store.open_group(place)
    every = store.chunks(group)
    there = written_chunks(place, group, "status")

    def tally(piece: tuple[slice, Chunk]) -> tuple[slice, np.ndarray]:
        # Nothing is asked for what is not there: an object store answers each question by itself.
        begun = there[piece[0]].any()
        return piece[0], _tally(group, every, piece) if begun else _counted(_no_status(every, piece[1]), every)

    yield from place.each(tally, every.pieces())


def counts(place: Place) -> Counter[str]:
    """Return how many cells of a store have each status; those that have none are left out."""
    total = sum((tally.sum(axis=0) for _, tally in tallies(place)), start=np.zeros(len(STATUS), dtype=int))
    return Counter({name: int(total[code]) for name, code in STATUS.items() if total[code]})


def pending(place: Place, retry_failed: bool) -> tuple[np.ndarray, np.ndarray]:
    """Return which chunks are to be computed (chunk,), and how many cells of the others have each status (status,).

    What a store holds of a computed chunk that lacks a variable, or is tried again, counts no more then.
    """
    group = store.open_group(place)
    every = store.chunks(group)
    whole = np.ones(len(every), dtype=bool)
    for there in place.each(partial(written_chunks, place, group), store.kind_in(group).chunked):
        whole &= there
    missing, counts = np.zeros(len(every), dtype=bool), np.zeros(len(STATUS), dtype=int)
    for numbers, tally in tallies(place):
        open_yet = tally[:, STATUS["pending"]] > 0
        again = _any_of(tally, WITH_RESULT) & ~whole[numbers]
        if retry_failed:
            again |= _any_of(tally, FAILED)
        for index in np.flatnonzero(again & ~open_yet):
            store.mark_chunk(place, every[numbers.start + int(index)], STATUS["pending"])
        missing[numbers] = open_yet | again
        counts += tally[~missing[numbers]].sum(axis=0)
    return missing, counts


def damaged(place: Place) -> Iterator[tuple[int, dict[Chunk, list[str]]]]:
    """Yield how many chunks were read back, and the variables of those that cannot be, piece by piece.

    What is gone of a chunk with a result cannot be either, nor a status that is gone of a store that was complete.
    """
    group = store.open_group(place)
    every, complete = store.chunks(group), metadata.attributes(place)["complete"]
    there = {name: written_chunks(place, group, name) for name in store.kind_in(group).chunked}
    no_status = ~written_chunks(place, group, "status") if complete else np.zeros(len(every), dtype=bool)

    def read(piece: tuple[slice, Chunk]) -> tuple[int, dict[Chunk, list[str]]]:
        numbers, whole = piece
        suspect = bool(store.unreadable_parts(group, whole))
        has_result = _any_of(_tally(group, every, piece), WITH_RESULT)
        found = dict[Chunk, list[str]]()
        for number, result in zip(range(numbers.start, numbers.stop), has_result, strict=True):
            lost = [name for name in there if not there[name][number]] if result else []
            lost += ["status"] if no_status[number] else []
            chunk = every[number] if suspect or lost else whole
            if parts := [*(store.unreadable_parts(group, chunk) if suspect else []), *lost]:
                found[chunk] = parts
        return len(has_result), found

    yield from place.each(read, every.pieces())


def written_chunks(place: Place, group: store.Group, name: str) -> np.ndarray:
    """Return which chunks of a variable are there (chunk,), in shards where the store is packed."""
    array, every = store.array_of(group, name), store.chunks(group)
    steps = array.shards or array.chunks
    files = np.zeros([-(-size // step) for size, step in zip(array.shape, steps, strict=True)], dtype=bool)
    folder = f"{place.root}/{name}/"
    for key, _ in place.written(folder.rstrip("/")):
        found = _KEY.fullmatch(key, len(folder))
        index = tuple(map(int, found[1].replace("/", ".").split("."))) if found else ()
        # What else lies in the folder is nobody's.
        if len(index) == files.ndim and all(i < size for i, size in zip(index, files.shape, strict=True)):
            files[index] = True
    chunk_of = [
        np.arange(count) * chunk // step for count, chunk, step in zip(every.shape, array.chunks, steps, strict=False)
    ]
    # What stands behind the blocks is whole in every file.
    there: np.ndarray = files.reshape(files.shape[: len(chunk_of)])[np.ix_(*chunk_of)]
    return there.ravel()


def _tally(group: store.Group, every: Chunks, piece: tuple[slice, Chunk]) -> np.ndarray:
    """Return how many cells of the chunks of a piece have each status (chunk, status)."""
    numbers, whole = piece
    try:
        return _counted(store.status_of(group, whole), every)
    except Unreadable:
        if numbers.stop - numbers.start == 1:
            return _counted(_no_status(every, whole), every)
    ones = range(numbers.start, numbers.stop)
    return np.concatenate([_tally(group, every, (slice(one, one + 1), every[one])) for one in ones])


def _counted(status: np.ndarray, every: Chunks) -> np.ndarray:
    """Return how many cells of each chunk have each status (chunk, status), of a status (entry, ...)."""
    by_entry = np.stack(
        [np.count_nonzero(status.reshape(len(status), -1) == code, axis=1) for code in STATUS.values()], axis=1
    )
    return np.add.reduceat(by_entry, np.arange(0, len(status), every.block), axis=0)


def _any_of(tally: np.ndarray, codes: tuple[int, ...]) -> np.ndarray:
    """Return which chunks have a cell with one of these statuses (chunk,)."""
    return np.asarray((tally[:, list(codes)] > 0).any(axis=1))


def _no_status(every: Chunks, chunk: Chunk) -> np.ndarray:
    """Return the status of a chunk of which nothing is known (entry, cell)."""
    return np.full((chunk.last - chunk.first, every.each), STATUS["pending"], dtype=np.uint8)
