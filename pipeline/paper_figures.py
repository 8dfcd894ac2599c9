"""Figures P1 to P9: what the paper shows, on this model."""

from pathlib import Path

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.figures import COLOURS, STABLE, STYLE, modes_label, over_speed, panel, panels, shared_legend
from pipeline.findings import Evidence
from pipeline.lobes import dominance, known_limit, most_misjudged, stability_limit


def write(evidence: Evidence, folder: Path) -> list[Path]:
    """Write every figure into a folder and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    drawn = {
        "p1_ball_forces": ball_forces,
        "p2_contact_angles": contact_angles,
        "p3_radial_stiffness": radial_stiffness,
        "p4_natural_frequencies": natural_frequencies,
        "p5_modal_parameters": modal_parameters,
        "p6_single_mode_lobes": single_mode_lobes,
        "p7_four_modes": four_modes,
        "p8_modes_one_by_one": modes_one_by_one,
        "p9_deceptive_speed": deceptive_speed,
    }
    paths = []
    for name, draw in drawn.items():
        paths.append(folder / f"{name}.png")
        draw(evidence).savefig(paths[-1], dpi=150)
    return paths


def ball_forces(evidence: Evidence) -> Figure:
    """Draw centrifugal force and gyroscopic moment of a ball over speed for each preload."""
    figure, (left, right) = panels("P1: forces on one ball", 1, 2, height=4.0)
    _by_preload(left, evidence.bearing["centrifugal_force"], "centrifugal force [N]")
    _by_preload(right, evidence.bearing["gyroscopic_moment"] * 1e3, "gyroscopic moment [mN m]")
    left.legend(frameon=False)
    return figure


def contact_angles(evidence: Evidence) -> Figure:
    """Draw inner and outer contact angle over speed for each preload."""
    figure, axes = panel("P2: contact angles of the balls")
    _by_preload(axes, evidence.bearing["inner_contact_angle"], "contact angle [deg]")
    _by_preload(axes, evidence.bearing["outer_contact_angle"], "contact angle [deg]", linestyle="--", named=False)
    axes.set_title("solid: inner race, dashed: outer race", loc="right", fontsize="small")
    axes.legend(frameon=False)
    return figure


def radial_stiffness(evidence: Evidence) -> Figure:
    """Draw the radial stiffness of one bearing over speed for each preload."""
    figure, axes = panel("P3: radial stiffness of one bearing")
    _by_preload(axes, evidence.bearing["radial_stiffness"], "radial stiffness [N/\N{MICRO SIGN}m]")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False)
    return figure


def natural_frequencies(evidence: Evidence) -> Figure:
    """Draw the natural frequencies over speed."""
    figure, axes = panel("P4: natural frequencies at the tool tip")
    _by_mode(axes, evidence.modes["natural_frequency"], "natural frequency [Hz]")
    axes.set_ylim(bottom=0.0)
    axes.legend(frameon=False, ncols=4, loc="upper right", bbox_to_anchor=(1.0, 0.9))
    return figure


def modal_parameters(evidence: Evidence) -> Figure:
    """Draw modal stiffness and mass at the tip over speed."""
    figure, (left, right) = panels("P5: modal stiffness and mass at the tool tip", 1, 2, height=4.0)
    _by_mode(left, evidence.modes["modal_stiffness"], "modal stiffness [N/\N{MICRO SIGN}m]")
    _by_mode(right, evidence.modes["modal_mass"], "modal mass [kg]")
    for axes in (left, right):
        axes.set_yscale("log")
    right.legend(frameon=False)
    return figure


def single_mode_lobes(evidence: Evidence) -> Figure:
    """Draw the lobes of each mode alone, bearings at speed and at standstill."""
    figure, grid = panels("P6: lobes of each mode alone", 2, 2, height=7.4)
    limit = stability_limit(evidence.alone).isel(preload=0)
    for axes, number in zip(grid.flat, limit["mode_count"].values, strict=False):
        _dynamic_and_static(axes, limit.sel(mode_count=number))
        axes.set_yscale("log")
        axes.set_ylim(0.5, float(evidence.alone["axial_depth"].max()))
        axes.set_title(modes_label(evidence.alone, int(number)), loc="right", fontsize="small")
        _over_speed(axes, limit, "axial depth [mm]")
    shared_legend(figure, grid.flat[0])
    return figure


def four_modes(evidence: Evidence) -> Figure:
    """Draw the lobes of all modes, bearings at speed and at standstill, with the mode that dominates."""
    figure, axes = panel("P7: static and dynamic lobes with all modes")
    limit = _all_modes(evidence)
    _dynamic_and_static(axes, limit)
    _finish(axes, limit)
    ranges = dominance(evidence.together)
    modes = int(evidence.together["mode_count"].max())
    shown = ranges[(ranges["modal_parameters"] == "dynamic") & (ranges["mode_count"] == modes)]
    bottom = 0.03 * axes.get_ylim()[1]
    for row in shown.itertuples():
        colour = COLOURS[(int(row.dominant_mode) + 1) % len(COLOURS)]
        axes.plot([row.from_rpm, row.to_rpm], [bottom, bottom], color=colour, linewidth=5.0, solid_capstyle="butt")
        if row.to_rpm - row.from_rpm > 1500.0:
            middle = 0.5 * (row.from_rpm + row.to_rpm)
            axes.annotate(f"mode {row.dominant_mode} dominant", (middle, 1.6 * bottom), ha="center", fontsize="small")
    axes.legend(frameon=False)
    return figure


def modes_one_by_one(evidence: Evidence) -> Figure:
    """Draw the lobes of the first mode, the first two, and so on."""
    figure, axes = panel("P8: modes added one by one, dynamic parameters")
    limit = stability_limit(evidence.together).isel(preload=0).sel(modal_parameters="dynamic")
    for colour, number in zip(COLOURS, limit["mode_count"].values, strict=False):
        line = limit.sel(mode_count=number)
        label = modes_label(evidence.together, int(number))
        axes.plot(line["spindle_speed"], line, color=colour, linewidth=1.4, label=label)
    _over_speed(axes, limit, "axial depth [mm]")
    axes.set_yscale("log")
    axes.set_ylim(0.5, float(evidence.together["axial_depth"].max()))
    axes.legend(frameon=False)
    return figure


def deceptive_speed(evidence: Evidence) -> Figure:
    """Draw where static lobes promise most beyond what dynamic ones allow."""
    figure, axes = panel("P9: a speed that only the standing spindle recommends")
    limit = _all_modes(evidence)
    _dynamic_and_static(axes, limit)
    stable = known_limit(evidence.together).isel(preload=0, mode_count=-1).sel(modal_parameters="dynamic")
    axes.fill_between(stable["spindle_speed"], 0.0, stable, color=STABLE)
    worst = most_misjudged(
        evidence.together, float(evidence.together["preload"][0]), int(evidence.together["mode_count"].max())
    )
    if worst is not None:
        speed = worst.spindle_speed_rpm
        ends = (worst.dynamic_limit_mm, worst.static_limit_mm)
        axes.annotate("", (speed, ends[0]), (speed, ends[1]), arrowprops={"arrowstyle": "<->", "color": "black"})
        axes.annotate(
            f"{speed:.0f} rpm\n{ends[1]:.2f} mm promised\n{ends[0]:.2f} mm stable",
            (speed, ends[0] + 0.2 * (ends[1] - ends[0])),
            ha="center",
            va="center",
            fontsize="small",
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 2.0},
        )
    _finish(axes, limit)
    axes.legend(frameon=False)
    return figure


def _all_modes(evidence: Evidence) -> xr.DataArray:
    return stability_limit(evidence.together).isel(preload=0, mode_count=-1)


def _dynamic_and_static(axes: Axes, limit: xr.DataArray) -> None:
    for colour, name in zip(COLOURS, ("dynamic", "static"), strict=False):
        line = limit.sel(modal_parameters=name)
        axes.plot(line["spindle_speed"], line, color=colour, linestyle=STYLE[name], label=f"{name} parameters")


def _by_preload(axes: Axes, values: xr.DataArray, label: str, linestyle: str = "-", named: bool = True) -> None:
    for colour, preload in zip(COLOURS, values["preload"].values, strict=False):
        axes.plot(
            values["spindle_speed"],
            values.sel(preload=preload),
            color=colour,
            linestyle=linestyle,
            label=f"{preload:g} N" if named else None,
        )
    _over_speed(axes, values, label)


def _by_mode(axes: Axes, values: xr.DataArray, label: str) -> None:
    for colour, mode in zip(COLOURS, values["mode"].values, strict=False):
        axes.plot(values["spindle_speed"], values.sel(mode=mode), color=colour, label=f"mode {mode}")
    _over_speed(axes, values, label)


def _over_speed(axes: Axes, values: xr.DataArray, label: str) -> None:
    over_speed(axes, values)
    axes.set_ylabel(label)


def _finish(axes: Axes, limit: xr.DataArray) -> None:
    _over_speed(axes, limit, "axial depth [mm]")
    axes.set_ylim(bottom=0.0)
