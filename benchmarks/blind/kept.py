"""Answers that are kept: one file for each campaign and ablation, and whether it still holds.

An answer holds for the program and the campaign that it was computed with: their digests stand in it. The program's
is that of every file that can change a number of a diagnosis (``SOURCES``) and of the versions of numpy, scipy and
numba; a comment counts too, so ``any_program`` also takes answers of other versions, and the report then says so.
"""

import hashlib
import importlib.metadata
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
SOURCES = (
    "chatter_core/**/*.py",
    "configs/effects/*.yaml",
    "pipeline/diagnosis.py",
    "pipeline/search.py",
    "pipeline/after_verdict.py",
    "pipeline/pieces.py",
    "pipeline/diagnosis_document.py",
    "pipeline/model_file.py",
    "pipeline/predict.py",
    "pipeline/campaigns.py",
    "benchmarks/blind/program.py",
    "benchmarks/blind/ablations.py",
    "benchmarks/blind/tables.py",
)
LIBRARIES = ("numpy", "scipy", "numba")
DONE, FAILED = "done", "failed"


@cache
def program_digest() -> str:
    """Return the digest of everything that a number of a diagnosis depends on, but for the campaign."""
    found = hashlib.sha256()
    for pattern in SOURCES:
        for file in sorted(ROOT.glob(pattern)):
            found.update(f"{file.relative_to(ROOT)}\n".encode() + file.read_bytes())
    found.update(" ".join(f"{name} {importlib.metadata.version(name)}" for name in LIBRARIES).encode())
    return found.hexdigest()[:16]


def folder_digest(folder: Path) -> str:
    """Return the digest of a folder's files."""
    found = hashlib.sha256()
    for file in sorted(folder.iterdir()):
        found.update(f"{file.name}\n".encode() + file.read_bytes())
    return found.hexdigest()[:16]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A campaign to diagnose, under an ablation; path: where the answer is kept."""

    campaign: Path
    ablation: str
    path: Path

    def __str__(self) -> str:
        return f"{self.campaign.name} {self.ablation}"


def task_of(root: Path, campaigns: str, seed: int, ablation: str) -> Task:
    """Return the task of a seed; ``campaigns``: folder of ``root`` that holds the campaigns."""
    return Task(
        campaign=root / campaigns / str(seed),
        ablation=ablation,
        path=root / "diagnoses" / campaigns / ablation / f"{seed}.json",
    )


def write(path: Path, content: dict[str, Any]) -> None:
    """Write as ``write_bytes`` does."""
    write_bytes(path, (json.dumps(content, allow_nan=False) + "\n").encode())


def write_bytes(path: Path, content: bytes) -> None:
    """Write beside the place and move: what is there is whole."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(".draft")
    beside.write_bytes(content)
    beside.replace(path)


def read(path: Path) -> dict[str, Any]:
    """Return what is kept."""
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found


def holds(task: Task, limit_s: float, *, any_program: bool = False) -> bool:
    """Return whether a kept answer needs not be computed again; one that failed does where it now has more time."""
    if not task.path.exists():
        return False
    found = read(task.path)
    if found["campaign"] != folder_digest(task.campaign):
        return False
    if found["state"] == FAILED and found["limit_s"] < limit_s:
        return False
    return any_program or found["program"] == program_digest()
