"""Settings of a data set: a machine, and a design of what varies around it."""

from typing import Any, ClassVar

from pydantic import Field

from pipeline.design.settings import Design
from pipeline.settings import Study


class DatasetSettings(Study):
    """Everything that a data set needs to know."""

    design: Design = Field(description="what varies, and how it is chosen")

    own_science: ClassVar[tuple[str, ...]] = ("design",)

    @property
    def base(self) -> dict[str, Any]:
        """The description that a design varies: parts of the machine, and the values of effects that are on."""
        return {**self.machine.described(), "effects": self.effects}
