"""Whole tasks: a lobe diagram, modes over speed, a set of trials, and a study on one and two workers."""

import json
import subprocess
import sys
import tempfile
import time
from datetime import datetime
from pathlib import Path

import numpy as np
import psutil

from benchmarks.cases import RPM
from benchmarks.clock import median_seconds
from benchmarks.points import DEFAULT, radii
from chatter_core.chain import milling_equation, structure
from chatter_core.effects import activate, apply_effects
from chatter_core.lobes import lobe_block
from pipeline.configuration import compose_settings, sort_words

#: Step in ln(depth) from which the slope of ln(spectral radius) is taken.
SLOPE_STEP = 1e-3
#: Runout that makes teeth unlike.
RUNOUT_UM = 10.0


def single_lines() -> list[str]:
    """Return sentences on tasks of one core."""
    machine = compose_settings(sort_words(["study=reference"], ())).machine
    speed = np.linspace(2_000.0, 24_000.0, 221) * RPM
    random = np.random.default_rng(5)
    trial_speed = random.uniform(4_000.0, 20_000.0, 150) * RPM
    trial_depth = random.uniform(0.3e-3, 2e-3, 150)
    given = structure(machine, trial_speed, mode_count=4)
    uneven = apply_effects(machine, [activate("tool_runout", {"runout_um": RUNOUT_UM, "phase_deg": 0.0})])

    def diagram(cells: str) -> None:
        lobe_block(
            machine,
            spindle_speed=speed,
            axial_depth=np.linspace(0.1e-3, 6e-3, 60),
            mode_count=4,
            modal_parameters="dynamic",
            method=DEFAULT,
            cells=cells,
        )

    def modes() -> None:
        for preload in (50.0, 100.0, 200.0, 400.0):
            structure(machine.with_preload(preload), speed, mode_count=4)

    def trials(built: object = None, stages: object = machine) -> None:
        built = built or structure(machine, trial_speed, mode_count=4)
        index = np.tile(np.arange(150), 2)
        depth = np.concatenate([trial_depth, trial_depth * np.exp(SLOPE_STEP)])
        radius = radii(milling_equation(stages, built, index, depth), DEFAULT)
        np.log(radius[150:] / radius[:150]) / SLOPE_STEP

    told = []
    for name, work in (
        ("D: a lobe diagram of C, 221 speeds, 60 depths, with limit depths, every cell", lambda: diagram("all")),
        ("D: the same, evaluated where needed", lambda: diagram("adaptive")),
        ("F: bearing and modes, 221 speeds, 4 preloads", modes),
        ("G: 150 trials, spectral radii and their slope over depth, modes given", lambda: trials(given)),
        ("G: the same with bearing and modes anew", trials),
        (
            f"G: as the first, with {RUNOUT_UM:g} um of runout and the motion it forces",
            lambda: trials(given, uneven),
        ),
    ):
        told.append(f"{name}: {1e3 * median_seconds(work):.0f} ms.  ")
    return told


def study_lines() -> list[str]:
    """Run the reference study on one and two workers; return time, parallel efficiency and memory."""
    told = [
        "| E: reference study, workers | seconds from first chunk to last | seconds, start to report | cells a second |"
        " largest process, MiB |",
        "| --- | --- | --- | --- | --- |",
    ]
    computing = {}
    for workers in (1, 2):
        with tempfile.TemporaryDirectory() as folder:
            began = time.perf_counter()
            memory = _run(Path(folder) / "study", workers)
            whole = time.perf_counter() - began
            events = [json.loads(text) for text in (Path(folder) / "study" / "journal.jsonl").read_text().splitlines()]
        chunks = [event for event in events if event["event"] == "chunk"]
        first, last = (datetime.fromisoformat(chunks[place]["time"]) for place in (0, -1))
        # What is done by the time of the first chunk was done before the clock started.
        cells = sum(sum(event["counts"].values()) for event in chunks[1:])
        computing[workers] = (last - first).total_seconds()
        told.append(
            f"| {workers} | {computing[workers]:.1f} | {whole:.1f} | {cells / computing[workers]:.0f} | {memory:.0f} |"
        )
    efficiency = computing[1] / (2.0 * computing[2])
    return [*told, "", f"Parallel efficiency on two workers: {100.0 * efficiency:.0f} %."]


def _run(output: Path, workers: int) -> float:
    """Run the study and return the largest memory that any of its processes took [MiB]."""
    command = [sys.executable, "-m", "pipeline", "sweep", "study=reference", f"cluster.workers={workers}"]
    process = subprocess.Popen([*command, f"output={output}"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    largest, watched = 0.0, psutil.Process(process.pid)
    while process.poll() is None:
        for child in watched.children(recursive=True):
            try:
                largest = max(largest, child.memory_info().rss / 1024**2)
            except psutil.NoSuchProcess:
                continue
        time.sleep(0.2)
    if process.returncode:
        raise SystemExit(f"the study ended with exit code {process.returncode}")
    return largest
