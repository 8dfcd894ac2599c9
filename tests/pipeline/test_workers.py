"""What a worker may take of its machine: one thread of linear algebra, and its share of the memory."""

from pathlib import Path

import psutil
import pytest
from threadpoolctl import threadpool_limits

from pipeline import report
from pipeline.cluster import open_client
from pipeline.settings import Cluster
from tests.pipeline.studies import sweep

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@pytest.mark.parametrize("kind", ["serial", "threads", "local"])
def test_linear_algebra_takes_one_thread_wherever_a_chunk_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    monkeypatch.setattr(report, "write", lambda output: [])
    # What the environment of the command says is no matter.
    for name in THREADS:
        monkeypatch.setenv(name, "2")
    with threadpool_limits(2):
        assert sweep(tmp_path, f"cluster={kind}", kernel="one_threaded") == 0


def test_local_workers_share_the_memory_of_the_machine() -> None:
    with open_client(Cluster(kind="local", workers=2)) as client:
        assert client is not None
        limits = [worker["memory_limit"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
    assert len(limits) == 2
    assert 0 < sum(limits) <= psutil.virtual_memory().total
