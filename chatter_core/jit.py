"""Compiled functions: how the program uses numba, in one place."""

import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
from llvmlite import binding
from numba import types
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.dispatcher import Dispatcher
from numba.extending import get_cython_function_address

#: Division by zero is infinite, as in numpy; the compiler's freedoms keep infinities and not-a-numbers
#: what they are.
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
}

#: What reading a damaged file of the cache may raise.
DAMAGED = (EOFError, pickle.UnpicklingError, OSError, ValueError, KeyError, IndexError, AttributeError, ImportError)


class _ForgivingCache(FunctionCache):
    """Numba's cache on disk, of a function that calls compiled ones of other files, too.

    Numba asks for the age of a function's own file alone, and what it calls is part of what is kept. Damaged files
    count as absent, and a full disk as a place that cannot be written.
    """

    def __init__(self, function: Callable[..., Any], sources: frozenset[str]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        states = [Path(source).stat() for source in sorted(sources)]
        self._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=tuple((state.st_mtime, state.st_size) for state in states),
        )

    def load_overload(self, signature: Any, target: Any) -> Any:
        """Return what was compiled for a signature, nothing where it cannot be read."""
        try:
            return super().load_overload(signature, target)  # type: ignore[no-untyped-call]
        except DAMAGED:
            return None

    def save_overload(self, signature: Any, data: Any) -> None:
        """Keep what was compiled; an index that cannot be read is begun anew."""
        for _ in range(2):
            try:
                super().save_overload(signature, data)  # type: ignore[no-untyped-call]
            except OSError:
                return
            except DAMAGED:
                self.flush()  # type: ignore[no-untyped-call]
            else:
                return


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, and keep the result on disk where there is a place for it."""
    dispatcher = numba.njit(**OPTIONS)(function)
    dispatcher.sources = _sources(function)
    # Neither the code's folder nor the user's cache folder may be there to write, nor the source to be asked.
    with suppress(RuntimeError, OSError):
        dispatcher._cache = _ForgivingCache(function, dispatcher.sources)
    return dispatcher


def _sources(function: Callable[..., Any]) -> frozenset[str]:
    """Return the files of a function and of what its file had imported before, in its package.

    Of a number that was imported alone nobody knows where it is from.
    """
    values, package = list(function.__globals__.values()), function.__module__.partition(".")[0]
    names = {value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", "") for value in values}
    own = [name for name in names if isinstance(name, str) and name.partition(".")[0] == package]
    files = [getattr(sys.modules.get(name), "__file__", None) for name in own]
    behind = [getattr(value, "sources", ()) for value in values if isinstance(value, Dispatcher)]
    return frozenset({function.__code__.co_filename, *filter(None, files)}).union(*behind)


def scipy_routine(library: str, name: str, arguments: str) -> Any:
    """Return a routine of scipy's ``blas`` or ``lapack`` for compiled functions, which pass it pointers.

    arguments: a letter for what each pointer is to, c for characters, i for integers, d for reals.
    """
    binding.add_symbol(f"chatter_{name}", get_cython_function_address(f"scipy.linalg.cython_{library}", name))
    pointer: Any = types.CPointer
    kinds = {"c": types.uint8, "i": types.int32, "d": types.float64}
    return types.ExternalFunction(f"chatter_{name}", types.void(*(pointer(kinds[argument]) for argument in arguments)))
