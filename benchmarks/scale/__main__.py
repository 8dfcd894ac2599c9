"""Measure what many chunks cost: ``python -m benchmarks.scale [--chunks N ...] [--computed N] [--folder DIR]``.

Every phase of every size is measured in a process of its own and kept; interrupted and started again, it goes on.
"""

import argparse
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.scale import physics, table
from benchmarks.scale.phase import PHASES
from benchmarks.scale.study import folder_of


def main(words: list[str]) -> int:
    """Measure what is not measured yet, and write the tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scale", description=__doc__.splitlines()[0])
    parser.add_argument("--chunks", type=int, nargs="+", default=[2000, 20000, 200000], help="sizes of studies")
    parser.add_argument(
        "--computed", type=int, default=10000, help="chunks of each that tasks compute; copies the others"
    )
    parser.add_argument("--folder", type=Path, default=Path("results/scale"), help="where studies and numbers lie")
    asked = parser.parse_args(words)
    asked.folder.mkdir(parents=True, exist_ok=True)
    kept = asked.folder / "measured.json"
    found: dict[str, Any] = json.loads(kept.read_text()) if kept.exists() else {}
    for chunks in asked.chunks:
        for phase in PHASES:
            if phase not in found.setdefault(str(chunks), {}):
                found[str(chunks)][phase] = measured(phase, chunks, asked.computed, asked.folder)
                kept.write_text(json.dumps(found, indent=1))
        # A study of 200 thousand chunks has some millions of files.
        shutil.rmtree(folder_of(asked.folder, chunks), ignore_errors=True)
    if "physics" not in found:
        found["physics"] = physics.rows(asked.folder)
        kept.write_text(json.dumps(found, indent=1))
    told = "\n".join(table.lines(found)) + "\n"
    (asked.folder / "scale.md").write_text(told, encoding="utf-8")
    print(told)
    return 0


def measured(phase: str, chunks: int, computed: int, folder: Path) -> dict[str, Any]:
    """Return what a phase of a study costs, as its own process tells on its last line."""
    print(f"{chunks} chunks: {phase}", file=sys.stderr, flush=True)
    words = [phase, str(chunks), str(computed), str(folder_of(folder, chunks))]
    process = subprocess.run(
        [sys.executable, "-m", "benchmarks.scale.phase", *words], stdout=subprocess.PIPE, text=True, check=False
    )
    if process.returncode:
        raise SystemExit(f"{phase} of {chunks} chunks ended with exit code {process.returncode}")
    found: dict[str, Any] = json.loads(process.stdout.splitlines()[-1])
    return found


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
