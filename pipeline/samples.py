"""What a data set holds of one machine: its structure over speed, and the limit depths of its cuts."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from chatter_core.chain import structure_variables
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import lobe_block
from chatter_core.stages import Stages
from chatter_core.variables import DATASET, STRUCTURE

Array = NDArray[np.float64]
#: Variable of a data set -> what holds it in the lobes of a cut, and whether there is one for each crossing.
OF_LOBES = {name: name.startswith("limit_") for name in DATASET if name not in STRUCTURE}


def machine_sample(
    cuts: Sequence[Stages],
    *,
    spindle_speed: Array,
    deepest: float,
    mode_count: int,
    modal_parameters: str,
    method: MethodSettings,
) -> tuple[dict[str, Array], NDArray[np.uint8]]:
    """Return the variables of ``DATASET`` of one machine, in SI, and the status (cut, speed).

    cuts: the machine with each of its cuts, whose modes are the same; spindle_speed: (speed,) [rad/s]; deepest: depth
    down to which limit depths are looked for [m]. Arrays are (speed, ...) of the structure, (cut, speed) of the limits.

    Raises InvalidInput when the machine has fewer modes than ``mode_count``.
    """
    found = structure_variables(cuts[0], spindle_speed, mode_count=mode_count, modal_parameters=modal_parameters)
    blocks = [
        lobe_block(
            cut,
            spindle_speed=spindle_speed,
            axial_depth=np.array([deepest]),
            mode_count=mode_count,
            modal_parameters=modal_parameters,
            method=method,
            cells="adaptive",
        )
        for cut in cuts
    ]
    for name, each_crossing in OF_LOBES.items():
        arrays = [getattr(block, name) for block in blocks]
        found[name] = np.stack([array[:, 0] if each_crossing else array for array in arrays])
    return found, np.stack([block.status[:, 0] for block in blocks])
