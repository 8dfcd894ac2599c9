"""What options of a verb are: declared once, for the verb, its help, completion and documentation."""

import errno
import inspect
import os
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, Literal, Self, get_args, get_origin

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, field_validator
from pydantic.fields import FieldInfo

from chatter_core.errors import InvalidInput
from chatter_core.reading import sentences, shown

#: What a path must lead to, as help says it.
DirectoryPath = Annotated[Path, "DIR"]
YamlPath = Annotated[Path, "FILE.yaml"]
CsvPath = Annotated[Path, "FILE.csv"]
#: A list of names in brackets, which the configuration reads.
Names = Annotated[str, "[NAME,...]"]
#: Where an object store's study lies; places read it.
Address = Annotated[str, "s3://BUCKET/PREFIX"]
Seconds = Annotated[str, "NUMBER"]
#: A study, by its folder or its address.
StudyPlace = Annotated[str, "DIR or s3://BUCKET/PREFIX"]


def _small(said: Any) -> Any:
    return said.lower() if isinstance(said, str) else said


#: Yes or no.
Truth = Annotated[Literal["true", "false"], BeforeValidator(_small)]
#: Seconds after which a run that is not heard of holds an object store no longer, unless said, and what may be said.
LEASE, SHORTEST, LONGEST = 60.0, 3.0, 86400.0
#: Margins of recommended cuts stay below the first, and go up to the second [%].
ALL_DEPTH, MOST_SPEED = 100.0, 50.0
#: Folders in one another that a path may lead through.
DEEPEST = 200
#: Groups of configs that describe the machine and its cut.
MACHINE = ("machine", "bearing", "spindle", "tool", "cutting", "process")


class Options(BaseModel):
    """Options of a verb; its docstring says what the verb does.

    examples: words after the program's name; groups: those of configs whose choices and keys the verb takes; instead:
    of keys that other verbs have and this one has not, what is to be said of them.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    examples: ClassVar[tuple[str, ...]] = ()
    groups: ClassVar[tuple[str, ...]] = ()
    instead: ClassVar[Mapping[str, str]] = MappingProxyType({})

    format: Literal["text", "json"] = Field(
        default="text", description="json: standard output holds one JSON object alone"
    )
    quiet: Truth = Field(default="false", description="true: nothing is told but errors, and the exit code")

    @field_validator("*")
    @classmethod
    def _leads_somewhere(cls, said: Any) -> Any:
        """Refuse a path that is none: whoever asks where it leads would get no answer."""
        try:
            if isinstance(said, Path):
                os.stat(said)
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise ValueError(f"symbolic links lead in a circle: {said}") from None
        return said

    @classmethod
    def fields(cls) -> dict[str, FieldInfo]:
        """Return the options by their keys, as they are said."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}

    @classmethod
    def verb(cls) -> str:
        """Return the verb's name."""
        return cls.__name__.removesuffix("Options").lower()

    @classmethod
    def summary(cls) -> str:
        """Return in a line what the verb does."""
        return cls.explanation()[0]

    @classmethod
    def explanation(cls) -> list[str]:
        """Return what the verb does, line by line."""
        return (inspect.getdoc(cls) or "").splitlines()

    @classmethod
    def choices_of(cls, name: str) -> tuple[str, ...]:
        """Return the choices of an option, none where it has none."""
        return next((get_args(one) for one in _kinds(cls.fields()[name]) if get_origin(one) is Literal), ())

    @classmethod
    def shape_of(cls, name: str) -> str:
        """Return what may be said for an option: its choices, or what kind of thing."""
        if cls.choices_of(name):
            return "|".join(cls.choices_of(name))
        kinds = _kinds(cls.fields()[name])
        words = [one for one in kinds if isinstance(one, str)]
        return words[0] if words else "NUMBER"

    @classmethod
    def is_path(cls, name: str) -> bool:
        """Return whether an option names a file or a folder."""
        return Path in _kinds(cls.fields()[name])

    @classmethod
    def _no_path(cls, name: str, value: str) -> list[str]:
        """Return what keeps a text from being a path: folders would be made that nobody meant."""
        if found := no_address(name, value):
            instead = "; say store=ADDRESS for an object store" if name == "output" and "store" in cls.fields() else ""
            return [f"{one}{instead}" for one in found]
        depth = len(Path(value).parts)
        return [f"{name}: leads through {depth} folders, allowed: at most {DEEPEST}"] if depth > DEEPEST else []

    @classmethod
    def read(cls, said: Mapping[str, str]) -> Self:
        """Return the options that are said; raise InvalidInput with every one that is missing or wrong."""
        empty = [name for name, value in said.items() if not value and name in cls.fields()]
        if empty:
            raise InvalidInput([f"{name}: is empty; needed: {cls.fields()[name].description}" for name in empty])
        paths = {name: value for name, value in said.items() if name in cls.fields() and cls.is_path(name)}
        problems = [problem for name, value in paths.items() for problem in cls._no_path(name, value)]
        if problems:
            raise InvalidInput(problems)
        try:
            return cls.model_validate(dict(said))
        except ValidationError as error:
            raise InvalidInput(sentences(error, cls)) from None


def no_address(name: str, value: str) -> list[str]:
    """Return what is to be said of an address where a path on this machine is wanted; nothing of a path."""
    return [f"{name}: found the address {shown(value)}, allowed: a path on this machine"] if "://" in value else []


def _kinds(field: FieldInfo) -> list[Any]:
    """Return everything that a field's annotation is made of."""
    found: list[Any] = [field.annotation, *field.metadata]
    for one in found:
        found += [*getattr(one, "__metadata__", ()), *(() if get_origin(one) is Literal else get_args(one))]
    return found


class EffectOptions(Options):
    """Which effects are on."""

    effects: Names | None = Field(default=None, description="effects that are on, of the program's or your own")
    effects_path: DirectoryPath | None = Field(
        default=None, description="folder with effects of your own; what lies there is run"
    )


class BaseOptions(EffectOptions):
    """Which base model, and which effects are on."""

    base: Literal["full", "static_bearing"] = Field(
        default="full", description="base model; static_bearing: without the balls' inertia"
    )


class PlaceOptions(Options):
    """Where a study lies."""

    output: DirectoryPath | None = Field(default=None, description="folder of the study, or for what people read of it")
    store: Address | None = Field(default=None, description="the study lies in an object store")
    lease_s: Seconds | None = Field(
        default=None,
        description="seconds that a run holds an object store without being heard of; "
        f"{SHORTEST:g} to {LONGEST:g}, default {LEASE:g}",
    )


class MarginOptions(Options):
    """How far recommended cuts keep from their boundary, where not as the last run of the study said."""

    depth_percent: float | None = Field(
        default=None,
        alias="margins.depth_percent",
        ge=0.0,
        lt=ALL_DEPTH,
        description="share of the limit depth that recommended cuts keep free",
    )
    speed_percent: float | None = Field(
        default=None,
        alias="margins.speed_percent",
        ge=0.0,
        le=MOST_SPEED,
        description="by how much a spindle may miss its speed in recommended cuts",
    )

    @property
    def margins(self) -> dict[str, float]:
        """The margins that are said, by their keys in a study."""
        said = {"depth_percent": self.depth_percent, "speed_percent": self.speed_percent}
        return {key: value for key, value in said.items() if value is not None}
