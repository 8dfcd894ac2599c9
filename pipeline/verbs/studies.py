"""Verbs that compute: a grid, a design, a point, the paper's two studies."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import ClassVar, Literal

from pydantic import Field

from chatter_core.machine import LEAST_PRELOAD, MOST_PRELOAD
from pipeline.verbs.options import MACHINE, BaseOptions, DirectoryPath, EffectOptions, Options, PlaceOptions, Truth

#: What begins a word that makes a key of a design vary, with a distribution or a list of values.
VARY = "vary."
#: What begins a word that makes a key of a design follow from others.
FORMULA = "formula."
RETRY = "cells that failed are computed again"
REPORT = "false: no tables, figures and page are written; the verb report writes them at any time"


class SweepOptions(BaseOptions, PlaceOptions):
    """Compute a grid of operating points into a store, with lobes, tables, figures and report.

    What is in the store already is not computed again: the same command goes on where it was, whatever interrupted it.
    Without output or store the study gets a folder of its own under results/.
    """

    examples = (
        "sweep study=smoke",
        "sweep study=reference spindle.preload_type=rigid grid.spindle_speed_rpm.count=441",
        "sweep machine=path/to/machine.yaml study=smoke output=my_results",
        "sweep study=overnight cluster=slurm cluster.job.count=8 cluster.job.walltime_min=120",
        "sweep study=overnight store=s3://bucket/machines/first",
    )
    groups: ClassVar[tuple[str, ...]] = (*MACHINE, "grid", "method", "cluster", "study")

    retry_failed: Truth = Field(default="false", description=RETRY)
    report: Truth = Field(default="true", description=REPORT)


class DatasetOptions(EffectOptions, PlaceOptions):
    """Compute machines and cuts of a design into a store: data sets to learn from, parameter studies, sensitivities.

    vary.KEY=VALUE lets a key vary, by a list of values or a distribution, formula.KEY=FORMULA lets one follow from
    others; design=FILE.yaml names a design of your own.
    Goes on where it was, as a sweep does.
    """

    examples = (
        "dataset study=dataset_small",
        "dataset study=parameter_study 'vary.process.radial_immersion=[0.1, 0.2]' 'vary.tool.teeth=[2, 4]'",
        "dataset machine=path/to/machine.yaml study=sensitivity design=path/to/design.yaml",
        "dataset study=dataset_overnight budget_hours=2",
    )
    groups: ClassVar[tuple[str, ...]] = (*MACHINE, "design", "method", "cluster", "study")

    retry_failed: Truth = Field(default="false", description=RETRY)
    report: Truth = Field(default="true", description=REPORT)
    budget_hours: float | None = Field(
        default=None, gt=0, le=10_000, description="time after which nothing more is begun; the same command goes on"
    )


class PointOptions(BaseOptions):
    """Compute the whole chain at one operating point: bearings, modes, stability, limit depths."""

    examples = (
        "point spindle_speed_rpm=12000 axial_depth_mm=1",
        "point machine=path/to/machine.yaml spindle_speed_rpm=12000 axial_depth_mm=1 format=json",
        "point spindle_speed_rpm=3000 axial_depth_mm=2 'effects=[process_damping]'",
    )
    groups: ClassVar[tuple[str, ...]] = (*MACHINE, "grid", "method", "study")
    instead: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"mode_count": "not for point; say modes= for how many are kept on each axis"}
    )

    spindle_speed_rpm: float = Field(gt=0, le=1e6, description="spindle speed")
    axial_depth_mm: float = Field(ge=1e-6, le=1e4, description="axial depth of cut")
    preload_n: float | None = Field(
        default=None, ge=LEAST_PRELOAD, le=MOST_PRELOAD, description="axial preload on every single bearing"
    )
    modes: int | None = Field(default=None, ge=1, le=100, description="modes kept on each axis")
    modal_parameters: Literal["dynamic", "static"] = Field(default="dynamic", description="bearings at speed or rest")
    output: DirectoryPath | None = Field(default=None, description="folder for point.json")


class PaperOptions(Options):
    """Compute the paper's findings on the reference machine: figures P1 to P9 and a table of what holds."""

    examples = ("paper", "paper output=results/my_paper machine=path/to/machine.yaml")
    groups: ClassVar[tuple[str, ...]] = (*MACHINE, "grid", "method", "cluster")

    output: DirectoryPath = Field(default=Path("results/paper"), description="folder for the findings")
