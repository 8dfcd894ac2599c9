"""One run holds a study in an object store, and one alone takes over from a run that has died."""

import json
import threading
import time
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path

import pytest

from chatter_core.errors import InvalidInput
from pipeline.errors import StoreInUse, StoreUnavailable
from pipeline.places import Place, StillHeld, place_of
from pipeline.places.lease import Lease
from tests.object_server.server import Buckets, Refused
from tests.pipeline.object_store.server_side import (
    ADDRESS,
    BUCKET,
    SHORT,
    STORE,
    age,
    serving_again,
    start,
)
from tests.pipeline.standins import GATE
from tests.pipeline.studies import PATIENCE, journal, run, wait_until


def abandon(place: Place) -> None:
    """Hold a place and never give it back, as a run that is killed does."""
    Lease(place.objects, str(place), 3.0)._acquire()


def test_a_second_run_is_refused_while_the_first_one_lives(
    place: Place, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    gate = tmp_path / "gate"
    monkeypatch.setenv(GATE, str(gate))
    process = start(tmp_path / "first", kernel="gated")
    try:
        wait_until(lambda: len(journal(tmp_path / "first", "chunk")) >= 1, process)
        with pytest.raises(StoreInUse, match=rf"in use by process {process.pid} on \S+ since 2\S+, last heard of"):
            run([STORE, SHORT, f"output={tmp_path / 'second'}"])
    finally:
        gate.touch()
        _, told = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, told
    # It was given back, so nobody has to wait.
    assert run([STORE, SHORT, f"output={tmp_path / 'second'}"]) == 0
    assert journal(tmp_path / "second", "chunk") == []


def test_of_many_takers_one_alone_succeeds(place: Place, buckets: Buckets) -> None:
    """With no lock at all, with one that is over, and with one that was given back."""
    takers = 8
    outcomes = list[list[str]]()
    for before in ("none", "expired", "released", "expired", "released"):
        if before == "none":
            buckets.kept[BUCKET].clear()
        if before == "expired":
            abandon(place)
            age(buckets)
        ready, done, outcome = threading.Barrier(takers), threading.Barrier(takers), list[str]()

        def take(ready: threading.Barrier, done: threading.Barrier, outcome: list[str]) -> None:
            ready.wait()
            try:
                with place.held():
                    outcome.append("held")
                    done.wait(PATIENCE)
            except StoreInUse:
                outcome.append("refused")
                done.wait(PATIENCE)

        threads = [threading.Thread(target=take, args=(ready, done, outcome)) for _ in range(takers)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE)
        outcomes.append(sorted(outcome))
    assert outcomes == [["held", *["refused"] * (takers - 1)]] * 5


def test_a_run_that_was_taken_for_dead_learns_of_it_and_leaves_the_lock_to_the_other(
    place: Place, buckets: Buckets
) -> None:
    with place.held() as first:
        first()
        age(buckets)
        with place.held() as second:
            with pytest.raises(StoreInUse, match="was taken over by process"):
                ask_until_it_raises(first)
            second()
        released = place.read("lock.json")
    assert place.read("lock.json") == released


@pytest.mark.filterwarnings("error::pytest.PytestUnhandledThreadExceptionWarning")
def test_a_run_whose_lock_was_removed_learns_of_it(place: Place) -> None:
    with place.held() as still_held:
        place.delete("lock.json")
        with pytest.raises(StoreInUse, match="was taken over by another run"):
            ask_until_it_raises(still_held)


def test_a_hold_is_renewed_as_long_as_its_run_lives(place: Place) -> None:
    end = time.monotonic() + PATIENCE
    with place.held() as still_held:
        while json.loads(place.read("lock.json"))["renewal"] < 3:
            still_held()
            assert time.monotonic() < end
            time.sleep(0.02)
    assert "released" in json.loads(place.read("lock.json"))


def test_age_is_told_by_the_clock_of_the_store(place: Place, buckets: Buckets) -> None:
    """A machine whose clock is a day off takes nobody for dead."""
    buckets.ahead = timedelta(days=-1)
    with place.held(), pytest.raises(StoreInUse), place.held():
        pass


def test_a_hold_that_cannot_be_renewed_ends_by_itself(buckets: Buckets, address: str, tmp_path: Path) -> None:
    with ExitStack() as held:
        with serving_again(buckets, address):
            place = place_of({"store": ADDRESS, "output": str(tmp_path / "here"), "lease_s": "3"})
            still_held = held.enter_context(place.held())
        with pytest.raises(StoreUnavailable, match="could not be told for 3 s that this run goes on"):
            ask_until_it_raises(still_held)


def ask_until_it_raises(still_held: StillHeld) -> None:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        still_held()
        time.sleep(0.02)


@pytest.mark.parametrize("condition", ["If-Match", "If-None-Match"])
def test_a_store_that_does_not_keep_to_conditions_is_refused(place: Place, buckets: Buckets, condition: str) -> None:
    buckets.careless = frozenset({condition})
    with pytest.raises(InvalidInput, match="writes whatever If-None-Match and If-Match say"), place.held():
        pass


def test_a_server_keeps_to_the_conditions_of_a_write() -> None:
    """The server itself, by what Amazon's API reference says of If-None-Match and If-Match."""
    buckets = Buckets({BUCKET: {}})
    first = buckets.put(BUCKET, "key", b"1", None, "*")
    for match, none_match, code in (
        (None, "*", "PreconditionFailed"),
        ('"another"', None, "PreconditionFailed"),
    ):
        with pytest.raises(Refused, match=code):
            buckets.put(BUCKET, "key", b"2", match, none_match)
    with pytest.raises(Refused, match="NoSuchKey"):
        buckets.put(BUCKET, "other", b"2", first.tag, None)
    assert buckets.put(BUCKET, "key", b"2", first.tag, None).content == buckets.object(BUCKET, "key").content == b"2"
