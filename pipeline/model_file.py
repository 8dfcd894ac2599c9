"""A calibrated model as a file, model.yaml: what was fitted, how surely, and of which machine."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field
from pathlib import Path
from typing import Any, Literal, Self

import numpy as np
import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from chatter_core.effects import effect_class, effect_names
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Campaign
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.machine import Machine, no_truth_value
from chatter_core.parameters import Parameter
from chatter_core.reading import load_yaml, sentences, shown
from pipeline.fitted_cuts import marks, other_marks
from pipeline.settings import differing_keys, own_digests

HEAD = """# A calibrated model: the machine that it belongs to, effects, and parameters as they were fitted.
# Logarithms of factors have the unit ln. Give it to compare or predict as model=FILE.
"""
#: Parameters of a response are of its measurement, and say nothing of other cuts.
OF_A_RESPONSE = "receptance_"
#: Widths of its prior that an estimate may be away from it: of what lies farther no computer holds the factor.
FARTHEST = 100.0
#: Parameters that depend on what was cut: absent where nothing was, or no label is marginal.
OPTIONAL = ("marginal_width", "mislabelled", "outcome_width")
#: Digits of estimates, and of correlations.
DIGITS, CORRELATION_DIGITS = 8, 5


@dataclass(frozen=True, kw_only=True)
class Content:
    """What a model is made of: its base, the modes of each axis that this keeps, and effects with their settings.

    effects_path: folder of the user's own effects, as the command line named it; a file never does.
    """

    base: Literal["full", "static_bearing"] = "full"
    modes: int | None = None
    effects: dict[str, dict[str, Any]] = dataclass_field(default_factory=dict)
    effects_path: Path | None = None

    def with_effect(self, name: str, settings: dict[str, Any]) -> "Content":
        """Return the same with one effect more."""
        return replace(self, effects={**self.effects, name: settings})


class FittedParameter(BaseModel):
    """A parameter of the model."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    name: str = Field(description="name of the parameter")
    unit: str = Field(description="unit, ln for the logarithm of a factor")
    estimate: float = Field(description="fitted value")
    standard_deviation: float = Field(ge=0, description="its standard deviation")

    _no_truth_values = field_validator("estimate", "standard_deviation", mode="before")(no_truth_value)


class ModelFile(BaseModel):
    """Content of a model file."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    base: Literal["full", "static_bearing"] = Field(default="full", description="what the base model holds")
    modes: int | None = Field(default=None, ge=1, le=100, description="modes of each axis that the base model keeps")
    effects: dict[str, dict[str, Any]] = Field(description="effects beyond the base model, each with its settings")
    own_effects: dict[str, str] = Field(
        default={}, description="of the user's own among them, digests of the files that were fitted"
    )
    parameters: tuple[FittedParameter, ...] = Field(max_length=1000, description="fitted parameters")
    correlation: tuple[tuple[float, ...], ...] = Field(description="how they correlate, a row for each")
    fitted_cuts: tuple[str, ...] = Field(default=(), description="marks of the cuts that they were fitted to")
    fitted_measurements: tuple[str, ...] = Field(
        default=(), description="marks of the measurements without cutting that they were fitted to"
    )
    machine: Machine = Field(description="the machine as described, that the parameters belong to")

    _no_truth_values = field_validator("modes", mode="before")(no_truth_value)

    @model_validator(mode="after")
    def _correlation_is_one(self) -> Self:
        count = len(self.parameters)
        if any(len(row) != count for row in self.correlation) or len(self.correlation) != count:
            raise ValueError(f"correlation: needed {count} rows of {count} numbers, as there are parameters")
        matrix = np.array(self.correlation).reshape(count, count)
        if count and (np.abs(matrix - matrix.T).max() > 1e-9 or np.linalg.eigvalsh(matrix).min() < -1e-3):
            raise ValueError("correlation: the matrix must be symmetric and have no negative eigenvalue")
        if count and np.abs(np.diag(matrix) - 1.0).max() > 1e-9:
            raise ValueError("correlation: every parameter correlates with itself by 1, on the diagonal")
        return self

    def content(self, own: Path | None) -> Content:
        """Return what the model is made of; own: folder of the user's own effects."""
        return Content(base=self.base, modes=self.modes, effects=self.effects, effects_path=own)

    @property
    def belief(self) -> Belief:
        """The parameters as predictions use them."""
        return Belief(
            names=tuple(parameter.name for parameter in self.parameters),
            estimate=np.array([parameter.estimate for parameter in self.parameters]),
            deviation=np.array([parameter.standard_deviation for parameter in self.parameters]),
            correlation=np.array(self.correlation).reshape(len(self.parameters), len(self.parameters)),
        )


def write(path: Path, campaign: Campaign, fit: Fit, content: Content, remarks: Sequence[str] = ()) -> None:
    """Write a fit to a campaign as a model file; content: what the model is made of; remarks: for those who read it."""
    kept = [i for i, parameter in enumerate(fit.parameters) if not parameter.name.startswith(OF_A_RESPONSE)]
    parameters = [
        {
            "name": fit.parameters[i].name,
            "unit": fit.parameters[i].unit,
            "estimate": _written(fit.parameters[i], fit.estimate[i]),
            "standard_deviation": _rounded(fit.standard_deviation[i], DIGITS),
        }
        for i in kept
    ]
    correlation = [[round(float(fit.correlation[i, j]), CORRELATION_DIGITS) for j in kept] for i in kept]
    written = {
        "base": content.base,
        **({"modes": content.modes} if content.modes is not None else {}),
        "effects": content.effects,
        **({"own_effects": digests} if (digests := own_digests(content.effects, content.effects_path)) else {}),
        "parameters": parameters,
        "correlation": correlation,
        **({"fitted_cuts": cuts} if (cuts := marks(campaign)) else {}),
        **({"fitted_measurements": others} if (others := other_marks(campaign)) else {}),
        "machine": campaign.machine.described(),
    }
    head = HEAD + "".join(f"# {remark}\n" for remark in remarks)
    path.write_text(head + yaml.safe_dump(written, sort_keys=False, default_flow_style=None, width=120), "utf-8")


def read(path: Path, machine: Machine, own: Path | None = None) -> ModelFile:
    """Return the model in a file.

    own: folder of the user's own effects, where it may have some of its effects from.

    Raises InvalidInput when it cannot be read, names an effect that there is not or that was changed since, or belongs
    to another machine than the campaign's.
    """
    found = _read(path)
    problems = [
        problem for name, settings in found.effects.items() for problem in _effect_problems(name, settings, own)
    ]
    problems = problems or _changed_effects(found, own)
    if problems:
        raise InvalidInput([f"{path}: {problem}" for problem in problems])
    differing = differing_keys(found.machine.described(), machine.described())
    if differing:
        raise InvalidInput(
            [f"{path}: belongs to another machine than the campaign's machine.yaml; they differ in {_some(differing)}"]
        )
    return found


def _read(path: Path) -> ModelFile:
    """Return what a file says of a model; raise InvalidInput where it says none."""
    content = load_yaml(path)
    if content and not {*content} & {*ModelFile.model_fields}:
        keys = ", ".join(map(shown, [*content][:6]))
        wanted = "needed: a model.yaml that compare, diagnose or improve wrote"
        raise InvalidInput([f"{path}: is no calibrated model but has the keys {keys}; {wanted}"])
    try:
        return ModelFile.model_validate(content)
    except ValidationError as error:
        raise InvalidInput([f"{path}: {sentence}" for sentence in sentences(error, ModelFile)]) from None


def another_campaign(path: Path, campaign: Campaign) -> str:
    """Return in words why the model in a file is of another campaign of the same name, "" where it is not.

    A campaign with some of the cuts may have a machine that was corrected since; one without any has the same machine
    and some of the other measurements. A file that cannot be read says nothing.
    """
    try:
        found = _read(path)
    except InvalidInput:
        return ""
    cuts, others = marks(campaign), other_marks(campaign)
    if cuts and found.fitted_cuts:
        return "" if {*cuts} & {*found.fitted_cuts} else "it has none of these cuts"
    if not {*cuts, *others} & {*found.fitted_cuts, *found.fitted_measurements}:
        return "it has none of these measurements"
    differing = differing_keys(found.machine.described(), campaign.machine.described())
    return f"it has another machine, they differ in {_some(differing)}" if differing else ""


def _some(keys: Sequence[str]) -> str:
    """Return the first of many keys in words."""
    return ", ".join(keys[:6]) + (f" and {len(keys) - 6} more" if len(keys) > 6 else "")


def _effect_problems(name: str, settings: dict[str, Any], own: Path | None) -> list[str]:
    """Return what is wrong with an effect of a model file."""
    if own is None and name not in effect_names():
        return [
            f"effects: found {shown(name)}, which the program has not; where it is your own, "
            "name its folder by effects_path=DIR"
        ]
    try:
        kind = effect_class(name, own)
        known = [setting.name for setting in kind.settings]
        if sorted(settings) != sorted(known):
            return [f"effects.{name}: found {', '.join(settings) or 'none'}; needed: {', '.join(known) or 'none'}"]
        kind(**settings)
    except InvalidInput as error:
        return error.problems
    return []


def _changed_effects(found: ModelFile, own: Path | None) -> list[str]:
    """Return which of the user's own effects are not any more what was fitted."""
    unknown = [name for name in found.own_effects if name not in found.effects]
    if unknown:
        return [f"own_effects: found {shown(name)}, which is not among the effects of the model" for name in unknown]
    now = own_digests(found.effects, own)
    return [
        f"effects.{name}: {name}.py was changed since the model was fitted; fit the model again"
        for name, digest in found.own_effects.items()
        if now.get(name) != digest
    ]


def belief_of(found: ModelFile, path: Path, model: CampaignModel) -> Belief:
    """Return what a model file says of the parameters of a model.

    Raises InvalidInput when it lacks a parameter of the model, names one that the model has not, or twice, in another
    unit or with a value that it does not allow.
    """
    problems = [f"{path}: {problem}" for problem in _parameter_problems(found, model)]
    if problems:
        raise InvalidInput(problems)
    return found.belief


def _parameter_problems(found: ModelFile, model: CampaignModel) -> Iterator[str]:
    """Yield what is wrong with the parameters, seen by the model's own."""
    known = {parameter.name: parameter for parameter in model.parameters}
    names = [parameter.name for parameter in found.parameters]
    missing = [name for name in known if name not in (*names, *OPTIONAL) and not name.startswith(OF_A_RESPONSE)]
    for name in missing:
        yield f"parameters: {name}: missing; needed: every parameter of the model, so restore it or fit the model again"
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield f"parameters: {shown(name)} stands twice; keep one of them"
    for parameter in found.parameters:
        own = known.get(parameter.name)
        if own is None:
            if parameter.name not in OPTIONAL:
                yield f"parameters: {shown(parameter.name)}: unknown; allowed: {', '.join(known)}"
            continue
        if parameter.unit != own.unit:
            yield f"parameters: {own.name}: found unit {shown(parameter.unit)}, allowed: {shown(own.unit)}"
        reach = FARTHEST * own.prior_width
        lower, upper = max(own.lower, own.prior_mean - reach), min(own.upper, own.prior_mean + reach)
        if not lower <= parameter.estimate <= upper:
            yield (f"parameters: {own.name}: found {parameter.estimate:g} {own.unit}, allowed {lower:g} to {upper:g}")
        if parameter.standard_deviation > reach:
            yield (
                f"parameters: {own.name}: found the standard deviation {parameter.standard_deviation:g} {own.unit}, "
                f"allowed 0 to {reach:g}"
            )


def _written(parameter: Parameter, estimate: Any) -> float:
    """Return an estimate as it is written; one that rounding would take beyond a bound is the bound with all digits."""
    return float(np.clip(_rounded(estimate, DIGITS), parameter.lower, parameter.upper))


def _rounded(value: Any, digits: int) -> float:
    return float(f"{float(value):.{digits}g}")
