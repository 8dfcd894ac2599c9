"""Every byte of a store read back: what is damaged is named, and with ``repair=true`` made anew."""

import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import yaml
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS, STRUCTURE, WITH_RESULT
from pipeline import metadata, store, sweep
from pipeline.configuration import EFFECTS_PATH
from pipeline.locking import locked
from pipeline.progress import Meter
from pipeline.settings import Cluster, Settings, recorded
from pipeline.study_folder import study_folder

#: Damaged places that are named one by one.
NAMED = 20


@dataclass(frozen=True, kw_only=True)
class Damage:
    """What does not read back as it was written.

    documents: place in the store, and what is wrong; fixed: arrays of coordinates and structure; chunks: with the
    variables of each; settings: whether the readable record beside the store differs from it.
    """

    documents: dict[str, str]
    fixed: list[str]
    chunks: dict[store.Chunk, list[str]]
    settings: bool

    def __bool__(self) -> bool:
        return bool(self.documents or self.fixed or self.chunks or self.settings)

    def sentences(self) -> list[str]:
        """Return what is wrong in words, place by place."""
        return [
            *(f"{place}: {why}" for place, why in self.documents.items()),
            *(f"{name}: cannot be read" for name in self.fixed),
            *(
                f"{name}: indices {', '.join(map(str, chunk.outer))}, speeds {chunk.first} to {chunk.last - 1}"
                for chunk, names in self.chunks.items()
                for name in names
            ),
            *(["settings.yaml: is not what the store says"] if self.settings else []),
        ]


def run(words: list[str]) -> int:
    """Read back a store, repair it where asked; return 1 where damage is left or cells have failed, else 0."""
    output, options = study_folder(words, "verify", {"repair": ("false", "true"), EFFECTS_PATH: ()})
    own = Path(options[EFFECTS_PATH]).resolve() if options[EFFECTS_PATH] else None
    with locked(output):
        store.recover(output)
        found = damage(output)
        if not found:
            print(f"{output}: every byte reads back as it was written")
            return 0
        told = found.sentences()
        for sentence in told[:NAMED]:
            print(f"damaged: {sentence}")
        if len(told) > NAMED:
            print(f"damaged: and {len(told) - NAMED} more places")
        if options["repair"] != "true":
            again = f"python -m pipeline verify output={output} repair=true"
            print(f"{len(told)} places are damaged; made anew with: {again}", file=sys.stderr)
            return 1
        return repair(output, found, own, words)


def damage(output: Path) -> Damage:
    """Return what is damaged in the store of a study."""
    path = output / "lobes.zarr"
    documents = metadata.problems(path)
    if documents:
        # Nothing can be read by documents that are wrong.
        return Damage(documents=documents, fixed=[], chunks={}, settings=False)
    group = store.open_group(path)
    fixed = [name for name in (*store.COORDINATES, *STRUCTURE) if not _reads(group, name)]
    every, chunks = store.chunks(group), dict[store.Chunk, list[str]]()
    with Meter(len(every), 0, "chunks") as meter:
        for chunk in every:
            parts = _unreadable(path, group, chunk)
            if parts:
                chunks[chunk] = parts
            meter.advance(1)
    return Damage(documents={}, fixed=fixed, chunks=chunks, settings=_record_differs(output))


def repair(output: Path, found: Damage, own: Path | None, argv: list[str], cluster: Cluster | None = None) -> int:
    """Make anew what is damaged in the store of a study, whose folder is locked; return the exit code.

    own: folder with effects of the user's own, where the study has such. Raises InvalidInput where the settings of
    the study are lost, or cannot be followed by this version of the program.
    """
    path = output / "lobes.zarr"
    # One thread here as where it was computed: the order of summation, and so the last digit, stays the same.
    with threadpool_limits(1):
        if found.documents:
            lost = metadata.restore(path)
            if lost:
                raise InvalidInput([f"{lost[0]}: what was to be computed is not known any more; run the study again"])
            print(f"restored: {', '.join(found.documents)}")
            found = damage(output)
        _remove_unreadable_shards(path, found)
        settings = recorded(metadata.attributes(path), own, cluster or Cluster(kind="local"))
        _restore_fixed(path, found.fixed, settings)
        (output / "settings.yaml").write_text(settings.record())
        for chunk in found.chunks:
            store.mark_chunk(path.resolve(), chunk, STATUS["pending"])
        return sweep.carry_on(settings, output, argv=argv)


def _remove_unreadable_shards(path: Path, found: Damage) -> None:
    """Remove the shards of damaged chunks: what else they hold is computed again with them.

    A shard whose index is damaged takes no chunk any more.
    """
    group = store.open_group(path.resolve())
    if not store.is_packed(group):
        return
    for file in {store.file_of(path, group, chunk, name) for chunk, names in found.chunks.items() for name in names}:
        file.unlink(missing_ok=True)
    found.chunks.update({chunk: parts for chunk in store.chunks(group) if (parts := _unreadable(path, group, chunk))})


def _reads(group: store.Group, name: str) -> bool:
    try:
        store.whole(group, name)
    except ValueError:
        return False
    return True


def _unreadable(path: Path, group: store.Group, chunk: store.Chunk) -> list[str]:
    """Return the variables of a chunk that cannot be read back, or are gone although there is a result."""
    parts = store.unreadable_parts(group, chunk)
    has_result = "status" not in parts and bool(np.isin(store.status_of(group, chunk), WITH_RESULT).any())
    return [*parts, *(store.lost_parts(path, group, chunk) if has_result else [])]


def _record_differs(output: Path) -> bool:
    try:
        said = yaml.safe_load((output / "settings.yaml").read_text())
    except (OSError, ValueError, yaml.YAMLError):
        return True
    held = metadata.attributes(output / "lobes.zarr")
    return bool(said != {"study": held["study"], **held["settings"]})


def _restore_fixed(path: Path, names: list[str], settings: Settings) -> None:
    """Compute coordinates and structure anew that cannot be read."""
    if not names:
        return
    with TemporaryDirectory(prefix="chatter-") as scratch:
        fresh = Path(scratch) / "fresh" / "lobes.zarr"
        fresh.parent.mkdir()
        store.create(fresh, settings, [])
        for name in names:
            shutil.rmtree(path / name / "c", ignore_errors=True)
            shutil.copytree(fresh / name / "c", path / name / "c")
