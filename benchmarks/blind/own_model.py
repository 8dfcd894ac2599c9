"""The same shops, drawn from the program's own model: how much easier it is to find what one put in oneself.

The machine, the cuts and the responses are those of a generated campaign; parameters are drawn from their priors,
hidden effects by their own laws, and what is measured has the errors that the likelihoods state.
"""

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.blind.tables import read_rows, write_rows
from chatter_core.effects import Effect, variants
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Campaign, base_model, read_campaign
from chatter_core.evidence.measured import OUTCOMES, Receptance
from chatter_core.machine import Machine
from chatter_core.parameters import Array, Parameter
from chatter_core.units import si_factor
from tests.hidden_effect.design import Plan, plan
from tests.synthetic import drawn_truth, measured

#: Sizes of effects from weak to strong, in widths of their priors.
WEAK, STRONG = 0.5, 3.0
#: Kept-back cuts over those in the campaign, as the generator has them, and how far they lie from these in ln(depth).
KEPT_BACK, ASIDE = 3.0 / 7.0, 0.2
#: A drawn machine is worth a campaign when the share of its cuts that chatter lies between these.
CHATTER = (0.1, 0.9)
MOST_DRAWS = 40


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """A campaign, the cuts kept back with whether they chatter (trial,), and the parameters of the truth by name."""

    campaign: Campaign
    back: Campaign
    back_chatters: NDArray[np.bool_]
    parameters: dict[str, float]
    effects: tuple[Effect, ...]


def draw(folder: Path, place: Path, truth_place: Path, seed: int) -> bool:
    """Write a campaign and its truth after the example of a generated one; return whether there is one.

    What has no name has no law here either. The campaign is moved to its place last of all.

    Raises ValueError when no drawn machine is worth a campaign.
    """
    planned = plan(seed)
    if planned.kind == "foreign" or place.is_dir():
        return planned.kind != "foreign"
    example = _unjudged(read_campaign(folder))
    for attempt in range(MOST_DRAWS):
        found = _drawn(planned, example, np.random.default_rng([seed, 30, attempt]))
        if found is not None:
            _write(found, planned, folder, place, truth_place)
            return True
    raise ValueError(f"seed {seed}: none of {MOST_DRAWS} draws of the program's own model is worth a campaign")


def _unjudged(example: Campaign) -> Campaign:
    """Return the cuts and responses of a campaign without what was found in them."""
    assert example.trials is not None
    trials = replace(example.trials, outcome=np.zeros(len(example.trials), dtype=np.int8))
    return replace(example, trials=trials, natural_frequencies=None, stiffness=None)


def _drawn(planned: Plan, example: Campaign, rng: np.random.Generator) -> Drawn | None:
    """Return a campaign after an example; None where it is not worth one, or out of the model's range."""
    chosen = [_variant(name, example.machine, rng) for name in planned.effects]
    effects = tuple(sorted(chosen, key=lambda effect: effect.place()))
    model = base_model(example, effects)
    truth = drawn_truth(model, rng)
    for effect, strength in zip(chosen, planned.strengths, strict=True):
        set_strength(truth, model.parameters, effect, strength, rng)
    back = _kept_back(example, rng)
    parameters = model.named(truth)
    try:
        found = measured(example, truth, rng, effects)
        of_back = base_model(back, effects)
        margin = of_back.predict(np.array([parameters[p.name] for p in of_back.parameters])).margin
    except InvalidInput:
        return None
    assert found.trials is not None
    share = float((found.trials.outcome == OUTCOMES.index("chatter")).mean())
    if not CHATTER[0] <= share <= CHATTER[1] or np.isnan(margin).any():
        return None
    return Drawn(campaign=found, back=back, back_chatters=margin > 0.0, parameters=parameters, effects=effects)


def _variant(name: str, machine: Machine, rng: np.random.Generator) -> Effect:
    """Return an effect in a variant that can act on a machine."""
    able = [effect for effect in variants(name) if _acts(effect, machine)]
    return able[int(rng.integers(len(able)))]


def _acts(effect: Effect, machine: Machine) -> bool:
    try:
        effect.require(machine)
    except InvalidInput:
        return False
    return True


def set_strength(
    values: Array, parameters: tuple[Parameter, ...], effect: Effect, strength: float, rng: np.random.Generator
) -> None:
    """Set the amplitudes of an effect among values (parameter,); to either side where they can go there."""
    size = WEAK * (STRONG / WEAK) ** strength
    shapes = {f"{effect.name()}.{shape}" for shape in effect.shapes}
    own = {parameter.name for parameter in effect.parameters} - shapes
    for index, parameter in enumerate(parameters):
        if parameter.name in own:
            side = rng.choice([-1.0, 1.0]) if parameter.lower < parameter.null < parameter.upper else 1.0
            values[index] = parameter.aside(side * size)


def _kept_back(example: Campaign, rng: np.random.Generator) -> Campaign:
    """Return other cuts of the same machine, near some of the campaign's."""
    assert example.trials is not None
    count = len(example.trials)
    some = example.trials.at(np.sort(rng.choice(count, round(KEPT_BACK * count), replace=False)))
    aside = np.exp(ASIDE * rng.uniform(-1.0, 1.0, len(some)))
    return replace(example, trials=replace(some, axial_depth=some.axial_depth * aside), receptances=())


def _write(found: Drawn, planned: Plan, folder: Path, place: Path, truth_place: Path) -> None:
    """Write truth and campaign; the campaign is moved to its place last."""
    assert found.campaign.trials is not None
    draft = place.with_name(f".{place.name}.draft")
    for stale in (draft, truth_place):
        shutil.rmtree(stale, ignore_errors=True)
        stale.mkdir(parents=True)
    truth = {
        "kind": planned.kind,
        "effect_names": list(planned.effects),
        "foreign": [],
        "strengths": list(planned.strengths),
        "parameters": found.parameters,
        "settings": {
            effect.name(): {setting.name: getattr(effect, setting.name) for setting in effect.settings}
            for effect in found.effects
        },
    }
    (truth_place / "truth.json").write_text(json.dumps(truth, indent=1) + "\n", encoding="utf-8")
    silent = np.full(len(found.back_chatters), np.nan)
    _write_cuts(truth_place / "stability_test.csv", folder, found.back, found.back_chatters, silent)
    shutil.copyfile(folder / "machine.yaml", draft / "machine.yaml")
    chatters = found.campaign.trials.outcome == OUTCOMES.index("chatter")
    _write_cuts(draft / "stability.csv", folder, found.campaign, chatters, found.campaign.trials.chatter_frequency)
    # Without an effect that couples the axes a cross response of this model is nothing, not even noise.
    responses = [one for one in found.campaign.receptances if one.value.any()]
    if responses:
        write_rows(draft / "frf.csv", [row for one in responses for row in _response_rows(one)])
    draft.replace(place)


def _write_cuts(
    path: Path, folder: Path, campaign: Campaign, chatters: NDArray[np.bool_], chatter_frequency: Array
) -> None:
    """Write cuts with their outcomes; what else they have is as in the example."""
    rows = {int(row["trial"]): row for row in read_rows(folder / "stability.csv")}
    trials, written = campaign.trials, []
    assert trials is not None
    for index, number in enumerate(trials.trial):
        heard = chatters[index] and np.isfinite(chatter_frequency[index])
        frequency = chatter_frequency[index] / si_factor("chatter_frequency_hz") if heard else None
        written.append(
            {
                **rows[int(number)],
                "axial_depth_mm": f"{trials.axial_depth[index] / si_factor('axial_depth_mm'):.6g}",
                "outcome": "chatter" if chatters[index] else "stable",
                "chatter_frequency_hz": "" if frequency is None else f"{frequency:.1f}",
            }
        )
    write_rows(path, written)


def _response_rows(one: Receptance) -> list[dict[str, Any]]:
    """Return the rows of frf.csv of a response."""
    return [
        {
            "spindle_speed_rpm": f"{one.spindle_speed / si_factor('spindle_speed_rpm'):g}",
            "frequency_hz": f"{frequency / si_factor('frequency_hz'):.1f}",
            "output_axis": "xy"[one.output_axis],
            "input_axis": "xy"[one.input_axis],
            "real_um_n": f"{value.real / si_factor('real_um_n'):.6g}",
            "imag_um_n": f"{value.imag / si_factor('imag_um_n'):.6g}",
        }
        for frequency, value in zip(one.frequency, one.value, strict=True)
    ]
