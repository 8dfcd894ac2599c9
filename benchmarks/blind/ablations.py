"""What is taken from a campaign to see that it was needed; on files alone."""

import shutil
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.blind.tables import Rows, read_rows, write_rows

#: Files of measurements without cutting.
RESPONSES, STRUCTURE = ("frf.csv", "modes.csv"), ("frf.csv", "modes.csv", "bearing.csv")
LABEL_COLUMNS = ("outcome", "chatter_frequency_hz")
SHUFFLE_SEED = 7


@dataclass(frozen=True, kw_only=True)
class Ablation:
    """What is taken, and what must come of it.

    text, expected: in words; without: files that are left out; cuts: what becomes of stability.csv; frozen: whether
    nuisances of the machine stay as described.
    """

    text: str
    expected: str = ""
    without: tuple[str, ...] = ()
    cuts: Callable[[Rows], Rows] | None = None
    frozen: bool = False

    def concerns(self, folder: Path) -> bool:
        """Return whether it takes something from a campaign."""
        return self.cuts is not None or self.frozen or any((folder / name).exists() for name in self.without)


def shuffled(rows: Rows) -> Rows:
    """Return the cuts with their labels, and the frequencies that belong to these, dealt out anew."""
    order = np.random.default_rng([SHUFFLE_SEED, zlib.crc32(repr(rows).encode())]).permutation(len(rows))
    return [
        {**row, **{name: rows[other][name] for name in LABEL_COLUMNS}} for row, other in zip(rows, order, strict=True)
    ]


def labels_alone(rows: Rows) -> Rows:
    """Return the cuts without chatter frequencies."""
    return [{**row, "chatter_frequency_hz": ""} for row in rows]


WHOLE = "whole"
#: Shuffled labels lose the measurements without cutting as well: those would rightly name what they show.
ABLATIONS = {
    WHOLE: Ablation(text="everything that was measured"),
    "without_responses": Ablation(text="without frf.csv and modes.csv", expected="fewer right", without=RESPONSES),
    "labels_alone": Ablation(text="labels alone", expected="fewer right", without=STRUCTURE, cuts=labels_alone),
    "shuffled": Ablation(
        text="labels shuffled, and nothing but cuts", expected="nothing named", without=STRUCTURE, cuts=shuffled
    ),
    "frozen": Ablation(text="nuisances of the machine frozen", expected="more named wrongly", frozen=True),
}


def prepare(folder: Path, name: str, place: Path) -> Path:
    """Write what an ablation leaves of a campaign into ``place`` and return it; the campaign itself if that is all."""
    ablation = ABLATIONS[name]
    if not ablation.without and ablation.cuts is None:
        return folder
    place.mkdir(parents=True)
    for file in folder.iterdir():
        if file.name not in ablation.without:
            shutil.copyfile(file, place / file.name)
    if ablation.cuts is not None:
        path = place / "stability.csv"
        write_rows(path, ablation.cuts(read_rows(path)))
    return place
