"""A diagnosis as data: diagnosis.json, and a table of what the campaign could have shown."""

import json
from pathlib import Path
from typing import Any

import pandas as pd

from chatter_core.evidence.assessment import Limits, curvature
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.next_measurement import NextMeasurement
from chatter_core.evidence.power import ENOUGH, USUAL
from chatter_core.evidence.ranking import NOTHING, Ranked
from chatter_core.evidence.scores import COVERAGE, ERRORS, Score
from chatter_core.units import si_factor
from pipeline import corrections
from pipeline.comparison_document import cautions, failure_data, fit_data, made_of, measured, parameter_data
from pipeline.diagnosis import Diagnosis, name_of
from pipeline.telling import plain

#: Files.
DOCUMENT, POWER = "diagnosis.json", "power.csv"
#: Measurements that are told of, those most worth their cost.
MEASUREMENTS = 5
#: A measurement that is expected to tell less than this parts nothing [nats].
WORTH_ITS_COST = 0.01
#: Quantities whose error on what was held out a ranking tells, the first that there is.
TOLD_HELD_OUT = ("outcome", "limit_depth")
#: Why intervals are of the curvature alone.
NOT_PROFILED = "not profiled: a diagnosis fits too many models"


def write(told: dict[str, Any], path: Path) -> Path:
    """Write a diagnosis as ``document`` has it; return the path."""
    path.write_text(json.dumps(told, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return path


def write_power(found: Diagnosis, path: Path) -> Path:
    """Write the table of what the campaign could have shown; return the path."""
    power_table(found).to_csv(path, index=False, float_format="%.4g")
    return path


def document(found: Diagnosis, campaign: str, given: str | None) -> dict[str, Any]:
    """Return everything as plain data; what is not known is null. given: the file of the model, None for none."""
    return {
        "campaign": campaign,
        "model": given,
        **made_of(found.content),
        "verdict": found.verdict.kind,
        "missing": list(found.verdict.missing),
        "text": found.verdict.text,
        "cautions": unsettled(found),
        "ranking": [ranked_data(found, one) for one in found.ranking if one.name != NOTHING],
        "probability_of_none": next(one.probability for one in found.ranking if one.name == NOTHING),
        # Single effects and nothing missing share one probability; a pair stands beside them by its evidence.
        "pair": None if found.pair is None else ranked_data(found, found.pair) | {"probability": None},
        "other_pairs": [{"effect": one.name, "score": one.gain} for one in found.pairs[1:]],
        "calibration": parameters_of(found.base, set()),
        "coverage_of_intervals": COVERAGE,
        "where_it_fails": [failure_data(failure) for failure in found.judged[NOTHING].failures],
        "not_tried": [{"effect": name, "reason": reason} for name, reason in found.not_tried.items()],
        "still_fails": [failure_data(failure) for failure in found.left[name_of(found.best)]],
        "corrections": corrections.data(found.corrections),
        "corrections_text": None if found.corrections is None else found.corrections.text,
        "errors": errors(found),
        "next_trial": next_trial_data(found),
        "next_measurements": next_measurements_data(found),
        "power": power_table(found).to_dict(orient="records"),
        "measured": measured(found.base.comparison.model.campaign),
    }


def ranked_data(found: Diagnosis, one: Ranked) -> dict[str, Any]:
    """Return an effect of the ranking as plain data."""
    best = one.best
    return {
        "effect": one.name,
        "probability": one.probability,
        "score": one.gain,
        "settings": {candidate.name: candidate.settings for candidate in best.candidates},
        "heldout_quantity": held_out_quantity(found),
        "heldout_error_before": _value(held_out_score(found, NOTHING)),
        "heldout_error_after": _value(held_out_score(found, one.name)),
        "parameters": {
            name if len(best.candidates) == 1 else f"{candidate.name}.{name}": told
            for candidate in best.candidates
            for name, told in effect_parameters(found, best, candidate.name).items()
        },
        "calibration": parameters_of(best, {p.name for c in best.candidates for p in c.term.parameters}),
        "fit": fit_data(best.fit),
    }


def unsettled(found: Diagnosis) -> list[str]:
    """Return in sentences which fits that the verdict rests on have not arrived: the base model's, the best one's."""
    told = cautions(found.base.fit, "The calibration of the base model")
    return told + ([] if found.best is found.base else cautions(found.best.fit, f"The fit with {found.best.name}"))


def effect_parameters(found: Diagnosis, hypothesis: Hypothesis, effect: str) -> dict[str, Any]:
    """Return the parameters of one effect by their own names, with intervals: profiled where the effect is named."""
    own = [p.name for c in hypothesis.candidates if c.name == effect for p in c.term.parameters]
    profiled = found.intervals if hypothesis is found.supported else {}
    return {name.removeprefix(f"{effect}."): _parameter(hypothesis.fit, name, profiled.get(name)) for name in own}


def parameters_of(hypothesis: Hypothesis, without: set[str]) -> dict[str, Any]:
    """Return the parameters of a hypothesis by name, but for some."""
    names = [parameter.name for parameter in hypothesis.fit.parameters]
    return {name: _parameter(hypothesis.fit, name) for name in names if name not in without}


def _parameter(fit: Fit, name: str, limits: Limits | None = None) -> dict[str, Any]:
    return parameter_data(fit, name, curvature(fit, name, NOT_PROFILED) if limits is None else limits)


def held_out_quantity(found: Diagnosis) -> str | None:
    """Return the quantity whose error on what was held out a ranking tells, None where nothing was."""
    known = found.held_out.get(NOTHING, {})
    return next((quantity for quantity in TOLD_HELD_OUT if quantity in known), None)


def held_out_score(found: Diagnosis, name: str) -> Score | None:
    """Return the score of a hypothesis on what was held out, of the quantity that is told; None where not known."""
    quantity = held_out_quantity(found)
    return None if quantity is None else found.held_out.get(name, {}).get(quantity)


def _value(score: Score | None) -> Any:
    return None if score is None else plain(score.value)


def errors(found: Diagnosis) -> dict[str, Any]:
    """Return the errors on cuts held out by quantity and hypothesis."""
    return {
        quantity: {
            "unit": ERRORS[quantity][0],
            "meaning": ERRORS[quantity][1],
            **{name: plain(scores[quantity].value) for name, scores in found.held_out.items() if quantity in scores},
        }
        for quantity in ERRORS
        if any(quantity in scores for scores in found.held_out.values())
    }


def next_trial_data(found: Diagnosis) -> dict[str, Any] | None:
    """Return the cut that would part the contenders."""
    trial = found.next_trial
    if trial is None or len(found.ranking) < 2:
        return None
    names = [one.name for one in found.contenders]
    speed = trial.spindle_speed / si_factor("spindle_speed_rpm")
    depth = trial.axial_depth / si_factor("axial_depth_mm")
    chances = [f"{100.0 * p:.0f} % by {name}" for p, name in zip(trial.probability, names, strict=True)]
    doubt = ", if one of the two is right, against which a check speaks" if found.verdict.kind == "unexplained" else ""
    text = (
        f"A cut at {speed:.0f} rpm and {depth:.3g} mm would chatter with {chances[0]} and {chances[1]}: "
        f"expected to tell {trial.expected_gain:.2g} nats{doubt}."
        if trial.expected_gain >= WORTH_ITS_COST
        else f"No cut at the speeds and depths of the campaign would part {' from '.join(names)}."
    )
    return {
        "spindle_speed_rpm": speed,
        "axial_depth_mm": depth,
        "separates": names,
        "expected_gain_nats": trial.expected_gain,
        "text": text,
    }


def next_measurements_data(found: Diagnosis) -> list[dict[str, Any]]:
    """Return the measurements that would part the contenders, none where nothing would."""
    worth = [one for one in found.next_measurements if one.expected_gain >= WORTH_ITS_COST]
    return [measurement_data(one) for one in worth[:MEASUREMENTS]]


def measurement_data(one: NextMeasurement) -> dict[str, Any]:
    """Return a measurement that would part the contenders."""
    speed = one.spindle_speed / si_factor("spindle_speed_rpm")
    depth = None if one.axial_depth is None else one.axial_depth / si_factor("axial_depth_mm")
    where = "at rest" if speed == 0.0 else f"at {speed:.0f} rpm" + ("" if depth is None else f" and {depth:.3g} mm")
    return {
        "kind": one.kind,
        "spindle_speed_rpm": speed,
        "axial_depth_mm": depth,
        "expected_gain_nats": one.expected_gain,
        "cost_in_cuts": one.cost,
        "text": f"{one.kind} {where}: {one.expected_gain:.2g} nats for {one.cost:g} cut{'s' if one.cost > 1 else ''}",
    }


def power_table(found: Diagnosis) -> pd.DataFrame:
    """Return what each candidate of usual size would have left in the campaign, by kind of measurement."""
    rows = []
    for power in found.powers:
        sizes = [f"{p.searched_at(USUAL):.4g} {p.unit}".strip() for p in power.candidate.amplitudes]
        rows.append(
            {
                "effect": power.candidate.name,
                "variant": ", ".join(f"{k} {v}" for k, v in power.candidate.settings.items()),
                "size": ", ".join(sizes),
                "nats": float(power.nats),
                "seen": bool(power.nats >= ENOUGH),
                **{f"nats_of_{name}": float(share) for name, share in power.by_quantity.items()},
            }
        )
    return pd.DataFrame(rows)
