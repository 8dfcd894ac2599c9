"""Compiled functions: how the program uses numba, in one place."""

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import binding
from numba import types
from numba.extending import get_cython_function_address

#: Division by zero is infinite, as in numpy; the compiler's freedoms keep infinities and not-a-numbers
#: what they are.
OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"contract", "reassoc", "nsz", "arcp"},
}


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called, and keep the result on disk where there is a place for it."""
    try:
        return numba.njit(cache=True, **OPTIONS)(function)
    except RuntimeError:  # neither the code's folder nor the user's cache folder can be written
        return numba.njit(**OPTIONS)(function)


def scipy_routine(library: str, name: str, arguments: str) -> Any:
    """Return a routine of scipy's ``blas`` or ``lapack`` for compiled functions, which pass it pointers.

    arguments: a letter for what each pointer is to, c for characters, i for integers, d for reals.
    """
    binding.add_symbol(f"chatter_{name}", get_cython_function_address(f"scipy.linalg.cython_{library}", name))
    pointer: Any = types.CPointer
    kinds = {"c": types.uint8, "i": types.int32, "d": types.float64}
    return types.ExternalFunction(f"chatter_{name}", types.void(*(pointer(kinds[argument]) for argument in arguments)))
