"""Corrections without a formula, where no effect explains what is left: what must change, by how much, against what."""

from chatter_core.evidence.corrections.fitted import Corrected, Told, fit_correction, told
from chatter_core.evidence.corrections.terms import Correction, corrections_of

__all__ = ["Corrected", "Correction", "Told", "corrections_of", "fit_correction", "told"]
