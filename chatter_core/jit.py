"""Compiled functions: how the program uses numba, in one place."""

import pickle
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
from llvmlite import binding
from numba import types
from numba.core.caching import FunctionCache
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
    """Numba's cache on disk, but damaged files count as absent, and a full disk as a place that cannot be written."""

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
    # Neither the code's folder nor the user's cache folder may be there to write.
    with suppress(RuntimeError):
        dispatcher._cache = _ForgivingCache(function)  # type: ignore[no-untyped-call]
    return dispatcher


def scipy_routine(library: str, name: str, arguments: str) -> Any:
    """Return a routine of scipy's ``blas`` or ``lapack`` for compiled functions, which pass it pointers.

    arguments: a letter for what each pointer is to, c for characters, i for integers, d for reals.
    """
    binding.add_symbol(f"chatter_{name}", get_cython_function_address(f"scipy.linalg.cython_{library}", name))
    pointer: Any = types.CPointer
    kinds = {"c": types.uint8, "i": types.int32, "d": types.float64}
    return types.ExternalFunction(f"chatter_{name}", types.void(*(pointer(kinds[argument]) for argument in arguments)))
