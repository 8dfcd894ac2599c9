"""Make many campaigns: python -m tests.hidden_effect.blind SEEDS FOLDER [--count N] [..], seeds as ``design`` has them.

FOLDER/campaigns/SEED is what a diagnosis may see, FOLDER/truth/SEED what it may not. A campaign whose seal holds is
not made again, so an interrupted run is continued by the same command.
"""

import argparse
import os
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

# Workers are processes; a second thread in each would only be in the way of the others.
os.environ.setdefault("OMP_NUM_THREADS", "1")


def folders(root: Path, seed: int) -> tuple[Path, Path]:
    """Return the folders of a seed: the campaign and its truth."""
    return root / "campaigns" / str(seed), root / "truth" / str(seed)


def make(root: Path, seed: int) -> float:
    """Make the campaign of a seed; return the time that it took [s]."""
    from tests.hidden_effect.campaign import make_campaign

    begun = time.perf_counter()
    make_campaign(seed, *folders(root, seed))
    return time.perf_counter() - begun


def make_all(root: Path, seeds: range, workers: int) -> list[int]:
    """Make what is missing; return the seeds that failed, with their reasons printed."""
    from tests.hidden_effect.campaign import is_sealed

    wanted = [seed for seed in seeds if not is_sealed(*folders(root, seed))]
    print(f"{len(seeds) - len(wanted)} of {len(seeds)} campaigns are there")
    failed = []
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running = {pool.submit(make, root, seed): seed for seed in wanted}
        for done, future in enumerate(as_completed(running), start=1):
            seed = running[future]
            if error := future.exception():
                failed.append(seed)
                print(f"{done}/{len(wanted)}  seed {seed}: {error}", flush=True)
            else:
                print(f"{done}/{len(wanted)}  seed {seed}: {future.result():.1f} s", flush=True)
    return sorted(failed)


def add_seeds(parser: argparse.ArgumentParser) -> None:
    """Let a command line say which seeds, as ``seeds_of`` reads it."""
    from tests.hidden_effect.design import SEEDS, TEST_SEEDS

    parser.add_argument("seeds", choices=tuple(SEEDS))
    parser.add_argument("--skip", type=int, default=0, help="how many of the first seeds are left out")
    parser.add_argument("--count", type=int, default=len(TEST_SEEDS), help="how many seeds are taken after those")


def seeds_of(arguments: argparse.Namespace) -> range:
    """Return the seeds that a command line has said."""
    from tests.hidden_effect.design import SEEDS

    return SEEDS[arguments.seeds][arguments.skip :][: arguments.count]


def main() -> int:
    """Read the command line and make the campaigns; return 1 when some failed."""
    parser = argparse.ArgumentParser(prog="python -m tests.hidden_effect.blind", description=__doc__.splitlines()[0])
    add_seeds(parser)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes at once")
    arguments = parser.parse_args()
    failed = make_all(arguments.folder, seeds_of(arguments), arguments.workers)
    if failed:
        print(f"failed: {', '.join(map(str, failed))}")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
