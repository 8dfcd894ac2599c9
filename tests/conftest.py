"""The reference machine and small builders of equations shared by the tests."""

import math
from importlib import resources

import numpy as np
import pytest
import yaml

from chatter_core.cutting import CuttingGain, ForceCoefficients, engagement
from chatter_core.floquet import DelayedFeedback, DelayEquation, LinearSystem, MethodSettings
from chatter_core.machine import Machine, Process, Tool
from chatter_core.teeth import equal_teeth, passages
from chatter_core.tip import TipModes, state_space

COLLOCATION = MethodSettings(name="collocation", tolerance=1e-4)


#: Files that take a minute of a processor or more, the longest first.
LONGEST = ("test_tutorial.py", "test_blind.py", "test_compare.py", "test_starts.py", "test_interruption.py")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes longest: files are spread over processes, and none should be left with it in the end."""
    items.sort(key=lambda item: LONGEST.index(item.path.name) if item.path.name in LONGEST else len(LONGEST))


@pytest.fixture(scope="session")
def reference_machine() -> Machine:
    """The machine of the reference study, read from the shipped configs."""
    configs = resources.files("configs")
    groups = {
        "bearing": "b7009c",
        "spindle": "reference",
        "tool": "endmill_4x16",
        "cutting": "cast_iron",
        "process": "down_40",
    }
    return Machine.model_validate(
        {group: yaml.safe_load((configs / group / f"{name}.yaml").read_text()) for group, name in groups.items()}
    )


def milling_benchmark(
    *, direction: str, immersion: float, rpm: list[float], depth_mm: list[float], axes: tuple[int, ...]
) -> DelayEquation:
    """Two straight teeth on one mode of 922 Hz per axis: damping 0.011, 39.93 g, 600 and 200 MPa.

    The benchmark of T. Insperger and G. Stepan, Int. J. Numer. Meth. Engng 61 (2004) 117-141.
    """
    speed = np.asarray(rpm) * 2.0 * math.pi / 60.0
    tool = Tool(teeth=2, diameter_mm=10.0, helix_angle_deg=0.0, rake_angle_deg=0.0)
    gain = CuttingGain(
        axial_depth=np.asarray(depth_mm) * 1e-3,
        spindle_speed=speed,
        tool=tool,
        coefficients=ForceCoefficients(tangential=600e6, radial=200e6),
        passages=passages(
            equal_teeth(2),
            engagement(Process(direction=direction, radial_immersion=immersion, feed_per_tooth_mm=0.1)),
            1e-4,
        ),
    )
    one = np.ones((1, len(axes)))
    modes = TipModes(
        axis=np.array(axes),
        label=np.ones(len(axes), dtype=int),
        natural_frequency=922.0 * 2.0 * math.pi * one,
        damping_ratio=0.011 * one,
        modal_mass=0.03993 * one,
        tracking_confidence=one,
    )
    space = state_space(modes)
    return DelayEquation(
        system=LinearSystem(
            state_matrix=space.state_matrix, input_matrix=space.input_matrix, output_matrix=space.output_matrix
        ),
        system_index=np.zeros(len(rpm), dtype=int),
        feedback=(DelayedFeedback(gain=gain, delay=gain.tooth_period),),
        period=gain.tooth_period,
        breakpoints=gain.breakpoints(),
    )


def oscillator(*, frequency: float, damping: float, mass: float, gain: float, period: float) -> DelayEquation:
    """Turning: m x'' + c x' + k x = -gain (x(t) - x(t - period)), constant in time."""
    system = LinearSystem(
        state_matrix=np.array([[[0.0, 1.0], [-(frequency**2), -2.0 * damping * frequency]]]),
        input_matrix=np.array([[[0.0], [1.0 / mass]]]),
        output_matrix=np.array([[[1.0, 0.0]]]),
    )
    feedback = DelayedFeedback(gain=lambda time: np.full((*time.shape, 1, 1), -gain), delay=np.array([period]))
    return DelayEquation(
        system=system,
        system_index=np.zeros(1, dtype=int),
        feedback=(feedback,),
        period=np.array([period]),
        breakpoints=np.zeros((1, 1)),
    )
