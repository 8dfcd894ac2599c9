"""Command line: ``python -m pipeline VERB key=value ...``."""

import signal
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from types import FrameType

from chatter_core.effects import effect_names
from chatter_core.errors import ChatterError, InvalidInput
from chatter_core.reading import nearest, printable
from pipeline.configuration import groups
from pipeline.errors import StoreInUse

#: Verb -> module with ``run(words) -> exit code``, and what it does.
VERBS = {
    "sweep": "compute a grid of operating points into a store, with lobes, tables, figures and report",
    "dataset": "machines and cuts of a design into a store: data sets to learn from, parameter studies, sensitivities",
    "point": "the whole chain at one operating point",
    "compare": "a model held against a campaign: how good it is, calibrated and not, and where it fails",
    "diagnose": "which physical effect is missing in a model, by a campaign",
    "improve": "diagnose, add what is missing, calibrate again, until nothing more is supported",
    "predict": "what a model says of cuts that are planned",
    "identify": "tip modes from measured receptances, as a machine file with uncertainties",
    "paper": "the paper's findings on the reference machine: figures P1 to P9 and a table of what holds",
    "template": "write an empty measurement campaign to fill in, every file, key and column explained",
    "report": "write tables, figures and report of a computed study again",
    "verify": "read every byte of a computed study back, name what is damaged, and make it anew with repair=true",
    "pack": "put a finished study's chunks into few files, each still with its own checksum",
    "journal": "what happened in the runs of a study, in sentences: begun, stopped, failed and why",
    "status": "how far a study is that is being computed, or was: done, failed, rate, time left",
}

#: Verb -> the options that it takes beside groups and values.
OPTIONS = {
    "sweep": "output=DIR, store=s3://BUCKET/PREFIX, lease_s=60, retry_failed=true, effects=[NAME,...], "
    "effects_path=DIR, base=full|static_bearing",
    "dataset": "design=FILE.yaml, vary.KEY=[VALUE, ...], budget_hours=1, retry_failed=true, output=DIR, "
    "store=s3://BUCKET/PREFIX, lease_s=60, effects=[NAME,...], effects_path=DIR",
    "point": "spindle_speed_rpm, axial_depth_mm, preload_n, modes, modal_parameters=dynamic|static, format=text|json, "
    "output=DIR, effects=[NAME,...], effects_path=DIR, base=full|static_bearing",
    "compare": "campaign=DIR, model=FILE.yaml, output=DIR, base=full|static_bearing, modes=N, effects=[NAME,...], "
    "effects_path=DIR",
    "diagnose": "as compare",
    "improve": "as compare",
    "predict": "campaign=DIR, model=FILE.yaml, trials=FILE.csv, predictions=FILE.csv, base=full|static_bearing, "
    "modes=N, effects=[NAME,...], effects_path=DIR",
    "identify": "frf=FILE.csv|FILE.uff or campaign=DIR, modes, lowest_frequency_hz, highest_frequency_hz, "
    "output=FILE.yaml",
    "paper": "output=DIR",
    "template": "output=DIR",
    "report": "output=DIR or store=s3://BUCKET/PREFIX",
    "journal": "output=DIR or store=s3://BUCKET/PREFIX",
    "status": "output=DIR or store=s3://BUCKET/PREFIX, format=text|json",
    "verify": "output=DIR or store=s3://BUCKET/PREFIX, repair=true, effects_path=DIR",
    "pack": "output=DIR",
}

#: Word that asks for an MPI run: all its processes read it, and before anything else is done each has its part.
MPI = "cluster=mpi"

HELP = """Milling chatter from a bearing's data sheet.

usage: python -m pipeline VERB [group=choice ...] [group.key=value ...] [option=value ...]

verbs
{verbs}

examples
  python -m pipeline sweep study=smoke
  python -m pipeline sweep study=reference spindle.preload_type=rigid cluster=threads
  python -m pipeline sweep machine=path/to/machine.yaml study=smoke output=my_results
  python -m pipeline sweep study=overnight cluster=slurm cluster.job.count=8 cluster.job.walltime_min=120
  python -m pipeline dataset study=dataset_small
  python -m pipeline dataset study=parameter_study 'vary.process.radial_immersion=[0.1, 0.2]' 'vary.tool.teeth=[2, 4]'
  python -m pipeline point spindle_speed_rpm=12000 axial_depth_mm=1
  python -m pipeline point machine=path/to/machine.yaml spindle_speed_rpm=12000 axial_depth_mm=1 format=json
  python -m pipeline point spindle_speed_rpm=3000 axial_depth_mm=2 'effects=[process_damping]'
  python -m pipeline identify frf=path/to/frf.csv machine=path/to/machine.yaml output=machine_tip.yaml
  python -m pipeline identify campaign=my_campaign output=machine_tip.yaml
  python -m pipeline template output=my_campaign
  python -m pipeline compare campaign=my_campaign
  python -m pipeline diagnose campaign=my_campaign
  python -m pipeline improve campaign=my_campaign output=results/improved
  python -m pipeline predict campaign=my_campaign model=model.yaml trials=plan.csv predictions=out.csv
  python -m pipeline sweep study=overnight store=s3://bucket/machines/first
  python -m pipeline report output=results/smoke-1234abcd
  python -m pipeline status output=results/smoke-1234abcd
  python -m pipeline verify output=results/smoke-1234abcd repair=true

groups and their choices
{groups}

effects, with the values of configs/effects; one is changed by effects.NAME.KEY=VALUE; your own by effects_path=DIR
{effects}

options of verbs
{options}

exit codes: 0 all well, 1 some points failed and are marked, or no worker is left, 2 bad input, 3 store in use
"""


def main(words: list[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    words = sys.argv[1:] if words is None else words
    if not words or words[0] == "help" or {"-h", "--help"} & set(words):
        print(_help())
        return 0 if words else 2
    if words[0] == "--version":
        print(_version())
        return 0
    try:
        with _role(words) as drives, _terminated_in_order():
            return _verb(words[0])(words[1:]) if drives else 0
    except InvalidInput as error:
        for problem in error.problems:
            print(f"error: {printable(problem)}", file=sys.stderr)
        return 2
    except StoreInUse as error:
        print(f"error: {error}", file=sys.stderr)
        return 3
    except ChatterError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("stopped at once; a store goes on where it was", file=sys.stderr)
        return 128 + signal.SIGINT
    except Terminated:
        print("terminated; a store goes on where it was", file=sys.stderr)
        return 128 + signal.SIGTERM
    except BrokenPipeError:
        # Whoever read our output has gone: nothing is left to tell.
        sys.stderr.close()
        return 1
    except OSError as error:
        # What a run had computed is told where it is written; this is a path that cannot be used.
        where = f"{str(error.filename)[:200]}: " if error.filename else ""
        print(f"error: {where}{error.strerror or error}", file=sys.stderr)
        return 2


class Terminated(BaseException):
    """SIGTERM came: as Ctrl-C does, it ends what was started and clears away what is half done."""


@contextmanager
def _terminated_in_order() -> Iterator[None]:
    """Turn SIGTERM into Terminated, for a verb that does not do better."""

    def handle(number: int, frame: FrameType | None) -> None:
        # What is cleared away must not be broken off by a second one.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _role(words: list[str]) -> AbstractContextManager[bool]:
    """Return whether this process is to do what the words say, and not another one of an MPI run; see pipeline.mpi."""
    joined: AbstractContextManager[bool] = import_module("pipeline.mpi").joined() if MPI in words else nullcontext(True)
    return joined


def _verb(name: str) -> Callable[[list[str]], int]:
    if name not in VERBS:
        raise InvalidInput([f"{name}: unknown verb; {nearest(name, list(VERBS))}"])
    run: Callable[[list[str]], int] = import_module(f"pipeline.{name}").run
    return run


def _version() -> str:
    try:
        return version("milling-chatter")
    except PackageNotFoundError:
        return "not installed, run from its source folder"


def _help() -> str:
    verbs = "\n".join(f"  {name:10}{doc}" for name, doc in VERBS.items())
    choices = "\n".join(f"  {name:8} {', '.join(found)}" for name, found in groups().items())
    effects = textwrap.fill(", ".join(effect_names()), 100, initial_indent="  ", subsequent_indent="  ")
    options = "\n".join(_option_lines(verb, said) for verb, said in OPTIONS.items())
    return HELP.format(verbs=verbs, groups=choices, effects=effects, options=options)


def _option_lines(verb: str, options: str) -> str:
    """Return the options of a verb beside its name, with lines of a terminal's width."""
    return textwrap.fill(options, 110, initial_indent=f"  {verb:10}", subsequent_indent=" " * 12)


if __name__ == "__main__":
    sys.exit(main())
