"""Which cuts a model was fitted to: marks in its file by which they are known again, in other campaigns, too."""

from collections.abc import Collection
from hashlib import sha256

from chatter_core.evidence import Campaign

#: Letters of a mark: of a thousand cuts two share one by chance once in ten thousand campaigns.
LETTERS = 8
#: What makes a cut what it is, for trials and for limit depths; not its number, by which only people know it.
SAYS_WHAT = (
    "spindle_speed", "axial_depth", "outcome", "preload", "radial_immersion", "feed_per_tooth", "direction",
    "limit_depth",
)  # fmt: skip
#: A mark of letters alone is a number in no file.
SPELT = str.maketrans("0123456789abcdef", "abcdefghijklmnop")
#: Digits of a number in a mark: files are written with fewer, and units are converted with more.
DIGITS = 10


def marks(campaign: Campaign) -> list[str]:
    """Return a mark for every cut of a campaign, its trials first, then its limit depths."""
    found = []
    for table in (campaign.trials, campaign.limits):
        if table is not None:
            columns = [getattr(table, name) for name in SAYS_WHAT if hasattr(table, name)]
            found += [_mark(cells) for cells in zip(*columns, strict=True)]
    return found


def _mark(cells: tuple[float, ...]) -> str:
    text = ",".join(f"{float(cell):.{DIGITS}g}" for cell in cells)
    return sha256(text.encode()).hexdigest()[:LETTERS].translate(SPELT)


def seen(campaign: Campaign, fitted: Collection[str]) -> str:
    """Return in a sentence how many cuts of a campaign a model was fitted to already; "" where it was to none."""
    own, known = marks(campaign), frozenset(fitted)
    count = sum(mark in known for mark in own)
    if not count:
        return ""
    which = "all of these cuts" if count == len(own) else f"{count} of these {len(own)} cuts"
    return f"the model was fitted to {which} already; its errors on them as described are no test of it"
