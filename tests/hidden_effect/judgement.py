"""What a cut is judged to be: the motion that does not repeat, its size, its trend and its strongest line."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

OUTCOMES = ("stable", "marginal", "chatter")
#: Sizes of the motion that does not repeat, over the feed per tooth: below the first a cut is stable, above the
#: second it chatters; between them it is marginal unless it is dying out.
QUIET, LOUD = 0.008, 0.12
#: A motion is dying out when its second half is smaller than the first by this factor.
DYING = 0.75


def not_repeating(motion: Array, period: int) -> Array:
    """Return the motion (step, 2) without what every ``period`` steps repeat; whole periods only, the last ones."""
    whole = len(motion) // period * period
    folded = motion[len(motion) - whole :].reshape(-1, period, 2)
    return np.asarray((folded - folded.mean(axis=0)).reshape(-1, 2))


def outcome(motion: Array, period: int, feed_per_tooth: float) -> str:
    """Return the outcome of a cut whose observed motion this is (step, 2) [m]."""
    half = len(motion) // 2
    sizes = [np.sqrt((not_repeating(part, period) ** 2).sum(axis=1).mean()) for part in (motion[:half], motion[half:])]
    size = sizes[1] / feed_per_tooth
    if size < QUIET or (size < LOUD and sizes[1] < DYING * sizes[0]):
        return "stable"
    return "chatter" if size >= LOUD else "marginal"


def chatter_frequency(motion: Array, period: int, step_time: float) -> float:
    """Return the strongest line [Hz] of what does not repeat; between lines by a parabola through the logarithms."""
    rest = not_repeating(motion, period)
    window = np.hanning(len(rest))[:, None]
    power = (np.abs(np.fft.rfft(rest * window, axis=0)) ** 2).sum(axis=1)
    peak = int(np.argmax(power[1:-1])) + 1
    low, middle, high = np.log(power[peak - 1 : peak + 2])
    shift = 0.5 * (low - high) / (low - 2.0 * middle + high)
    return float((peak + shift) / (len(rest) * step_time))
