"""Choice of a method of Floquet analysis and its accuracy."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator


class MethodSettings(BaseModel):
    """Method and accuracy: a tolerance for collocation, a number of intervals for semi-discretization."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: Literal["collocation", "semi_discretization"] = Field(description="method of Floquet analysis")
    tolerance: float | None = Field(
        default=None, ge=1e-9, le=1e-1, description="allowed relative error of the spectral radius near the boundary"
    )
    intervals: int | None = Field(default=None, ge=2, le=4000, description="intervals a period")

    @model_validator(mode="after")
    def _accuracy_belongs_to_method(self) -> "MethodSettings":
        wanted, foreign = ("tolerance", "intervals") if self.name == "collocation" else ("intervals", "tolerance")
        if getattr(self, wanted) is None or getattr(self, foreign) is not None:
            raise ValueError(f"method '{self.name}' takes {wanted} and not {foreign}")
        return self
