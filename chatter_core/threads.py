"""Linear algebra on one thread, where numbers or speed hang on how many there are."""

from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

from threadpoolctl import threadpool_limits

#: Held by whoever computes on one thread: their number is one for the whole process, and of two at a time one would
#: set it back while the other still computes, and that one to what it was meanwhile.
_ONE_AT_A_TIME = Lock()


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep the linear algebra within to one thread; whoever else asks for that waits."""
    with _ONE_AT_A_TIME, threadpool_limits(1):
        yield
