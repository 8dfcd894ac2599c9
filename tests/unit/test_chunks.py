"""How large chunks are for which nothing is said."""

import math

import pytest

from pipeline.chunks import Chunks
from pipeline.configuration import compose_settings, sort_words
from pipeline.kinds import Lobes
from pipeline.kinds.lobes import coordinate_values
from pipeline.store import block_of


def chunks_of(*words: str) -> Chunks:
    settings = compose_settings(sort_words(list(words), ()))
    values = coordinate_values(settings)
    shape = tuple(len(values[dim]) for dim in Lobes.status.dims)
    return Chunks(
        outer=shape[: Lobes().outer],
        entries=shape[Lobes().outer],
        each=math.prod(shape[Lobes().outer + 1 :]),
        block=block_of(Lobes(), settings, values),
    )


@pytest.mark.parametrize(
    ("words", "block", "number"),
    [
        # 24 lines of 221 speeds and 60 depths: a second or so each, for as many workers as one machine has.
        (["study=reference"], 133, 48),
        # 40 lines of 400 speeds and 100 depths.
        (["study=overnight"], 80, 200),
        # 4 lines of 13 speeds and 12 depths: a line is less than a quarter of a second.
        (["study=smoke"], 13, 4),
        # 8 lines of 221 speeds and 45 depths: smaller, so that there are enough.
        (["study=reference", "grid=paper_alone"], 55, 40),
        (["study=reference", "cluster.cells_per_task=1500"], 25, 216),
    ],
)
def test_studies_are_cut_into_chunks_of_a_second_and_small_ones_into_enough(
    words: list[str], block: int, number: int
) -> None:
    found = chunks_of(*words)
    assert (found.block, len(found)) == (block, number)
