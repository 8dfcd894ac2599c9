"""A limit on how long a worker may be at a chunk, kept even where compiled code never comes back."""

import faulthandler
import itertools
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

#: When what is limited must have ended, by its number [s of time.monotonic]; a process has one timer for all.
_ends: dict[int, float] = {}
_numbers, _changing = itertools.count(), threading.Lock()
_HOLE = os.open(os.devnull, os.O_WRONLY)


@contextmanager
def limited(seconds: float | None) -> Iterator[None]:
    """End this process, at once and with all that is in it, where the block takes longer than so many seconds.

    The timer is the interpreter's own for hung processes: no thread of Python has to run for it to go off.
    """
    if seconds is None:
        yield
        return
    number = next(_numbers)
    with _changing:
        _ends[number] = time.monotonic() + seconds
        _set_timer()
    try:
        yield
    finally:
        with _changing:
            del _ends[number]
            _set_timer()


def _set_timer() -> None:
    """Have the timer go off at the earliest end."""
    faulthandler.cancel_dump_traceback_later()
    if _ends:
        left = max(min(_ends.values()) - time.monotonic(), 1e-3)
        # Where it hung stays untold: what a worker says ends nowhere that anybody would look for it.
        faulthandler.dump_traceback_later(left, exit=True, file=_HOLE)
