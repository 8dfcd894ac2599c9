"""The long soak: python -m tests.soak FOLDER [--speeds 1000] [--kills 20] [--seed 1]."""

import argparse
import sys
import time
from collections import Counter
from pathlib import Path

from tests.soak.harness import soak


def main() -> int:
    """Run the soak, write its report, and return 0 where it has passed."""
    parser = argparse.ArgumentParser(prog="python -m tests.soak", description=__doc__)
    parser.add_argument("folder", type=Path, help="an empty folder")
    parser.add_argument("--speeds", type=int, default=1000, help="speeds of the study: two chunks each")
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    said = parser.parse_args()
    began = time.monotonic()
    found = soak(said.folder, said.speeds, said.kills, said.seed, said.workers)
    kinds = ", ".join(f"{count} x {name}" for name, count in sorted(Counter(found.kills).items()))
    lines = [
        "# Soak",
        "",
        f"`python -m tests.soak {said.folder} --speeds {said.speeds} --kills {said.kills} --seed {said.seed} "
        f"--workers {said.workers}`, {time.monotonic() - began:.0f} s",
        "",
        "| | |",
        "|---|---|",
        f"| chunks | {found.chunks} |",
        f"| kills (SIGKILL) | {len(found.kills)}: {kinds} |",
        f"| chunks computed again | {found.computed - found.chunks}, allowed {found.allowed}: one a worker and kill |",
        f"| most often computed | {found.most_again} times |",
        f"| files that differ from the undisturbed store | {len(found.differing)} |",
        f"| verdict | {'passed' if found.passed else 'FAILED'} |",
    ]
    (said.folder / "soak.md").write_text("\n".join(lines) + "\n")
    print("\n".join(lines))
    return 0 if found.passed and len(found.kills) == said.kills else 1


if __name__ == "__main__":
    sys.exit(main())
