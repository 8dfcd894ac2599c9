"""Every byte of a store read back: what is damaged is named, and with ``repair=true`` made anew."""

from dataclasses import dataclass
from pathlib import Path

import yaml
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from chatter_core.variables import STATUS
from pipeline import execution, journal, metadata, store, survey
from pipeline.chunks import Chunk
from pipeline.errors import StoreUnavailable, Unreadable
from pipeline.kinds import kind_of
from pipeline.places import RECORD, Folder, Place, StillHeld, as_long_as_it_takes
from pipeline.progress import Meter
from pipeline.scratch import scratch_folder
from pipeline.settings import Cluster, Study, recorded
from pipeline.study_place import study_place
from pipeline.telling import command, complain, fact, say
from pipeline.verbs.stores import VerifyOptions

#: Damaged places that are named one by one.
NAMED = 20


@dataclass(frozen=True, kw_only=True)
class Damage:
    """What does not read back as it was written.

    documents: place in the store, and what is wrong; fixed: arrays of coordinates and structure; chunks: with the
    variables of each; beside: files beside the store, and what is wrong; torn: lines of the journal, which nothing
    restores and which are left; entry: what chunks are blocks of.
    """

    documents: dict[str, str]
    fixed: list[str]
    chunks: dict[Chunk, list[str]]
    beside: dict[str, str]
    torn: int
    entry: str

    @property
    def mendable(self) -> bool:
        """Whether there is something to be made anew."""
        return bool(self.documents or self.fixed or self.chunks or self.beside)

    def __bool__(self) -> bool:
        return self.mendable or bool(self.torn)

    def entries_of(self, chunk: Chunk) -> str:
        """Return in words where a chunk stands."""
        where = f"indices {', '.join(map(str, chunk.outer))}, " if chunk.outer else ""
        return f"{where}{self.entry}s {chunk.first} to {chunk.last - 1}"

    def sentences(self) -> list[str]:
        """Return what is wrong in words, place by place."""
        return [
            *(f"{place}: {why}" for place, why in {**self.documents, **self.beside}.items()),
            *(f"{name}: cannot be read" for name in self.fixed),
            *(f"{name}: {self.entries_of(chunk)}" for chunk, names in self.chunks.items() for name in names),
        ]


def run(words: list[str]) -> int:
    """Read back a store, repair it where asked; return 1 where damage is left or cells have failed, else 0."""
    place, options = study_place(words, VerifyOptions)
    own = options.effects_path.resolve() if options.effects_path else None
    with place.held() as still_held:
        found = damage(place)
        told = found.sentences()
        fact(store=place.where(place.root), damaged=told, torn_lines=found.torn)
        if found.torn:
            say(f"{journal.FILE}: {found.torn} lines are not as they were written; they stay, no result is in them")
        if not found.mendable:
            say(f"{place}: every byte {'of the store ' if found.torn else ''}reads back as it was written")
            return 0
        for sentence in told[:NAMED]:
            say(f"damaged: {sentence}")
        if len(told) > NAMED:
            say(f"damaged: and {len(told) - NAMED} more places")
        if options.repair != "true":
            again = command("verify", place.option, "repair=true")
            complain(f"{len(told)} places are damaged; made anew with: {again}")
            return 1
        return repair(place, found, own, words, still_held=still_held)


def damage(place: Place) -> Damage:
    """Return what is damaged in the store of a study."""
    documents, torn = metadata.problems(place), journal.torn_lines(place.make_output() / journal.FILE)
    if documents:
        # Nothing can be read by documents that are wrong.
        return Damage(documents=documents, fixed=[], chunks={}, beside={}, torn=torn, entry=kind_of(place).entry)
    group = store.open_group(place)
    kind = store.kind_in(group)
    wholes = (*kind.coordinates, *kind.wholes)
    lost = store.lost_wholes(place, wholes)
    fixed = [name for name in wholes if name in lost or not _reads(group, name)]
    chunks = dict[Chunk, list[str]]()
    with Meter(len(store.chunks(group)), 0, "chunks") as meter:
        for count, parts in survey.damaged(place):
            chunks |= parts
            meter.advance(count)
    return Damage(documents={}, fixed=fixed, chunks=chunks, beside=_wrong_beside(place), torn=torn, entry=kind.entry)


def repair(
    place: Place,
    found: Damage,
    own: Path | None,
    argv: list[str],
    cluster: Cluster | None = None,
    still_held: StillHeld = as_long_as_it_takes,
) -> int:
    """Make anew what is damaged in the store of a study, whose place is held; return the exit code.

    own: folder with effects of the user's own, where the study has such. Raises InvalidInput where the settings of
    the study are lost, or cannot be followed by this version of the program.
    """
    # One thread here as where it was computed: the order of summation, and so the last digit, stays the same.
    with threadpool_limits(1):
        if found.documents:
            lost = metadata.restore(place)
            if lost:
                raise InvalidInput([f"{lost[0]}: what was to be computed is not known any more; run the study again"])
            say(f"restored: {', '.join(found.documents)}")
            found = damage(place)
        _remove_unreadable_shards(place, found)
        settings = recorded(kind_of(place).settings, metadata.attributes(place), own, cluster or Cluster(kind="local"))
        _restore_fixed(place, found.fixed, settings)
        place.write(RECORD, settings.record().encode())
        metadata.refresh_copy(place)
        for chunk in found.chunks:
            store.mark_chunk(place, chunk, STATUS["pending"])
        return execution.carry_on(settings, place, still_held, argv=argv)


def _remove_unreadable_shards(place: Place, found: Damage) -> None:
    """Remove the shards of damaged chunks: what else they hold is computed again with them.

    A shard whose index is damaged takes no chunk any more.
    """
    group = store.open_group(place)
    if not store.is_packed(group):
        return
    for key in {store.key_of(group, chunk, name) for chunk, names in found.chunks.items() for name in names}:
        place.delete(key)
    for _, parts in survey.damaged(place):
        found.chunks.update(parts)


def _reads(group: store.Group, name: str) -> bool:
    try:
        store.whole(group, name)
    except Unreadable:
        return False
    return True


def _wrong_beside(place: Place) -> dict[str, str]:
    """Return which files beside a store are wrong that it restores, and in which way."""
    found = {RECORD: "is not what the store says"} if _record_differs(place) else {}
    return found if metadata.copy_is_whole(place) else {**found, metadata.COPY: "does not bear its checksum"}


def _record_differs(place: Place) -> bool:
    try:
        said = yaml.safe_load(place.read(RECORD))
    except StoreUnavailable:
        raise
    except (OSError, ValueError, yaml.YAMLError):
        return True
    held = metadata.attributes(place)
    return bool(said != {"study": held["study"], **held["settings"]})


def _restore_fixed(place: Place, names: list[str], settings: Study) -> None:
    """Compute coordinates and structure anew that cannot be read."""
    if not names:
        return
    with scratch_folder() as scratch:
        fresh = Folder(scratch, place.root)
        store.create(fresh, settings, [])
        made, group = store.open_group(fresh), store.open_group(place)
        for name in names:
            store.write_whole(store.array_of(group, name), store.whole(made, name))
