"""Data sets: machines and cuts of a design, each with its structure and limit depths over speed."""

import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.floquet import MethodSettings
from chatter_core.machine import Machine
from chatter_core.reading import sentences
from chatter_core.stages import Stages
from chatter_core.tip import AXES
from chatter_core.units import SUFFIXES
from chatter_core.variables import CUT_STATUS, DATASET, DATASET_INPUTS
from pipeline.chunks import Chunk
from pipeline.design import DatasetSettings, Description, Design, described, draw
from pipeline.design.distributions import Choice
from pipeline.kinds.kernels import function_of
from pipeline.kinds.kind import Computed, Kind, raise_slip, status_of
from pipeline.modes import check_modes
from pipeline.places import DATASET as STORE
from pipeline.places import Place
from pipeline.progress import watched
from pipeline.settings import model_with

COORDINATES = {
    "machine": ("", "number of the machine, in the order in which they are computed"),
    "cut": ("", "number of the cut of a machine"),
    "input_key": ("", "key of the description that varies, ending in its unit"),
    "spindle_speed": ("rpm", "spindle speed"),
    "mode": ("", "number of the mode on its axis, by frequency at standstill"),
    "axis": ("", "direction; x is the feed direction"),
}


@dataclass(frozen=True, kw_only=True)
class Described:
    """What a store says of all its machines; numbers: (machine, cut, key), as they were drawn."""

    base: Description
    design: Design
    method: MethodSettings
    numbers: np.ndarray

    def cuts_of(self, machine: int, effects_path: Path | None) -> list[Stages]:
        """Return the stages of a machine with each of its cuts."""
        return [_model(one, effects_path) for one in descriptions(self.base, self.design, self.numbers[machine])]

    def physics(self, speeds: np.ndarray, mode_count: int) -> dict[str, Any]:
        """Return what the kernel is told of every machine; speeds [rpm]."""
        return {
            "spindle_speed": speeds * SUFFIXES["rpm"][0],
            "deepest": self.design.deepest * SUFFIXES["mm"][0],
            "mode_count": mode_count,
            "modal_parameters": self.design.modal_parameters,
            "method": self.method,
        }


class Dataset(Kind):
    """A data set's store: a chunk is a block of machines, with all cuts and speeds."""

    name, verb, settings = STORE, "dataset", DatasetSettings
    coordinates, wholes, chunked, status = COORDINATES, DATASET_INPUTS, DATASET, CUT_STATUS
    along, entry = "machine", "machine"
    kernel = "pipeline.samples:machine_sample"
    told_by = ()
    # Each is a limit depth that is searched for: a dozen times the work of a sweep's cell.
    cells_of_task = (1500, 1500)

    def title(self, settings: DatasetSettings) -> str:
        """Return the title of a store."""
        return settings.design.title

    def written_whole(
        self, settings: DatasetSettings
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, Any]]:
        """Return coordinates, the numbers of the design and the parts, and what its words stand for.

        Raises InvalidInput where a machine of the design cannot be, and where a law of the user's own fails for its
        first.
        """
        design = settings.design
        check_modes(settings.machine, design.mode_count, "design.mode_count")
        drawn = draw(design, settings.base)
        machines, cuts = drawn.cuts.shape[:2]
        of_machines = np.repeat(drawn.machines[:, None], cuts, axis=1)
        numbers = np.concatenate([of_machines, drawn.cuts], axis=2)
        _check(settings, numbers)
        first = Described(base=settings.base, design=design, method=settings.method, numbers=numbers)
        if any(cut.own_files for cut in first.cuts_of(0, settings.effects_path)[:1]):
            self.compute_first(first, settings.effects_path)
        varied = design.varied
        values = {
            "machine": np.arange(machines),
            "cut": np.arange(cuts),
            "input_key": np.array(list(varied), dtype=np.dtypes.StringDType()),
            "spindle_speed": design.spindle_speed_rpm.points(),
            "mode": np.arange(1, design.mode_count + 1),
            "axis": np.array(AXES, dtype=np.dtypes.StringDType()),
        }
        words = {key: list(one.values) for key, one in varied.items() if isinstance(one, Choice) and one.of_words}
        return values, {"input": numbers, "split": drawn.split}, {"input_words": words, "licence": design.licence}

    def described(self, attributes: Mapping[str, Any], read: Callable[[str], np.ndarray]) -> Described:
        """Return what all machines of a store share, and their numbers."""
        said = attributes["settings"]
        return Described(
            base={**said["machine"], "effects": said.get("effects", {})},
            design=Design.model_validate(said["design"]),
            method=MethodSettings.model_validate(said["method"]),
            numbers=read("input"),
        )

    def compute(self, described: Described, chunk: Chunk, kernel: str, effects_path: Path | None) -> Computed:
        """Compute a block of machines; one that raises is marked and the others go on."""
        design, samples, errors = described.design, list[Computed](), list[str]()
        speeds = design.spindle_speed_rpm.points()
        for machine in range(chunk.first, chunk.last):
            try:
                arrays, status = function_of(kernel)(
                    described.cuts_of(machine, effects_path), **described.physics(speeds, design.mode_count)
                )
                samples.append(Computed(arrays=arrays, status=status))
            except Exception as error:
                raise_slip(error)
                samples.append(_marked(described.numbers.shape[1], len(speeds), design.mode_count, status_of(error)))
                errors.append(f"machine {machine}: " + traceback.format_exc(limit=-3).strip())
        return Computed(
            arrays={name: np.stack([one.arrays[name] for one in samples]) for name in DATASET},
            status=np.stack([one.status for one in samples]),
            errors=tuple(errors),
        )

    def compute_first(self, described: Described, effects_path: Path | None) -> None:
        """Compute the first machine at one speed, with one mode."""
        first = described.design.spindle_speed_rpm.points()[-1:]
        function_of(self.kernel)(described.cuts_of(0, effects_path)[:1], **described.physics(first, 1))

    def told(
        self, said: Mapping[str, Any], values: Mapping[str, list[Any]], outer: tuple[int, ...], first: int, last: int
    ) -> str:
        """Return in words which chunk one is."""
        return f"machines {first} to {last - 1}"

    def report(self, place: Place, **margins: float) -> list[Path]:
        """Write card, tables, figures and page of a data set."""
        # The page imports what draws it, which a worker has no use for.
        from pipeline import dataset_report

        return dataset_report.write(place, **margins)


def descriptions(base: Description, design: Design, numbers: np.ndarray) -> list[Description]:
    """Return the descriptions of a machine's cuts from their numbers (cut, key)."""
    own = len(design.machine.vary)
    machine = described(base, design.machine, numbers[0, :own])
    return [described(machine, design.cut, cut[own:]) for cut in numbers]


def _model(description: Description, effects_path: Path | None) -> Stages:
    """Return the stages of a description; raises InvalidInput, or ValidationError of the machine."""
    machine = Machine.model_validate({key: value for key, value in description.items() if key != "effects"})
    return model_with(machine, description["effects"], effects_path)


def _check(settings: DatasetSettings, numbers: np.ndarray) -> None:
    """Raise InvalidInput for the first machine of a design that cannot be."""
    for machine, cuts in enumerate(watched(numbers, len(numbers), "machines checked")):
        try:
            found = descriptions(settings.base, settings.design, cuts)
        except ValueError as error:
            raise InvalidInput([f"design: {error}"]) from None
        for cut, description in enumerate(found):
            try:
                _model(description, settings.effects_path)
                continue
            except ValidationError as error:
                told = sentences(error, Machine)
            except InvalidInput as error:
                told = error.problems
            varied = settings.design.varied.items()
            drawn = ", ".join(f"{k} {v.value(float(x))}" for (k, v), x in zip(varied, cuts[cut], strict=True))
            what = f"drawn: {drawn}. Narrow what varies, or add a constraint"
            raise InvalidInput([f"design: machine {machine} cannot be: {one}; {what}" for one in told])


def _marked(cuts: int, speeds: int, modes: int, code: int) -> Computed:
    """Return a machine without results, with one status."""
    sizes = {"spindle_speed": speeds, "cut": cuts, "axis": len(AXES), "mode": modes}
    return Computed(
        arrays={name: v.without_result(tuple(sizes[dim] for dim in v.dims[1:])) for name, v in DATASET.items()},
        status=np.full((cuts, speeds), code, dtype=np.uint8),
    )
