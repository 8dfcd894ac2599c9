"""The study that is measured: chunks of one speed whose numbers cost nothing, written as any others."""

from pathlib import Path

from chatter_core.variables import SWEEP
from pipeline.configuration import compose_settings, words_for
from pipeline.settings import Settings
from pipeline.verbs.studies import SweepOptions

#: Variables that are written chunk by chunk.
CHUNKED = (*SWEEP, "status")
#: Computes a chunk in microseconds; everything else is as it is with the physics.
KERNEL = "tests.pipeline.standins:plain"
#: Chunks for each speed: 2 kinds of parameters x 10 preloads x 4 numbers of modes.
PER_SPEED = 80
DEPTHS = 4


def study(chunks: int, cluster: str = "local") -> Settings:
    """Return a study of so many chunks, a multiple of PER_SPEED, of DEPTHS cells each."""
    speeds = chunks // PER_SPEED
    if speeds * PER_SPEED != chunks or speeds < 2:
        raise SystemExit(f"--chunks: found {chunks}, allowed: multiples of {PER_SPEED} from {2 * PER_SPEED}")
    words = [
        "study=smoke",
        f"grid.spindle_speed_rpm={{start: 6000, stop: 16000, count: {speeds}}}",
        f"grid.axial_depth_mm={{start: 0.5, stop: 2, count: {DEPTHS}}}",
        "grid.preload_n={start: 50, stop: 500, count: 10}",
        "grid.mode_count=[1, 2, 3, 4]",
        "grid.modal_parameters=[dynamic, static]",
        f"cluster.cells_per_task={DEPTHS}",
        f"cluster={cluster}",
    ]
    return compose_settings(words_for(SweepOptions, words))


def folder_of(root: Path, chunks: int) -> Path:
    """Return where the study of so many chunks lies."""
    return root / f"study-{chunks}"
