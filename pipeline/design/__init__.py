"""Designs of data sets and parameter studies: which machines and which cuts, drawn or laid out."""

from pipeline.design.described import Description, described
from pipeline.design.drawing import PARTS, Drawn, draw
from pipeline.design.settings import CUT_PARTS, Design, Level, first_of_cuts, varied_of
from pipeline.design.study import DatasetSettings

__all__ = [
    "CUT_PARTS",
    "PARTS",
    "DatasetSettings",
    "Description",
    "Design",
    "Drawn",
    "Level",
    "described",
    "draw",
    "first_of_cuts",
    "varied_of",
]
