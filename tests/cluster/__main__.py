"""A study in a job of a SLURM on this machine, cancelled midway: ``python -m tests.cluster FOLDER``."""

import argparse
import sys
import time
from pathlib import Path

from tests.cluster.demonstration import CHUNKS, demonstrate
from tests.cluster.slurm import missing, one_node


def main() -> int:
    """Show it; return whether all of it held, as an exit code."""
    parser = argparse.ArgumentParser(prog="python -m tests.cluster", description=__doc__)
    parser.add_argument("folder", type=Path, help="a folder that is not there yet")
    folder = parser.parse_args().folder.resolve()
    lacking = missing()
    if lacking:
        print(f"no SLURM can be started here: {lacking}", file=sys.stderr)
        return 2
    folder.mkdir(parents=True)
    began = time.monotonic()

    def tell(what: str) -> None:
        print(f"{time.monotonic() - began:5.1f} s: {what}", flush=True)

    tell("a SLURM of one node is started")
    with one_node() as slurm:
        tell(f"it is up: {slurm.ask('sinfo', '--version')[0]}")
        shown = demonstrate(slurm, folder, tell)
    print(shown.told.strip(), file=sys.stderr)
    tell(f"the run ended with exit code {shown.code}, all {CHUNKS} chunks computed")
    tell(f"arrays that differ from the serial run's, bit for bit: {', '.join(shown.differing) or 'none'}")
    tell(f"jobs left in the queue: {', '.join(shown.left) or 'none'}")
    print(f"report: {folder / 'slurm' / 'report.html'}")
    return 0 if shown.held else 1


if __name__ == "__main__":
    sys.exit(main())
