"""The stages of the chain and the terms that exchange them, as comparisons with measurements use them."""

from chatter_core.stages import ComplexArray, Indices, Stages, Term, apply_terms

__all__ = ["ComplexArray", "Indices", "Stages", "Term", "apply_terms"]
