"""Designs of data sets and parameter studies: which machines and which cuts, drawn or laid out."""

from pipeline.design.described import Description, described
from pipeline.design.drawing import PARTS, Drawn, draw
from pipeline.design.settings import Design, Level, varied_of
from pipeline.design.study import DatasetSettings

__all__ = ["PARTS", "DatasetSettings", "Description", "Design", "Drawn", "Level", "described", "draw", "varied_of"]
