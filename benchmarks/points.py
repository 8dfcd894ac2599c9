"""Microseconds and errors of single operating points: the default, orders 0 to 2 at its error, and plain code."""

import time

import numpy as np

from benchmarks.cases import Case, cases, many_modes
from benchmarks.clock import median_seconds
from benchmarks.plain import spectral_radius
from chatter_core.floquet import DelayEquation, MethodSettings, compiled, critical_motion
from chatter_core.floquet.collocation import NODES
from chatter_core.floquet.multipliers import WARM_UP
from chatter_core.floquet.ritz import SQUARINGS

DEFAULT = MethodSettings(name="collocation", tolerance=1e-4)
#: Points for the program's method, for orders 0 to 2, and for the plain code, which takes half a second each.
POINTS, SOME_POINTS, PLAIN_POINTS = 1024, 64, 4
#: Points analysed at once, as the program does it.
BATCH = 256
#: Refinement of what errors are measured against, and where they are asked for.
REFERENCE, NEAR = 3.0, (0.9, 1.1)
#: Intervals tried for orders 0 to 2 until their error near the boundary is that of the default or less.
INTERVALS = (40, 80, 160, 320, 640)
HEADER = (
    "| case | method | us a point | error near the boundary | times faster than plain |",
    "| --- | --- | --- | --- | --- |",
)


def radii(equation: DelayEquation, method: MethodSettings, refinement: float = 1.0) -> np.ndarray:
    """Return the spectral radii of all points."""
    return np.abs(critical_motion(equation, method, refinement).multiplier)


def worst(found: np.ndarray, exact: np.ndarray) -> float:
    """Return the largest relative error near the boundary, zero without a point there."""
    near = (exact > NEAR[0]) & (exact < NEAR[1])
    return float(np.max(np.abs(found / exact - 1.0)[near], initial=0.0))


def line(case: Case, method: str, seconds: float, error: float, plain: float) -> str:
    return f"| {case.name} | {method} | {1e6 * seconds:.0f} | {error:.1e} | {plain / seconds:.0f} |"


def rows_of(case: Case) -> list[str]:
    """Measure one case."""
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
        line(case, "collocation (default)", seconds, error, plain),
        line(
            case,
            "plain order 0, n = 40, error at its points",
            plain,
            float(np.max(np.abs(found / exact_few - 1.0))),
            plain,
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
        rows.append(line(case, f"order {order}, n = {intervals}", taken, reached, plain))
    return rows


def counted_operations(equation: DelayEquation) -> float:
    """Return the multiplications of a point: integrals, inverses, Krylov space and filter at its usual size."""
    operator = compiled.build(equation)
    elements = float(np.take_along_axis(operator.cuts, operator.piece, axis=1).sum(axis=1).mean())
    tables = float((operator.cuts & (operator.table == np.arange(operator.cuts.shape[1]))).sum(axis=1).mean())
    values, parts = operator.solve.shape[-1], operator.states
    poles, steps = parts // 2, parts + parts // 8 + 4
    seen = 2.0 * NODES * float(np.diff(operator.sees, axis=1).sum())
    pushed = 2.0 * NODES * float(np.diff(operator.pushes, axis=1).sum())
    once = seen + values**2 + operator.gain[0, 0].size + pushed
    size = parts + elements * values
    return (
        tables * poles * 12.0 * 2.0 * (NODES + 1) * NODES
        + elements * values**3
        + (steps + WARM_UP) * elements * once
        + size * steps**2
        + (SQUARINGS * steps**3 if steps > 12 else 10.0 * steps**3)
    )


def floor_lines() -> list[str]:
    """Set the time of a point beside that of its operations at DGEMM's rate."""
    square = np.random.default_rng(0).normal(size=(512, 512))
    rate = 512.0**3 / median_seconds(lambda: square @ square)
    told = [f"DGEMM does {rate / 1e9:.1f} multiplications a nanosecond.", ""]
    told += [
        "| case | multiplications a point | us at DGEMM's rate | us taken | share |",
        "| --- | --- | --- | --- | --- |",
    ]
    for case in cases():
        equation = case.equation(BATCH)
        count = counted_operations(equation)
        taken = 1e6 * median_seconds(lambda equation=equation: radii(equation, DEFAULT)) / BATCH
        floor = 1e6 * count / rate
        told.append(f"| {case.name} | {count:.3g} | {floor:.1f} | {taken:.1f} | {100.0 * floor / taken:.0f} % |")
    return told


def growth_lines() -> list[str]:
    """Return the cost of a point over number of modes, resolution and points at once."""
    told = ["| what grows | value: us a point | |", "| --- | --- | --- |"]

    def microseconds(equation: DelayEquation, refinement: float = 1.0) -> str:
        points = len(equation)
        return f"{1e6 * median_seconds(lambda: radii(equation, DEFAULT, refinement)) / points:.0f}"

    modes = ", ".join(f"{n}: {microseconds(many_modes(n).equation(BATCH))}" for n in (1, 2, 4, 8, 16))
    told.append(f"| modes in x and y, all within 500 to 2500 Hz | {modes} | between linear and cubic |")
    middle = cases()[3].equation(BATCH)
    finer = ", ".join(f"{r:g}: {microseconds(middle, r)}" for r in (1.0, 2.0, 4.0, 8.0))
    told.append(f"| resolution, C at 4000 to 10000 rpm | {finer} | linear |")
    together = ", ".join(f"{n}: {microseconds(cases()[3].equation(n))}" for n in (1, 16, 256, 1024))
    told.append(f"| points at once, the same | {together} | constant, but for what a batch costs |")
    return told
