"""What a column of a measured table is: key with its unit, bounds, meaning; declared once.

Reader, error texts, template and tests take it from here. Where a column is the same quantity as
a key of the machine, its bounds and words are those of the key.
"""

from dataclasses import dataclass
from typing import Any, Literal, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from chatter_core.units import SUFFIXES, split_key

#: What stands for a missing word (one of a column's choices).
NO_WORD = -1
#: Keyword of a bound in a description -> how messages say it.
BOUND_WORDS = {"gt": "more than", "ge": "at least", "lt": "less than", "le": "at most"}


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Range of a number in the unit of its key; None where it has no end."""

    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None

    def inside(self, values: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return which values lie inside; one that is no number does not."""
        inside = np.isfinite(values)
        for bound, compare in (
            (self.gt, np.greater),
            (self.ge, np.greater_equal),
            (self.lt, np.less),
            (self.le, np.less_equal),
        ):
            if bound is not None:
                inside &= compare(values, bound)
        return inside

    def __str__(self) -> str:
        ends = {words: getattr(self, key) for key, words in BOUND_WORDS.items()}
        return " and ".join(f"{words} {end:g}" for words, end in ends.items() if end is not None)


@dataclass(frozen=True, kw_only=True)
class Column:
    """One column. ``choices``: the words it takes, instead of numbers in ``bounds``.

    ``optional``: the column may be left away, and a cell of it empty.
    """

    key: str
    doc: str
    bounds: Bounds = Bounds()
    whole: bool = False
    choices: tuple[str, ...] = ()
    optional: bool = False

    @property
    def name(self) -> str:
        """Name of the quantity, without its unit."""
        return split_key(self.key)[0]

    @property
    def unit(self) -> str:
        """Unit as texts write it, "" for pure numbers and words."""
        suffix = split_key(self.key)[1]
        return SUFFIXES[suffix][1] if suffix else ""

    @property
    def allowed(self) -> str:
        """What a cell may hold, in words."""
        if self.choices:
            return f"one of {', '.join(self.choices)}"
        return " ".join(filter(None, ("a whole number" if self.whole else "a number", str(self.bounds), self.unit)))


@dataclass(frozen=True, kw_only=True)
class Table:
    """A file of measurements: ``identity`` names the columns that no two rows have in common."""

    file: str
    doc: str
    identity: tuple[str, ...]
    columns: tuple[Column, ...]


def bounds_of(field: FieldInfo) -> Bounds:
    """Return the bounds that a description's field declares."""
    found = {key: getattr(item, key) for item in field.metadata for key in BOUND_WORDS if hasattr(item, key)}
    return Bounds(**found)


def choices_of(field: FieldInfo) -> tuple[str, ...]:
    """Return the words that a description's field takes, none where it takes something else."""
    kind: Any = field.annotation
    return tuple(get_args(kind)) if get_origin(kind) is Literal else ()


def column_like(model: type[BaseModel], name: str, doc: str, *, optional: bool = False) -> Column:
    """Return the column of a quantity that a machine also has: key, bounds and words are its field's."""
    field = model.model_fields[name]
    return Column(
        key=field.alias or name,
        doc=doc,
        bounds=bounds_of(field),
        whole=field.annotation is int,
        choices=choices_of(field),
        optional=optional,
    )
