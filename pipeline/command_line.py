"""What the command line does with its words: it answers at once, or does what a verb does."""

import gc
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib import import_module
from types import FrameType

from chatter_core.errors import ChatterError, InvalidInput
from pipeline import completion, usage
from pipeline.errors import StoreInUse
from pipeline.stopping import heard, leave_terminal
from pipeline.telling import Telling, alone, complain, finish, leave_telling, note, say, told
from pipeline.verbs import VERBS

__all__ = ["VERBS", "main"]

#: A signal that was lost comes again after so long [s].
SOON = 0.1
#: Word that asks for an MPI run: all its processes read it, and before anything else is done each has its part.
MPI = "cluster=mpi"
#: Words that ask for help wherever they stand, and for the version.
HELP, VERSION = {"-h", "--help"}, ("-V", "--version", "version")
#: What is answered at once: the words after it -> text.
ANSWERED_BY: dict[str, Callable[[list[str]], str]] = {
    "help": usage.help_on,
    "completion": completion.answer,
    **dict.fromkeys(VERSION, usage.versions),
}


def main(words: list[str] | None = None) -> int:
    """Run the command line and return the exit code."""
    words = sys.argv[1:] if words is None else words
    if words[:1] == ["help"] or HELP & set(words):
        words = ["help", *(word for word in words if word not in {"help", *HELP, *VERSION})]
    verb, rest = (words[0], words[1:]) if words else ("", [])
    with told(rest if verb in VERBS else []) as telling:
        return _guarded(lambda: finish(telling, verb, _carry_out(telling, verb, rest)))


def _carry_out(telling: Telling, verb: str, rest: list[str]) -> int:
    """Answer at once, or do what a verb does; return the exit code."""
    if not verb or verb in ANSWERED_BY:
        say(ANSWERED_BY[verb or "help"](rest))
        return 0 if verb else 2
    if unreadable := [word for word in rest if word != word.encode(errors="replace").decode()]:
        # A page, a journal and a store could not repeat them.
        raise InvalidInput([f"{word}: holds bytes that are no UTF-8 text" for word in unreadable])
    with alone(telling), _role(rest) as drives, _terminated_in_order():
        if drives:
            return _run_of(verb)(rest)
    leave_telling()
    return 0


def _guarded(work: Callable[[], int]) -> int:
    """Do work and return its exit code; whatever goes wrong is told in sentences."""
    try:
        return work()
    except InvalidInput as error:
        for problem in error.problems:
            complain(problem)
        return 2
    except StoreInUse as error:
        complain(str(error))
        return 3
    except ChatterError as error:
        complain(str(error))
        return 1
    except KeyboardInterrupt as stop:
        note("stopped at once; a study goes on where it was, any other answer begins again")
        # What chunks are computed under says which signal it was; Python's own is of Ctrl-C.
        number: int = next(iter(stop.args), signal.SIGINT)
        return 128 + number
    except Terminated as end:
        note("terminated; a study goes on where it was, any other answer begins again")
        return 128 + end.number
    except BrokenPipeError:
        # Whoever read our output has gone: nothing is left to tell.
        if sys.stderr is not None:
            sys.stderr.close()
        return 1
    except OSError as error:
        # What a run had computed is told where it is written; this is a path that cannot be used.
        where = f"{str(error.filename)[:200]}: " if error.filename else ""
        complain(f"{where}{error.strerror or error}")
        return 2


class Terminated(BaseException):
    """SIGTERM came, or the terminal was closed: it ends what was started and clears away what is half done."""

    def __init__(self, number: int) -> None:
        self.number = number
        super().__init__(number)


@contextmanager
def _terminated_in_order() -> Iterator[None]:
    """Turn SIGTERM and SIGHUP into Terminated, for a verb that does not do better."""

    def handle(number: int, frame: FrameType | None) -> None:
        # What is cleared away must not be broken off by a second one.
        for one in before:
            signal.signal(one, signal.SIG_IGN)
        if number == signal.SIGHUP:
            leave_terminal()
        raise Terminated(number)

    def again(found: "sys.UnraisableHookArgs") -> None:
        """End what goes on because a library that was called back has lost the exception, as a compiler may."""
        if not isinstance(found.exc_value, Terminated):
            hook(found)
            return
        signal.signal(found.exc_value.number, handle)
        repeated = threading.Timer(SOON, signal.raise_signal, (found.exc_value.number,))
        repeated.daemon = True
        repeated.start()

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, handle) for number in heard(signal.SIGTERM, signal.SIGHUP)}
    hook, sys.unraisablehook = sys.unraisablehook, again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        for number, handler in before.items():
            signal.signal(number, handler)


def _role(words: list[str]) -> AbstractContextManager[bool]:
    """Return whether this process is to do what the words say, and not another one of an MPI run; see pipeline.mpi."""
    joined: AbstractContextManager[bool] = import_module("pipeline.mpi").joined() if MPI in words else nullcontext(True)
    return joined


def _run_of(verb: str) -> Callable[[list[str]], int]:
    if verb not in VERBS:
        raise InvalidInput([f"{verb}: {usage.no_verb(verb, [*VERBS, *ANSWERED_BY])}"])
    loaded = f"pipeline.{verb}"
    with nullcontext() if loaded in sys.modules else _not_looked_through():
        run: Callable[[list[str]], int] = import_module(loaded).run
    return run


@contextmanager
def _not_looked_through() -> Iterator[None]:
    """Have what is loaded not looked through for garbage: it stays, and that takes a sixth of the time of loading."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()
