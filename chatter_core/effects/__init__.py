"""Physical effects beyond the base model: one file an effect, one named stage, found by its name."""

from chatter_core.effects._base import REFERENCE_SPEED, Effect, Scan, Setting
from chatter_core.effects._finding import effect_class, effect_names, own_digest, own_effects
from chatter_core.effects._using import ActiveEffect, activate, apply_effects, variants

__all__ = [
    "REFERENCE_SPEED",
    "ActiveEffect",
    "Effect",
    "Scan",
    "Setting",
    "activate",
    "apply_effects",
    "effect_class",
    "effect_names",
    "own_digest",
    "own_effects",
    "variants",
]
