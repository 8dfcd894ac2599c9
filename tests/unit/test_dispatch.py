"""Chunks are handed out to as many workers as there are at the time."""

from itertools import count
from unittest.mock import Mock

import pytest

from pipeline import cluster, dispatch
from pipeline.stopping import Stopping


class Enough(Exception):
    """What is to be seen has been seen."""


class NothingEnds:
    """Stands in for the tasks that are being computed; none ends, and two looks at them are enough."""

    def __init__(self) -> None:
        self.looks = 0

    def add(self, future: Mock) -> None:
        """Take a task."""

    def has_ready(self) -> bool:
        self.looks += 1
        if self.looks > 2:
            raise Enough
        return False


def test_workers_that_come_later_are_given_chunks_before_any_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    client, keys = Mock(), count()
    client.submit.side_effect = lambda *_, **__: Mock(key=f"chunk-{next(keys)}")
    # One worker as the work begins, and then fifty.
    client.nthreads.side_effect = [{"first": 1}, *[{f"worker {i}": 1 for i in range(50)}] * 3]
    monkeypatch.setattr(cluster, "LOOK", 0.0)
    monkeypatch.setattr(dispatch, "as_completed", NothingEnds)
    with pytest.raises(Enough):
        next(dispatch.dispatched([Mock()] * 1000, client, Stopping(), patience=60.0))
    assert client.submit.call_count == 50 * (1 + dispatch.WINDOW)
