"""What a design says: what varies and how, which combinations are left out, at which speeds, and how it is split."""

import math
from collections.abc import Iterable
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import AfterValidator, Field, field_validator, model_validator

from chatter_core.reading import shown
from pipeline.design.distributions import Choice, Integer, LogUniform, Normal, Uniform
from pipeline.design.expressions import formula
from pipeline.keys import parts_of
from pipeline.settings import Axis, Part

#: What one value is drawn from.
Varied = Annotated[Uniform | LogUniform | Normal | Integer | Choice, Field(discriminator="distribution")]
#: Parts of a description that a cut is: whatever they say, the machine's modes stay the same.
CUT_PARTS = ("tool", "cutting", "process")
#: Longest words about a data set.
LONGEST = 200


def _in_one_line(words: str) -> str:
    """Return words as they are; raise ValueError where a card could not hold them."""
    if not 1 <= len(words) <= LONGEST or any(ord(letter) < ord(" ") or letter == "\x7f" for letter in words):
        allowed = f"1 to {LONGEST} letters, no end of a line or other control character"
        raise ValueError(f"found {shown(words)}, allowed: {allowed}")
    return words


Words = Annotated[str, AfterValidator(_in_one_line)]
#: Limits of a design's size.
MOST_MACHINES, MOST_CUTS, MOST_RULES = 1_000_000, 10_000, 200
#: Cuts times speeds of a machine, which are computed and written together.
MOST_OF_A_MACHINE = 10_000_000
#: Ways to choose the machines: drawn, laid out, or as an analysis of sensitivities needs them.
DRAWN = ("sobol", "latin_hypercube", "random")


class Level(Part):
    """What varies from machine to machine, or from cut to cut."""

    vary: Annotated[dict[str, Varied], Field(max_length=MOST_RULES)] = Field(
        default={}, description="dotted keys of the description, each with its distribution, or a list to choose from"
    )
    formulas: Annotated[dict[str, str], Field(max_length=MOST_RULES)] = Field(
        default={}, description="dotted keys, each with a formula of others; computed in their order, after what varies"
    )
    constraints: Annotated[tuple[str, ...], Field(max_length=MOST_RULES)] = Field(
        default=(), description="comparisons that every one satisfies; what does not is drawn again"
    )

    @field_validator("vary", mode="before")
    @classmethod
    def _in_short(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        try:
            return {key: varied_of(one) for key, one in flat(given).items()}
        except ValueError as error:
            raise ValueError(f"{error}; on a command line say vary.KEY=..., in the place of all that varies") from None

    @field_validator("formulas", mode="before")
    @classmethod
    def _numbers_are_formulas(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        return {key: one if isinstance(one, str) else str(one) for key, one in flat(given).items()}

    @model_validator(mode="after")
    def _is_understood(self) -> Self:
        for key in (*self.vary, *self.formulas):
            try:
                parts = parts_of(key)
            except ValueError as error:
                raise ValueError(f"{key}: {error}") from None
            if parts[0] == "effects" and len(parts) < 3:
                raise ValueError(f"{key}: found a whole effect, allowed: one of its values, effects.NAME.KEY")
        for key, text in self.formulas.items():
            if key in self.vary:
                raise ValueError(f"formulas: {key} varies already")
            formula(text)
        for text in self.constraints:
            formula(text)
        return self

    def at_levels(self) -> list[np.ndarray]:
        """Return the numbers that a grid takes of every key; raise ValueError naming the key that says none."""
        levels = []
        for key, varied in self.vary.items():
            try:
                levels.append(varied.at_levels())
            except ValueError as error:
                raise ValueError(f"vary.{key}: {error}") from None
        return levels


def flat(given: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return nested keys as dotted ones: ``{tool: {teeth: ...}}`` as ``{tool.teeth: ...}``.

    Raises ValueError for a key that stands there in both ways.
    """
    found: dict[str, Any] = {}
    for key, one in given.items():
        where = f"{prefix}.{key}" if prefix else str(key)
        nested = isinstance(one, dict) and "distribution" not in one and one
        for inner, value in (flat(one, where) if nested else {where: one}).items():
            if inner in found:
                raise ValueError(f"{inner} stands twice, nested and dotted")
            found[inner] = value
    return found


def first_of_cuts(text: str, keys: Iterable[str]) -> str | None:
    """Return the first of some keys that a formula names, or a part or the whole of it; None where it names none.

    keys: dotted ones, of what differs from cut to cut. Raises ValueError where the text is no formula.
    """
    named = formula(text).named()
    return next((key for key in keys if any(_overlap(tuple(parts_of(key)), one) for one in named)), None)


def _overlap(one: tuple[str | int, ...], other: tuple[str | int, ...]) -> bool:
    return all(first == second for first, second in zip(one, other, strict=False))


def varied_of(given: Any) -> Any:
    """Return what a distribution says in full: a list is a choice among its entries."""
    return {"distribution": "choice", "values": given} if isinstance(given, list) else given


class Splits(Part):
    """Shares of the machines; all cuts of a machine lie in one part."""

    train: float = Field(default=0.8, ge=0.0, le=1.0, description="share to learn from")
    validation: float = Field(default=0.1, ge=0.0, le=1.0, description="share to choose by")
    test: float = Field(default=0.1, ge=0.0, le=1.0, description="share to judge by, once")

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        total = self.train + self.validation + self.test
        if abs(total - 1.0) > 1e-9:
            raise ValueError(f"found shares whose sum is {total:g}, allowed: 1")
        return self


class Design(Part):
    """Machines, cuts of each, and the speeds that every cut is computed at."""

    sampling: Literal["sobol", "latin_hypercube", "random", "grid", "one_at_a_time", "saltelli"] = Field(
        description="how machines are chosen"
    )
    machines: Annotated[int, Field(ge=1, le=MOST_MACHINES)] | None = Field(
        default=None, description="number of machines; saltelli: a power of two, of each of its blocks; grid: none"
    )
    cuts_per_machine: Annotated[int, Field(ge=1, le=MOST_CUTS)] | None = Field(
        default=None, description="number of cuts of each machine; without it one, or those of the grid"
    )
    seed: int = Field(ge=0, le=2**63 - 1, description="seed of everything that is drawn")
    machine: Level = Field(default=Level(), description="what varies from machine to machine; any key")
    cut: Level = Field(default=Level(), description="what varies from cut to cut: keys of tool, cutting and process")
    spindle_speed_rpm: Axis = Field(description="speeds at which every cut is computed")
    deepest: float = Field(
        gt=0.0, le=1e4, alias="deepest_mm", description="depth down to which limit depths are looked for"
    )
    mode_count: int = Field(ge=1, le=100, description="modes kept on each axis")
    modal_parameters: Literal["dynamic", "static"] = Field(
        default="dynamic", description="bearings at speed, or at standstill whatever the speed"
    )
    splits: Splits = Field(default=Splits(), description="shares to learn from, choose by and judge by")
    title: Words = Field(description="title of the data set, for its card")
    licence: Words = Field(default="CC-BY-4.0", description="licence of the data set, for its card")

    @model_validator(mode="after")
    def _varies(self) -> Self:
        if not self.machine.vary and not self.cut.vary:
            raise ValueError("nothing varies; say so with machine.vary, or vary.KEY=[1, 2, 3] on the command line")
        if self.spindle_speed_rpm.points()[-1] > 1e6:
            raise ValueError(f"spindle_speed_rpm: found {self.spindle_speed_rpm.points()[-1]:g}, allowed: at most 1e6")
        return self

    @model_validator(mode="after")
    def _keys_are_where_they_belong(self) -> Self:
        of_machine = {*self.machine.vary, *self.machine.formulas}
        for key in (*self.cut.vary, *self.cut.formulas):
            if parts_of(key)[0] not in CUT_PARTS:
                raise ValueError(f"cut: found {key}, allowed: keys of {', '.join(CUT_PARTS)}; all others in machine")
            if key in of_machine:
                raise ValueError(f"found {key} in machine and in cut, allowed: in one of them")
        return self

    @model_validator(mode="after")
    def _counts_fit(self) -> Self:
        way = f"for sampling {self.sampling}"
        if (self.machines is None) == (self.sampling in (*DRAWN, "saltelli")):
            raise ValueError(f"machines: {'missing, needed' if self.machines is None else 'not allowed'} {way}")
        if self.sampling == "saltelli" and self.machines and self.machines & (self.machines - 1):
            raise ValueError(f"machines: found {self.machines}, allowed {way}: a power of two")
        if self.sampling == "grid" and (self.cuts_per_machine is not None or self.cut.constraints):
            raise ValueError("cuts_per_machine, cut.constraints: not allowed for sampling grid, which has all its cuts")
        if self.sampling in ("one_at_a_time", "saltelli"):
            if self.cut.vary or self.machine.constraints or self.cut.constraints:
                raise ValueError(f"cut.vary and constraints: not allowed {way}; what varies stands in machine.vary")
            if self.cuts_per_machine is not None:
                raise ValueError(f"cuts_per_machine: not allowed {way}, which has one cut of each")
        return self

    @model_validator(mode="after")
    def _is_of_a_size_that_can_be(self) -> Self:
        machines, cuts = self._machines_and_cuts()
        if machines * cuts > MOST_MACHINES:
            raise ValueError(f"found {machines} machines, cuts of each: {cuts}; allowed: at most {MOST_MACHINES} cuts")
        speeds = len(self.spindle_speed_rpm.points())
        if cuts * speeds > MOST_OF_A_MACHINE:
            found = f"found {cuts} cuts of each machine at {speeds} speeds"
            raise ValueError(f"{found}, allowed: at most {MOST_OF_A_MACHINE} together")
        return self

    @property
    def varied(self) -> dict[str, Varied]:
        """What varies from machine to machine and from cut to cut, in the order of a store's inputs."""
        return {**self.machine.vary, **self.cut.vary}

    def _machines_and_cuts(self) -> tuple[int, int]:
        """Return the number of machines, of a grid before its constraints, and of the cuts of each."""
        if self.sampling == "grid":
            machines, cuts = (math.prod(map(len, level.at_levels())) for level in (self.machine, self.cut))
            return machines, cuts
        keys = len(self.machine.vary)
        machines = 1 + 2 * keys if self.machines is None else self.machines
        return machines * (keys + 2) if self.sampling == "saltelli" else machines, self.cuts_per_machine or 1
