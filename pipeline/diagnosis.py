"""What is missing in a model: every candidate is fitted to a campaign, and one of five answers given."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from math import prod

from chatter_core.cards import Card, ShownAsCard
from chatter_core.effects import Effect, effect_names, variants
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Comparison, calibrate
from chatter_core.evidence.assessment import Assessment, Limits, Version, version
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.candidates import Candidate, Hypothesis, slope_of
from chatter_core.evidence.failures import Failure
from chatter_core.evidence.next_measurement import NextMeasurement
from chatter_core.evidence.next_trial import NextTrial
from chatter_core.evidence.power import Power, power
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.evidence.pursuit import fit_hypothesis, ground, look, pursue, refit
from chatter_core.evidence.ranking import NOTHING, Ranked, rank
from chatter_core.evidence.scores import Score
from chatter_core.evidence.verdict import PAIR_GAIN, Verdict, decide, failed_checks
from pipeline.campaigns import settings_of
from pipeline.cluster import Workers
from pipeline.corrections import Corrections
from pipeline.jobs import Job, spread
from pipeline.model_file import Content

#: Effects that restore what a base model was asked to leave out.
RESTORING = {"speed_dependent_bearing": "base", "higher_modes": "modes"}
#: Hypotheses whose evidence comes so near to the best are fitted to their end [nats]: of others none could be named.
CLOSE = 12.0
#: Where the base model rises by more than this from the best effect's place [nats], all is looked at again, once.
RISEN, GROUNDS = 1.0, 2
#: Second effects that are fitted beside the first, those that promise most.
SECONDS = 4
#: Verdicts after which the best effect belongs to the model, although others may be tied with it.
SUPPORTED = ("effect", "ambiguous")
#: Of the ranking, so many are shown.
SHOWN = 5
#: Fewer cuts and responses together than this tell nothing.
FEWEST_CUTS = 8


@dataclass(frozen=True, kw_only=True, repr=False)
class Diagnosis(ShownAsCard):
    """Everything that a diagnosis found.

    base: the model as it was, calibrated; ranking: nothing missing and single effects; pairs: with the first of
    them, the best first, none where none was tried; powers: of every candidate; judged: the base model and the best
    ones held against the campaign, by name, and left: what each of them fails in that counts; held_out: scores on cuts
    held out, by name; next_trial: the cut that would part the two best; next_measurements: that one and others, what
    is most worth its cost first; intervals: of the parameters of effects that are named, profiled; before_and_after:
    the base model and the best one with their lobes, for pictures, None where nothing is missing; corrections: without
    a formula, where the verdict is ``unexplained``. All after the verdict is found by ``pipeline.after_verdict``.
    """

    content: Content
    base: Hypothesis
    ranking: list[Ranked]
    pairs: list[Ranked]
    powers: list[Power]
    judged: dict[str, Version]
    left: dict[str, list[Failure]]
    verdict: Verdict
    held_out: dict[str, dict[str, Score]] = field(default_factory=dict)
    next_trial: NextTrial | None = None
    next_measurements: list[NextMeasurement] = field(default_factory=list)
    intervals: dict[str, Limits] = field(default_factory=dict)
    before_and_after: Assessment | None = None
    corrections: Corrections | None = None

    def card(self) -> Card:
        """Return the verdict, and how probable the first of the ranking are."""
        columns = ("missing", "probability", "gain in nats")
        rows = tuple((one.name, f"{one.probability:.3f}", f"{one.gain:+.1f}") for one in self.ranking[:SHOWN])
        title = f"Diagnosis: {self.verdict.kind}. {self.verdict.text}"
        return Card(title=title, rows=rows, columns=columns)

    @property
    def pair(self) -> Ranked | None:
        """The best pair, None where none was tried."""
        return self.pairs[0] if self.pairs else None

    @property
    def best(self) -> Hypothesis:
        """The hypothesis that the verdict names, or the best supported one; the base model where nothing is missing."""
        if self.verdict.kind in ("none", "underpowered"):
            return self.base
        if self.pair is not None and self.pair.gain > self.ranking[0].gain + PAIR_GAIN:
            return self.pair.best
        return self.ranking[0].best

    @property
    def supported(self) -> Hypothesis:
        """The best hypothesis where effects are named, one or several; else the base model."""
        return self.best if self.verdict.kind in SUPPORTED else self.base

    @property
    def supported_content(self) -> Content:
        """What the supported hypothesis is made of."""
        content = self.content
        for candidate in self.supported.candidates:
            content = content.with_effect(candidate.name, candidate.settings)
        return content

    def version(self, hypothesis: Hypothesis) -> Version:
        """Return a hypothesis that was judged as it was held against the campaign."""
        return self.judged[name_of(hypothesis)]


def check_enough(model: CampaignModel) -> None:
    """Raise InvalidInput where there is too little to judge a model by."""
    campaign = model.campaign
    cuts = len(campaign.trials or ()) + len(campaign.limits or ())
    others = (campaign.receptances, campaign.natural_frequencies, campaign.stiffness)
    if cuts < FEWEST_CUTS and not any(others):
        raise InvalidInput(
            [
                f"campaign: found {cuts} cut{'s' if cuts > 1 else ''} and nothing else that was measured; needed to "
                f"judge a model by: {FEWEST_CUTS} cuts, or a receptance, natural frequency or bearing stiffness"
            ]
        )


def candidates_of(model: CampaignModel, content: Content) -> list[Candidate]:
    """Return every effect that the model lacks and that can act on its machine, in all its variants.

    Those that act last in the chain come first: unequal teeth take longest, and no worker should be left with them.
    """
    found = []
    for name in effect_names(content.effects_path):
        restores = RESTORING.get(name)
        kept = {"base": content.base == "full", "modes": content.modes is None}
        if name in content.effects or (restores is not None and kept[restores]):
            continue
        for effect in variants(name, content.effects_path):
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
                    heard=f"{name}.{effect.heard}" if effect.heard else None,
                    place=effect.place(),
                )
            )
    return sorted(found, key=lambda candidate: candidate.place, reverse=True)


def diagnose(
    workers: Workers | None, model: CampaignModel, belief: Belief, content: Content, start: Belief | None = None
) -> Diagnosis:
    """Return what is missing in a model: the ranking and the verdict.

    belief: what is known of its parameters before the campaign; start: where calibrations with all data start, there
    unless something better is known.
    """
    comparison, candidates = Comparison(model=model), candidates_of(model, content)
    known = (start or belief).about(model).estimate
    (fit,) = spread(workers, [Job(name="base model", call=partial(calibrate, comparison, start=known))])
    base, ranking = _ranking(workers, Hypothesis(candidates=(), comparison=comparison, fit=fit), candidates)
    told_of = {NOTHING: base, **{one.name: one.best for one in ranking[:2] if one.name != NOTHING}}
    judged = {name: _judged(one) for name, one in told_of.items()}
    left = {name: what_is_left(one, judged[name]) for name, one in told_of.items()}
    pairs = _pairs(workers, base, candidates, ranking, left)
    for pair in pairs[:1]:
        judged[pair.name] = _judged(pair.best)
        left[pair.name] = what_is_left(pair.best, judged[pair.name])
    powers = _powers(workers, base, candidates)
    return Diagnosis(
        content=content,
        base=base,
        ranking=ranking,
        pairs=pairs,
        powers=powers,
        judged=judged,
        left=left,
        verdict=decide(ranking, pairs, powers, left),
    )


def _ranking(
    workers: Workers | None, base: Hypothesis, candidates: Sequence[Candidate]
) -> tuple[Hypothesis, list[Ranked]]:
    """Return the base model and the ranking of nothing missing and single effects."""
    for _ in range(GROUNDS):
        fitted_with = partial(fit_hypothesis, base.comparison, nested=ground(base))
        near = spread(workers, [Job(name=str(one), call=partial(fitted_with, [one])) for one in candidates])
        singles = _climbed(workers, near)
        ranking = rank(base, singles)
        before = base.fit.log_evidence
        if ranking[0].name != NOTHING:
            # The base model gets the same chance to arrive as what is held against it.
            base = refit(base, ranking[0].best.fit)
        if base.fit.log_evidence < before + RISEN:
            # What stood where the base model was has not been held against a better one.
            break
    return base, rank(base, singles)


def _climbed(workers: Workers | None, near: Sequence[Hypothesis]) -> list[Hypothesis]:
    """Return hypotheses, fitted to their end where an effect has left its null and they come near the best."""
    found, ended = list(near), {index for index, one in enumerate(near) if not one.moved}
    while True:
        best = max((one.fit.log_evidence for one in found), default=0.0)
        close = [i for i, one in enumerate(found) if i not in ended and one.fit.log_evidence > best - CLOSE]
        if not close:
            return found
        jobs = [Job(name=f"{found[i].name}, to its end", call=partial(refit, found[i], found[i].fit)) for i in close]
        for index, one in zip(close, spread(workers, jobs), strict=True):
            found[index] = one
            ended.add(index)


def _judged(hypothesis: Hypothesis) -> Version:
    """Return a hypothesis held against the campaign; lobes are for those that are drawn."""
    title = f"With {hypothesis.name.replace('_', ' ')}" if hypothesis.name else "Calibrated base model"
    return version(title, hypothesis.comparison, hypothesis.fit, fitted(hypothesis.fit), ())


def what_is_left(hypothesis: Hypothesis, judged: Version) -> list[Failure]:
    """Return what a hypothesis fails in, but for how large its own effects are within their bounds.

    Their priors say what is usual, and the evidence has counted already how unusual they are.
    """
    fit = hypothesis.fit
    at_bound = {p.name for p, stands in zip(fit.parameters, fit.at_bound, strict=True) if stands}
    own = effect_parameters(hypothesis.comparison.model) - at_bound
    return [failure for failure in judged.failures if failure.band.get("parameter") not in own]


def _pairs(
    workers: Workers | None,
    base: Hypothesis,
    candidates: Sequence[Candidate],
    ranking: Sequence[Ranked],
    left: Mapping[str, Sequence[Failure]],
) -> list[Ranked]:
    """Return pairs with the first of the ranking, the best first; none where that one suffices or nothing is missing.

    Seconds are those that promise most beside the first: what a model with neither says of them may be nothing.
    """
    first = ranking[0]
    if first.name == NOTHING or not failed_checks(left[first.name]):
        return []
    named, known = first.best, ground(first.best)
    looks = [
        Job(
            name=f"{first.name} and {one}",
            call=partial(look, base.comparison, [*named.candidates, one], nested=known),
        )
        for one in candidates
        if one.name != first.name
    ]
    prospects = sorted(spread(workers, looks), key=lambda one: -one.promise)[:SECONDS]
    jobs = [Job(name=f"{first.name} and {one.candidates[-1]}, fitted", call=partial(pursue, one)) for one in prospects]
    variants_of = Counter(one.name for one in candidates)
    paired = _climbed(workers, spread(workers, jobs))
    counts = {pair.name: prod(variants_of[name] for name in pair.names) for pair in paired}
    pairs = [one for one in rank(base, paired, counts) if one.name != NOTHING]
    return sorted(pairs, key=lambda one: -one.gain)


def _powers(workers: Workers | None, base: Hypothesis, candidates: Sequence[Candidate]) -> list[Power]:
    slope = slope_of(base)
    return spread(workers, [Job(name=f"power for {one}", call=partial(power, base, one, slope)) for one in candidates])


def effect_parameters(model: CampaignModel) -> set[str]:
    """Return the names of all parameters of a model's effects."""
    return {p.name for term in model.terms if isinstance(term, Effect) for p in term.parameters}


def name_of(hypothesis: Hypothesis) -> str:
    """Return the name of a hypothesis, as the ranking has it."""
    return hypothesis.name or NOTHING
