"""The stand-in for the physics that notes every chunk it begins."""

import os
import time
from typing import Any

from chatter_core.lobes import LobeBlock
from chatter_core.stages import stages_of
from tests.pipeline.standins import plain
from tests.soak.harness import LOG

#: Seconds that a chunk takes.
DURATION = 0.02


def logged(model: Any, **cells: Any) -> LobeBlock:
    """Note the chunk, in one write so that lines of several processes do not mix, and compute it."""
    preload = stages_of(model).machine.spindle.preload
    with open(os.environ[LOG], "a", buffering=1) as log:
        log.write(f"{preload:g}/{cells['mode_count']}/{cells['spindle_speed'][0]:.9g}\n")
    time.sleep(DURATION)
    return plain(model, **cells)
