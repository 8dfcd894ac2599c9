"""The numbers of a design: drawn, laid out on a grid, or as an analysis of sensitivities needs them.

Everything that is drawn follows from the seed, and of a Sobol sequence or plain random numbers fewer machines are the
first of more, so that a data set may be cut short and stays as evenly spread.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy
from numpy.typing import NDArray

from chatter_core.errors import InvalidInput
from chatter_core.reading import shown
from pipeline.design.described import Description, described, satisfies
from pipeline.design.settings import DRAWN, Design, Level
from pipeline.keys import get
from pipeline.progress import watched

Array = NDArray[np.float64]
#: Points that a sequence is drawn in: a power of two, as Sobol's needs it.
BLOCK = 64
#: Draws for each machine or cut, and at least, before constraints count as impossible to satisfy.
TRIES, LEAST_TRIES = 200, 2_000
#: What a seed is used for.
MACHINES, CUTS, SPLITS = 0, 1, 2
#: Parts that machines are split into, as they are stored.
PARTS = ("train", "validation", "test")


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Numbers of a design, in the order of its keys.

    machines: (machine, key); cuts: (machine, cut, key); split: (machine,) places in PARTS.
    """

    machines: Array
    cuts: Array
    split: NDArray[np.int8]


def draw(design: Design, base: Description) -> Drawn:
    """Return the numbers of a design on a description.

    Raises InvalidInput where a formula or constraint has no value, or constraints leave next to nothing.
    """
    try:
        machines = _machines(design, base)
        cuts = _cuts(design, base, machines)
    except ValueError as error:
        raise InvalidInput([f"design: {error}"]) from None
    return Drawn(machines=machines, cuts=cuts, split=_split(design, len(machines)))


def _machines(design: Design, base: Description) -> Array:
    level = design.machine
    if design.sampling in DRAWN:
        assert design.machines is not None

        def accepted(_: int, numbers: Array) -> bool:
            return satisfies(described(base, level, numbers), level)

        return _accepted(design.machines, _stream(design, level, MACHINES, design.machines), accepted, "machine")
    if design.sampling == "grid":
        every = _grid(level)
        each = watched(every, len(every), "machines described")
        rows = [row for row in each if satisfies(described(base, level, row), level)]
        if not rows:
            raise ValueError("machine.constraints: no point of the grid satisfies them")
        return np.array(rows).reshape(len(rows), len(level.vary))
    return _one_at_a_time(level, base) if design.sampling == "one_at_a_time" else _saltelli(design)


def _cuts(design: Design, base: Description, machines: Array) -> Array:
    level = design.cut
    if design.sampling == "grid":
        rows = _grid(level)
        return np.tile(np.array(rows).reshape(1, len(rows), len(level.vary)), (len(machines), 1, 1))
    each = design.cuts_per_machine or 1
    count = each * len(machines)
    if not level.vary and not level.constraints:
        return np.empty((len(machines), each, 0))

    @lru_cache(maxsize=1)
    def machine(number: int) -> Description:
        # One at a time, since cuts come in their machines' order: those of a large design would take all memory.
        return described(base, design.machine, machines[number])

    def accepted(place: int, numbers: Array) -> bool:
        return satisfies(described(machine(place // each), level, numbers), level)

    found = _accepted(count, _stream(design, level, CUTS, count), accepted, "cut")
    return found.reshape(len(machines), each, len(level.vary))


def _accepted(count: int, stream: Iterator[Array], accepted: Callable[[int, Array], bool], level: str) -> Array:
    """Return the first numbers of a stream (place, key) that are accepted in their places."""

    def found() -> Iterator[Array]:
        kept = 0
        for tried, numbers in enumerate(stream, start=1):
            if accepted(kept, numbers):
                kept += 1
                yield numbers
            elif tried >= max(TRIES * (kept + 1), LEAST_TRIES):
                raise ValueError(f"{level}.constraints: {kept} of {tried} draws satisfy them, too few to go on")

    return np.array(list(watched(itertools.islice(found(), count), count, f"{level}s drawn")))


def _stream(design: Design, level: Level, use: int, count: int) -> Iterator[Array]:
    """Yield numbers (key,) of a level without end."""
    rng = np.random.default_rng([design.seed, use])
    size = max(len(level.vary), 1)
    if design.sampling == "random":
        shares: Callable[[], Array] = lambda: rng.random((BLOCK, size))  # noqa: E731
    elif design.sampling == "sobol":
        sequence = scipy.stats.qmc.Sobol(size, rng=rng)
        shares = lambda: sequence.random(BLOCK)  # noqa: E731
    else:
        # As many strata as are needed; where constraints take some, what follows is of another hypercube.
        shares = lambda: scipy.stats.qmc.LatinHypercube(size, rng=rng).random(count)  # noqa: E731
    while True:
        yield from _numbers(level, shares())


def _numbers(level: Level, shares: Array) -> Array:
    """Return the numbers (row, key) at shares (row, key) of each key's distribution."""
    columns = [varied.quantile(shares[:, place]) for place, varied in enumerate(level.vary.values())]
    return np.column_stack(columns) if columns else np.empty((len(shares), 0))


def _grid(level: Level) -> list[Array]:
    return [np.array(row) for row in itertools.product(*level.at_levels())]


def _one_at_a_time(level: Level, base: Description) -> Array:
    """Return the description's own numbers, then those with one key at its low and at its high end, key by key."""
    own = np.array([_own_number(base, key, level) for key in level.vary])
    rows = [own]
    for place, varied in enumerate(level.vary.values()):
        for end in varied.ends():
            rows.append(own.copy())
            rows[-1][place] = end
    return np.array(rows)


def _own_number(base: Description, key: str, level: Level) -> float:
    """Return the number that stands for what a description says itself at a key."""
    value, varied = get(base, key), level.vary[key]
    if value is None:
        raise ValueError(f"machine.vary.{key}: the description says nothing there, and one at a time begins with it")
    number = varied.number_of(value)
    if number is None:
        raise ValueError(f"machine.vary.{key}: the description says {shown(value)}, which is not among its values")
    return number


def _saltelli(design: Design) -> Array:
    """Return the blocks from which first-order and total indices of Sobol follow (N (key + 2), key)."""
    # It takes scipy's statistics along: half a second, in every process of every run.
    from SALib.sample import sobol as saltelli

    size = len(design.machine.vary)
    problem = {"num_vars": size, "names": list(design.machine.vary), "bounds": [[0.0, 1.0]] * size}
    # Nothing at the very ends, where an unbounded distribution has no number.
    shares = np.clip(
        saltelli.sample(problem, design.machines, calc_second_order=False, seed=design.seed), 1e-9, 1 - 1e-9
    )
    return _numbers(design.machine, shares)


def _split(design: Design, machines: int) -> NDArray[np.int8]:
    """Return the part of every machine (machine,), the parts' sizes as near to their shares as whole numbers are."""
    ends = np.rint(np.cumsum([getattr(design.splits, part) for part in PARTS]) * machines).astype(int)
    split = np.searchsorted(ends, np.arange(machines), side="right").astype(np.int8)
    return np.random.default_rng([design.seed, SPLITS]).permutation(split)
