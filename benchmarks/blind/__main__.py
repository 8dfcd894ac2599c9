"""Make campaigns, diagnose them blind, and judge: python -m benchmarks.blind SEEDS FOLDER.

SEEDS is calibration, test, second, third (the third to the fifth test's) or sixth (the sixth to the ninth test's).
FOLDER/campaigns/SEED is what a diagnosis sees, FOLDER/truth/SEED what it does not: the truth is opened when all
diagnoses are there. The same command continues what was interrupted.
"""

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

# Workers are processes; a second thread in each would only be in the way of the others.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks.blind import kept, own_model, report
from benchmarks.blind.ablations import ABLATIONS, WHOLE
from benchmarks.blind.kept import Task
from benchmarks.blind.opening import truth_folder
from benchmarks.blind.running import run_all
from pipeline.cluster import open_client
from pipeline.settings import Cluster
from tests.hidden_effect.blind import add_seeds, folders, make_all, seeds_of
from tests.hidden_effect.campaign import is_sealed

#: Campaigns of an ablation: so many of those that it concerns, evenly through the seeds.
ABLATED = 24
#: A diagnosis that takes longer has failed [s].
LIMIT_S = 1800.0
GENERATED, OWN = "campaigns", "own_campaigns"


@dataclass(frozen=True, kw_only=True)
class Work:
    """What is to be done: seeds whose campaigns are all there, and the tasks of each set and ablation."""

    root: Path
    seeds: Sequence[int]
    tasks: dict[tuple[str, str], list[Task]]


def spread_evenly(seeds: Sequence[int], count: int) -> list[int]:
    """Return so many of the seeds, evenly spread, or all of them.

    The composition repeats with the period of a block, so the step must not divide it: golden-ratio steps do not.
    """
    if len(seeds) <= count:
        return list(seeds)
    places = sorted(range(len(seeds)), key=lambda place: (place * 0.6180339887) % 1.0)
    return [seeds[place] for place in sorted(places[:count])]


def work_of(root: Path, seeds: Sequence[int], ablations: Sequence[str], *, own: bool) -> Work:
    """Return what is to be done."""
    tasks = {(GENERATED, WHOLE): [kept.task_of(root, GENERATED, seed, WHOLE) for seed in seeds]}
    for name in ablations:
        concerned = [seed for seed in seeds if ABLATIONS[name].concerns(root / GENERATED / str(seed))]
        tasks[GENERATED, name] = [
            kept.task_of(root, GENERATED, seed, name) for seed in spread_evenly(concerned, ABLATED)
        ]
    if own:
        drawn = [seed for seed in seeds if (root / OWN / str(seed)).is_dir()]
        tasks[OWN, WHOLE] = [kept.task_of(root, OWN, seed, WHOLE) for seed in drawn]
    return Work(root=root, seeds=seeds, tasks=tasks)


def diagnose_missing(work: Work, arguments: argparse.Namespace) -> None:
    """Diagnose what is not kept yet."""
    everything = [task for tasks in work.tasks.values() for task in tasks]
    wanted = [task for task in everything if not kept.holds(task, arguments.limit, any_program=arguments.any_program)]
    print(f"{len(everything) - len(wanted)} of {len(everything)} diagnoses are there", file=sys.stderr)
    if wanted:
        cluster = Cluster(kind="local", workers=arguments.workers)
        with TemporaryDirectory(prefix="blind-") as scratch, open_client(cluster) as client:
            assert client is not None
            run_all(client, wanted, arguments.limit, Path(scratch))


def command_line() -> argparse.Namespace:
    """Return what the command line says."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind", description=__doc__.splitlines()[0])
    add_seeds(parser)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="diagnoses at once")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="seconds after which a diagnosis has failed")
    parser.add_argument("--ablations", nargs="*", choices=[*list(ABLATIONS)[1:], "own_model"], default=None)
    parser.add_argument("--any-program", action="store_true", help="take answers of other versions of the program")
    arguments = parser.parse_args()
    if arguments.ablations is None:
        arguments.ablations = [*list(ABLATIONS)[1:], "own_model"]
    return arguments


def main() -> int:
    """Make, diagnose, judge; return 1 when a campaign could not be made."""
    arguments = command_line()
    root = arguments.folder
    # Ends in order what was started, as Ctrl-C does.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    every = seeds_of(arguments)
    try:
        failed = make_all(root, every, arguments.workers)
        seeds = [seed for seed in every if is_sealed(*folders(root, seed))]
        own = "own_model" in arguments.ablations
        if own:
            for seed in spread_evenly(seeds, ABLATED):
                own_model.draw(
                    root / GENERATED / str(seed), root / OWN / str(seed), truth_folder(root, OWN, seed), seed
                )
        ablations = [name for name in arguments.ablations if name in ABLATIONS]
        work = work_of(root, seeds, ablations, own=own)
        diagnose_missing(work, arguments)
    except KeyboardInterrupt:
        print("interrupted; the same command goes on", file=sys.stderr)
        return 130
    for path in report.write(work.root, work.tasks, arguments.workers):
        print(f"written: {path}")
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
