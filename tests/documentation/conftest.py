"""Fixtures of all tests in this folder."""

from tests.coarse_lobes import drawn_coarsely

__all__ = ["drawn_coarsely"]
