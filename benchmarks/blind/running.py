"""Diagnoses spread over a cluster: a campaign a task, a process a diagnosis, so that none can hold up the others."""

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from distributed import Client, as_completed

from benchmarks.blind import kept
from benchmarks.blind.ablations import ABLATIONS, prepare
from benchmarks.blind.kept import DONE, FAILED, ROOT, Task
from pipeline.cluster import open_client
from pipeline.settings import Cluster

#: Characters of an error text that are kept, its last ones.
KEPT_TEXT = 600


def run(task: Task, limit_s: float, program: str, scratch: Path) -> dict[str, Any]:
    """Diagnose a campaign within a time limit, keep the answer, and return it.

    program: its digest as work began; scratch: folder that whoever began it clears away.

    The diagnosis runs in a process of its own, which is ended when its time is over or when this one is gone.
    """
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory(dir=scratch) as own:
        folder = prepare(task.campaign, task.ablation, Path(own) / task.campaign.name)
        file, told = Path(own) / "answer.json", Path(own) / "told.txt"
        words = [sys.executable, "-m", "benchmarks.blind.program", str(folder.resolve()), str(file)]
        words += ["--frozen"] if ABLATIONS[task.ablation].frozen else []
        with told.open("wb") as errors:
            process = subprocess.Popen(
                words, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=errors
            )  # fmt: skip
            try:
                process.wait(limit_s)
                reason = _reason(process.returncode, told)
            except subprocess.TimeoutExpired:
                reason = f"not done after {limit_s:g} s"
            finally:
                process.kill()
                process.communicate()
        found = {"state": FAILED, "reason": reason} if reason else {"state": DONE, **kept.read(file)}
    content = {**_head(task, limit_s, program), "elapsed_s": time.perf_counter() - begun, **found}
    kept.write(task.path, content)
    return content


def _head(task: Task, limit_s: float, program: str) -> dict[str, Any]:
    """Return what every kept answer begins with."""
    return {
        "seed": int(task.campaign.name),
        "ablation": task.ablation,
        "program": program,
        "campaign": kept.folder_digest(task.campaign),
        "limit_s": limit_s,
    }


def run_all(client: Client, tasks: Sequence[Task], limit_s: float, scratch: Path) -> None:
    """Diagnose all; one that fails is told and kept as failed, and the others go on."""
    begun, program = time.monotonic(), kept.program_digest()
    futures = {client.submit(run, task, limit_s, program, scratch, pure=False): task for task in tasks}
    try:
        for done, future in enumerate(as_completed(futures), start=1):
            task = futures[future]
            error = future.exception()
            if error is not None:
                # Its worker died; what a diagnosis itself raises is kept already.
                lost = {"elapsed_s": 0.0, "state": FAILED, "reason": repr(error)}
                kept.write(task.path, {**_head(task, limit_s, program), **lost})
            tell(done, len(tasks), f"{task}: {_said(kept.read(task.path))}", begun)
            future.release()
    finally:
        client.cancel(list(futures))


def _reason(code: int, told: Path) -> str:
    """Return why a diagnosis failed, "" where it did not."""
    if code == 0:
        return ""
    return told.read_text(errors="replace").strip()[-KEPT_TEXT:] or f"ended with {code}"


def _said(found: dict[str, Any]) -> str:
    """Return an answer in a word or two."""
    if found["state"] == FAILED:
        return f"failed: {found['reason'].splitlines()[-1]}"
    document = found["document"]
    return f"{' '.join([document['verdict'], *document['missing']])} in {found['elapsed_s']:.0f} s"


def spread_calls(call: Callable[..., str], words: Sequence[tuple[Any, ...]], workers: int) -> None:
    """Make the same call of many arguments, spread over processes; what it returns is told."""
    begun = time.monotonic()
    with open_client(Cluster(kind="local", workers=workers)) as client:
        assert client is not None
        futures = {client.submit(call, *given, pure=False): given for given in words}
        for done, future in enumerate(as_completed(futures), start=1):
            tell(done, len(words), f"{futures[future][-1]}: {future.result()}", begun)


def tell(done: int, total: int, what: str, begun: float) -> None:
    """Tell how far the work is, and how long it will take (stderr)."""
    left = (time.monotonic() - begun) / done * (total - done)
    print(f"{done} of {total}, {left / 60.0:.0f} min left: {what}", file=sys.stderr, flush=True)
