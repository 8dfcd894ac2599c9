"""The chunks of a store, by number: as many as there are, none is held in memory before it is asked for."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

#: Most cells and chunks of a piece that is read at once [cells, chunks].
PIECE_CELLS, PIECE_CHUNKS = 1_000_000, 1000


@dataclass(frozen=True, kw_only=True, order=True)
class Chunk:
    """Place of a chunk: indices of the outer dimensions and the range of speeds."""

    outer: tuple[int, int, int]
    first: int
    last: int

    @property
    def region(self) -> tuple[Any, ...]:
        """Index of the chunk in a variable; dimensions behind the speed are taken whole."""
        return (*self.outer, slice(self.first, self.last))


@dataclass(frozen=True, kw_only=True)
class Chunks:
    """Every chunk of a store, in the order in which they are computed.

    outer: sizes of the dimensions before the speed; speeds and depths: how many there are; block: speeds of a chunk.
    """

    outer: tuple[int, int, int]
    speeds: int
    depths: int
    block: int

    @property
    def of_a_line(self) -> int:
        """Chunks of one place in the outer dimensions."""
        return -(-self.speeds // self.block)

    @property
    def shape(self) -> tuple[int, int, int, int]:
        """Number of chunks along each dimension."""
        return (*self.outer, self.of_a_line)

    def __len__(self) -> int:
        return prod(self.shape)

    def __getitem__(self, number: int) -> Chunk:
        line, block = divmod(number, self.of_a_line)
        return self._between(line, block, block + 1)

    def __iter__(self) -> Iterator[Chunk]:
        return (self[number] for number in range(len(self)))

    @property
    def all_cells(self) -> int:
        """Cells of all chunks together."""
        return prod(self.outer) * self.speeds * self.depths

    def cells(self, chunk: Chunk) -> int:
        """Return how many cells a chunk has."""
        return (chunk.last - chunk.first) * self.depths

    def pieces(self) -> Iterator[tuple[slice, Chunk]]:
        """Yield neighbouring chunks of a line, read at once as if they were one, with their numbers."""
        most = max(1, min(PIECE_CHUNKS, PIECE_CELLS // (self.block * self.depths)))
        for line in range(prod(self.outer)):
            for first in range(0, self.of_a_line, most):
                last = min(first + most, self.of_a_line)
                begin = line * self.of_a_line
                yield slice(begin + first, begin + last), self._between(line, first, last)

    def _between(self, line: int, first: int, last: int) -> Chunk:
        """Return the chunks from one block of a line to before another, as one."""
        i, j, k = (int(index) for index in np.unravel_index(line, self.outer))
        return Chunk(outer=(i, j, k), first=first * self.block, last=min(last * self.block, self.speeds))
