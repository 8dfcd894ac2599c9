"""Signals that ask a run to stop, while chunks are computed."""

import os
import signal
import stat
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from pipeline.telling import note

#: Ctrl-C, whoever ends processes in good order, and a terminal that is closed.
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class Stopping:
    """Remembers that a signal asked for the end; a second one ends at once. So does time that was given, when it is up.

    A second one raises KeyboardInterrupt with its number. A terminal that is closed is told of twice, by its shell and
    by the kernel when that has gone: nobody asks again.

    number: of the signal, 0 without one; deadline: on the monotonic clock [s], none without one.
    """

    number: int = 0
    deadline: float | None = None

    @property
    def asked(self) -> bool:
        """Whether nothing more is to be begun."""
        return bool(self.number) or (self.deadline is not None and time.monotonic() > self.deadline)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal."""
        if number == signal.SIGHUP:
            leave_terminal()
            if self.number:
                return
        if self.number:
            raise KeyboardInterrupt(number)
        self.number = number
        note("\nstopping: waiting for the chunks in progress (once more to stop at once)")


def leave_terminal() -> None:
    """Have nothing more said to a terminal: one that is closed answers with an error."""
    silence = os.open(os.devnull, os.O_RDWR)
    for descriptor in (1, 2):
        # Where it is a file or a pipe, somebody may still read it.
        if stat.S_ISCHR(os.fstat(descriptor).st_mode):
            os.dup2(silence, descriptor)
    os.close(silence)


def heard(*numbers: signal.Signals) -> list[signal.Signals]:
    """Return which of some signals are not to be ignored: ``nohup`` has one be."""
    return [number for number in numbers if signal.getsignal(number) != signal.SIG_IGN]


@contextmanager
def held_back() -> Iterator[None]:
    """Let signals that ask for the end wait until what must not be broken off is done; it is short.

    The run then ends as one that was stopped, although that is done.
    """
    if threading.current_thread() is not threading.main_thread():
        # Handlers run in the main thread, and disturb no other.
        yield
        return
    came, before = list[int](), dict[int, Any]()
    try:
        for one in heard(*SIGNALS):
            before[one] = signal.signal(one, lambda number, frame: came.append(number))
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


@contextmanager
def signals() -> Iterator[Stopping]:
    """Turn signals into a wish to stop, for as long as chunks are computed."""
    stopping = Stopping()
    before = {number: signal.signal(number, stopping) for number in heard(*SIGNALS)}
    try:
        yield stopping
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
