"""What the paper claims, each held against this model: the number found, and whether the claim holds.

The paper is "Effects of spindle speed-dependent dynamic characteristics of ball bearing and
multi-modes on the stability of milling processes"; its findings are numbered P1 to P9 here. Its
machine is not fully given, so figures are compared in kind and not in digits.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import xarray as xr

from pipeline.lobes import crossover_speeds, dominance, most_misjudged, stability_limit

#: Seconds of a lobe diagram in the paper: n = 40, a processor of 2.8 GHz.
PAPER_SECONDS = 110.0
#: Speed that the paper names for P9 [rpm].
PAPER_SPEED = 10_000.0
#: Preload at which the lobes are drawn [N].
PRELOAD = 100.0
#: Speeds up to which static and dynamic lobes are expected to coincide [rpm].
LOW_SPEED = 6_000.0
#: Speeds that count as high where mode 1 never dominates [rpm].
HIGH_SPEED = 15_000.0
#: The claim of P9.
DECEPTIVE = (
    "There is a speed that looks good on static lobes and is bad on dynamic ones (on the paper's machine 10,000 rpm)."
)
#: A lobe's peak is looked for within this share of the speed at which a tooth passes in step with the mode.
PEAK_REACH = 0.12


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What the claims are held against.

    bearing: (preload, spindle_speed); modes: (mode, spindle_speed), one axis; together and alone:
    lobes of modes 1 to n and of mode n; seconds: of one lobe diagram, by method.
    """

    bearing: xr.Dataset
    modes: xr.Dataset
    together: xr.Dataset
    alone: xr.Dataset
    seconds: dict[str, float]


@dataclass(frozen=True, kw_only=True)
class Finding:
    """One claim: what the paper says, what was found, whether it holds, and why where it does not."""

    name: str
    claim: str
    found: str
    holds: Literal["yes", "in part", "no"]
    why: str = ""


def findings(evidence: Evidence) -> list[Finding]:
    """Return every claim of the paper with what this model says to it."""
    return [claim(evidence) for claim in CLAIMS]


def centrifugal_force(evidence: Evidence) -> Finding:
    """P1: the force grows with speed squared, alike for all preloads."""
    force = evidence.bearing["centrifugal_force"].sel(spindle_speed=slice(3000.0, None))
    logarithm = np.log(force.transpose("spindle_speed", "preload").values)
    exponent = np.polynomial.polynomial.polyfit(np.log(force["spindle_speed"].values), logarithm, 1)[1]
    spread = force.max("preload") / force.min("preload") - 1.0
    rising = (force.diff("preload") >= 0.0).any("preload")
    ordered_from = float(force["spindle_speed"].where(rising).max() if rising.any() else force["spindle_speed"][0])
    before = float(spread.sel(spindle_speed=slice(None, ordered_from)).max())
    alike = float(spread.max()) < 0.1
    return Finding(
        name="P1",
        claim="The balls' centrifugal force rises with speed squared, nearly alike for all preloads, a little less at "
        "higher preload.",
        found=f"exponent {exponent.min():.2f} to {exponent.max():.2f}; at one speed the preloads differ by at most "
        f"{float(spread.max()):.1%}, less at higher preload beyond {ordered_from:g} rpm (up to there they differ by "
        f"{before:.2%} at most)",
        holds=_verdict(bool(np.all(np.abs(exponent - 2.0) < 0.1)), alike, ordered_from < PAPER_SPEED, before < 0.01),
    )


def contact_angles(evidence: Evidence) -> Finding:
    """P2: the inner angle rises and the outer falls with speed, less so at higher preload."""
    inner, outer = evidence.bearing["inner_contact_angle"], evidence.bearing["outer_contact_angle"]
    spreading = bool((inner.diff("spindle_speed") > 0.0).all() and (outer.diff("spindle_speed") < 0.0).all())
    change = abs(inner - inner.isel(spindle_speed=0)) + abs(outer - outer.isel(spindle_speed=0))
    less = bool((change.isel(spindle_speed=slice(1, None)).diff("preload") < 0.0).all())
    last = {name: angle.isel(spindle_speed=-1) for name, angle in (("inner", inner), ("outer", outer))}
    first = inner.isel(spindle_speed=0)
    told = "; ".join(
        f"{float(n):g} N: from {float(first.sel(preload=n)):.1f} to {float(last['inner'].sel(preload=n)):.1f} inner "
        f"and {float(last['outer'].sel(preload=n)):.1f} outer"
        for n in (inner["preload"].values[0], inner["preload"].values[-1])
    )
    return Finding(
        name="P2",
        claim="The inner contact angle rises and the outer falls with speed, less so at higher preload.",
        found=f"up to {float(inner['spindle_speed'].max()):g} rpm, in degrees: {told}",
        holds=_verdict(spreading, less),
    )


def radial_stiffness(evidence: Evidence) -> Finding:
    """P3: stiffness rises with preload, falls with speed, and at light preload rises again."""
    stiffness = evidence.bearing["radial_stiffness"]
    with_preload = bool((stiffness.diff("preload") > 0.0).all())
    least = stiffness.min("spindle_speed")
    falls = bool((least < 0.6 * stiffness.isel(spindle_speed=0)).all())
    light = stiffness.sel(preload=slice(None, 100.0))
    again = bool((light.isel(spindle_speed=-1) > 1.05 * light.min("spindle_speed")).all())
    told = "; ".join(
        f"{float(n):g} N: {float(stiffness.sel(preload=n)[0]):.1f}, least {float(least.sel(preload=n)):.1f} at "
        f"{float(stiffness.sel(preload=n).idxmin('spindle_speed')):g} rpm, "
        f"{float(stiffness.sel(preload=n)[-1]):.1f} at the end"
        for n in stiffness["preload"].values
    )
    return Finding(
        name="P3",
        claim="Radial stiffness rises with preload; it falls with speed; at 100 N and less it falls, then rises again.",
        found=f"N/um, from standstill: {told}",
        holds=_verdict(with_preload, falls, again),
    )


def natural_frequencies(evidence: Evidence) -> Finding:
    """P4: the first two frequencies fall clearly, the next two little; the first rises again."""
    frequency = evidence.modes["natural_frequency"]
    fall = 1.0 - frequency.min("spindle_speed") / frequency.isel(spindle_speed=0)
    lowest = float(frequency.sel(mode=1).idxmin("spindle_speed"))
    rises = bool(frequency.sel(mode=1)[-1] > 1.005 * frequency.sel(mode=1).min())
    clear = bool((fall.sel(mode=[1, 2]) > 0.3).all() and (fall.sel(mode=[3, 4]) < 0.2).all())
    return Finding(
        name="P4",
        claim="The first and second natural frequencies fall clearly with speed, the third and fourth little; the "
        "first falls, then rises.",
        found="they fall by "
        + ", ".join(f"{float(fall.sel(mode=k)):.0%}" for k in frequency["mode"].values)
        + f"; the first is lowest at {lowest:g} rpm",
        holds=_verdict(clear, rises),
    )


def modal_parameters(evidence: Evidence) -> Finding:
    """P5: the first mode's stiffness and mass at the tip change by far the most."""
    stiffness, mass = evidence.modes["modal_stiffness"], evidence.modes["modal_mass"]
    ratio = [_range(array) for array in (stiffness, mass)]
    greatest = all(bool(r.sel(mode=1) > 3.0 * r.sel(mode=slice(2, None)).max()) for r in ratio)
    others = stiffness.sel(mode=slice(2, None))
    above = bool(stiffness.sel(mode=1)[0] > 5.0 * others.isel(spindle_speed=0).max())
    end = stiffness.isel(spindle_speed=-1)
    among = bool(end.sel(mode=1) < end.sel(mode=slice(2, None)).max())
    small = all(bool((r.sel(mode=[3, 4]) < 0.1 * r.sel(mode=1)).all()) for r in ratio)
    return Finding(
        name="P5",
        claim="Modal stiffness and mass at the tip: the first mode's change is by far the greatest, from far above the "
        "others to among them; the third's and fourth's are small.",
        found="largest over smallest, modes 1 to 4: stiffness "
        + ", ".join(f"{float(v):.3g}" for v in ratio[0])
        + "; mass "
        + ", ".join(f"{float(v):.3g}" for v in ratio[1]),
        holds=_verdict(greatest, above, among, small),
    )


def _range(array: xr.DataArray) -> xr.DataArray:
    return array.max("spindle_speed") / array.min("spindle_speed")


def single_mode_lobes(evidence: Evidence) -> Finding:
    """P6: single-mode lobes, bearings at standstill against bearings at speed."""
    limit = stability_limit(evidence.alone).isel(preload=0)
    # Slower than that lobes are so narrow that speeds miss their minima, and both kinds of parameters are alike.
    least = limit.sel(spindle_speed=slice(LOW_SPEED, None)).min("spindle_speed")
    static, dynamic = least.sel(modal_parameters="static"), least.sel(modal_parameters="dynamic")
    numbers = [int(k) for k in limit["mode_count"].values]
    far_above = bool(static.sel(mode_count=1) > 5.0 * static.sel(mode_count=slice(2, None)).max())
    change = {k: float(dynamic.sel(mode_count=k) / static.sel(mode_count=k) - 1.0) for k in numbers}
    risen = [k for k in numbers if change[k] > 0.01]
    little = all(abs(change[k]) < 0.25 for k in numbers[2:])
    shift = {k: _peak_shift(evidence, k) for k in numbers}
    moved = all(shift[k] < 0.0 for k in numbers)
    furthest = min(shift, key=lambda k: shift[k])
    return Finding(
        name="P6",
        claim="Single-mode lobes: static parameters put mode 1 far above modes 2 to 4; dynamic ones lower the minimum "
        "and shift the lobes to lower speed, most for mode 1, little for 3 and 4.",
        found=f"least limit depth above {LOW_SPEED:g} rpm in mm, static and dynamic: "
        + "; ".join(
            f"mode {k}: {float(static.sel(mode_count=k)):.3g} and {float(dynamic.sel(mode_count=k)):.3g}"
            for k in numbers
        )
        + ". A lobe's peak moves by "
        + ", ".join(f"{shift[k]:.0%}" for k in numbers),
        holds=_verdict(far_above, not risen, change[1] == min(change.values()), little, moved, furthest == 1),
        why=" ".join(
            [f"The minimum of mode {k} does not fall: {_stiffer(evidence, k)}." for k in risen]
            + [f"Mode {furthest}'s lobes move furthest: {_slower(evidence, furthest)}."] * (furthest != 1)
        ),
    )


def _stiffer(evidence: Evidence, mode: int) -> str:
    stiffness = evidence.modes["modal_stiffness"].sel(mode=mode)
    return f"its stiffness at the tip goes from {float(stiffness[0]):.3g} to {float(stiffness[-1]):.3g} N/um with speed"


def _slower(evidence: Evidence, mode: int) -> str:
    frequency = evidence.modes["natural_frequency"]
    fall = 1.0 - frequency.min("spindle_speed") / frequency.isel(spindle_speed=0)
    return f"its frequency falls by {float(fall.sel(mode=mode)):.0%}, that of mode 1 by {float(fall.sel(mode=1)):.0%}"


def _peak_shift(evidence: Evidence, mode: int) -> float:
    """Return how far the highest lobe's peak of a mode moves from static to dynamic parameters, relative.

    A lobe peaks where its mode vibrates a whole number of times between two teeth. At standstill that
    is a closed form; at speed the mode changes under way, and the peak is read from the boundary.
    """
    alone = evidence.alone
    teeth = alone.attrs["settings"]["machine"]["tool"]["teeth"]
    frequency = evidence.modes["natural_frequency"].sel(mode=mode)
    speed = alone["spindle_speed"].values
    waves = max(1, math.ceil(60.0 * float(frequency[0]) / teeth / speed[-1]))
    static = 60.0 * float(frequency[0]) / teeth / waves
    in_step = 60.0 * np.interp(speed, frequency["spindle_speed"].values, frequency.values) / teeth / waves
    expected = speed[int(np.argmin(np.abs(in_step - speed)))]
    limit = stability_limit(alone).isel(preload=0).sel(modal_parameters="dynamic", mode_count=mode)
    near = limit.sel(spindle_speed=slice(expected * (1.0 - PEAK_REACH), expected * (1.0 + PEAK_REACH)))
    # Where the boundary lies above the grid, it is deepest there.
    peak = float(near.fillna(math.inf).idxmax("spindle_speed"))
    return float(peak / static - 1.0)


def four_modes(evidence: Evidence) -> Finding:
    """P7: with four modes static and dynamic lobes coincide at low speed and differ at high speed."""
    limit = stability_limit(evidence.together).isel(preload=0, mode_count=-1)
    static, dynamic = (limit.sel(modal_parameters=name) for name in ("static", "dynamic"))
    difference = abs(static / dynamic - 1.0)
    low = float(difference.sel(spindle_speed=slice(None, LOW_SPEED)).median())
    first = _ranges_of_mode(evidence, 1)
    bands = first or [(HIGH_SPEED, math.inf)]
    high = float(np.median(np.concatenate([difference.sel(spindle_speed=slice(a, b)).values for a, b in bands])))
    crossing = _crossover(evidence)
    slow = evidence.together["spindle_speed"].sel(spindle_speed=slice(None, LOW_SPEED)).values
    fourth = np.mean([any(a <= speed <= b for a, b in _ranges_of_mode(evidence, 4)) for speed in slow])
    told = f"; mode 4 hands over to mode 1 at {crossing:.0f} rpm" if math.isfinite(crossing) else ""
    return Finding(
        name="P7",
        claim="Four modes: static and dynamic lobes nearly coincide at low speed (fourth mode dominant) and differ at "
        "high speed (first dominant).",
        found=f"median difference {low:.1%} up to {LOW_SPEED:g} rpm, {high:.0%} where mode 1 dominates "
        f"({', '.join(f'{a:.0f} to {b:.0f} rpm' for a, b in first if b > a)}){told}",
        holds=_verdict(low < 0.05, high > 0.15, math.isfinite(crossing), bool(fourth > 0.8)),
    )


def _ranges_of_mode(evidence: Evidence, mode: int) -> list[tuple[float, float]]:
    """Return the ranges of speed in which a mode dominates the boundary of all modes, dynamic parameters."""
    ranges = dominance(evidence.together)
    modes = int(evidence.together["mode_count"].max())
    shown = ranges[
        (ranges["modal_parameters"] == "dynamic") & (ranges["mode_count"] == modes) & (ranges["dominant_mode"] == mode)
    ]
    return [(float(row.from_rpm), float(row.to_rpm)) for row in shown.itertuples()]


def _crossover(evidence: Evidence) -> float:
    """Return the speed at which mode 4 hands the boundary over to the widest range of mode 1 [rpm]."""
    widest = max(_ranges_of_mode(evidence, 1), key=lambda ends: ends[1] - ends[0], default=None)
    table = crossover_speeds(evidence.together)
    modes = int(evidence.together["mode_count"].max())
    rows = table[
        (table["modal_parameters"] == "dynamic")
        & (table["mode_count"] == modes)
        & (table["from_mode"] == 4)
        & (table["to_mode"] == 1)
    ]
    if widest is None or rows.empty:
        return math.nan
    crossings = rows["crossover_rpm"].to_numpy()
    return float(crossings[int(np.argmin(np.abs(crossings - widest[0])))])


def modes_one_by_one(evidence: Evidence) -> Finding:
    """P8: adding modes lowers the boundary at low speed and hardly changes it at high speed."""
    limit = stability_limit(evidence.together).isel(preload=0).sel(modal_parameters="dynamic")
    deepest = float(evidence.together["axial_depth"].max())
    known = limit.fillna(deepest)
    low = known.sel(spindle_speed=slice(None, LOW_SPEED)).median("spindle_speed")
    falling = bool((low.diff("mode_count") < 0.0).all())
    widest = max(_ranges_of_mode(evidence, 1), key=lambda ends: ends[1] - ends[0], default=(HIGH_SPEED, math.inf))
    change = known / known.isel(mode_count=-1)
    first = change.sel(spindle_speed=slice(*widest)).median("spindle_speed")
    beyond = change.sel(spindle_speed=slice(widest[1], None)).median("spindle_speed")
    numbers = [int(k) for k in limit["mode_count"].values]
    lasts = bool((abs(beyond - 1.0) < 0.25).all())
    return Finding(
        name="P8",
        claim="Adding modes one by one lowers the boundary at low speed and hardly changes it at high speed.",
        found=f"median limit up to {LOW_SPEED:g} rpm with 1 to {numbers[-1]} modes: "
        + ", ".join(
            ("more than " if float(low.sel(mode_count=k)) >= deepest else "") + f"{float(low.sel(mode_count=k)):.3g}"
            for k in numbers
        )
        + f" mm; relative to {numbers[-1]} modes from {widest[0]:.0f} to {widest[1]:.0f} rpm "
        + ", ".join(f"{float(first.sel(mode_count=k)):.2f}" for k in numbers)
        + ", beyond that "
        + ", ".join(f"{float(beyond.sel(mode_count=k)):.2f}" for k in numbers),
        holds=_verdict(falling, bool((abs(first - 1.0) < 0.25).all()), lasts),
        why=""
        if lasts
        else f"Beyond {widest[1]:.0f} rpm a higher mode sets the boundary again, on its next lobe: there it is needed.",
    )


def deceptive_speed(evidence: Evidence) -> Finding:
    """P9: a speed looks good on static lobes and is bad on dynamic ones."""
    modes = int(evidence.together["mode_count"].max())
    preload = float(evidence.together["preload"][0])
    worst = most_misjudged(evidence.together, preload, modes)
    limit = stability_limit(evidence.together).isel(preload=0, mode_count=-1)
    usual = float(limit.sel(modal_parameters="static").min())
    named = limit.sel(spindle_speed=PAPER_SPEED, method="nearest")
    if worst is None:
        return Finding(name="P9", claim=DECEPTIVE, found="no speed of the grid has both limits", holds="no")
    least = "at least " if worst.static_above_grid else ""
    good = worst.static_limit_mm > 2.0 * usual and worst.dynamic_limit_mm < 1.5 * usual
    return Finding(
        name="P9",
        claim=DECEPTIVE,
        found=f"{worst.spindle_speed_rpm:.0f} rpm: static lobes promise {least}{worst.static_limit_mm:.2f} mm, "
        f"dynamic ones allow {worst.dynamic_limit_mm:.2f} mm; at {float(named['spindle_speed']):.0f} rpm here "
        f"{float(named.sel(modal_parameters='static')):.2f} and {float(named.sel(modal_parameters='dynamic')):.2f} mm",
        holds=_verdict(good),
    )


def gyroscopic_moment(evidence: Evidence) -> Finding:
    """What the paper says of the gyroscopic moment, and the equations contradict."""
    moment = evidence.bearing["gyroscopic_moment"].isel(spindle_speed=-1)
    lightest, heaviest = moment.isel(preload=0), moment.isel(preload=-1)
    return Finding(
        name="moment",
        claim="The gyroscopic moment of a ball grows faster with speed at lower preload.",
        found=f"at {float(moment['spindle_speed']):g} rpm {float(lightest) * 1e3:.1f} mN m at "
        f"{float(lightest['preload']):g} N and {float(heaviest) * 1e3:.1f} mN m at {float(heaviest['preload']):g} N",
        holds="yes" if float(lightest) > float(heaviest) else "no",
        why=""
        if float(lightest) > float(heaviest)
        else "The paper's own equations give the opposite: the moment is proportional to the sine of the ball's pitch "
        "angle, which follows the outer contact angle, and that falls more at lower preload (P2).",
    )


def computing_time(evidence: Evidence) -> str:
    """Return the seconds of one lobe diagram beside the paper's, in a sentence."""
    told = " and ".join(f"{seconds:.3g} s with {name}" for name, seconds in evidence.seconds.items())
    cells = evidence.together.sizes["spindle_speed"] * evidence.together.sizes["axial_depth"]
    return (
        f"One lobe diagram of {cells} points with four modes, limit depths included, took {told} on one core. The "
        f"paper says about {PAPER_SECONDS:g} s (n = 40, a processor of 2.8 GHz), and not for how many points."
    )


def _verdict(*parts: bool) -> Literal["yes", "in part", "no"]:
    if all(parts):
        return "yes"
    return "in part" if any(parts) else "no"


CLAIMS: tuple[Callable[[Evidence], Finding], ...] = (
    centrifugal_force,
    contact_angles,
    radial_stiffness,
    natural_frequencies,
    modal_parameters,
    single_mode_lobes,
    four_modes,
    modes_one_by_one,
    deceptive_speed,
    gyroscopic_moment,
)
