"""Following modes through speed, so that the first mode stays the same mode.

Frequencies veer: two modes come close, exchange their shapes and part again. Modes are therefore
told by shape, from standstill along a path of speeds that is the same for every question asked,
whatever grid it comes from. The measure is the modal assurance criterion in the mass norm,
(phi_a^T M phi_b)^2 for normalised modes. Source: R. J. Allemang, Sound and Vibration 37 (2003) 14-23.
"""

import numpy as np
import scipy.optimize
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Step of the path from standstill [rad/s] (250 rpm).
PATH_STEP = 250.0 * 2.0 * np.pi / 60.0
#: Modes beyond those asked for among which a partner is looked for.
SPARE_MODES = 4


def path_to(spindle_speed: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return a path of speeds (path,) [rad/s] from standstill, and the place of each speed on it.

    The path holds every multiple of the step up to the highest speed, and the speeds themselves.

    See docs/physics.md#modes-through-speed.
    """
    steps = np.arange(int(np.floor(spindle_speed.max(initial=0.0) / PATH_STEP)) + 1) * PATH_STEP
    path, place = np.unique(np.concatenate([steps, spindle_speed]), return_inverse=True)
    return path, place[len(steps) :]


def follow_modes(path: Array, shapes: Array, mode_count: int) -> tuple[NDArray[np.intp], Array]:
    """Follow the lowest modes from the first speed of a path.

    path: (speed,) ascending [rad/s]; shapes: (speed, shape, mode), mass-orthonormal, ascending in
    frequency. Each speed is compared with the last multiple of the path's step below it, so that
    speeds between do not change the answer.

    Returns the index of each followed mode at each speed, and the least assurance met on the way
    to it, both (speed, mode_count).

    See docs/physics.md#modes-through-speed.
    """
    reach = min(mode_count + SPARE_MODES, shapes.shape[-1])
    index = np.empty((len(path), mode_count), dtype=np.intp)
    confidence = np.empty((len(path), mode_count))
    anchor = 0
    index[0], confidence[0] = np.arange(mode_count), 1.0
    for place in range(1, len(path)):
        before = shapes[anchor][:, index[anchor]]
        assurance = (before.T @ shapes[place][:, :reach]) ** 2
        kept, partner = scipy.optimize.linear_sum_assignment(assurance, maximize=True)
        index[place, kept] = partner
        confidence[place] = np.minimum(confidence[anchor], assurance[kept, partner])
        multiple = path[place] / PATH_STEP
        if abs(multiple - round(multiple)) < 1e-9 * max(1.0, multiple):
            anchor = place
    return index, confidence
