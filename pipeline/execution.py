"""The way of every study: what is missing in its store is computed, and its report written; whatever interrupts."""

import errno
import json
import os
import signal
import socket
import threading
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from chatter_core.variables import FAILED, STATUS
from pipeline import metadata, store, survey
from pipeline.answer_folder import PAGE
from pipeline.cluster import open_client, pages
from pipeline.configuration import Words
from pipeline.dispatch import dispatched
from pipeline.errors import StorageFailed, StoreUnavailable, WorkersLost
from pipeline.journal import Journal
from pipeline.kinds import kind_of
from pipeline.places import CLOCK, LOCK, RECORD, STORES, Place, StillHeld, as_long_as_it_takes, place_of
from pipeline.progress import Meter
from pipeline.provenance import code_version
from pipeline.settings import Cluster, Study, differing_keys, margins_of
from pipeline.stopping import signals
from pipeline.task import Record, Task, compute_first
from pipeline.telling import bars, command, complain, fact, note, say, wrote

#: What is in a place whose study was being created when the run was killed.
OF_A_CREATION = {".lock", LOCK, CLOCK, *STORES, metadata.COPY}
OF_A_CREATION |= {f"{metadata.COPY}.partial", f"{RECORD}.partial"}
#: Seconds of compiling before it is said.
COMPILING_PATIENCE = 1.0


class Stopped(Exception):
    """A signal asked the run to stop; the store is resumable."""

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(signal.Signals(number).name)


def execute_words(
    settings: Study,
    words: Words,
    argv: list[str],
    *,
    root: str,
    retry_failed: bool = False,
    budget: float | None = None,
    report: bool = True,
) -> int:
    """Compute what is missing of a study in the place that the words of its verb name, by default one of its own.

    root: name of the store. Returns and raises what ``execute`` does.
    """
    place = place_of(words.options, Path("results") / f"{settings.study}-{settings.fingerprint()[:8]}", root)
    return execute(settings, place, retry_failed=retry_failed, argv=argv, budget=budget, report=report)


def execute(
    settings: Study,
    place: Place,
    *,
    retry_failed: bool = False,
    argv: list[str] | None = None,
    kernel: str | None = None,
    budget: float | None = None,
    report: bool = True,
) -> int:
    """Compute what is missing in the store of a study and write its report.

    Returns 0 when every cell is ok, 1 when some are marked as failed, 129, 130 or 143 when stopped by
    a signal. Raises InvalidInput when the place holds another study, StoreInUse when another run
    works on it. budget: seconds after which nothing more is begun; what is missing then stays pending, which is no
    failure. report: whether tables, figures and page are written.
    """
    # One thread here as in every worker: the order of summation, and so the last digit, stays the same.
    with place.held() as still_held, threadpool_limits(1):
        _prepare(settings, place, argv or [])
        return carry_on(
            settings,
            place,
            still_held,
            retry_failed=retry_failed,
            argv=argv,
            kernel=kernel,
            budget=budget,
            report=report,
        )


def carry_on(
    settings: Study,
    place: Place,
    still_held: StillHeld = as_long_as_it_takes,
    *,
    retry_failed: bool = False,
    argv: list[str] | None = None,
    kernel: str | None = None,
    budget: float | None = None,
    report: bool = True,
) -> int:
    """Compute what is missing in a store that is there and belongs to the settings, and whose place is held.

    Returns and raises what ``execute`` does.
    """
    journal = Journal(place.make_output())
    try:
        journal.write("start", argv=argv or [], pid=os.getpid(), host=socket.gethostname())
        counts = _compute(settings, place, still_held, journal, retry_failed, kernel, budget)
        still_held()
        written = _finish(place, journal, counts, report)
    except Stopped as stop:
        again = command(kind_of(place).verb, *argv) if argv else "the same command"
        # Where its terminal was closed nobody reads what a run says.
        journal.write("stopped", signal=str(stop), again=again)
        note(f"stopped; nothing is lost. Go on with: {again}")
        return 128 + stop.number
    except OSError as error:
        # The disk is full or ill, or the place has gone away: what was computed before is in the store.
        raise StorageFailed(
            f"{error.filename or place.where(place.root)}: {error.strerror or error}; what was computed is kept, "
            f"the same command goes on once {_mended(error)}"
        ) from None
    return _tell(place, counts, written, journal)


def _mended(error: OSError) -> str:
    """Return what must come about before a run can go on that a file has stopped."""
    if isinstance(error, StoreUnavailable):
        return "it answers"
    return "there is room" if error.errno in (errno.ENOSPC, errno.EDQUOT) else "that is mended"


def _prepare(settings: Study, place: Place, argv: list[str]) -> None:
    """Create the store, or check that the one that is there belongs to these settings."""
    # What lies here need not be what lay here when this process looked last.
    store.forget()
    names = place.names()
    if {RECORD, place.root} <= names:
        existing: dict[str, Any] = store.check(place).attrs.asdict()
        wanted = json.loads(json.dumps(settings.scientific()))
        # Not by their digests, which tell 1 from 1.0; the version of the store is among the settings.
        if existing.get("settings") != wanted:
            keys = differing_keys(existing.get("settings", {}), wanted)
            shown = ", ".join(keys[:12]) + (f" and {len(keys) - 12} more" if len(keys) > 12 else "")
            raise InvalidInput([f"{place}: holds a study with other settings; they differ in: {shown}"])
        if margins_of(existing) != settings.margins:
            metadata.update(place, margins=settings.margins.said)
        metadata.refresh_copy(place)
        return
    if place.root in names and len(store.written_at(place)):
        restored = f"restored by: {command('verify', place.option, 'repair=true')}"
        raise InvalidInput([f"{place}: {RECORD} is missing beside a store that holds results; {restored}"])
    if names - OF_A_CREATION:
        name = place.option.partition("=")[0]
        raise InvalidInput([f"{place}: holds files that are no study; choose an empty place with {name}="])
    # The record is written after the template, so a template that was cut short is made again.
    store.create(place, settings, argv)
    place.write(RECORD, settings.record().encode())


def _compute(
    settings: Study,
    place: Place,
    still_held: StillHeld,
    journal: Journal,
    retry_failed: bool,
    kernel: str | None,
    budget: float | None,
) -> Counter[str]:
    """Compute the chunks that are missing; return how many cells of the store have which status then."""
    group = store.open_group(place)
    kind, every = store.kind_in(group), store.chunks(group)
    missing, of_others = survey.pending(place, retry_failed)
    counts = Counter({name: int(of_others[code]) for name, code in STATUS.items()})
    numbers = np.flatnonzero(missing)
    if not len(numbers):
        return counts
    begun = f"{len(numbers)} of {len(every)} chunks to compute, code {code_version()}"
    made = metadata.begin(place, begun)
    # Many writers of one shard would lose each other's chunks.
    cluster = Cluster(kind="serial") if store.is_packed(group) else settings.cluster
    own, limit = settings.effects_path, cluster.time_limit
    first = Task(
        place=place.anywhere(),
        chunk=every[int(numbers[0])],
        kernel=kernel or kind.kernel,
        made=made,
        effects_path=own,
        time_limit=limit,
    )
    if cluster.kind != "address":
        _compile_once(first)
    # Made when they are handed out: a list of all would be the largest thing in this process.
    tasks = (replace(first, chunk=every[int(number)]) for number in numbers)
    meter = Meter(every.all_cells, counts.total())
    with signals() as stopping:
        stopping.deadline = None if budget is None else time.monotonic() + budget
        try:
            with open_client(cluster, lambda: bool(stopping.number)) as client, meter:
                _note_pages(journal, cluster, pages(client))
                for record in dispatched(tasks, client, stopping, cluster.patience):
                    still_held()
                    _note(journal, record, kind.entry)
                    meter.advance(every.cells(record.chunk))
        except (WorkersLost, RuntimeError, OSError) as error:
            # A signal that went to the whole process group may have taken the workers along.
            if not stopping.number and isinstance(error, RuntimeError):
                raise WorkersLost(f"cluster: the workers could not be started: {error}") from error
            if not stopping.number:
                raise
        if stopping.number:
            raise Stopped(stopping.number)
    return _kept(place, stopping.asked)


def _kept(place: Place, short: bool) -> Counter[str]:
    """Return how many cells of the store have which status, as the store itself says when all has been written.

    short: whether some were not begun. Raises StorageFailed where others are missing: they were removed or damaged.
    """
    missing, of_others = survey.pending(place, retry_failed=False)
    counts = Counter({name: int(of_others[code]) for name, code in STATUS.items()})
    if missing.any() and not short:
        raise StorageFailed(
            f"{place.where(place.root)}: {np.count_nonzero(missing)} chunks that were written are not there any more, "
            "or damaged; the same command computes them again"
        )
    counts["pending"] = store.chunks(store.open_group(place)).all_cells - counts.total()
    return counts


def _compile_once(task: Task) -> None:
    """Have the physics compiled here before several workers compile it side by side, and say so where it takes time."""
    told = threading.Timer(COMPILING_PATIENCE, note, ["compiling, once after installation: about 15 s"])
    told.daemon = True
    told.start()
    try:
        compute_first(task)
    except Exception:
        # Whatever is wrong with this point: its chunk will tell, and mark it.
        return
    finally:
        told.cancel()


def _note_pages(journal: Journal, cluster: Cluster, address: str | None) -> None:
    """Note where workers can be watched, and tell whoever sits before a terminal."""
    if address is None:
        return
    journal.write("workers", cluster=cluster.kind, pages=address)
    if bars():
        note(f"workers can be watched at {address}")


def _note(journal: Journal, record: Record, entry: str) -> None:
    journal.write(
        "chunk",
        outer=list(record.chunk.outer),
        **{f"{entry}s": [record.chunk.first, record.chunk.last]},
        counts=record.counts,
        seconds=round(record.seconds, 4),
        **({"errors": list(record.errors)} if record.errors else {}),
    )


def _mark_damaged(place: Place) -> None:
    """Mark chunks that cannot be read as pending; raise InvalidInput naming them when there are any."""
    damaged = {chunk: parts for _, found in survey.damaged(place) for chunk, parts in found.items()}
    for chunk in damaged:
        store.mark_chunk(place, chunk, STATUS["pending"])
    if damaged:
        metadata.update(place, complete=False)
        entry = kind_of(place).entry
        named = list(damaged.items())[:4]
        where = ", ".join(f"{parts[0]} of {entry}s {chunk.first} to {chunk.last - 1}" for chunk, parts in named)
        raise InvalidInput(
            [
                f"{place.where(place.root)}: {len(damaged)} chunks are damaged ({where}) and count as pending now; "
                "the same command computes them again"
            ]
        )


def _finish(place: Place, journal: Journal, counts: Counter[str], report: bool) -> list[Path]:
    """Write the report of a store whose cells have these statuses, if it is wanted; return what was written."""
    metadata.update(place, complete=not counts["pending"])
    written = list[Path]()
    if report:
        try:
            written = kind_of(place).report(place)
        except InvalidInput:
            _mark_damaged(place)
            raise
    else:
        before = "; those that are there are of before" if (place.output / PAGE).exists() else ""
        note(f"no tables, figures and page were asked for{before}; write them with: {command('report', place.option)}")
    journal.write("end", counts={name: counts[name] for name in STATUS if counts[name]})
    return written


def _tell(place: Place, counts: Counter[str], written: list[Path], journal: Journal) -> int:
    """Say what there is; return the exit code."""
    failed = {name: count for name, count in counts.items() if count and STATUS[name] in FAILED}
    store_at = place.where(place.root)
    say(f"store:   {store_at}")
    fact(
        store=store_at,
        journal=journal.path,
        cells={name: count for name, count in counts.items() if count},
        cells_failed=sum(failed.values()),
        cells_total=counts.total(),
    )
    wrote(written)
    if counts["pending"]:
        note(f"{counts['pending']} of {counts.total()} are not computed yet: the time is up; the same command goes on")
    if failed:
        why = ", ".join(f"{count} {name}" for name, count in failed.items())
        complain(
            f"{sum(failed.values())} of {counts.total()} cells failed and are marked ({why}); "
            f"see {journal.path}; compute them again with retry_failed=true"
        )
    return 1 if failed else 0
