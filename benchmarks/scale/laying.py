"""A store most of whose chunks are laid beside each other as copies of one that was computed."""

from pathlib import Path

from benchmarks.scale.study import CHUNKED, KERNEL, study
from pipeline import metadata, store
from pipeline.places import LOBES, RECORD, Folder
from pipeline.task import Task, compute_chunk


def create(chunks: int, folder: Path) -> None:
    """Make the store of a study, without any chunk."""
    settings, place = study(chunks), Folder(folder)
    folder.mkdir(parents=True)
    store.create(place, settings, [])
    place.write(RECORD, settings.record().encode())


def lay(chunks: int, folder: Path, computed: int) -> None:
    """Lay chunks into the store of a study until no more are missing than are to be computed.

    A copy costs a hundredth of a chunk that a task computes and writes, and is the same to whoever reads the store.
    """
    if chunks <= computed:
        return
    place = Folder(folder)
    group = store.open_group(place)
    every = store.chunks(group)
    compute_chunk(Task(place=place, chunk=every[0], kernel=KERNEL, made=metadata.identity(place)))
    for name in CHUNKED:
        encoded = store.array_of(group, name).metadata.encode_chunk_key
        behind = (0,) * (len(store.array_of(group, name).shape) - store.kind_in(group).outer - 1)
        root = folder / LOBES / name
        content = (root / encoded((0, 0, 0, 0, *behind))).read_bytes()
        for number in range(1, chunks - computed):
            chunk = every[number]
            # One speed a chunk: the number of the first speed is that of the block.
            file = root / encoded((*chunk.outer, chunk.first, *behind))
            if not file.parent.exists():
                file.parent.mkdir(parents=True)
            file.write_bytes(content)
