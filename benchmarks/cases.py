"""The cases: equations of random operating points, from one mode to the reference machine."""

from dataclasses import dataclass

import numpy as np

from chatter_core.chain import milling_equation, structure
from chatter_core.floquet import DelayEquation
from chatter_core.machine import Machine
from chatter_core.units import SUFFIXES
from pipeline.configuration import compose_settings, sort_words

RPM = SUFFIXES["rpm"][0]
#: Seed of every random choice.
SEED = 4


@dataclass(frozen=True, kw_only=True)
class Case:
    """Operating points of one machine: speeds [rpm] and depths [mm] are drawn evenly from two ranges."""

    name: str
    machine: Machine
    modes: int
    speeds: tuple[float, float]
    depths: tuple[float, float]

    def equation(self, points: int, seed: int = 0) -> DelayEquation:
        """Return the delay equations of random points, each at a speed of its own."""
        random = np.random.default_rng([SEED, seed])
        speed = random.uniform(*self.speeds, points) * RPM
        depth = random.uniform(*self.depths, points) * 1e-3
        built = structure(self.machine, speed, mode_count=self.modes)
        return milling_equation(self.machine, built, np.arange(points), depth)


def cases() -> list[Case]:
    """Return the cases A to C in the order of their size."""
    reference = compose_settings(sort_words(["study=reference"], ())).machine
    return [
        Case(
            name="A: one mode in x, two straight teeth, a/D 0.1 down",
            machine=_two_teeth(("x",), 0.1),
            modes=1,
            speeds=(5_000.0, 25_000.0),
            depths=(0.1, 10.0),
        ),
        Case(
            name="B: one mode in x and y, two straight teeth, a/D 0.5 down",
            machine=_two_teeth(("x", "y"), 0.5),
            modes=1,
            speeds=(5_000.0, 25_000.0),
            depths=(0.1, 5.0),
        ),
        *(
            Case(
                name=f"C: reference machine, four modes, helix, {low:g} to {high:g} rpm",
                machine=reference,
                modes=4,
                speeds=(low, high),
                depths=(0.1, 3.0),
            )
            for low, high in ((2_000.0, 4_000.0), (4_000.0, 10_000.0), (10_000.0, 20_000.0))
        ),
    ]


def many_modes(modes: int) -> Case:
    """Return a case of many modes in x and y, 500 to 2500 Hz, on the two-tooth cut: what cost grows with."""
    tip = [
        {
            "axis": axis,
            "natural_frequency_hz": float(frequency) * (1.0 if axis == "x" else 1.03),
            "damping_ratio": 0.03,
            "stiffness_n_um": 10.0,
        }
        for axis in ("x", "y")
        for frequency in np.linspace(2_500.0, 500.0, modes)
    ]
    machine = Machine.model_validate({**_cut(0.5), "tip": {"modes": tip}})
    return Case(name=f"{modes} modes", machine=machine, modes=modes, speeds=(5_000.0, 25_000.0), depths=(0.1, 5.0))


def _two_teeth(axes: tuple[str, ...], immersion: float) -> Machine:
    """Return the benchmark of T. Insperger and G. Stepan, Int. J. Numer. Meth. Engng 61 (2004) 117-141."""
    stiffness = 0.03993 * (2.0 * np.pi * 922.0) ** 2 * 1e-6
    mode = {"natural_frequency_hz": 922.0, "damping_ratio": 0.011, "stiffness_n_um": stiffness}
    return Machine.model_validate({**_cut(immersion), "tip": {"modes": [{"axis": axis, **mode} for axis in axes]}})


def _cut(immersion: float) -> dict[str, dict[str, object]]:
    """Return tool, cutting and process of the two-tooth benchmark."""
    return {
        "tool": {"teeth": 2, "diameter_mm": 10.0, "helix_angle_deg": 0.0, "rake_angle_deg": 0.0},
        "cutting": {"kt_mpa": 600.0, "kn": 1.0 / 3.0, "friction_coefficient": 0.0},
        "process": {"direction": "down", "radial_immersion": immersion, "feed_per_tooth_mm": 0.1},
    }
