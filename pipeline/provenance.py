"""Where results come from: code, versions, command, time."""

import platform
import subprocess
import sys
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any


def now() -> str:
    """Return the time, to the second, in UTC."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def provenance(argv: list[str]) -> dict[str, Any]:
    """Return where a store comes from: code, versions, command."""
    packages = ("milling-chatter", "numpy", "scipy", "dask", "zarr", "xarray")
    return {
        "created": now(),
        "command": argv,
        "versions": {"python": platform.python_version(), **{name: _version(name) for name in packages}},
        "platform": f"{sys.platform} {platform.machine()}",
        "code": code_version(),
    }


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def code_version() -> str:
    """Return the commit of the code, and whether it was changed since; "released" outside a checkout."""
    here = Path(__file__).resolve().parent

    def git(*words: str) -> str:
        return subprocess.run(
            ["git", "-C", str(here), *words], capture_output=True, text=True, check=True
        ).stdout.strip()

    try:
        if Path(git("rev-parse", "--show-toplevel")) != here.parent:
            return "released"
        return git("rev-parse", "HEAD") + (
            " with changes" if git("status", "--porcelain", "--untracked-files=no") else ""
        )
    except (OSError, subprocess.CalledProcessError):
        return "released"
