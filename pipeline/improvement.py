"""A model with what is missing added: diagnose, add, calibrate again, until nothing more is supported."""

from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from chatter_core.evidence import CampaignModel, Comparison
from chatter_core.evidence.assessment import Assessment, Version, as_described, version
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.held_out import groups
from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import ERRORS, Score
from pipeline.after_verdict import completed, side_by_side, with_pictures
from pipeline.campaigns import Asked, model_of
from pipeline.cluster import Workers
from pipeline.diagnosis import Diagnosis, diagnose
from pipeline.model_file import Content

#: Effects are added so many times at most.
MOST_STEPS = 3
#: Errors on cuts, which a model as described has not seen: only the labels' noise and the sensors are fitted then.
OF_CUTS = ("outcome", "depth_margin", "chatter_frequency", "limit_depth")


@dataclass(frozen=True, kw_only=True)
class Improvement:
    """What became of a model.

    diagnoses: in turn; final: the hypothesis in the end, and content: what it is made of; added: names of the effects
    that it has more than in the beginning; history: a row for each version of the model, where a pair is added one for
    its better half first; before_and_after: the base model calibrated and the final one with their lobes, for pictures;
    where nothing was added, the best of the first diagnosis takes its place, and None is there where that is the base
    model.
    """

    diagnoses: list[Diagnosis]
    final: Hypothesis
    content: Content
    added: tuple[str, ...]
    history: pd.DataFrame
    before_and_after: Assessment | None

    @property
    def unfinished(self) -> bool:
        """Whether the last diagnosis names an effect that is not added any more."""
        last = self.diagnoses[-1]
        return last.supported is not last.base

    @property
    def stand_for(self) -> list[str]:
        """Sentences about effects that were added and stand for others, which the measurements cannot part."""
        return [
            line
            for one in self.diagnoses
            if one.best.name and set(one.best.names) <= set(self.added)
            for line in one.stands_for
        ]

    @property
    def final_version(self) -> Version:
        """The final hypothesis held against the campaign."""
        return self.diagnoses[-1].version(self.final)


def improve(workers: Workers | None, asked: Asked) -> Improvement:
    """Return a model with what is missing added, step by step."""
    model, belief, content = asked.model, asked.belief, asked.content
    rows = [row_as_described(model, belief, unseen=asked.unseen)]
    diagnoses: list[Diagnosis] = []
    known: Fit | None = None
    pairs: list[Hypothesis] | None = None
    of_base: dict[str, Score] | None = None
    while True:
        found = diagnose(workers, model, belief, content, known, pairs, seconds=len(diagnoses) < MOST_STEPS)
        found = completed(workers, found, belief, of_base)
        if not diagnoses:
            rows.append(_row("calibrated", found.version(found.base), found.held_out.get(NOTHING, {})))
        diagnoses.append(found)
        best = found.supported
        if best is found.base or len(diagnoses) > MOST_STEPS:
            break
        if (half := found.better_half) is not None:
            rows.append(_row(half_of(found, half), found.version(half), found.held_out.get(half.name, {})))
        content = found.supported_content
        rows.append(_row(" + ".join(content.effects), found.version(best), found.held_out.get(best.name, {})))
        model, known = model_of(model.campaign, content), best.fit
        pairs = found.beside if best is found.ranking[0].best else None
        of_base = found.held_out.get(best.name)
    added = tuple(name for name in content.effects if name not in asked.content.effects)
    return Improvement(
        diagnoses=diagnoses,
        final=diagnoses[-1].base,
        content=content,
        added=added,
        history=_history(rows),
        before_and_after=_before_and_after(workers, diagnoses, added),
    )


def _before_and_after(workers: Workers | None, diagnoses: list[Diagnosis], added: tuple[str, ...]) -> Assessment | None:
    """Return the calibrated base model and the final one side by side."""
    first, last = diagnoses[0], diagnoses[-1]
    if not added:
        return with_pictures(workers, first).before_and_after
    final = replace(last.version(last.base), title=f"With {' + '.join(added).replace('_', ' ')}")
    return side_by_side(workers, (first.base, first.version(first.base)), (last.base, final))


def half_of(found: Diagnosis, half: Hypothesis) -> str:
    """Return how the row of one half of a pair is called: by its effects, and the variant if the pair has another."""
    (candidate,) = half.candidates
    of_the_pair = {str(one) for one in found.supported.candidates}
    return " + ".join([*found.content.effects, half.name if str(candidate) in of_the_pair else str(candidate)])


def row_as_described(model: CampaignModel, belief: Belief, *, unseen: bool) -> dict[str, Any]:
    """Return the row of the model as described, whose cuts all are held out where it was fitted to none of them."""
    comparison = Comparison(model=model)
    found = version("As described", comparison, as_described(comparison, belief), belief.about(model), ())
    held_out = OF_CUTS if unseen and groups(model.campaign) else ()
    return _row("as described", found, {name: found.scores[name] for name in held_out if name in found.scores})


def _history(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return a table of rows: errors on the data of the fit, then those on cuts held out, then the evidence."""
    kinds = [f"{name}_{kind}" for kind in ("in_sample", "held_out") for name in ERRORS]
    columns = ["effect", *(name for name in kinds if any(name in row for row in rows)), "log_evidence"]
    return pd.DataFrame(rows, columns=columns).rename_axis("step").reset_index()


def _row(effect: str, found: Version, held_out: dict[str, Score]) -> dict[str, Any]:
    """Return a row of the history: errors in and out of sample by quantity."""
    inside = {f"{name}_in_sample": found.scores[name].value for name in ERRORS if name in found.scores}
    outside = {f"{name}_held_out": held_out[name].value for name in ERRORS if name in held_out}
    return {"effect": effect, **inside, **outside, "log_evidence": found.fit.log_evidence}
