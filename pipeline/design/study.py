"""Settings of a data set: a machine, and a design of what varies around it."""

from typing import Any, ClassVar, Self

from pydantic import Field, model_validator

from pipeline.design.settings import Design, first_of_cuts
from pipeline.keys import parts_of
from pipeline.settings import Study


class DatasetSettings(Study):
    """Everything that a data set needs to know."""

    design: Design = Field(description="what varies, and how it is chosen")

    own_science: ClassVar[tuple[str, ...]] = ("design",)

    @model_validator(mode="after")
    def _effects_that_vary_are_on(self) -> Self:
        for key in (*self.design.machine.vary, *self.design.machine.formulas):
            group, *rest = parts_of(key)
            if group == "effects" and rest[0] not in self.effects:
                raise ValueError(f"{key}: the effect is not on; say effects=[{rest[0]}]")
        return self

    @model_validator(mode="after")
    def _machines_know_no_cut(self) -> Self:
        """What follows for a machine is computed before its cuts are: it would see the values as described."""
        level, of_cuts = self.design.machine, (*self.design.cut.vary, *self.design.cut.formulas)
        said = {f"formulas: {key}": text for key, text in level.formulas.items()}
        said |= {f"constraints: {text}": text for text in level.constraints}
        for where, text in said.items():
            if found := first_of_cuts(text, of_cuts):
                raise ValueError(
                    f"design.machine.{where}: found {found}, which differs from cut to cut, allowed: keys that all "
                    "cuts of a machine share; what of tool, cutting and process follows from the others stands in cut"
                )
        return self

    @property
    def base(self) -> dict[str, Any]:
        """The description that a design varies: parts of the machine, and the values of effects that are on."""
        return {**self.machine.described(), "effects": self.effects}
