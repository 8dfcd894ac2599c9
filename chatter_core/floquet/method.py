"""Choice of a method of Floquet analysis and its accuracy."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class MethodSettings(BaseModel):
    """Method and accuracy: a tolerance for collocation, intervals and order for semi-discretization."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: Literal["collocation", "semi_discretization"] = Field(description="method of Floquet analysis")
    tolerance: float | None = Field(
        default=None, ge=1e-8, le=1e-1, description="allowed relative error of the spectral radius near the boundary"
    )
    intervals: int | None = Field(default=None, ge=2, le=4000, description="intervals a period")
    order: Literal[0, 1, 2] | None = Field(default=None, description="order of the delayed output's polynomial")

    @model_validator(mode="after")
    def _accuracy_belongs_to_method(self) -> "MethodSettings":
        tolerance, fixed = {"tolerance": self.tolerance}, {"intervals": self.intervals, "order": self.order}
        wanted, foreign = (tolerance, fixed) if self.name == "collocation" else (fixed, tolerance)
        if None in wanted.values() or set(foreign.values()) != {None}:
            raise ValueError(f"method '{self.name}' takes {' and '.join(wanted)}, and not {' or '.join(foreign)}")
        return self
