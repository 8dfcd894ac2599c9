"""Measure speed and error side by side and write a table: ``python -m benchmarks [output=FILE]``."""

import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.cases import RPM, Case, cases
from benchmarks.plain import spectral_radius
from chatter_core.chain import milling_equation, structure
from chatter_core.floquet import DelayEquation, MethodSettings, analyse, collocation
from chatter_core.lobes import lobe_block
from pipeline.configuration import compose_settings, sort_words

DEFAULT = MethodSettings(name="collocation", tolerance=1e-4)
#: Points for the program's method, for orders 0 to 2, and for the plain code, which takes half a second each.
POINTS, SOME_POINTS, PLAIN_POINTS = 256, 64, 4
REPEATS = 5
#: Points analysed at once, as the program does it.
BATCH = 64
#: Refinement of what errors are measured against, and where they are asked for.
REFERENCE, NEAR = 3.0, (0.9, 1.1)
#: Intervals tried for orders 0 to 2 until their error near the boundary is that of the default or less.
INTERVALS = (40, 80, 160, 320, 640)


@dataclass(frozen=True, kw_only=True)
class Row:
    """One line of the table."""

    case: str
    method: str
    microseconds: float
    error: float
    ratio: float


def median_seconds(work: Callable[[], object]) -> float:
    """Return the median time of some repeats, after one to warm up."""
    work()
    taken = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


def radii(equation: DelayEquation, method: MethodSettings, refinement: float = 1.0) -> np.ndarray:
    """Return the spectral radii of all points."""
    return np.abs(analyse(equation, method, refinement).multiplier)


def worst(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest relative error near the boundary, zero without a point there."""
    near = (exact > NEAR[0]) & (exact < NEAR[1])
    return float(np.max(np.abs(found / exact - 1.0)[near], initial=0.0))


def rows_of(case: Case) -> list[Row]:
    """Measure one case: the default, orders 0 to 2 at its error, and the plain code."""
    parts = [case.equation(BATCH, seed) for seed in range(POINTS // BATCH)]
    exact = np.concatenate([radii(part, DEFAULT, REFERENCE) for part in parts])
    error = worst(np.concatenate([radii(part, DEFAULT) for part in parts]), exact)
    seconds = median_seconds(lambda: [radii(part, DEFAULT) for part in parts]) / POINTS

    few = case.equation(PLAIN_POINTS)
    exact_few = radii(few, DEFAULT, REFERENCE)
    began = time.perf_counter()
    found = np.array([spectral_radius(few, point) for point in range(PLAIN_POINTS)])
    plain = (time.perf_counter() - began) / PLAIN_POINTS
    rows = [
        Row(
            case=case.name,
            method="collocation (default)",
            microseconds=1e6 * seconds,
            error=error,
            ratio=plain / seconds,
        ),
        Row(
            case=case.name,
            method="plain order 0, n = 40, error at its points",
            microseconds=1e6 * plain,
            error=float(np.max(np.abs(found / exact_few - 1.0))),
            ratio=1.0,
        ),
    ]
    some = case.equation(SOME_POINTS)
    exact_some = radii(some, DEFAULT, REFERENCE)
    for order in (0, 1, 2):
        for intervals in INTERVALS:
            method = MethodSettings(name="semi_discretization", order=order, intervals=intervals)
            reached = worst(radii(some, method), exact_some)
            if reached <= max(error, 1e-4):
                break
        taken = median_seconds(lambda method=method: radii(some, method)) / SOME_POINTS
        rows.append(
            Row(
                case=case.name,
                method=f"order {order}, n = {intervals}",
                microseconds=1e6 * taken,
                error=reached,
                ratio=plain / taken,
            )
        )
    return rows


def counted_rate(case: Case) -> tuple[float, float]:
    """Return the multiplications of a point's operator, applied thirty times, and DGEMM's rate [1/s]."""
    operator = collocation.build(case.equation(BATCH))
    elements, size = operator.element_map.shape[1:3]
    values = size - operator.states
    solve = values**3 / 3.0 + values**2 * size + operator.states * values * size
    square = np.random.default_rng(0).normal(size=(512, 512))
    return elements * (solve + 30.0 * size**2), 512.0**3 / median_seconds(lambda: square @ square)


def main(words: list[str]) -> int:
    """Measure, print and write the table."""
    output = Path(dict(word.split("=", 1) for word in words).get("output", "results/bench.md"))
    lines = [
        "| case | method | us a point | error near the boundary | times faster than plain |",
        "| --- | --- | --- | --- | --- |",
    ]
    with threadpool_limits(1):
        for case in cases():
            print(case.name)
            for row in rows_of(case):
                lines.append(
                    f"| {row.case} | {row.method} | {row.microseconds:.0f} | {row.error:.1e} | {row.ratio:.0f} |"
                )
                print("  " + lines[-1])
        lines += ["", *_whole_tasks()]
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"written: {output}")
    return 0


def _whole_tasks() -> list[str]:
    """Return sentences on whole tasks: a lobe diagram, modes over speed, a set of trials, DGEMM's share."""
    machine = compose_settings(sort_words(["study=reference"], ())).machine
    speed = np.linspace(2_000.0, 24_000.0, 221) * RPM
    random = np.random.default_rng(5)
    trials = random.uniform(4_000.0, 20_000.0, 150) * RPM, random.uniform(0.3e-3, 2e-3, 150)

    def diagram() -> None:
        lobe_block(
            machine,
            spindle_speed=speed,
            axial_depth=np.linspace(0.1e-3, 6e-3, 60),
            mode_count=4,
            modal_parameters="dynamic",
            method=DEFAULT,
        )

    def modes() -> None:
        for preload in (50.0, 100.0, 200.0, 400.0):
            structure(machine.with_preload(preload), speed, mode_count=4)

    def trial_set() -> None:
        built = structure(machine, trials[0], mode_count=4)
        radii(milling_equation(machine, built, np.arange(150), trials[1]), DEFAULT)

    told = []
    for name, work in (
        ("D: a lobe diagram of C, 221 speeds, 60 depths, with limit depths", diagram),
        ("F: bearing and modes, 221 speeds, 4 preloads", modes),
        ("G: 150 trials, modes and spectral radii", trial_set),
    ):
        began = time.perf_counter()
        work()
        told.append(f"{name}: {1e3 * (time.perf_counter() - began):.0f} ms.")
        print(told[-1])
    for case in cases():
        count, rate = counted_rate(case)
        told.append(f"{case.name}: {count:.3g} multiplications a point, {1e6 * count / rate:.1f} us at DGEMM's rate.")
        print(told[-1])
    return told


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
