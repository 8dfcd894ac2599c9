"""The chunks of a store, by number: as many as there are, none is held in memory before it is asked for."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

#: Most cells and chunks of a piece that is read at once [cells, chunks].
PIECE_CELLS, PIECE_CHUNKS = 1_000_000, 1000

#: Chunks that a study has where their size allows: every core is busy to the end, and progress is smooth.
ENOUGH = 32


def usual_cells(total: int, least: int, most: int) -> int:
    """Return how many cells a chunk of a study has for which nothing is said: of so many, within bounds."""
    return min(max(total // ENOUGH, least), most)


@dataclass(frozen=True, kw_only=True, order=True)
class Chunk:
    """Place of a chunk: indices of the outer dimensions, and the range of entries along the one it is a block of."""

    outer: tuple[int, ...]
    first: int
    last: int

    @property
    def region(self) -> tuple[Any, ...]:
        """Index of the chunk in a variable; dimensions behind are taken whole."""
        return (*self.outer, slice(self.first, self.last))


@dataclass(frozen=True, kw_only=True)
class Chunks:
    """Every chunk of a store, in the order in which they are computed.

    outer: sizes of the dimensions before the one that chunks are blocks of; entries: how many there are along that one;
    each: cells of an entry; block: entries of a chunk.
    """

    outer: tuple[int, ...]
    entries: int
    each: int
    block: int

    @property
    def of_a_line(self) -> int:
        """Chunks of one place in the outer dimensions."""
        return -(-self.entries // self.block)

    @property
    def shape(self) -> tuple[int, ...]:
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
        return prod(self.outer) * self.entries * self.each

    def cells(self, chunk: Chunk) -> int:
        """Return how many cells a chunk has."""
        return (chunk.last - chunk.first) * self.each

    def pieces(self) -> Iterator[tuple[slice, Chunk]]:
        """Yield neighbouring chunks of a line, read at once as if they were one, with their numbers."""
        most = max(1, min(PIECE_CHUNKS, PIECE_CELLS // (self.block * self.each)))
        for line in range(prod(self.outer)):
            for first in range(0, self.of_a_line, most):
                last = min(first + most, self.of_a_line)
                begin = line * self.of_a_line
                yield slice(begin + first, begin + last), self._between(line, first, last)

    def _between(self, line: int, first: int, last: int) -> Chunk:
        """Return the chunks from one block of a line to before another, as one."""
        outer = tuple(int(index) for index in np.unravel_index(line, self.outer)) if self.outer else ()
        return Chunk(outer=outer, first=first * self.block, last=min(last * self.block, self.entries))
