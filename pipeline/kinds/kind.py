"""What a kind of study is: what its store holds, how a chunk of it is computed, what people read of it."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chatter_core.errors import InvalidInput, NoEquilibrium, OwnLawFails
from chatter_core.variables import STATUS, Variable
from pipeline.chunks import Chunk
from pipeline.places import Place
from pipeline.settings import Study

#: Arrays by the names of variables, in SI.
Arrays = Mapping[str, np.ndarray]


@dataclass(frozen=True, kw_only=True)
class Computed:
    """What a chunk came to: arrays (entry, ...) and status (entry, ...), and the errors that were caught."""

    arrays: Arrays
    status: np.ndarray
    errors: tuple[str, ...] = ()


def joined(parts: Sequence[Computed]) -> Computed:
    """Return parts of a chunk, in their order, as one."""
    return Computed(
        arrays={name: np.concatenate([part.arrays[name] for part in parts]) for name in parts[0].arrays},
        status=np.concatenate([part.status for part in parts]),
        errors=tuple(error for part in parts for error in part.errors),
    )


def status_of(error: Exception) -> int:
    """Return the status of what raised: outside what the model holds for, or not computed."""
    return STATUS["outside_validity" if isinstance(error, NoEquilibrium | InvalidInput) else "not_converged"]


def raise_slip(error: Exception) -> None:
    """Raise an error again that is a slip in a user's own file: it is to be mended, and no cell marked for it."""
    if isinstance(error, OwnLawFails) and not error.hangs_on_values:
        raise error


class Kind(ABC):
    """A kind of study. One task owns one chunk of every chunked variable: a block of entries along ``along``.

    name: of the store in its place; verb: that computes it; settings: class of its settings; coordinates: dimension ->
    unit suffix and meaning; wholes: variables that are written once, before the chunks; chunked: those that are
    written chunk by chunk; status: completion and outcome; along: dimension that chunks are blocks of; entry: what one
    along it is called; kernel: physics that a chunk is computed by, ``MODULE:FUNCTION``;
    told_by: coordinates that say to people which chunk one is; cells_of_task: least and most cells of a chunk, where
    nothing is said.
    """

    name: str
    verb: str
    settings: type[Study]
    coordinates: Mapping[str, tuple[str, str]]
    wholes: Mapping[str, Variable]
    chunked: Mapping[str, Variable]
    status: Variable
    along: str
    entry: str
    kernel: str
    told_by: tuple[str, ...]
    cells_of_task: tuple[int, int]

    @property
    def outer(self) -> int:
        """Number of dimensions before the one that chunks are blocks of."""
        return self.status.dims.index(self.along)

    def dimensions(self, name: str) -> tuple[str, ...]:
        """Return the dimensions of a variable that is written chunk by chunk."""
        return {**self.chunked, "status": self.status}[name].dims

    @abstractmethod
    def title(self, settings: Any) -> str:
        """Return the title of a store."""

    @abstractmethod
    def written_whole(self, settings: Any) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, Any]]:
        """Return coordinates, variables that are written once, in the units of the border, and further attributes.

        Raises InvalidInput when the machine cannot give what is asked for.
        """

    @abstractmethod
    def described(self, attributes: Mapping[str, Any], read: Callable[[str], np.ndarray]) -> Any:
        """Return what all chunks of a store share, by its attributes and arrays; kept as long as the process lives."""

    @abstractmethod
    def compute(self, described: Any, chunk: Chunk, kernel: str, effects_path: Path | None) -> Computed:
        """Compute a chunk; what raises is narrowed down to its entries, and those are marked.

        Raises OwnLawFails for a slip in a user's own file.
        """

    @abstractmethod
    def compute_first(self, described: Any, effects_path: Path | None) -> None:
        """Compute as little as has everything compiled that is compiled when first used."""

    @abstractmethod
    def told(
        self, said: Mapping[str, Any], values: Mapping[str, list[Any]], outer: tuple[int, ...], first: int, last: int
    ) -> str:
        """Return in words which chunk one is; said: settings of the store; values: of coordinates in ``told_by``."""

    @abstractmethod
    def report(self, place: Place, **margins: float) -> list[Path]:
        """Write what people read of a store; return the paths. Raises InvalidInput where it cannot be read.

        margins: of recommended cuts by their keys, in the place of those that its last run named.
        """
