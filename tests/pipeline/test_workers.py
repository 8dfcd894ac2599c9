"""What a worker may take of its machine: one thread of linear algebra, its share of the memory, no port to others."""

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
        workers = [] if kind == "serial" else ["cluster.workers=1"]
        assert sweep(tmp_path, f"cluster={kind}", *workers, kernel="one_threaded") == 0


@pytest.mark.parametrize("kind", ["local", "threads"])
def test_workers_share_the_memory_of_the_machine_and_open_no_port_beyond_it(kind: str) -> None:
    before = listening()
    with open_client(Cluster(kind=kind, workers=2)) as client:
        assert client is not None
        opened = listening() - before
        limits = [worker["memory_limit"] for worker in client.scheduler_info(n_workers=-1)["workers"].values()]
    assert {address for address, _ in opened} == {"127.0.0.1"}
    assert len(limits) == (2 if kind == "local" else 1)
    assert 0 < sum(limits) <= psutil.virtual_memory().total


def listening() -> set[tuple[str, int]]:
    me = psutil.Process()
    family = [me, *me.children(recursive=True)]
    return {c.laddr for p in family for c in p.net_connections() if c.status == psutil.CONN_LISTEN}
