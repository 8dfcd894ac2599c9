"""What helps to go on once a verdict stands: errors on cuts held out, intervals, what to measure next, pictures."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from chatter_core.evidence.assessment import Assessment, Ended, Limits, Version, curvature
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.held_out import together
from chatter_core.evidence.next_measurement import NextMeasurement, next_receptances, of_cut, other_cuts
from chatter_core.evidence.next_trial import NextTrial, next_trial
from chatter_core.evidence.ranking import NOTHING
from chatter_core.evidence.scores import Score, cut_scores
from chatter_core.evidence.verdict import not_ruled_out
from pipeline.cluster import Workers
from pipeline.corrections import correct
from pipeline.diagnosis import Diagnosis, name_of
from pipeline.jobs import Job, spread, spread_parts
from pipeline.pieces import held_out_jobs, interval_jobs, intervals, lobe_jobs, lobes
from pipeline.profiling import own_parameters

#: Parts of what is computed when the verdict stands, beside the cuts held out, which bear the names of hypotheses.
ENDS, CUTS, RESPONSES = "ends of intervals", "next cuts", "next receptances"
#: A cut as the machine is set up, among kinds of cuts.
PLAIN_CUT = "cut"
#: A cut with another feed, width or direction has to tell so much more than one without. Where the answers that are to
#: be parted do not hang on any of these, those tell alike, but for rounding.
WORTH_SETTING_UP = 1.05


def completed(
    workers: Workers | None, found: Diagnosis, belief: Belief, of_base: dict[str, Score] | None = None
) -> Diagnosis:
    """Return a diagnosis with all that helps to go on: errors on cuts held out, the next cut, and corrections.

    belief: what was known of the parameters before the campaign; of_base: scores of the base model on cuts held out,
    where they are known.
    """
    told_of = [one for one in _told_of_others(found) if of_base is None or one is not found.base]
    known = {} if of_base is None else {NOTHING: of_base}
    # Together no worker waits for the last one of another part; what takes longest comes first.
    parts = spread_parts(
        workers,
        {
            **{name_of(one): _held_out_jobs(one, found.base, belief) for one in reversed(told_of)},
            ENDS: _interval_jobs(found),
            **_next_jobs(*(one.best for one in found.contenders)),
        },
    )
    cut, measurements = _next(parts)
    campaign = found.base.comparison.model.campaign
    said = {name_of(one): parts[name_of(one)] for one in told_of if parts[name_of(one)]}
    return replace(
        found,
        held_out=known | {name: cut_scores(campaign, together(groups)) for name, groups in said.items()},
        next_trial=cut,
        next_measurements=measurements,
        intervals=_intervals(found, parts[ENDS]),
        corrections=correct(workers, found.base) if found.verdict.kind == "unexplained" else None,
    )


def intervals_of(workers: Workers | None, found: Diagnosis) -> dict[str, Limits]:
    """Return the profile intervals of the parameters of effects that are named; none for the base model."""
    return _intervals(found, spread(workers, _interval_jobs(found)))


def side_by_side(
    workers: Workers | None, before: tuple[Hypothesis, Version], after: tuple[Hypothesis, Version]
) -> Assessment:
    """Return two hypotheses that were judged side by side, with their lobes, and how sure those of the second are."""
    (first, told_before), (best, told) = before, after
    jobs = {
        "before": lobe_jobs(first.comparison.model, told_before.belief.sure(), "lobes before"),
        "after": lobe_jobs(best.comparison.model, told.belief, "lobes after"),
    }
    drawn = {name: lobes(answers) for name, answers in spread_parts(workers, jobs).items()}
    return Assessment(
        comparison=best.comparison,
        described=replace(told_before, fields=drawn["before"]),
        refitted=replace(told, fields=drawn["after"]),
        held_out=None,
        held_out_scores={},
        held_out_groups=0,
        intervals={p.name: curvature(best.fit, p.name, "") for p in best.fit.parameters},
    )


def with_pictures(workers: Workers | None, found: Diagnosis) -> Diagnosis:
    """Return a diagnosis with the lobes of the base model and of the best one, where that is another."""
    if found.best is found.base:
        return found
    pair = [(one, found.version(one)) for one in (found.base, found.best)]
    return replace(found, before_and_after=side_by_side(workers, *pair))


def _told_of_others(found: Diagnosis) -> list[Hypothesis]:
    """Return the hypotheses that are judged on cuts held out.

    The base model, and the best or else a likely effect; of a pair that is named its better half, too.
    """
    effects = [one.best for one in not_ruled_out(found.ranking) if one.name != NOTHING]
    half = [] if found.better_half is None else [found.better_half]
    return [found.base, *half, *([found.best] if found.best is not found.base else effects[:1])]


def _held_out_jobs(hypothesis: Hypothesis, base: Hypothesis, belief: Belief) -> list[Job]:
    """Return jobs that tell cuts held out; from before the campaign starts the base model alone.

    With an effect that takes several times as long, and hardly ever ends higher.
    """
    before = belief.about(hypothesis.comparison.model).estimate
    return held_out_jobs(hypothesis.comparison, hypothesis.fit.estimate, before, anew=hypothesis is base)


def _interval_jobs(found: Diagnosis) -> list[Job]:
    """Return the jobs for the intervals of effects that are named; none where the search has found them."""
    named = found.supported
    return [] if found.intervals else interval_jobs(named.comparison, named.fit, own_parameters(named))


def _intervals(found: Diagnosis, ends: Sequence[Ended]) -> dict[str, Limits]:
    """Return the intervals of effects that are named, as the search has found them or as jobs have."""
    return found.intervals or intervals(found.supported.fit, own_parameters(found.supported), ends)


def _next_jobs(first: Hypothesis, second: Hypothesis) -> dict[str, list[Job]]:
    """Return the jobs that find which cut would part two hypotheses, of each kind, and which receptances would."""
    kinds: dict[str, dict[str, float]] = {PLAIN_CUT: {}, **other_cuts(first.comparison.model.campaign.machine)}
    return {
        CUTS: [Job(name=kind, call=partial(_next_cut, kind, first, second, own)) for kind, own in kinds.items()],
        RESPONSES: [Job(name="receptances", call=partial(next_receptances, first, second))],
    }


def _next_cut(kind: str, first: Hypothesis, second: Hypothesis, own: dict[str, float]) -> tuple[str, NextTrial | None]:
    return kind, next_trial(first, second, **own)


def _next(parts: Mapping[str, list[Any]]) -> tuple[NextTrial | None, list[NextMeasurement]]:
    """Return the cut that would part two hypotheses, and all measurements that would, by what they are worth."""
    cuts: dict[str, NextTrial | None] = dict(parts[CUTS])
    plain = cuts[PLAIN_CUT]
    least = 0.0 if plain is None else WORTH_SETTING_UP * plain.expected_gain
    told = {kind: one for kind, one in cuts.items() if one is not None and (one is plain or one.expected_gain > least)}
    measurements = [*parts[RESPONSES][0], *(of_cut(kind, one) for kind, one in told.items())]
    return plain, sorted(measurements, key=lambda one: -one.worth)
