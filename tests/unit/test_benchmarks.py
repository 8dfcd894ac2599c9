"""What ``make bench`` measures can be computed; how fast it is, no test says."""

import pytest

from benchmarks import tasks


def test_tasks_of_one_core_are_all_told(monkeypatch: pytest.MonkeyPatch) -> None:
    done = []

    def once(work):
        work()
        done.append(work)
        return 1.0

    monkeypatch.setattr(tasks, "median_seconds", once)
    told = tasks.single_lines()
    assert len(told) == len(done) > 0
    assert all(line.endswith(": 1000 ms.  ") for line in told)
