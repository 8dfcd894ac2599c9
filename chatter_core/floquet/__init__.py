"""Floquet analysis of linear periodic systems with delayed feedback; knows nothing of milling."""

from chatter_core.floquet.analysis import (
    FloquetSolution,
    analyse,
    analyse_leading,
    critical_motion,
    critical_multiplier,
    leading_multipliers,
)
from chatter_core.floquet.equation import DelayedFeedback, DelayEquation, Gain, LinearSystem, Spectrum
from chatter_core.floquet.method import MethodSettings

__all__ = [
    "DelayEquation",
    "DelayedFeedback",
    "FloquetSolution",
    "Gain",
    "LinearSystem",
    "MethodSettings",
    "Spectrum",
    "analyse",
    "analyse_leading",
    "critical_motion",
    "critical_multiplier",
    "leading_multipliers",
]
