"""Two studies held against each other: what was asked otherwise, and what became of the boundary of stability."""

from pipeline.contrast.verb import run

__all__ = ["run"]
