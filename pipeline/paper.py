"""The paper's findings on this model: studies, figures P1 to P9 and a table of what holds."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr
from threadpoolctl import threadpool_limits

from chatter_core.bearing import axisymmetric_state
from chatter_core.chain import structure_variables
from chatter_core.errors import InvalidInput
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.units import SUFFIXES
from chatter_core.variables import STRUCTURE
from pipeline import execution, paper_figures, store
from pipeline.answer_folder import write_text
from pipeline.configuration import Words, compose_settings, words_for
from pipeline.findings import HIGH_SPEED, LOW_SPEED, Evidence, Finding, computing_time, findings
from pipeline.locking import make_folder
from pipeline.places import Folder, Place
from pipeline.settings import Settings
from pipeline.telling import fact, say, wrote
from pipeline.verbs.studies import PaperOptions

#: Preloads [N] and speeds [rpm] at which a bearing is looked at alone.
PRELOADS = (50.0, 100.0, 200.0, 400.0)
BEARING_SPEEDS = np.linspace(0.0, 30_000.0, 61)
#: What the bearing stage says, by preload.
BEARING = (
    "inner_contact_angle",
    "outer_contact_angle",
    "centrifugal_force",
    "gyroscopic_moment",
    "radial_stiffness",
    "axial_stiffness",
)
MODES = ("natural_frequency", "damping_ratio", "modal_stiffness", "modal_mass")
#: Methods whose time for one lobe diagram is told; the second is the paper's.
TIMED = {
    "this program's default method": MethodSettings(name="collocation", tolerance=1e-4),
    "the paper's method": MethodSettings(name="semi_discretization", order=0, intervals=40),
}
STUDIES = ("together", "alone")
#: Keys of the grid that the findings are about, and so are not to be changed.
FIXED = ("grid.mode_count", "grid.mode_selection", "grid.modal_parameters")
#: Fewer speeds show no lobes.
FEWEST_SPEEDS = 10


def run(words: list[str]) -> int:
    """Compute both studies of the paper, draw its figures and write what holds; return the exit code."""
    sorted_words = words_for(PaperOptions, words)
    options = PaperOptions.read(sorted_words.options)
    problems = [
        f"{key}: not for paper, which has its own two studies; grid.spindle_speed_rpm and others may be changed"
        for key in (*sorted_words.choices, *(word.partition("=")[0] for word in sorted_words.values))
        if key in ("study", "grid") or key.startswith(FIXED)
    ]
    if problems:
        raise InvalidInput(problems)
    settings = {name: _settings(sorted_words, name) for name in STUDIES}
    if settings["together"].machine.spindle is None:
        raise InvalidInput(["machine: the paper's findings need bearing and spindle, found measured tip modes"])
    speeds = settings["together"].grid.spindle_speed_rpm.points()
    if len(speeds) < FEWEST_SPEEDS or speeds[0] >= LOW_SPEED or speeds[-1] <= HIGH_SPEED:
        raise InvalidInput(
            [
                f"grid.spindle_speed_rpm: found {len(speeds)} from {speeds[0]:g} to {speeds[-1]:g}, for paper allowed: "
                f"at least {FEWEST_SPEEDS} from below {LOW_SPEED:g} to above {HIGH_SPEED:g}"
            ]
        )
    output = options.output
    make_folder(output)
    codes = [execution.execute(settings[name], Folder(output / name), argv=words) for name in STUDIES]
    if any(code not in (0, 1) for code in codes):
        return max(codes)
    lobes = {name: _opened(Folder(output / name)) for name in STUDIES}
    evidence = gather(settings["together"], lobes["together"], lobes["alone"])
    found = findings(evidence)
    pictures = paper_figures.write(evidence, output / "figures")
    page = output / "paper.md"
    write_text(page, table(found, computing_time(evidence), pictures))
    for finding in found:
        say(f"{finding.name:7} {finding.holds:8} {finding.found}")
    fact(findings=[{"name": one.name, "holds": one.holds, "found": one.found} for one in found])
    wrote([*pictures, page])
    return max(codes)


def _settings(words: Words, name: str) -> Settings:
    return compose_settings(replace(words, choices={**words.choices, "study": f"paper_{name}"}))


def _opened(place: Place) -> xr.Dataset:
    with store.open_lobes(place) as lobes:
        loaded: xr.Dataset = lobes.load()
    return loaded


def gather(settings: Settings, together: xr.Dataset, alone: xr.Dataset) -> Evidence:
    """Return the evidence for every claim: lobes as computed, bearing and modes from their stages."""
    machine, preload = settings.machine, float(together["preload"][0])
    assert machine.spindle is not None
    return Evidence(
        bearing=bearing_over_speed(machine),
        modes=modes_over_speed(machine.with_preload(preload), together),
        together=together,
        alone=alone,
        seconds={name: _seconds(settings, preload, method) for name, method in TIMED.items()},
    )


def bearing_over_speed(machine: Machine) -> xr.Dataset:
    """Return the state of one bearing over preload and speed, in the units of the border."""
    assert machine.bearing is not None
    states = [
        axisymmetric_state(machine.bearing, preload, BEARING_SPEEDS * SUFFIXES["rpm"][0], "constant")
        for preload in PRELOADS
    ]
    for state in states:
        state.require_solved()
    return xr.Dataset(
        {
            name: (
                ("preload", "spindle_speed"),
                np.array([getattr(state, name) for state in states]) / STRUCTURE[name].si_factor,
                {"units": STRUCTURE[name].unit, "long_name": STRUCTURE[name].doc},
            )
            for name in BEARING
        },
        coords={"preload": list(PRELOADS), "spindle_speed": BEARING_SPEEDS},
    )


def modes_over_speed(machine: Machine, lobes: xr.Dataset) -> xr.Dataset:
    """Return the tip modes from standstill to the lobes' highest speed, x axis, in the units of the border."""
    speeds = np.linspace(0.0, float(lobes["spindle_speed"].max()), 97)
    numbers = lobes["mode"].values
    found = structure_variables(machine, speeds * SUFFIXES["rpm"][0], mode_count=int(numbers[-1]))
    return xr.Dataset(
        {
            name: (
                ("spindle_speed", "mode"),
                found[name][:, 0] / STRUCTURE[name].si_factor,
                {"units": STRUCTURE[name].unit, "long_name": STRUCTURE[name].doc},
            )
            for name in MODES
        },
        coords={"spindle_speed": speeds, "mode": numbers},
    )


def _seconds(settings: Settings, preload: float, method: MethodSettings) -> float:
    """Return the seconds of one lobe diagram with all modes, in this process on one core."""
    grid = settings.grid
    with threadpool_limits(1):
        began = time.perf_counter()
        lobe_block(
            settings.machine.with_preload(preload),
            spindle_speed=grid.spindle_speed_rpm.points() * SUFFIXES["rpm"][0],
            axial_depth=grid.axial_depth_mm.points() * SUFFIXES["mm"][0],
            mode_count=int(grid.mode_count.points()[-1]),
            modal_parameters="dynamic",
            method=method,
        )
        return time.perf_counter() - began


def table(found: list[Finding], seconds: str, pictures: list[Path]) -> str:
    """Return the findings as a page of Markdown."""
    lines = [
        "# What the paper reports, and what this model says to it",
        "",
        '"Effects of spindle speed-dependent dynamic characteristics of ball bearing and multi-modes on the stability '
        "of milling processes\", on the reference machine. The paper's own geometry and cutting data are incomplete; "
        "findings are compared in kind.",
        "",
        "| | the paper | found here | holds |",
        "| --- | --- | --- | --- |",
        *(f"| {f.name} | {f.claim} | {f.found} | {f.holds} |" for f in found),
        "",
        *(line for f in found if f.why for line in (f"{f.name}: {f.why}", "")),
        seconds,
        "",
        *(line for picture in pictures for line in (f"![{picture.stem}](figures/{picture.name})", "")),
    ]
    return "\n".join(lines)
