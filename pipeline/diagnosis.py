"""What is missing in a model: every candidate is fitted to a campaign, and one of five answers given."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from distributed import Client

from chatter_core.effects import effect_names, variants
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Comparison, calibrate
from chatter_core.evidence.assessment import Assessment, curvature, dominant_modes, version
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.boundary import field, setups
from chatter_core.evidence.candidates import Candidate, Hypothesis, fit_hypothesis, refit, slope_of
from chatter_core.evidence.failures import Failure, failures
from chatter_core.evidence.held_out import groups, held_out, together
from chatter_core.evidence.next_trial import NextTrial, next_trial
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.power import Power, power
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.evidence.ranking import NOTHING, Ranked, rank
from chatter_core.evidence.scores import Score, cut_scores
from chatter_core.evidence.verdict import Verdict, decide, failed_checks
from pipeline.campaigns import settings_of
from pipeline.jobs import Job, spread, spread_parts
from pipeline.model_file import Content

#: Effects that restore what a base model was asked to leave out.
RESTORING = {"speed_dependent_bearing": "base", "higher_modes": "modes"}
#: Hypotheses that are judged on cuts held out, beside the base model.
JUDGED = 1
#: Second effects that are tried beside the first, the best of them by themselves.
SECONDS = 4
#: Setups of the cuts of which lobes are drawn, those with most cuts.
DRAWN_SETUPS = 2
#: Fewer cuts and responses together than this tell nothing.
FEWEST_CUTS = 8


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """Everything that a diagnosis found.

    base: the model as it was, calibrated; ranking: nothing missing and single effects; pair: the best pair, None
    where none was tried; powers: of every candidate; left: where a hypothesis still fails, by name; held_out: scores
    on cuts held out, by name; next_trial: what would part the two best; before_and_after: the base model and the best
    one, for pictures, None where nothing is missing.
    """

    content: Content
    base: Hypothesis
    ranking: list[Ranked]
    pair: Ranked | None
    powers: list[Power]
    left: dict[str, list[Failure]]
    held_out: dict[str, dict[str, Score]]
    next_trial: NextTrial | None
    verdict: Verdict
    before_and_after: Assessment | None

    @property
    def best(self) -> Hypothesis:
        """The hypothesis that the verdict names, or the best supported one; the base model where nothing is missing."""
        if self.verdict.kind in ("none", "underpowered"):
            return self.base
        if self.pair is not None and self.verdict.missing == tuple(sorted(self.pair.best.names)):
            return self.pair.best
        return self.ranking[0].best


def check_enough(model: CampaignModel) -> None:
    """Raise InvalidInput where there is too little to judge a model by."""
    campaign = model.campaign
    cuts = len(campaign.trials or ()) + len(campaign.limits or ())
    others = (campaign.receptances, campaign.natural_frequencies, campaign.stiffness)
    if cuts < FEWEST_CUTS and not any(others):
        raise InvalidInput([f"campaign: found {cuts} cuts and nothing else, needed: {FEWEST_CUTS} at least"])


def candidates_of(model: CampaignModel, content: Content) -> list[Candidate]:
    """Return every effect that the model lacks and that can act on its machine, in all its variants."""
    found = []
    for name in effect_names():
        restores = RESTORING.get(name)
        kept = {"base": content.base == "full", "modes": content.modes is None}
        if name in content.effects or (restores is not None and kept[restores]):
            continue
        for effect in variants(name):
            try:
                effect.require(model.campaign.machine)
            except InvalidInput:
                continue
            found.append(
                Candidate(
                    name=name,
                    settings=settings_of(effect),
                    term=effect,
                    shapes=tuple(f"{name}.{shape}" for shape in effect.shapes),
                    place=effect.place(),
                )
            )
    return found


def diagnose(client: Client | None, model: CampaignModel, belief: Belief, content: Content) -> Diagnosis:
    """Return what is missing in a model."""
    comparison = Comparison(model=model)
    (fit,) = spread(
        client, [Job(name="base model", call=partial(calibrate, comparison, start=belief.about(model).estimate))]
    )
    base = Hypothesis(candidates=(), comparison=comparison, fit=fit)
    candidates, slope = candidates_of(model, content), slope_of(base)
    singles = spread(
        client, [Job(name=str(one), call=partial(fit_hypothesis, comparison, [one], base, slope)) for one in candidates]
    )
    ranking = rank(base, singles)
    if ranking[0].name != NOTHING:
        # The base model gets the same chance to arrive as what is held against it.
        base = refit(base, ranking[0].best.fit)
        ranking = rank(base, singles)
    left = {one.name: _left(one.best) for one in ranking[: JUDGED + 1]} | {NOTHING: _left(base)}
    pair = _pair(client, base, ranking, left)
    if pair is not None:
        left[pair.name] = _left(pair.best)
    powers = _powers(client, base, candidates)
    verdict = decide(ranking, pair, powers, left)
    judged = [base, *([pair.best] if pair else []), *(one.best for one in ranking if one.name != NOTHING)][: JUDGED + 1]
    first, second = (one.best for one in ranking[:2]) if len(ranking) > 1 else (base, base)
    found = Diagnosis(
        content=content,
        base=base,
        ranking=ranking,
        pair=pair,
        powers=powers,
        left=left,
        held_out=_held_out(client, judged, belief.about(model).estimate),
        next_trial=next_trial(first, second),
        verdict=verdict,
        before_and_after=None,
    )
    return found if found.best is base else replace(found, before_and_after=_before_and_after(client, base, found.best))


def _before_and_after(client: Client | None, base: Hypothesis, best: Hypothesis) -> Assessment:
    """Return the base model and a better one side by side."""
    hypotheses = {"Calibrated base model": base, f"With {name_of(best)}": best}
    kinds = range(min(len(setups(base.comparison.model)), DRAWN_SETUPS))
    fields = spread_parts(
        client,
        {
            title: [
                Job(name="lobes", call=partial(field, one.comparison.model, fitted(one.fit), kind)) for kind in kinds
            ]
            for title, one in hypotheses.items()
        },
    )
    before, after = (
        version(title, one.comparison, one.fit, fitted(one.fit), fields[title]) for title, one in hypotheses.items()
    )
    return Assessment(
        comparison=best.comparison,
        described=before,
        refitted=after,
        held_out=None,
        held_out_scores={},
        held_out_groups=0,
        intervals={p.name: curvature(best.fit, p.name, "") for p in best.fit.parameters},
    )


def _left(hypothesis: Hypothesis) -> list[Failure]:
    """Return where a hypothesis still fails."""
    comparison = hypothesis.comparison
    compared = comparison.compare(hypothesis.fit.estimate)
    modes = dominant_modes(comparison.model, compared.prediction).astype(float)
    return failures(comparison.model.campaign, compared, modes, hypothesis.fit)


def _pair(
    client: Client | None, base: Hypothesis, ranking: Sequence[Ranked], left: dict[str, list[Failure]]
) -> Ranked | None:
    """Return the best pair with the first of the ranking, None where that one suffices or nothing is missing."""
    first = ranking[0]
    if first.name == NOTHING or not failed_checks(left[first.name]):
        return None
    seconds = [one for one in sorted(ranking, key=lambda one: -one.gain) if one.name not in (NOTHING, first.name)]
    own, slope = first.best.candidates, slope_of(first.best)
    jobs = [
        Job(
            name=f"{first.name} and {one.name}",
            call=partial(fit_hypothesis, base.comparison, [*own, *one.best.candidates], first.best, slope),
        )
        for one in seconds[:SECONDS]
    ]
    pairs = [one for one in rank(base, spread(client, jobs)) if one.name != NOTHING]
    return max(pairs, key=lambda one: one.gain, default=None)


def _powers(client: Client | None, base: Hypothesis, candidates: Sequence[Candidate]) -> list[Power]:
    slope = slope_of(base)
    return spread(client, [Job(name=f"power for {one}", call=partial(power, base, one, slope)) for one in candidates])


def _held_out(client: Client | None, hypotheses: Sequence[Hypothesis], start: Array) -> dict[str, dict[str, Score]]:
    """Return the scores on cuts held out, by the names of the hypotheses."""
    campaign = hypotheses[0].comparison.model.campaign
    count = groups(campaign)
    jobs = [
        Job(
            name=f"cuts held out, group {group + 1}", call=partial(held_out, one.comparison, _before(one, start), group)
        )
        for one in hypotheses
        for group in range(count)
    ]
    answers = iter(spread(client, jobs))
    parts = {name_of(one): [next(answers) for _ in range(count)] for one in hypotheses}
    return {name: cut_scores(campaign, together(said)) for name, said in parts.items() if said}


def _before(hypothesis: Hypothesis, start: Array) -> Array:
    """Return where calibrations without some cuts start: as before the campaign, but for the sizes of effects.

    start: (parameter,) of the base model.
    """
    known = dict(zip((p.name for p in hypothesis.comparison.parameters), hypothesis.fit.estimate, strict=True))
    new = {p.name for candidate in hypothesis.candidates for p in candidate.term.parameters}
    names = [p.name for p in hypothesis.comparison.parameters]
    own = iter(start)
    return np.array([known[name] if name in new else next(own) for name in names])


def name_of(hypothesis: Hypothesis) -> str:
    """Return the name of a hypothesis, as the ranking has it."""
    return " + ".join(sorted(hypothesis.names)) or NOTHING


def finite(value: float) -> float | None:
    """Return a number as JSON holds it."""
    return float(value) if math.isfinite(value) else None


def outcome_error(scores: dict[str, Score] | None) -> float | None:
    """Return the balanced outcome error among scores, None where none is known."""
    return None if scores is None or "outcome" not in scores else finite(np.float64(scores["outcome"].value))
