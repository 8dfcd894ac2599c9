"""Distributions that a value of a description is drawn from, each by its quantile function.

A distribution answers shares between 0 and 1 with numbers. Words (``direction: down``) are drawn as their place in the
list of ``choice``, from zero: ``value`` turns a number back into what the description says.
"""

from abc import ABC, abstractmethod
from typing import Annotated, Any, Literal, Self

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, field_validator, model_validator

from chatter_core.machine import no_truth_value
from chatter_core.reading import shown

Array = NDArray[np.float64]

#: Tails of an unbounded distribution that no level of a grid or end of a range lies in.
TAIL = 0.05
MOST_LEVELS = 10_000
#: Largest number, and least of those whose ratio is drawn: differences and ratios of two stay finite.
MOST, LEAST_OF_RATIOS = 1e100, 1e-100
#: A number, which true and false are not.
Number = Annotated[float, Field(ge=-MOST, le=MOST), BeforeValidator(no_truth_value)]
#: How many values of a distribution a grid takes.
Levels = Annotated[int, Field(ge=1, le=MOST_LEVELS), BeforeValidator(no_truth_value)]


class Distribution(BaseModel, ABC):
    """Base of the distributions."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @abstractmethod
    def quantile(self, share: Array) -> Array:
        """Return the numbers below which these shares of all draws lie."""

    def value(self, number: float) -> float | int | str:
        """Return what a description says for a drawn number."""
        return number

    def number_of(self, said: Any) -> float | None:
        """Return the number that stands for what a description says, None where none does."""
        return float(said) if isinstance(said, int | float) else None

    def ends(self) -> Array:
        """Return a low and a high number (2,): the bounds, or where it has none the quantiles 5 and 95 %."""
        return self.quantile(np.array([0.0, 1.0]))

    def at_levels(self) -> Array:
        """Return the numbers of a grid, ascending: as many as ``levels`` says, evenly in probability."""
        count = getattr(self, "levels", None)
        if count is None:
            raise ValueError("levels: missing; needed: how many values of it a grid takes")
        low, high = self._outermost()
        return np.unique(self.quantile(np.linspace(low, high, count) if count > 1 else np.array([0.5])))

    def _outermost(self) -> tuple[float, float]:
        """Return the shares at the ends of a grid."""
        return 0.0, 1.0


class _Between(Distribution):
    """A distribution between two bounds."""

    low: Number = Field(description="lowest value")
    high: Number = Field(description="highest value")

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        if not self.low < self.high:
            raise ValueError(f"found low {self.low:g} and high {self.high:g}, allowed: low less than high")
        return self


class Uniform(_Between):
    """Every value between two bounds alike."""

    distribution: Literal["uniform"]
    levels: Levels | None = Field(default=None, description="how many values of it a grid takes")

    def quantile(self, share: Array) -> Array:
        """Return the numbers below which these shares of all draws lie."""
        return np.asarray(self.low + (self.high - self.low) * share)


class LogUniform(_Between):
    """Every ratio between two bounds alike."""

    distribution: Literal["log_uniform"]
    levels: Levels | None = Field(default=None, description="how many values of it a grid takes")

    @model_validator(mode="after")
    def _is_positive(self) -> Self:
        if self.low < LEAST_OF_RATIOS:
            raise ValueError(f"low: found {self.low:g}, allowed: more than 0, at least {LEAST_OF_RATIOS:g}")
        return self

    def quantile(self, share: Array) -> Array:
        """Return the numbers below which these shares of all draws lie."""
        # The ends are what was asked for, to the last digit.
        return np.clip(self.low * (self.high / self.low) ** share, self.low, self.high)


class Integer(_Between):
    """Every whole number between two bounds, both of them included."""

    distribution: Literal["integer"]

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        for name, bound in (("low", self.low), ("high", self.high)):
            if bound != round(bound) or abs(bound) > 1e9:
                raise ValueError(f"{name}: found {bound:g}, allowed: a whole number of at most 1e9")
        return self

    def quantile(self, share: Array) -> Array:
        """Return the numbers below which these shares of all draws lie."""
        return np.minimum(self.low + np.floor((self.high - self.low + 1.0) * share), self.high)

    def value(self, number: float) -> int:
        """Return what a description says for a drawn number."""
        return int(number)

    def number_of(self, said: Any) -> float | None:
        """Return the number that stands for what a description says, None where none does."""
        return float(said) if isinstance(said, int | float) and said == round(said) else None

    def at_levels(self) -> Array:
        """Return the numbers of a grid: all of them."""
        if self.high - self.low >= MOST_LEVELS:
            raise ValueError(f"found {self.high - self.low + 1:g} levels, allowed: at most {MOST_LEVELS}")
        return np.arange(self.low, self.high + 1.0)


class Normal(Distribution):
    """Normal, cut off at bounds where it has some."""

    distribution: Literal["normal"]
    mean: Number = Field(description="mean")
    standard_deviation: Number = Field(gt=0.0, description="standard deviation, before anything is cut off")
    low: Number | None = Field(default=None, description="lowest value")
    high: Number | None = Field(default=None, description="highest value")
    levels: Levels | None = Field(default=None, description="how many values of it a grid takes")

    @model_validator(mode="after")
    def _leaves_something(self) -> Self:
        low, high = self._bounds()
        if not low < high or scipy.stats.norm.cdf(high) - scipy.stats.norm.cdf(low) < 1e-6:
            raise ValueError("low and high leave less than a millionth of the distribution between them")
        return self

    def quantile(self, share: Array) -> Array:
        """Return the numbers below which these shares of all draws lie; those of 0 and 1 only where it has bounds."""
        low, high = self._bounds()
        return np.asarray(scipy.stats.truncnorm.ppf(share, low, high, loc=self.mean, scale=self.standard_deviation))

    def ends(self) -> Array:
        """Return a low and a high number (2,): the bounds, or where it has none the quantiles 5 and 95 %."""
        return self.quantile(np.array(self._outermost()))

    def _outermost(self) -> tuple[float, float]:
        return (TAIL if self.low is None else 0.0), (1.0 - TAIL if self.high is None else 1.0)

    def _bounds(self) -> tuple[float, float]:
        """Return the bounds in standard deviations from the mean."""
        low = -np.inf if self.low is None else (self.low - self.mean) / self.standard_deviation
        high = np.inf if self.high is None else (self.high - self.mean) / self.standard_deviation
        return low, high


class Choice(Distribution):
    """One of a list of numbers or words, each alike or by weight."""

    distribution: Literal["choice"]
    values: Annotated[tuple[int | float | str, ...], Field(min_length=1, max_length=MOST_LEVELS)] = Field(
        description="what is chosen among"
    )
    weights: tuple[Annotated[Number, Field(gt=0.0)], ...] | None = Field(
        default=None, description="how often each, relative to the others; without it all alike"
    )

    @field_validator("values", mode="before")
    @classmethod
    def _numbers_or_words(cls, given: Any) -> Any:
        for one in given if isinstance(given, list | tuple) else []:
            no_truth_value(one)
            if not isinstance(one, int | float | str):
                raise ValueError(f"found {shown(one)}, allowed: numbers or words")
            if isinstance(one, int | float) and not abs(one) <= MOST:
                raise ValueError(f"found {shown(one)}, allowed: numbers of at most {MOST:g}, or words")
        return given

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if len(set(self.values)) < len(self.values):
            raise ValueError("values: one stands twice")
        if len({isinstance(one, str) for one in self.values}) > 1:
            raise ValueError("values: found numbers and words, allowed: either")
        if self.weights is not None and len(self.weights) != len(self.values):
            raise ValueError(f"weights: found {len(self.weights)}, allowed: one for each of {len(self.values)} values")
        return self

    @property
    def of_words(self) -> bool:
        """Whether words are chosen among: drawn numbers are places in the list then."""
        return isinstance(self.values[0], str)

    def quantile(self, share: Array) -> Array:
        """Return the numbers below which these shares of all draws lie, in the order of the list."""
        weights = np.ones(len(self.values)) if self.weights is None else np.array(self.weights)
        upper = np.cumsum(weights) / weights.sum()
        return self._numbers()[np.minimum(np.searchsorted(upper, share, side="right"), len(self.values) - 1)]

    def value(self, number: float) -> float | int | str:
        """Return what a description says for a drawn number."""
        return self.values[int(np.flatnonzero(self._numbers() == number)[0])]

    def number_of(self, said: Any) -> float | None:
        """Return the number that stands for what a description says, None where none does."""
        return float(self._numbers()[self.values.index(said)]) if said in self.values else None

    def ends(self) -> Array:
        """Return a low and a high number (2,): the least and the largest, or first and last of words."""
        numbers = self._numbers()
        return np.array([numbers.min(), numbers.max()])

    def at_levels(self) -> Array:
        """Return the numbers of a grid: all of them, in the order of the list."""
        return self._numbers()

    def _numbers(self) -> Array:
        return np.arange(len(self.values), dtype=float) if self.of_words else np.array(self.values, dtype=float)
