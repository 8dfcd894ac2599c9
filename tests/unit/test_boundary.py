"""What is known of a cut in which several motions grow."""

from types import SimpleNamespace
from typing import cast

import numpy as np

from chatter_core.evidence.boundary import _Cells, _sureness

#: A fast motion whose growth moves by 0.1 with a deviation of the only parameter, and a slow one that moves by 0.001.
SLOPES = np.array([0.1, 0.001])
GROWTH, FREQUENCY = np.array([[0.05, 0.02], [0.05, -0.02]]), np.array([[900.0, 1500.0], [900.0, 1500.0]])


def motions(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two cells; the slow motion grows in the first, and in both the order changes where the parameter is moved."""
    moved = GROWTH + SLOPES * values[0]
    order = np.argsort(-moved, axis=1) if values[0] == 0.0 else np.array([[1, 0], [1, 0]])
    return np.take_along_axis(moved, order, axis=1), np.take_along_axis(FREQUENCY, order, axis=1)


def test_the_surest_of_the_growing_motions_counts_whatever_their_order() -> None:
    cells = cast(_Cells, SimpleNamespace(motions=motions))
    found = _sureness(cells, np.zeros(1), [(0, np.array([0.03]), 0.03)], np.eye(1))
    # 0.02 / 0.001 of the slow motion where that one grows, 0.05 / 0.1 of the fast one where it is alone.
    np.testing.assert_allclose(found, [20.0, 0.5], rtol=1e-12)
