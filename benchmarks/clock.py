"""How time is taken: the median of some repeats, after one to warm up."""

import statistics
import time
from collections.abc import Callable

REPEATS = 5


def median_seconds(work: Callable[[], object]) -> float:
    """Return the median time of the repeats."""
    work()
    taken = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)
