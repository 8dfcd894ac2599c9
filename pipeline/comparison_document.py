"""A comparison as data: comparison.json, and a table of the trials."""

import itertools
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from chatter_core.evidence.assessment import Assessment, Limits
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.failures import Failure
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.measured import OUTCOMES
from chatter_core.evidence.scores import COVERAGE, ERRORS, Score, Told
from chatter_core.units import si_factor
from pipeline.model_file import Content
from pipeline.telling import plain

#: Files.
DOCUMENT, TRIALS = "comparison.json", "trials.csv"
#: Correlations that are told, by their size.
STRONG_CORRELATION = 0.5
#: Borders of the probabilities of chatter between which it is counted how often cuts chattered.
PROBABILITIES = (0.0, 0.05, 0.25, 0.75, 0.95, 1.0)


def write(found: Assessment, campaign: str, given: str | None, content: Content, output: Path) -> list[Path]:
    """Write comparison.json and, where there are trials, trials.csv; return the paths."""
    paths = [output / DOCUMENT]
    paths[0].write_text(
        json.dumps(document(found, campaign, given, content), indent=1, allow_nan=False) + "\n", encoding="utf-8"
    )
    if found.comparison.model.campaign.trials is not None:
        paths.append(output / TRIALS)
        trials_table(found).to_csv(paths[1], index=False, float_format="%.6g")
    return paths


def document(found: Assessment, campaign: str, given: str | None, content: Content) -> dict[str, Any]:
    """Return everything as plain data; what is not known is null.

    given: the file of the model, None for none; content: what the model is made of.
    """
    fit = found.refitted.fit
    return {
        "campaign": campaign,
        "model": given,
        **made_of(content),
        "measured": measured(found.comparison.model.campaign),
        "coverage_of_intervals": COVERAGE,
        "held_out_groups": found.held_out_groups,
        "errors": errors(found),
        "calibration": calibration(found),
        "correlations": _correlations(found),
        "fit": {
            **fit_data(fit),
            "log_likelihood": fit.log_likelihood,
            "log_evidence": fit.log_evidence,
            "evaluations": fit.evaluations,
        },
        "reliability": reliability(found),
        "where_it_fails": {
            "as_described": [failure_data(one) for one in found.described.failures],
            "calibrated": [failure_data(one) for one in found.refitted.failures],
        },
    }


def measured(campaign: Campaign) -> dict[str, Any]:
    """Return what a campaign holds, in numbers of data."""
    trials = campaign.trials
    labels = {} if trials is None else {n: int((trials.outcome == i).sum()) for i, n in enumerate(OUTCOMES)}
    tables = {"natural_frequencies": campaign.natural_frequencies, "bearing_stiffnesses": campaign.stiffness}
    return {
        "trials": labels,
        "chatter_frequencies": 0 if trials is None else int(np.isfinite(trials.chatter_frequency).sum()),
        "receptances": [str(one) for one in campaign.receptances],
        "limit_depths": 0 if campaign.limits is None else len(campaign.limits),
        **{name: 0 if table is None else len(table.spindle_speed) for name, table in tables.items()},
    }


def errors(found: Assessment) -> dict[str, Any]:
    """Return the error of each measured quantity, as described, calibrated and on cuts held out."""
    return {
        name: {
            "unit": unit,
            "meaning": meaning,
            "as_described": _score(found.described.scores[name]),
            "calibrated": _score(found.refitted.scores[name]),
            "held_out": _score(found.held_out_scores.get(name)),
        }
        for name, (unit, meaning) in ERRORS.items()
        if name in found.refitted.scores
    }


def calibration(found: Assessment) -> dict[str, Any]:
    """Return the parameters with estimate, interval and pull, by name."""
    fit = found.refitted.fit
    return {p.name: parameter_data(fit, p.name, found.intervals[p.name]) for p in fit.parameters}


def parameter_data(fit: Fit, name: str, limits: Limits) -> dict[str, Any]:
    """Return a fitted parameter with its interval and pull as plain data; the logarithm of a factor as factor, too."""
    (index,) = (i for i, parameter in enumerate(fit.parameters) if parameter.name == name)
    parameter = fit.parameters[index]
    values = {"estimate": float(fit.estimate[index]), "low": limits.low, "high": limits.high}
    return {
        "unit": parameter.unit or "1",
        "meaning": parameter.doc,
        **values,
        **({"factor": {key: float(np.exp(v)) for key, v in values.items()}} if parameter.unit == "ln" else {}),
        "interval_by": limits.method,
        "reason": limits.reason,
        "pull": float(fit.pull[index]),
        "at_bound": bool(fit.at_bound[index]),
    }


def fit_data(fit: Fit) -> dict[str, Any]:
    """Return as plain data how a fit ended."""
    return {"converged": fit.converged, "reason": fit.reason}


def made_of(content: Content) -> dict[str, Any]:
    """Return as plain data what a model is made of."""
    return {"base": content.base, "modes": content.modes, "effects": content.effects}


def origin(given: str | None, content: Content) -> list[str]:
    """Return in sentences which model was asked; none where it is the base model of the machine as described.

    given: the file of the model, None for none; content: what it is made of.
    """
    told = [] if given is None else [f"The model to begin with, as described, is that in {given}."]
    parts = ["bearings as at rest"] if content.base == "static_bearing" else []
    if content.modes is not None:
        parts.append(f"{content.modes} mode{'' if content.modes == 1 else 's'} of each axis")
    parts += [name.replace("_", " ") for name in content.effects]
    return [*told, f"The model that was asked has {', '.join(parts)}."] if parts else told


def cautions(fit: Fit, what: str) -> list[str]:
    """Return in a sentence that a fit has not arrived; none where it has. what: the subject of the sentence."""
    return [] if fit.converged else [f"{what} did not converge: {fit.reason}. Take its numbers with care."]


def unjudged(failures: Sequence[Failure]) -> list[str]:
    """Return in sentences which data no model can be judged by, none mostly."""
    return [failure.text for failure in failures if not failure.counts]


def failure_data(failure: Failure) -> dict[str, Any]:
    """Return a failure as plain data."""
    return {name: plain(value) for name, value in vars(failure).items()}


def reliability(found: Assessment) -> list[dict[str, Any]]:
    """Return how often cuts chattered where that had such a probability, on cuts held out where there are some."""
    trials = found.comparison.model.campaign.trials
    if trials is None:
        return []
    said = found.held_out or found.refitted.told
    probability, chattered = said.probability[:, -1], trials.outcome == OUTCOMES.index("chatter")
    rows = []
    known = np.isfinite(said.margin)
    for low, high in itertools.pairwise(PROBABILITIES):
        inside = known & (probability >= low) & ((probability < high) | (high == 1.0))
        if inside.any():
            rows.append(
                {
                    "from": low,
                    "to": high,
                    "cuts": int(inside.sum()),
                    "predicted": float(probability[inside].mean()),
                    "chattered": float(chattered[inside].mean()),
                }
            )
    return rows


def trials_table(found: Assessment) -> pd.DataFrame:
    """Return every trial with what was measured and what each version of the model says of it."""
    trials = found.comparison.model.campaign.trials
    assert trials is not None
    columns: dict[str, Any] = {
        "trial": trials.trial,
        "spindle_speed_rpm": trials.spindle_speed / si_factor("spindle_speed_rpm"),
        "axial_depth_mm": trials.axial_depth / si_factor("axial_depth_mm"),
        "outcome": [OUTCOMES[code] for code in trials.outcome],
        "chatter_frequency_hz": trials.chatter_frequency / si_factor("chatter_frequency_hz"),
    }
    versions = {"as_described": found.described.told, "calibrated": found.refitted.told, "held_out": found.held_out}
    for name, said in versions.items():
        if said is not None:
            columns |= _columns(name, said)
    columns["dominant_mode_calibrated"] = found.refitted.dominant_mode
    return pd.DataFrame(columns)


def _columns(name: str, said: Told) -> dict[str, Any]:
    return {
        f"margin_{name}": said.margin,
        f"probability_chatter_{name}": np.where(np.isnan(said.margin), np.nan, said.probability[:, -1]),
        f"chatter_frequency_{name}_hz": said.chatter_frequency / si_factor("chatter_frequency_hz"),
    }


def _score(score: Score | None) -> dict[str, Any] | None:
    return None if score is None else {name: plain(value) for name, value in vars(score).items()}


def _correlations(found: Assessment) -> list[dict[str, Any]]:
    """Return the pairs of parameters that the data hardly part, the strongest first."""
    fit = found.refitted.fit
    first, second = np.triu_indices(len(fit.parameters), k=1)
    strength = fit.correlation[first, second]
    kept = [k for k in np.argsort(-np.abs(strength)) if abs(strength[k]) > STRONG_CORRELATION]
    return [
        {
            "between": [fit.parameters[first[k]].name, fit.parameters[second[k]].name],
            "correlation": float(strength[k]),
        }
        for k in kept
    ]
