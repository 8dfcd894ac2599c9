"""Corrections without a formula, where no effect explains what is left: what must change, by how much, against what."""

from chatter_core.evidence.corrections.fitted import (
    Corrected,
    Told,
    checks_failed,
    corrected_model,
    fit_correction,
    mending,
    told,
)
from chatter_core.evidence.corrections.terms import Correction, corrections_of, measured_places

__all__ = [
    "Corrected",
    "Correction",
    "Told",
    "checks_failed",
    "corrected_model",
    "corrections_of",
    "fit_correction",
    "measured_places",
    "mending",
    "told",
]
