"""Which seed hides what: composition by design, not by chance.

Of twenty seeds in a row that begin at a multiple of twenty, five hide nothing, eleven one effect, two a pair and two
one that has no name. Effects take turns, and so do their strengths.
"""

from dataclasses import dataclass, replace

import numpy as np

from tests.hidden_effect.effects import FOREIGN, NAMED

#: Seeds for choosing thresholds and temperatures, and seeds for a judgement each; no seed is in two of them. Later
#: tests are for programs that were changed because of what earlier ones showed; the third seeds are those of three.
CALIBRATION_SEEDS = range(1000, 1200)
TEST_SEEDS = range(5000, 5200)
SECOND_TEST_SEEDS = range(6000, 6200)
THIRD_TEST_SEEDS = range(7000, 7200)
SIXTH_TEST_SEEDS = range(8000, 8200)
#: The same by the names that commands know them by.
SEEDS = {
    "calibration": CALIBRATION_SEEDS,
    "test": TEST_SEEDS,
    "second": SECOND_TEST_SEEDS,
    "third": THIRD_TEST_SEEDS,
    "sixth": SIXTH_TEST_SEEDS,
}

BLOCK = 20
KINDS = ("none",) * 5 + ("one",) * 11 + ("two",) * 2 + ("foreign",) * 2


@dataclass(frozen=True, kw_only=True)
class Plan:
    """kind: none, one, two or foreign; effects: names; strengths: each 0 (weak) to 1 (strong).

    generation: how often its laws are others where the program's have become like those before.
    """

    kind: str
    effects: tuple[str, ...]
    strengths: tuple[float, ...]
    generation: int = 0


def plan(seed: int) -> Plan:
    """Return what a seed hides."""
    first = seed in CALIBRATION_SEEDS or seed in TEST_SEEDS
    return replace(_planned(seed), generation=0 if first else 2 if seed in SIXTH_TEST_SEEDS else 1)


def _planned(seed: int) -> Plan:
    block, place = divmod(seed, BLOCK)
    order = np.random.default_rng([block, 1]).permutation(BLOCK)
    drawn = int(order[place])
    kind = KINDS[drawn]
    rng = np.random.default_rng([seed, 2])
    if kind == "none":
        return Plan(kind=kind, effects=(), strengths=())
    rank, count = drawn - KINDS.index(kind), KINDS.count(kind)
    if kind == "two":
        pair = sorted(rng.choice(len(NAMED), 2, replace=False))
        # Of a weak pair nothing would be seen.
        return Plan(
            kind=kind,
            effects=tuple(list(NAMED)[index] for index in pair),
            strengths=tuple(float(value) for value in rng.uniform(0.5, 1.0, 2)),
        )
    names = list(NAMED if kind == "one" else FOREIGN)
    turn, position = divmod(block * count + rank, len(names))
    taken = int(np.random.default_rng([turn, 3 if kind == "one" else 4]).permutation(len(names))[position])
    level = (turn + taken) % 3
    return Plan(kind=kind, effects=(names[taken],), strengths=((level + float(rng.random())) / 3.0,))
