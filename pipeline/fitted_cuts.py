"""What a model was fitted to: marks in its file by which cuts and all else are known again, in other campaigns, too."""

from collections.abc import Collection, Iterable
from hashlib import sha256

from chatter_core.evidence import Campaign

#: Letters of a mark: of a thousand cuts two share one by chance once in ten thousand campaigns.
LETTERS = 8
#: What makes a cut what it is, for trials and for limit depths; not its number, by which only people know it.
SAYS_WHAT = (
    "spindle_speed", "axial_depth", "outcome", "preload", "radial_immersion", "feed_per_tooth", "direction",
    "limit_depth",
)  # fmt: skip
#: What makes a measurement without cutting what it is, row by row.
OF_MODES = ("spindle_speed", "mode", "natural_frequency", "damping_ratio")
OF_BEARINGS = ("spindle_speed", "preload", "radial_stiffness", "axial_stiffness")
#: A mark of letters alone is a number in no file.
SPELT = str.maketrans("0123456789abcdef", "abcdefghijklmnop")
#: Digits of a number in a mark: files are written with fewer, and units are converted with more.
DIGITS = 10


def marks(campaign: Campaign) -> list[str]:
    """Return a mark for every cut of a campaign, its trials first, then its limit depths."""
    found = []
    for table in (campaign.trials, campaign.limits):
        if table is not None:
            found += _marks_of_rows(table, SAYS_WHAT)
    return found


def other_marks(campaign: Campaign) -> list[str]:
    """Return a mark for everything that was measured without cutting: each response, then each row of the tables."""
    found = []
    for one in campaign.receptances:
        place = (one.spindle_speed, one.output_axis, one.input_axis)
        found.append(_mark([*place, *one.frequency, *one.value.real, *one.value.imag]))
    for table, columns in ((campaign.natural_frequencies, OF_MODES), (campaign.stiffness, OF_BEARINGS)):
        if table is not None:
            found += _marks_of_rows(table, columns)
    return found


def _marks_of_rows(table: object, names: Iterable[str]) -> list[str]:
    columns = [getattr(table, name) for name in names if hasattr(table, name)]
    return [_mark(cells) for cells in zip(*columns, strict=True)]


def _mark(cells: Iterable[float]) -> str:
    text = ",".join(f"{float(cell):.{DIGITS}g}" for cell in cells)
    return sha256(text.encode()).hexdigest()[:LETTERS].translate(SPELT)


def seen(campaign: Campaign, cuts: Collection[str], others: Collection[str]) -> str:
    """Return in a sentence how much of a campaign a model was fitted to already; "" where it was to nothing.

    cuts, others: marks of what it was fitted to.
    """
    counted = (
        _counted(marks(campaign), cuts, "cuts"),
        _counted(other_marks(campaign), others, "measurements without cutting"),
    )
    which = " and ".join(words for words in counted if words)
    if not which:
        return ""
    return f"the model was fitted to {which} already; its errors on them as described are no test of it"


def _counted(own: list[str], fitted: Collection[str], name: str) -> str:
    """Return in words how many of these marks are among those of a fit, "" for none."""
    known = frozenset(fitted)
    count = sum(mark in known for mark in own)
    if not count:
        return ""
    return f"all of these {name}" if count == len(own) else f"{count} of these {len(own)} {name}"
