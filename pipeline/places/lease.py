"""A run's hold of an object store: an object that is written on conditions, and anew as long as the run lives."""

import errno
import json
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import obstore
from obstore.exceptions import AlreadyExistsError, PreconditionError
from obstore.store import S3Store

from chatter_core.errors import InvalidInput
from pipeline.errors import StoreInUse, StoreUnavailable
from pipeline.json_text import parsed
from pipeline.places.place import CLOCK, LOCK, StillHeld
from pipeline.places.s3 import clear_words
from pipeline.verbs.options import LEASE

#: A condition that never holds: the tag of no content.
ANOTHER = {"e_tag": f'"{0:032}"'}
#: How often a lease is renewed before it would end.
RENEWALS = 4


class _Refused(Exception):
    """The lock is not as it was thought to be: another run was faster."""


@dataclass(frozen=True, kw_only=True)
class _Lock:
    """The lock as it was found: what it says, and the tag and time of the object."""

    said: dict[str, Any]
    tag: str
    written: datetime

    @property
    def lease(self) -> float:
        """Seconds after which it is over when it is not renewed; the usual ones where it cannot be read."""
        try:
            return float(self.said["lease_s"])
        except (KeyError, TypeError, ValueError):
            return LEASE

    def __str__(self) -> str:
        who = f"process {self.said.get('pid', 'unknown')} on {self.said.get('host', 'an unknown host')}"
        return f"{who} since {self.said.get('since', 'an unknown time')}"


class Lease:
    """The hold of one run: whoever finds it renewed for no longer than it says may take it over, one alone.

    Every write is on condition: that there is no lock, or that it is the one that was read. So of several takers one
    succeeds, and a run that was taken for dead learns of it when it renews.
    """

    def __init__(self, objects: S3Store, address: str, seconds: float) -> None:
        self.objects, self.address, self.seconds = objects, address, seconds
        self._me = {
            "pid": os.getpid(),
            "host": socket.gethostname(),
            "since": datetime.now(UTC).isoformat(timespec="seconds"),
            "lease_s": seconds,
            "token": uuid.uuid4().hex,
        }
        self._tag, self._renewals, self._renewed = "", 0, 0.0
        self._ending, self._silent, self._lost = threading.Event(), False, False

    @contextmanager
    def held(self) -> Iterator[StillHeld]:
        """Hold the store; yield what raises once another run holds it, or nobody could be told for too long.

        Raises StoreInUse when another run holds it, StoreUnavailable when it cannot be reached.
        """
        self._acquire()
        keeper = threading.Thread(target=self._keep, daemon=True, name="lease")
        keeper.start()
        try:
            yield self._still_held
        finally:
            self._ending.set()
            keeper.join()
            self._release()

    def _acquire(self) -> None:
        found = self._read()
        if found is not None and "released" not in found.said:
            silent = self._age(found)
            if silent <= found.lease:
                raise StoreInUse(
                    f"{self.address}: in use by {found}, last heard of {silent:.0f} s ago; wait for it (when it is not "
                    f"heard of for {found.lease:g} s it counts as dead), or choose another address with store="
                )
        try:
            self._put("create" if found is None else {"e_tag": found.tag})
        except _Refused:
            raise StoreInUse(f"{self.address}: in use by {self._read() or 'another run'}, which was faster") from None
        self._require_conditions()

    def _require_conditions(self) -> None:
        """Raise InvalidInput where the object store writes over the lock although a condition does not hold."""
        content = json.dumps(self._me).encode()
        for condition in ("create", ANOTHER):
            try:
                self._put_if(condition, content)
            except _Refused:
                continue
            kept = "If-None-Match and If-Match"
            raise InvalidInput([f"{self.address}: this object store writes whatever {kept} say; no run is alone there"])

    def _keep(self) -> None:
        """Renew the lease until it is given back, or lost."""
        while not self._ending.wait(self.seconds / RENEWALS):
            try:
                self._put({"e_tag": self._tag})
                self._silent = False
            except StoreUnavailable:
                self._silent = True
            except _Refused:
                self._lost = True
                return

    def _still_held(self) -> None:
        if self._lost:
            raise StoreInUse(
                f"{self.address}: was taken over by {self._read() or 'another run'}, since this run was not heard of "
                f"for {self.seconds:g} s; what it had computed is kept"
            )
        if time.monotonic() - self._renewed > self.seconds:
            raise StoreUnavailable(
                errno.ETIMEDOUT, f"could not be told for {self.seconds:g} s that this run goes on", self.address
            )

    def _release(self) -> None:
        if self._lost or self._silent:
            # It is another run's, or ends by itself.
            return
        with suppress(StoreUnavailable, _Refused):
            self._me["released"] = datetime.now(UTC).isoformat(timespec="seconds")
            self._put({"e_tag": self._tag})

    def _put(self, condition: Any) -> None:
        """Write the lock on a condition; raise _Refused where it does not hold."""
        began, self._renewals = time.monotonic(), self._renewals + 1
        try:
            self._tag = self._put_if(condition, json.dumps({**self._me, "renewal": self._renewals}).encode())
        except _Refused:
            # It may have been written by this very run, and the answer lost on its way.
            found = self._read()
            if found is None or found.said.get("token") != self._me["token"]:
                raise
            self._tag = found.tag
        self._renewed = began

    def _put_if(self, condition: Any, content: bytes) -> str:
        with clear_words(self.address):
            try:
                return str(obstore.put(self.objects, LOCK, content, mode=condition)["e_tag"])
            except (AlreadyExistsError, PreconditionError, FileNotFoundError):
                raise _Refused from None

    def _read(self) -> _Lock | None:
        """Return the lock, None where there is none."""
        try:
            with clear_words(self.address):
                found = obstore.get(self.objects, LOCK)
                content, meta = bytes(found.bytes()), found.meta
        except FileNotFoundError:
            return None
        try:
            said = dict(parsed(content))
        except (ValueError, TypeError):
            said = {}
        return _Lock(said=said, tag=str(meta["e_tag"]), written=meta["last_modified"])

    def _age(self, found: _Lock) -> float:
        """Return how long ago a lock was written [s], by the clock of the object store: those of machines differ."""
        with clear_words(self.address):
            obstore.put(self.objects, CLOCK, b"")
            return float((obstore.head(self.objects, CLOCK)["last_modified"] - found.written).total_seconds())
