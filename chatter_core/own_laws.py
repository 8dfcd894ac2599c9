"""Laws of users' own: whatever goes wrong because of one is told with its file, and where it can be with the line."""

import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from chatter_core.errors import ChatterError, InvalidInput, OwnLawFails

#: How the chain's own words on how many modes are asked for begin: no law has a part in that.
ASKED_FOR = "mode_count:"


def told(file: Path, call: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function of a user's file returns.

    Raises OwnLawFails with file and line where it raises anything.

    See docs/physics.md#effects.
    """
    try:
        return call(*arguments)
    except ChatterError:
        raise
    except (Exception, SystemExit) as error:
        raise OwnLawFails(
            [f"effects_path: {file}{_line(error, file)}: {in_words(error)}"],
            hangs_on_values=isinstance(error, ArithmeticError | ValueError),
        ) from error


@contextmanager
def blaming(files: tuple[Path, ...]) -> Iterator[None]:
    """Tell what goes wrong in a chain that holds laws of these files as theirs; without any it is left as it is.

    See docs/physics.md#effects.
    """
    try:
        yield
    except OwnLawFails:
        raise
    except Exception as error:
        asked = isinstance(error, InvalidInput) and all(one.startswith(ASKED_FOR) for one in error.problems)
        if not files or asked:
            raise
        named = " or ".join(f"{file}{_line(error, file)}" for file in files)
        what = str(error) if isinstance(error, ChatterError) else in_words(error)
        raise OwnLawFails([f"effects_path: {named}: the chain cannot use what it returns: {what}"]) from error


def in_words(error: BaseException) -> str:
    """Return the kind of an error that a user's own code has raised, and what it says, if it can be said.

    See docs/physics.md#effects.
    """
    try:
        said = str(error)
    except (Exception, SystemExit) as failure:
        said = f"what it says cannot be told, {type(failure).__name__}"
    return f"{type(error).__name__}: {said}"


def _line(error: BaseException, file: Path) -> str:
    """Return the line of a file in which an error arose, nothing where that was in none of its own."""
    lines = [one.lineno for one in traceback.extract_tb(error.__traceback__) if Path(one.filename) == file]
    return f", line {lines[-1]}" if lines else ""
