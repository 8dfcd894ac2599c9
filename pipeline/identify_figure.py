"""Figures of an identification: what was measured, what the modes make of it, and what is left."""

from collections.abc import Callable, Iterator
from itertools import cycle
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chatter_core.evidence.identified_tip import IdentifiedTip
from chatter_core.evidence.identify import IdentifiedModes
from chatter_core.tip import AXES
from chatter_core.units import si_factor
from pipeline.figures import COLOURS

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

MEASURED = "0.55"
#: Decades of magnitude shown below the largest, and room above it for the modes' numbers, as a factor.
DECADES, HEADROOM = 3.0, 2.5
#: Unit of a receptance on the page.
UNIT = "\N{MICRO SIGN}m/N"


def write(found: IdentifiedTip, machine_file: Path) -> list[Path]:
    """Write one figure for each receptance beside the machine file and return the paths."""
    paths = []
    for measured, modes in zip(found.receptances, found.modes, strict=True):
        speed = measured.spindle_speed / si_factor("speed_rpm")
        path = machine_file.with_name(f"{machine_file.stem}_{AXES[measured.output_axis]}_{speed:.0f}rpm.png")
        receptance(modes, f"Receptance of the tool tip, {measured}").savefig(path, dpi=150)
        paths.append(path)
    return paths


def receptance(modes: IdentifiedModes, title: str) -> Figure:
    """Draw magnitude, residual, real and imaginary part of a receptance, of its fit and of its modes."""
    figure = Figure(figsize=(12.0, 7.0), layout="constrained")
    figure.suptitle(title, fontweight="bold", x=0.01, ha="left")
    # Rows of equal height: the magnitude takes four of six, the real part three.
    panels = figure.subplot_mosaic("mr\nmr\nmr\nmi\nei\nei", sharex=True)
    _magnitude(panels["m"], modes)
    _residual(panels["e"], modes)
    _part(panels["r"], modes, "real part", np.real)
    _part(panels["i"], modes, "imaginary part", np.imag)
    hertz = _hertz(modes)
    panels["m"].set_xlim(hertz[0], hertz[-1])
    for name in "ei":
        panels[name].set_xlabel("frequency [Hz]")
    for axes in panels.values():
        axes.grid(alpha=0.3)
    handles, labels = panels["m"].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False)
    return figure


def _magnitude(axes: Axes, modes: IdentifiedModes) -> None:
    """Draw magnitudes; each mode has its colour, its number above its peak, and its values in the legend."""
    hertz, largest = _hertz(modes), float(_um(np.abs(modes.measured)).max())
    axes.semilogy(hertz, _um(np.abs(modes.measured)), ".", color=MEASURED, markersize=2.5, label="measured")
    axes.semilogy(hertz, _um(np.abs(modes.fitted)), color="black", linewidth=1.3, zorder=3.0, label="fitted, the sum")
    axes.semilogy(hertz, _um(np.abs(modes.outside)), ":", color="black", linewidth=1.1, label="outside the band")
    for mode, colour in _colours(modes):
        contribution = _um(np.abs(modes.contributions[:, mode]))
        axes.semilogy(hertz, contribution, color=colour, linewidth=1.1, label=_values(modes, mode))
        place = modes.natural_frequency[mode] / si_factor("frequency_hz")
        axes.text(
            place,
            # Numbers of close modes stand on two levels.
            0.98 - 0.05 * (mode % 2),
            f"{mode + 1}",
            color=colour,
            ha="center",
            va="top",
            fontweight="bold",
            clip_on=True,
            transform=axes.get_xaxis_transform(),
        )
    axes.set_ylim(largest / 10.0**DECADES, largest * HEADROOM)
    axes.set_ylabel(f"magnitude [{UNIT}]")


def _residual(axes: Axes, modes: IdentifiedModes) -> None:
    """Draw the residual's real and imaginary part over their expected standard deviation."""
    expected = modes.expected_error / np.sqrt(2.0)
    for part in (np.real, np.imag):
        over = part(modes.measured - modes.fitted) / expected
        axes.plot(_hertz(modes), over, ".", color=MEASURED, markersize=2.5)
    for border in (-2.0, 2.0):
        axes.axhline(border, color="black", linewidth=0.8, linestyle="--")
    axes.set_ylabel("residual over\nexpected error")
    axes.set_title(modes.statement(), loc="right", fontsize="small")


def _part(axes: Axes, modes: IdentifiedModes, name: str, part: Callable[[Complex], Array]) -> None:
    hertz = _hertz(modes)
    axes.plot(hertz, _um(part(modes.measured)), ".", color=MEASURED, markersize=2.5)
    for mode, colour in _colours(modes):
        axes.plot(hertz, _um(part(modes.contributions[:, mode])), color=colour, linewidth=1.1)
    axes.plot(hertz, _um(part(modes.fitted)), color="black", linewidth=1.3)
    axes.set_ylabel(f"{name} [{UNIT}]")


def _colours(modes: IdentifiedModes) -> Iterator[tuple[int, str]]:
    # Black is the fit's.
    return zip(range(len(modes)), cycle(colour for colour in COLOURS if colour != "#000000"), strict=False)


def _values(modes: IdentifiedModes, mode: int) -> str:
    """Return a mode's values for the legend."""
    frequency = modes.natural_frequency[mode] / si_factor("frequency_hz")
    stiffness = modes.modal_stiffness[mode] / si_factor("stiffness_n_um")
    return (
        f"{mode + 1}: {frequency:.0f} Hz, {100.0 * modes.damping_ratio[mode]:.2g} %, {stiffness:.3g} N/\N{MICRO SIGN}m"
    )


def _hertz(modes: IdentifiedModes) -> Array:
    return modes.frequency / si_factor("frequency_hz")


def _um(receptance: Array) -> Array:
    return receptance / si_factor("x_um")
