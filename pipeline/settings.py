"""Settings of a run, validated: machine, grid, method, cluster."""

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from chatter_core.effects import activate, apply_effects, own_digest, own_effects
from chatter_core.errors import InvalidInput
from chatter_core.floquet import MethodSettings
from chatter_core.machine import LEAST_PRELOAD, MOST_PRELOAD, Machine, no_truth_value
from chatter_core.reading import sentences
from chatter_core.stages import Stages
from chatter_core.variables import MODAL_PARAMETERS
from pipeline.verbs.options import ALL_DEPTH, MOST_SPEED

#: Raised when the meaning of what a store holds changes.
STORE_VERSION = 3
#: A grid with more cells than this is refused before anything is allocated: 2e9 cells take 110 GB.
MOST_CELLS = 2_000_000_000


class Part(BaseModel):
    """Base of a part of the settings."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_values(cls, value: Any) -> Any:
        return no_truth_value(value)


class Axis(Part):
    """Axis of a grid: start, stop and count, or a list of values; ascending."""

    start: float | None = Field(default=None, ge=-1e12, le=1e12, description="first value")
    stop: float | None = Field(default=None, ge=-1e12, le=1e12, description="last value")
    count: Annotated[int, Field(ge=1, le=1_000_000)] | None = Field(default=None, description="number of values")
    spacing: Literal["linear", "geometric"] = Field(default="linear", description="equal steps, or equal ratios")
    values: Annotated[tuple[float, ...], Field(min_length=1, max_length=1_000_000)] | None = Field(
        default=None, description="the values themselves, ascending"
    )

    @model_validator(mode="before")
    @classmethod
    def _list_or_number(cls, given: Any) -> Any:
        if given is None:
            raise ValueError("found nothing, allowed: a number, a list of numbers, or start, stop and count")
        for number in given if isinstance(given, list | tuple) else [given]:
            no_truth_value(number)
        if isinstance(given, list | tuple):
            return {"values": given}
        return {"values": [given]} if isinstance(given, int | float | str) else given

    @model_validator(mode="after")
    def _one_way_to_say_it(self) -> Self:
        regular = [self.start, self.stop, self.count]
        if regular.count(None) != (0 if self.values is None else 3):
            raise ValueError("an axis takes either start, stop and count, or a list of values")
        if self.spacing == "geometric" and (self.values is not None or min(self.start or 0.0, self.stop or 0.0) <= 0.0):
            raise ValueError("spacing geometric needs start, stop and count, all of them more than 0")
        points = self.points()
        if points[0] <= 0.0:
            raise ValueError(f"found {points[0]:g}, allowed: more than 0")
        if np.any(np.diff(points) <= 0.0):
            at = int(np.argmax(np.diff(points) <= 0.0))
            found = f"found {points[at + 1]:g} after {points[at]:g}"
            raise ValueError(f"values must ascend, none of them twice (start below stop); {found}")
        return self

    def points(self) -> np.ndarray:
        """Return the values of the axis, in the unit of its key."""
        if self.values is not None:
            return np.array(self.values, dtype=float)
        assert self.start is not None
        assert self.stop is not None
        assert self.count is not None
        if self.count == 1:
            return np.array([self.start])
        between = np.linspace if self.spacing == "linear" else np.geomspace
        return np.asarray(between(self.start, self.stop, self.count))


class Grid(Part):
    """Grid of a sweep; every combination of its axes is a cell."""

    spindle_speed_rpm: Axis = Field(description="spindle speeds")
    axial_depth_mm: Axis = Field(description="axial depths")
    preload_n: Axis | None = Field(default=None, description="preloads; without it the spindle's own")
    mode_count: Axis = Field(description="numbers of modes kept on each axis")
    mode_selection: Literal["up_to", "only"] = Field(
        default="up_to", description="a number of modes means all modes up to it, or that one mode alone"
    )
    cells: Literal["all", "adaptive"] = Field(
        default="all", description="evaluate every cell, or depths as the boundary needs them and interpolate the rest"
    )
    modal_parameters: tuple[Literal["dynamic", "static"], ...] = Field(
        default=("dynamic",), min_length=1, max_length=2, description="bearings at speed, at standstill, or both"
    )

    @model_validator(mode="after")
    def _is_a_grid(self) -> Self:
        counts = self.mode_count.points()
        if np.any(counts != np.rint(counts)) or counts[-1] > 100:
            raise ValueError(f"mode_count: found {_listed(counts)}, allowed: whole numbers from 1 to 100")
        if len(set(self.modal_parameters)) < len(self.modal_parameters):
            found = ", ".join(self.modal_parameters)
            raise ValueError(f"modal_parameters: found {found}, allowed: {', '.join(MODAL_PARAMETERS)}, each once")
        if self.preload_n is not None:
            preloads = self.preload_n.points()
            if preloads[0] < LEAST_PRELOAD or preloads[-1] > MOST_PRELOAD:
                found = f"{preloads[0]:g} to {preloads[-1]:g}"
                raise ValueError(f"preload_n: found {found}, allowed: {LEAST_PRELOAD:g} to {MOST_PRELOAD:g}")
        for name, axis, most in (
            ("spindle_speed_rpm", self.spindle_speed_rpm, 1e6),
            ("axial_depth_mm", self.axial_depth_mm, 1e4),
        ):
            if axis.points()[-1] > most:
                raise ValueError(f"{name}: found {axis.points()[-1]:g}, allowed: at most {most:g}")
        if self.axial_depth_mm.points()[0] < 1e-6:
            raise ValueError(f"axial_depth_mm: found {self.axial_depth_mm.points()[0]:g}, allowed: at least 1e-6")
        axes = (self.spindle_speed_rpm, self.axial_depth_mm, self.mode_count, self.preload_n)
        cells = len(self.modal_parameters) * int(np.prod([len(axis.points()) for axis in axes if axis], dtype=object))
        if cells > MOST_CELLS:
            raise ValueError(f"found {cells} cells, allowed: at most {MOST_CELLS}")
        return self


#: A name that a queue is told, as it is.
QueueName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.,:@+-]{1,64}$")]
#: A line of a job's script.
Line = Annotated[str, Field(pattern=r"^[^\n\r]{1,1000}$")]
#: Most of a walltime that may be left to the end of a job: a worker takes some seconds to begin.
MOST_DRAIN = 0.9
#: Queues that jobs with workers can be submitted to.
QUEUES = ("slurm", "pbs")


class QueueJobs(Part):
    """Jobs of a queue that workers run in, one process a core."""

    count: int = Field(ge=1, le=1000, description="jobs that are kept: one that ends is replaced")
    cores: int = Field(ge=1, le=1024, description="cores of a job, each with a worker")
    memory: float = Field(ge=0.25, le=1e5, alias="memory_gib", description="memory of a job, its workers' together")
    walltime: float = Field(ge=1.0, le=1e5, alias="walltime_min", description="time after which the queue ends a job")
    drain: float = Field(
        ge=1.0, le=1e5, alias="drain_s", description="time before the end of a job at which its last worker leaves"
    )
    queue: QueueName | None = Field(default=None, description="queue (partition); null: the queue's own default")
    account: QueueName | None = Field(default=None, description="account that is charged; null: the user's own")
    directives: tuple[Line, ...] = Field(
        default=(), description="further options of a job, as its script has them after #SBATCH or #PBS"
    )
    prologue: tuple[Line, ...] = Field(default=(), description="lines of a job's script before its workers start")
    interface: QueueName | None = Field(default=None, description="network interface of workers and scheduler")
    scheduler_interface: QueueName | None = Field(
        default=None, description="network interface of the scheduler, where it is another"
    )
    log_folder: Path = Field(description="folder for what jobs say, seen by this machine and theirs")

    @model_validator(mode="after")
    def _is_drained_before_its_end(self) -> Self:
        whole = 60.0 * self.walltime
        if self.drain > MOST_DRAIN * whole:
            raise ValueError(
                f"drain_s: found {self.drain:g} of a walltime of {whole:g} s, allowed: at most {MOST_DRAIN:g} of it"
            )
        return self

    @property
    def lifetime(self) -> float:
        """Longest life of a worker [s]."""
        return 60.0 * self.walltime - self.drain


class Cluster(Part):
    """Where the chunks are computed."""

    kind: Literal["serial", "threads", "local", "address", "slurm", "pbs", "mpi"] = Field(
        description="where the chunks are computed"
    )
    workers: Annotated[int, Field(ge=1, le=1024)] | None = Field(default=None, description="workers; none: one a core")
    address: str | None = Field(default=None, description="address of a running scheduler")
    job: QueueJobs | None = Field(default=None, description="jobs of a queue")
    cells_per_task: Annotated[int, Field(ge=1, le=10_000_000)] | None = Field(
        default=None, description="cells of a chunk; null: a second or two, and less where a study is small"
    )
    time_limit: Annotated[float, Field(gt=0.0, le=1e7)] | None = Field(
        default=None, alias="time_limit_s", description="seconds for a chunk, then its worker is ended; null: no limit"
    )
    patience: float = Field(
        default=60.0, gt=0.0, le=1e7, alias="patience_s", description="seconds without any worker, then a run ends"
    )

    @model_validator(mode="after")
    def _keys_belong_to_kind(self) -> Self:
        if (self.kind == "address") != (self.address is not None):
            raise ValueError("address: needed for kind 'address', and only there (tcp://host:port)")
        if self.address is not None and not re.fullmatch(r"(tcp|tls|ws|wss)://[^\s/:]+:[0-9]{1,5}", self.address):
            raise ValueError(f"address: found {self.address!r}, allowed: tcp://host:port (or tls, ws, wss)")
        if (self.kind in QUEUES) != (self.job is not None):
            raise ValueError(f"job: needed for kind {' or '.join(map(repr, QUEUES))}, and only there")
        if self.workers is not None and self.kind not in ("threads", "local"):
            instead = "; say job.count and job.cores" if self.job else ""
            raise ValueError(f"workers: not allowed for kind '{self.kind}'{instead}")
        if self.time_limit is not None and self.kind in ("serial", "threads"):
            raise ValueError(
                f"time_limit_s: not allowed for kind '{self.kind}': only a worker process of its own can be ended"
            )
        if self.job is not None and self.time_limit is not None and self.time_limit > 0.5 * self.job.lifetime:
            # What hangs would outlive its worker, and hang in the next one.
            raise ValueError(
                f"time_limit_s: found {self.time_limit:g}, allowed: at most half of the {self.job.lifetime:g} s "
                "that a worker lives (job.walltime_min less job.drain_s)"
            )
        return self


class Margins(Part):
    """How far a cut that is recommended keeps from its boundary; nothing that is computed depends on it."""

    depth: float = Field(
        default=10.0,
        ge=0.0,
        lt=ALL_DEPTH,
        alias="depth_percent",
        description="share of the limit depth that is kept free",
    )
    speed: float = Field(
        default=2.0,
        ge=0.0,
        le=MOST_SPEED,
        alias="speed_percent",
        description="by how much a spindle may miss its speed",
    )

    def __str__(self) -> str:
        return f"{self.depth:g} % below the boundary at all speeds within {self.speed:g} %"

    @property
    def said(self) -> dict[str, float]:
        """The margins as plain data, as a store keeps them."""
        return _plain(self)


class Study(Part):
    """What a run of any kind needs to know."""

    study: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")] = Field(description="name of the study")
    machine: Machine = Field(description="the machine and its cut")
    method: MethodSettings = Field(description="method of Floquet analysis")
    cluster: Cluster = Field(description="where the chunks are computed")
    effects: dict[str, dict[str, Any]] = Field(
        default={}, description="effects that are on, each with the values of its parameters and settings"
    )

    effects_path: Path | None = Field(default=None, description="folder with effects of the user's own")
    margins: Margins = Field(default=Margins(), description="how far recommended cuts keep from their boundary")

    #: What of the settings numbers depend on, beside machine, method and effects.
    own_science: ClassVar[tuple[str, ...]] = ()

    @model_validator(mode="after")
    def _effects_fit_the_machine(self) -> Self:
        try:
            self.model(self.machine)
        except InvalidInput as error:
            raise ValueError("; ".join(error.problems)) from None
        return self

    def model(self, machine: Machine) -> Stages:
        """Return the stages of a machine with the effects that are on."""
        return model_with(machine, self.effects, self.effects_path)

    def scientific(self) -> dict[str, Any]:
        """Return what the numbers of a run depend on, as plain data."""
        own = {
            name: getattr(self, name).model_dump(mode="json", exclude_none=True, by_alias=True)
            for name in self.own_science
        }
        return {
            "store_version": STORE_VERSION,
            "machine": self.machine.described(),
            **own,
            "method": _plain(self.method),
            # Without effects nothing is said of them: a study of the base model stays what it was.
            **({"effects": effects} if (effects := self._recorded_effects()) else {}),
            # Where a user's folder lies is not science; what its files say is.
            **({"own_effects": digests} if (digests := own_digests(self.effects, self.effects_path)) else {}),
        }

    def _recorded_effects(self) -> dict[str, dict[str, Any]]:
        """Return what is recorded of the effects that are on: all that is said."""
        return self.effects

    def record(self) -> str:
        """Return study and scientific settings as yaml."""
        return yaml.safe_dump({"study": self.study, **self.scientific()}, sort_keys=False)

    def fingerprint(self) -> str:
        """Return a digest of the scientific settings."""
        canonical = json.dumps(self.scientific(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()


class Settings(Study):
    """Everything that a sweep needs to know."""

    grid: Grid = Field(description="grid of a sweep")

    own_science: ClassVar[tuple[str, ...]] = ("grid",)

    def _recorded_effects(self) -> dict[str, dict[str, Any]]:
        """Return the effects that are on with what says something of each: no choice varies in a sweep."""
        unused = {name: activate(name, said, self.effects_path).effect.unused for name, said in self.effects.items()}
        return {
            name: {key: value for key, value in said.items() if key not in unused[name]}
            for name, said in self.effects.items()
        }

    @model_validator(mode="after")
    def _preload_belongs_to_a_spindle(self) -> Self:
        if self.grid.preload_n is not None and self.machine.spindle is None:
            raise ValueError(
                "grid.preload_n: not allowed for a machine of measured tip modes, which knows no preload; "
                "say grid.preload_n=null"
            )
        return self

    @property
    def preloads(self) -> np.ndarray:
        """Preloads of the sweep [N]; one zero for a machine that knows none."""
        if self.grid.preload_n is not None:
            return self.grid.preload_n.points()
        return np.array([self.machine.spindle.preload if self.machine.spindle else 0.0])


Kept = TypeVar("Kept", bound=Study)


def recorded(kind: type[Kept], attributes: dict[str, Any], own: Path | None, cluster: Cluster) -> Kept:
    """Return the settings that the attributes of a store hold, to be computed on a cluster.

    kind: class of the settings; own: folder with the user's own effects. Raises InvalidInput where they are not
    followed by this version of the program, or by the effects of that folder, as they were when the store was made.
    """
    said = {key: attributes["settings"][key] for key in ("machine", "method", *kind.own_science)}
    effects = attributes["settings"].get("effects", {})
    try:
        found = kind.model_validate(
            {"study": attributes["study"], **said, "effects": effects, "effects_path": own, "cluster": cluster}
        )
    except ValidationError as error:
        raise InvalidInput(sentences(error, kind)) from None
    if found.fingerprint() != attributes["fingerprint"]:
        raise InvalidInput(
            [
                f"study {attributes['study']}: its settings are not read as they were written: it is of another "
                "version of the program, or of an effect of the user's own (effects_path=DIR)"
            ]
        )
    return found


def margins_of(attributes: Mapping[str, Any]) -> Margins:
    """Return the margins that the attributes of a store hold; stores of earlier versions hold none."""
    return Margins.model_validate(attributes.get("margins", {}))


def own_digests(effects: Iterable[str], own: Path | None) -> dict[str, str]:
    """Return a digest of the Python file of every one of these effects that is from a user's ``own`` folder."""
    if own is None:
        return {}
    found = own_effects(own)
    return {name: own_digest(name, own) for name in effects if name in found}


def model_with(machine: Machine, effects: dict[str, dict[str, Any]], own: Path | None = None) -> Stages:
    """Return the stages of a machine with effects, of ``own`` folder too; raise InvalidInput with every finding."""
    active, problems = [], []
    for name, values in effects.items():
        try:
            active.append(activate(name, values, own))
        except InvalidInput as error:
            problems += error.problems
    if problems:
        raise InvalidInput(problems)
    return apply_effects(machine, active)


def _plain(part: BaseModel) -> dict[str, Any]:
    return part.model_dump(mode="json", exclude_none=True, by_alias=True)


def _listed(points: np.ndarray) -> str:
    shown = ", ".join(f"{point:g}" for point in points[:8])
    return f"[{shown}{', ...' if len(points) > 8 else ''}]"


def differing_keys(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Return the dotted keys whose values differ between two sets of plain data."""
    return list(differences(one, other))


def differences(one: dict[str, Any], other: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return what two sets of plain data say under dotted keys where they differ; None where one has no such key."""
    flat = [dict(_flatten(data, "")) for data in (one, other)]
    both = {key: (flat[0].get(key), flat[1].get(key)) for key in sorted(flat[0].keys() | flat[1].keys())}
    return {key: (first, second) for key, (first, second) in both.items() if first != second}


def _flatten(data: Any, prefix: str) -> list[tuple[str, Any]]:
    if isinstance(data, dict):
        return [pair for key, value in data.items() for pair in _flatten(value, f"{prefix}.{key}" if prefix else key)]
    if isinstance(data, list | tuple):
        return [pair for i, value in enumerate(data) for pair in _flatten(value, f"{prefix}[{i}]")]
    return [(prefix, data)]
