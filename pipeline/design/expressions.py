"""Formulas of a design: arithmetic on the values of a description by their keys, and nothing else.

    0.85 * tool.diameter_mm
    spindle.sections[0].length_mm <= 6 * spindle.sections[0].outer_diameter_mm

Names lead into the description alone: no function but those listed here can be called, and no attribute of Python be
reached.
"""

import ast
import math
import sys
from collections.abc import Iterable
from functools import lru_cache
from typing import Any

import simpleeval

from chatter_core.reading import nearest

#: Functions that a formula may call.
FUNCTIONS = {"min": min, "max": max, "abs": abs, "sqrt": math.sqrt}
#: Numbers that have a name.
CONSTANTS = {"pi": math.pi}
#: The library's operators, each with its guard against numbers that take all memory, less those for text and bits.
OPERATORS = {
    kind: simpleeval.DEFAULT_OPERATORS[kind]
    for kind in (
        *(ast.Add, ast.Sub, ast.Mult, ast.Div, ast.USub, ast.UAdd, ast.Not),
        *(ast.Eq, ast.NotEq, ast.Lt, ast.LtE, ast.Gt, ast.GtE),
    )
} | {
    # Of floating-point numbers: a power of whole ones may have millions of digits, and take seconds.
    ast.Pow: math.pow
}
#: Characters of a formula.
LONGEST = 500


@lru_cache(maxsize=1000)
def formula(text: str) -> "Formula":
    """Return a formula, parsed once; raises ValueError, in one sentence, when it is none."""
    return Formula(text)


class Formula:
    """A formula, parsed once; ``text`` as it was written. Raises ValueError, in one sentence, when it is none."""

    def __init__(self, text: str) -> None:
        if len(text) > LONGEST:
            raise ValueError(f"found a formula of {len(text)} characters, allowed: at most {LONGEST}")
        self.text = text
        try:
            # A second statement would be left out, with a warning.
            self._parsed = ast.parse(text.strip(), mode="eval").body
        except Exception as error:
            raise ValueError(f"found {text!r}, which is no formula: {_first_line(error)}") from None

    def __call__(self, description: dict[str, Any]) -> Any:
        """Return its value for a description (keys of the border, nested); raises ValueError in one sentence."""
        evaluator = simpleeval.SimpleEval(
            names={**CONSTANTS, **description},
            functions=FUNCTIONS,
            operators=OPERATORS,
            allowed_attrs={dict: _keys(description)},
        )
        # Formatted text is written out, however long, before the library asks how long it is.
        del evaluator.nodes[ast.JoinedStr]
        try:
            return evaluator.eval(self.text, previously_parsed=self._parsed)
        except Exception as error:
            # Whatever it is (an unknown key, a division by zero, a word times a number): the formula is not right.
            told = _unknown_key(self.named(), description) or _first_line(error)
            raise ValueError(f"{self.text!r} has no value: {told}") from None

    def number(self, description: dict[str, Any]) -> float:
        """Return its value, a finite number; raises ValueError in one sentence."""
        found = self(description)
        if isinstance(found, bool) or not isinstance(found, int | float) or not abs(found) <= sys.float_info.max:
            raise ValueError(f"{self.text!r} is {found!r}, allowed: a finite number")
        return float(found)

    def holds(self, description: dict[str, Any]) -> bool:
        """Return whether it holds; raises ValueError, in one sentence, where it is neither true nor false."""
        found = self(description)
        if not isinstance(found, bool):
            raise ValueError(f"{self.text!r} is {found!r}, allowed: a comparison, such as a.b <= 2 * c.d")
        return found

    def named(self) -> list[tuple[str | int, ...]]:
        """Return the parts of every key that it names, as far as they are written out (``tool`` of ``tool[1 + 1]``)."""
        return _named(self._parsed)


def _unknown_key(named: Iterable[tuple[str | int, ...]], description: dict[str, Any]) -> str:
    """Return which of the keys that are named a description does not say, with the nearest; "" where it says all."""
    for first, *others in named:
        here: Any = description.get(str(first))
        for place, part in enumerate(others):
            if isinstance(here, dict) and part not in here:
                whole = "".join(f"[{one}]" if isinstance(one, int) else f".{one}" for one in others[: place + 1])
                return f"{first}{whole} is not said of this machine; {nearest(str(part), [*here])}"
            try:
                here = here[part]
            except (TypeError, LookupError):
                break
    return ""


def _named(node: ast.AST) -> list[tuple[str | int, ...]]:
    if path := _path(node):
        return [path]
    return [found for inner in ast.iter_child_nodes(node) for found in _named(inner)]


def _path(node: ast.AST) -> tuple[str | int, ...]:
    """Return the parts of a key that a node is as a whole, none where it is no key or leaves one to be computed."""
    match node:
        case ast.Name(id=name):
            return (name,)
        case ast.Attribute(value=before, attr=last):
            pass
        case ast.Subscript(value=before, slice=ast.Constant(value=str() | int() as last)):
            pass
        case _:
            return ()
    path = _path(before)
    return (*path, last) if path else ()


def _keys(part: Any) -> frozenset[str]:
    """Return the keys at every depth of a description: all that may stand behind a dot."""
    if isinstance(part, dict):
        return frozenset(part).union(*map(_keys, part.values()))
    return frozenset().union(*map(_keys, part)) if isinstance(part, list) else frozenset()


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]
