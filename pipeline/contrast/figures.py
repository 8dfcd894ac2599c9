"""The figure of two studies held against each other."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pipeline.contrast.contrasted import Contrast
from pipeline.contrast.lines import STUDIES
from pipeline.contrast.plots import BAND, shown_lines
from pipeline.figures import COLOURS, draw_line

#: The file.
NAME = "contrast.png"
STYLES = ("-", "--")


def write(found: Contrast, folder: Path) -> list[Path]:
    """Write the figure into a folder and return its path."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = Figure(figsize=(8.0, 6.4), layout="constrained")
    limits, ratios = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    line, speed = shown_lines(found)[0], found.pairs.speed
    for which, name in enumerate(STUDIES):
        label = f"{name}: {found.studies[which].place}"
        style = {"linestyle": STYLES[which], "color": COLOURS[which]}
        draw_line(limits, speed, found.limit[which, line], label=label, **style)
    limits.set_title(found.name_of(line), fontsize=9, loc="left")
    limits.set_ylabel("limit depth [mm]")
    limits.set_ylim(bottom=0.0)
    limits.legend(frameon=False, fontsize=8)
    told = ~np.isnan(found.ratio).all(axis=0)
    if len(found.ratio) > 2 and told.any():
        below, above = np.nanquantile(found.ratio[:, told], BAND, axis=0)
        label = f"{BAND[0]:.0%} to {BAND[1]:.0%} of all lines"
        ratios.fill_between(speed[told], below, above, color=COLOURS[2], alpha=0.25, label=label)
    draw_line(ratios, speed, found.ratio[line], color=COLOURS[2], label="this line")
    ratios.axhline(1.0, color="grey", lw=0.8, ls=":")
    ratios.set_xlabel("spindle speed [rpm]")
    ratios.set_ylabel("second over first")
    ratios.legend(frameon=False, fontsize=8)
    drawn.savefig(folder / NAME, dpi=150)
    return [folder / NAME]
