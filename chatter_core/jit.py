"""Compiled functions: how the program uses numba, in one place."""

import hashlib
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
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

    Numba looks at a function's own file alone, and what it calls is part of what is kept. Damaged files count as
    absent, and a full disk as a place that cannot be written.
    """

    def __init__(self, function: Callable[..., Any], sources: frozenset[str]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        own = self._impl.locator.get_source_stamp()
        self._cache_file = IndexDataCacheFile(  # type: ignore[no-untyped-call]
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=(own, *((source, _digest(source)) for source in sorted(sources))),
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
    # Neither the code's folder nor the user's cache folder may be there to write.
    with suppress(RuntimeError):
        dispatcher._cache = _ForgivingCache(function, dispatcher.sources)
    return dispatcher


@cache
def _digest(source: str) -> str:
    """Return what a file's content is known by, nothing where it cannot be read, as in a notebook."""
    try:
        return hashlib.sha256(Path(source).read_bytes()).hexdigest()
    except OSError:
        return ""


def _sources(function: Callable[..., Any]) -> frozenset[str]:
    """Return the files that a function may be compiled from: what its file had imported before, in its package.

    With those that compiled functions among them are compiled from. A number that was imported alone does not say where
    it is from.
    """
    values, package = list(function.__globals__.values()), _top(function.__module__)
    modules = [one for one in map(_module, values) if one is not None and _top(one.__name__) == package]
    within = [value for module in modules for value in vars(module).values()]
    behind = [one.sources for one in (*values, *within) if isinstance(one, Dispatcher) and hasattr(one, "sources")]
    files = (getattr(module, "__file__", None) for module in modules)
    return frozenset({function.__code__.co_filename, *filter(None, files)}).union(*behind)


def _module(value: Any) -> ModuleType | None:
    """Return a module, or the one that a function or class is from; None where nothing says so."""
    name = getattr(value, "__module__", None)
    return value if isinstance(value, ModuleType) else sys.modules.get(name) if isinstance(name, str) else None


def _top(name: str | None) -> str:
    return (name or "").partition(".")[0]


def scipy_routine(library: str, name: str, arguments: str) -> Any:
    """Return a routine of scipy's ``blas`` or ``lapack`` for compiled functions, which pass it pointers.

    arguments: a letter for what each pointer is to, c for characters, i for integers, d for reals.
    """
    binding.add_symbol(f"chatter_{name}", get_cython_function_address(f"scipy.linalg.cython_{library}", name))
    pointer: Any = types.CPointer
    kinds = {"c": types.uint8, "i": types.int32, "d": types.float64}
    return types.ExternalFunction(f"chatter_{name}", types.void(*(pointer(kinds[argument]) for argument in arguments)))
