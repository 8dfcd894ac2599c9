"""Sweeps: lobes on a grid of speed and depth, for kinds of modal parameters, preloads and numbers of modes."""

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from chatter_core.chain import structure_variables
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import CROSSINGS, LobeBlock
from chatter_core.machine import Machine
from chatter_core.tip import AXES
from chatter_core.units import SUFFIXES
from chatter_core.variables import CELL_STATUS, STRUCTURE, SWEEP
from pipeline.chunks import Chunk
from pipeline.kinds.kernels import function_of
from pipeline.kinds.kind import Computed, Kind, raise_slip, status_of
from pipeline.modes import modes_called
from pipeline.places import LOBES, Place
from pipeline.settings import Settings, model_with

#: Physics that a chunk is computed by.
KERNEL = "chatter_core.lobes:lobe_block"
COORDINATES = {
    "modal_parameters": ("", "bearings at the spindle's speed (dynamic) or at standstill (static)"),
    "preload": ("n", "axial preload on every single bearing"),
    "mode_count": ("", "modes kept on each axis: up to this number, or this one alone (settings, grid.mode_selection)"),
    "spindle_speed": ("rpm", "spindle speed"),
    "axial_depth": ("mm", "axial depth of cut"),
    "crossing": ("", "crossing of the boundary, from the shallowest: stability is lost at odd, regained at even ones"),
    "mode": ("", "number of the mode on its axis, by frequency at standstill"),
    "axis": ("", "direction; x is the feed direction"),
}


@dataclass(frozen=True, kw_only=True)
class Described:
    """What a store says of all its chunks; values: of the coordinates, in the units of the border."""

    machine: Machine
    effects: dict[str, dict[str, Any]]
    common: dict[str, Any]
    values: dict[str, np.ndarray]


class Lobes(Kind):
    """A sweep's store: a chunk is a block of speeds, with all depths."""

    name, verb, settings = LOBES, "sweep", Settings
    coordinates, wholes, chunked, status = COORDINATES, STRUCTURE, SWEEP, CELL_STATUS
    along, entry = "spindle_speed", "speed"
    kernel = KERNEL
    told_by = ("modal_parameters", "preload", "mode_count", "spindle_speed")
    # A quarter of a second of a core, and somewhat more than one.
    cells_of_task = (1500, 8000)

    def title(self, settings: Settings) -> str:
        """Return the title of a store."""
        return f"Stability lobes of study {settings.study}"

    def written_whole(self, settings: Settings) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, Any]]:
        """Return coordinates and structure, in the units of the border; no further attributes.

        Raises InvalidInput where the machine has not the modes that the grid asks for, and where a law of the user's
        own fails at its first cell.
        """
        values = coordinate_values(settings)
        with modes_called("grid.mode_count"):
            found = _structure(settings, values)
        _try_own(settings, values)
        return values, found, {}

    def described(self, attributes: Mapping[str, Any], read: Callable[[str], np.ndarray]) -> Described:
        """Return what all chunks of a store share."""
        said = attributes["settings"]
        names = ("modal_parameters", "preload", "mode_count", "spindle_speed", "axial_depth")
        return Described(
            machine=Machine.model_validate(said["machine"]),
            effects=said.get("effects", {}),
            common={
                "method": MethodSettings.model_validate(said["method"]),
                "mode_selection": said["grid"]["mode_selection"],
                "cells": said["grid"]["cells"],
            },
            values={name: read(name) for name in names},
        )

    def compute(self, described: Described, chunk: Chunk, kernel: str, effects_path: Path | None) -> Computed:
        """Compute a chunk; where that raises, speed by speed, and those that raise are marked."""
        values = described.values
        parameters, preload, modes = (
            values[name][i] for name, i in zip(("modal_parameters", "preload", "mode_count"), chunk.outer, strict=True)
        )
        machine = _preloaded(described.machine, preload)
        model, physics = model_with(machine, described.effects, effects_path), function_of(kernel)
        depth = values["axial_depth"] * SUFFIXES["mm"][0]

        def compute(speeds: np.ndarray) -> LobeBlock:
            block: LobeBlock = physics(
                model,
                spindle_speed=speeds,
                axial_depth=depth,
                mode_count=int(modes),
                modal_parameters=str(parameters),
                **described.common,
            )
            return block

        speed = values["spindle_speed"][chunk.first : chunk.last] * SUFFIXES["rpm"][0]
        block, errors = _guarded(compute, speed, len(depth))
        arrays = dict(vars(block))
        return Computed(status=arrays.pop("status"), arrays=arrays, errors=tuple(errors))

    def compute_first(self, described: Described, effects_path: Path | None) -> None:
        """Compute the first cell with one mode."""
        function_of(KERNEL)(
            model_with(described.machine, described.effects, effects_path),
            spindle_speed=described.values["spindle_speed"][:1] * SUFFIXES["rpm"][0],
            axial_depth=described.values["axial_depth"][:1] * SUFFIXES["mm"][0],
            mode_count=1,
            modal_parameters="static",
            **{**described.common, "mode_selection": "up_to"},
        )

    def told(
        self, said: Mapping[str, Any], values: Mapping[str, list[Any]], outer: tuple[int, ...], first: int, last: int
    ) -> str:
        """Return in words which chunk one is."""
        parameters, preload, modes = (values[name][i] for name, i in zip(self.told_by[:3], outer, strict=True))
        begin, end = values["spindle_speed"][first], values["spindle_speed"][last - 1]
        kept = modes_in_words(said["grid"]["mode_selection"], modes)
        return f"{parameters}, {preload:g} N, {kept}, {begin:g} to {end:g} rpm"

    def report(self, place: Place, **margins: float) -> list[Path]:
        """Write tables, figures and the page of a sweep."""
        # The page imports what draws it, which a worker has no use for.
        from pipeline import report

        return report.write(place, **margins)


def modes_in_words(selection: str, number: int) -> str:
    """Return which modes a number of them stands for; selection: up to it, or only the one of that number."""
    return f"mode {number} alone" if selection == "only" or number == 1 else f"modes 1 to {number}"


def coordinate_values(settings: Settings) -> dict[str, np.ndarray]:
    """Return the values of every dimension, in the units of the border."""
    counts = settings.grid.mode_count.points().astype(int)
    return {
        "modal_parameters": np.array(settings.grid.modal_parameters, dtype=np.dtypes.StringDType()),
        "preload": settings.preloads,
        "mode_count": counts,
        "spindle_speed": settings.grid.spindle_speed_rpm.points(),
        "axial_depth": settings.grid.axial_depth_mm.points(),
        "crossing": np.arange(1, CROSSINGS + 1),
        "mode": np.arange(1, counts[-1] + 1),
        "axis": np.array(AXES, dtype=np.dtypes.StringDType()),
    }


def _structure(settings: Settings, values: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return every structure variable over its whole extent, in the units of the border."""
    speed = values["spindle_speed"] * SUFFIXES["rpm"][0]
    arrays = {
        name: np.empty([len(values[dim]) for dim in variable.dims], dtype=variable.dtype)
        for name, variable in STRUCTURE.items()
    }
    for i, parameters in enumerate(settings.grid.modal_parameters):
        for j, preload in enumerate(values["preload"]):
            model = settings.model(_preloaded(settings.machine, preload))
            found = structure_variables(
                model, speed, mode_count=int(values["mode_count"][-1]), modal_parameters=parameters
            )
            for name, array in found.items():
                arrays[name][i, j] = array / STRUCTURE[name].si_factor
    return arrays


def _preloaded(machine: Machine, preload: float) -> Machine:
    """Return a machine with a preload [N]; one of measured tip modes knows none."""
    return machine.with_preload(float(preload)) if machine.spindle else machine


def _try_own(settings: Settings, values: dict[str, np.ndarray]) -> None:
    """Compute the first cell where laws of the user's own are on; raises InvalidInput where one of them fails."""
    model = settings.model(_preloaded(settings.machine, values["preload"][0]))
    if model.own_files:
        function_of(KERNEL)(
            model,
            spindle_speed=values["spindle_speed"][:1] * SUFFIXES["rpm"][0],
            axial_depth=values["axial_depth"][:1] * SUFFIXES["mm"][0],
            mode_count=int(values["mode_count"][0]),
            modal_parameters=str(values["modal_parameters"][0]),
            method=settings.method,
            mode_selection=settings.grid.mode_selection,
        )


def _guarded(compute: Callable[[np.ndarray], LobeBlock], speed: np.ndarray, depths: int) -> tuple[LobeBlock, list[str]]:
    """Compute a block; where that raises, compute it speed by speed and mark those that raise.

    Raises OwnLawFails for a slip in a user's file, which no other speed mends.
    """
    try:
        return compute(speed), []
    except Exception:
        blocks, errors = [], []
        for one in speed:
            try:
                blocks.append(compute(np.array([one])))
            except Exception as error:
                raise_slip(error)
                blocks.append(_marked(depths, status_of(error)))
                errors.append(f"{one / SUFFIXES['rpm'][0]:.6g} rpm: " + traceback.format_exc(limit=-3).strip())
        joined = {f.name: np.concatenate([getattr(block, f.name) for block in blocks]) for f in fields(LobeBlock)}
        return replace(blocks[0], **joined), errors


def _marked(depths: int, code: int) -> LobeBlock:
    """Return the block of one speed without results, every cell with one status."""
    sizes = {"axial_depth": (1, depths), "crossing": (1, CROSSINGS), "spindle_speed": (1,)}
    empty = {name: v.without_result(sizes[v.dims[-1]]) for name, v in SWEEP.items()}
    return LobeBlock(**empty, status=np.full((1, depths), code, dtype=np.uint8))
