"""The paper's method by two codes: full companion matrices multiplied out, and the operator of this program.

Equations 34 to 46 of "Effects of spindle speed-dependent dynamic characteristics of ball bearing and
multi-modes on the stability of milling processes": the benchmark's plain code follows them to the letter.
"""

import numpy as np
import pytest

from benchmarks.plain import spectral_radius
from chatter_core.floquet import MethodSettings, analyse
from tests.conftest import milling_benchmark


@pytest.mark.parametrize(
    ("direction", "immersion", "axes"), [("down", 0.5, (0, 1)), ("up", 0.1, (0,)), ("slot", 1.0, (0,))]
)
def test_order_zero_is_the_papers_method(direction, immersion, axes):
    equation = milling_benchmark(
        direction=direction, immersion=immersion, rpm=[5000.0, 9000.0], depth_mm=[2.0, 0.7], axes=axes
    )
    method = MethodSettings(name="semi_discretization", order=0, intervals=40)
    found = np.abs(analyse(equation, method).multiplier)
    plain = [spectral_radius(equation, point) for point in range(2)]
    # The mean of a gain over an interval in which a tooth enters is found by finer parts there: 1e-3 of it.
    assert found == pytest.approx(plain, rel=2e-3)
    if (direction, immersion, axes) == ("down", 0.5, (0, 1)):
        assert plain[0] == pytest.approx(6.41, abs=0.006)
