"""What is missing in a model: every candidate is fitted to a campaign, and one of five answers given."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from chatter_core.cards import Card, ShownAsCard
from chatter_core.effects import Effect, effect_names, variants
from chatter_core.errors import InvalidInput
from chatter_core.evidence import Comparison, calibrate
from chatter_core.evidence.assessment import Assessment, Limits, Version, version
from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.candidates import Candidate, Hypothesis, slope_of
from chatter_core.evidence.failures import Failure, but_for_effects
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.next_measurement import NextMeasurement
from chatter_core.evidence.next_trial import NextTrial
from chatter_core.evidence.power import Power, power
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.evidence.ranking import NOTHING, Ranked
from chatter_core.evidence.scores import Score
from chatter_core.evidence.starts import waves_between_teeth
from chatter_core.evidence.verdict import (
    Verdict,
    close_pairs,
    decide,
    failed_checks,
    is_sure,
    leading_pair,
    led,
    not_ruled_out,
)
from chatter_core.stages import ARROWS
from pipeline.campaigns import require, settings_of
from pipeline.cluster import Workers
from pipeline.corrections import Corrections
from pipeline.jobs import Job, spread
from pipeline.model_file import Content
from pipeline.own_effects import check_own
from pipeline.profiling import profiled
from pipeline.search import Singles, arrived, pairs_of, singles, taken_over, with_halves_refitted

#: Effects that restore what a base model was asked to leave out.
RESTORING = {"speed_dependent_bearing": "base", "higher_modes": "modes"}
#: The place in the chain of effects that make teeth unequal.
PLACE_OF_TEETH = ARROWS.index("teeth")
#: Verdicts after which the best effect belongs to the model, although others may be tied with it.
SUPPORTED = ("effect", "ambiguous")
#: Of the ranking, so many are shown.
SHOWN = 5
#: Fewer cuts than this tell nothing, and a receptance with fewer lines than this shows no mode.
FEWEST_CUTS, FEWEST_LINES = 8, 8


@dataclass(frozen=True, kw_only=True, repr=False)
class Diagnosis(ShownAsCard):
    """Everything that a diagnosis found.

    base: the model as it was, calibrated; ranking: nothing missing and single effects; pairs: the one first that leads,
    none where none was tried; beside: the first, which suffices, with every effect that promised anything beside it,
    None where that was not asked; powers: of every candidate, the most first; judged: the base model, those that are
    not ruled out, the close pairs and the better half of the one that leads held against the campaign, by name; left:
    what they fail in that counts, but for that half; not_tried: effects that cannot act on the machine, and why;
    held_out: scores on cuts held out, by name; next_trial: the cut that would part the contenders; next_measurements:
    that one and others, what is most worth its cost first; intervals: of the parameters of effects that are named,
    profiled; before_and_after: the base model and the best one with their lobes, for pictures, None where nothing is
    missing; corrections: without a formula, where the verdict is ``unexplained``. All after the verdict is found by
    ``pipeline.after_verdict``.
    """

    content: Content
    base: Hypothesis
    ranking: list[Ranked]
    pairs: list[Ranked]
    powers: list[Power]
    judged: dict[str, Version]
    left: dict[str, list[Failure]]
    beside: list[Hypothesis] | None
    not_tried: dict[str, str]
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
        rows = tuple((one.name, f"{one.probability:.3f}", one.told_gain) for one in self.ranking[:SHOWN])
        title = f"Diagnosis: {self.verdict.kind}. {self.verdict.text}"
        return Card(title=title, rows=rows, columns=columns)

    @property
    def pair(self) -> Ranked | None:
        """The pair that leads, named or not; None where none was tried."""
        return self.pairs[0] if self.pairs else None

    @property
    def leading_pair(self) -> Ranked | None:
        """The pair that leads where it gains enough over what is simpler, else None."""
        return leading_pair(self.ranking, self.pairs, self.left)

    @property
    def contenders(self) -> tuple[Ranked, Ranked]:
        """The two answers that are to be parted: a leading pair and what gains most beside it, or the most probable."""
        pair = self.leading_pair
        if pair is None:
            return self.ranking[0], self.ranking[min(1, len(self.ranking) - 1)]
        return pair, max([*self.ranking, *self.pairs[1:]], key=lambda one: one.gain)

    @property
    def stands_for(self) -> list[str]:
        """A sentence where the supported hypothesis stands for one of several that are tied; else none."""
        if self.verdict.kind != "ambiguous":
            return []
        others = ", ".join(name for name in self.verdict.missing if name not in self.best.names)
        return [f"{self.best.name} stands for what these measurements cannot part it from, too: {others}."]

    @property
    def best(self) -> Hypothesis:
        """The hypothesis that the verdict names, or the best supported one; the base model where nothing is missing."""
        if self.verdict.kind in ("none", "underpowered"):
            return self.base
        if (pair := self.leading_pair) is not None:
            return pair.best
        if self.verdict.kind == "ambiguous":
            return next(one for one in self.ranking if one.name == self.verdict.missing[0]).best
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

    @property
    def named_pair(self) -> Ranked | None:
        """The pair that leads where its effects are named; else None."""
        pair = self.leading_pair
        return pair if pair is not None and self.supported is pair.best else None

    @property
    def better_half(self) -> Hypothesis | None:
        """Of a pair that is named the effect that alone gains more; None without one, or if it does nothing alone."""
        half = None if self.named_pair is None else better_half(self.ranking, self.named_pair)
        return half if half is not None and half.moved else None

    def version(self, hypothesis: Hypothesis) -> Version:
        """Return a hypothesis that was judged as it was held against the campaign."""
        return self.judged[name_of(hypothesis)]


def check_enough(model: CampaignModel) -> None:
    """Raise InvalidInput where there is too little to judge a model by."""
    campaign = model.campaign
    trials, limits = len(campaign.trials or ()), len(campaign.limits or ())
    told = [one for one in campaign.receptances if len(one.frequency) >= FEWEST_LINES]
    if trials + limits < FEWEST_CUTS and not any((told, campaign.natural_frequencies, campaign.stiffness)):
        few = len(campaign.receptances)
        short = f"{few} receptance{'s' if few > 1 else ''} of fewer than {FEWEST_LINES} lines"
        other = short if few else "nothing else that was measured"
        raise InvalidInput(
            [
                f"campaign: found {_counted(trials, limits)} and {other}; needed to judge a model by: "
                f"{FEWEST_CUTS} cuts or limiting depths, or a receptance of {FEWEST_LINES} lines, natural frequency or "
                "bearing stiffness"
            ]
        )


def _counted(trials: int, limits: int) -> str:
    counts = ((trials, "cut"), (limits, "limiting depth"))
    return ", ".join(f"{count} {what}{'' if count == 1 else 's'}" for count, what in counts if count) or "no cuts"


def candidates_of(model: CampaignModel, content: Content) -> list[Candidate]:
    """Return every effect that the model lacks and that can act on its machine, in all its variants.

    Unequal teeth take longest and come first, then what is looked at value by value, then what acts last in the chain:
    no worker should be left with them.
    """
    waves = waves_between_teeth(model.campaign)
    found = [
        candidate_of(effect, waves)
        for name in _lacking(content)
        for effect in variants(name, content.effects_path)
        if not _hindrance(effect, model) and not effect.is_superfluous(model.campaign.machine)
    ]
    return sorted(found, key=_cost_order)


def candidate_of(effect: Effect, waves: float) -> Candidate:
    """Return an effect as a candidate; what it is told of parameters that are unused is left out.

    waves: between two teeth, in the cuts that were heard.
    """
    name, used = effect.name(), {parameter.name for parameter in effect.used}
    heard, scan = effect.heard, effect.scan
    shapes = tuple(f"{name}.{shape}" for shape in effect.shapes if shape in used)
    return Candidate(
        name=name,
        settings=settings_of(effect),
        term=effect,
        shapes=shapes,
        heard=f"{name}.{heard}" if heard in used else None,
        scan=(f"{name}.{scan.parameter}", scan.with_waves(waves)) if scan and scan.parameter in used else None,
        scanned_shapes=scan.shapes if scan and shapes else (),
        place=effect.place(),
    )


def _cost_order(candidate: Candidate) -> tuple[bool, bool, int, str]:
    """Return what sorts candidates by how long they take, the longest first."""
    place, _, name = candidate.place
    return place != PLACE_OF_TEETH, candidate.scan is None, -place, name


def not_tried(model: CampaignModel, content: Content) -> dict[str, str]:
    """Return the effects that the model lacks and that cannot act on its machine: name -> why."""
    hindrances = {
        name: [_hindrance(effect, model) for effect in variants(name, content.effects_path)]
        for name in _lacking(content)
    }
    return {name: reasons[0] for name, reasons in hindrances.items() if all(reasons)}


def _lacking(content: Content) -> list[str]:
    """Return the names of the effects that a model lacks."""
    kept = {"base": content.base == "full", "modes": content.modes is None}
    names = [name for name in effect_names(content.effects_path) if name not in content.effects]
    return [name for name in names if name not in RESTORING or not kept[RESTORING[name]]]


def _hindrance(effect: Effect, model: CampaignModel) -> str:
    """Return why an effect cannot act on a machine, "" where it can."""
    try:
        require(effect, model.campaign)
    except InvalidInput as error:
        return " ".join(problem.removeprefix(f"effects.{effect.name()}: ") for problem in error.problems)
    if RESTORING.get(effect.name()) == "modes" and int(settings_of(effect)["modes"]) <= model.cut_modes:
        return f"restores modes that are there: the model keeps {model.cut_modes} of an axis"
    return ""


def diagnose(
    workers: Workers | None,
    model: CampaignModel,
    belief: Belief,
    content: Content,
    fitted_before: Fit | None = None,
    pairs: Sequence[Hypothesis] | None = None,
    *,
    seconds: bool = False,
) -> Diagnosis:
    """Return what is missing in a model: the ranking and the verdict.

    belief: what is known of its parameters before the campaign; fitted_before: its fit to all data, where known, and
    pairs: of the effect that it has gained with all that promised anything beside that, where those were tried;
    seconds: whether a second effect is looked for beside one that suffices, which takes as long as all before.
    """
    comparison, candidates = Comparison(model=replace(model, forgiving=True)), candidates_of(model, content)
    check_own(comparison, candidates)
    fit = fitted_before
    if fit is None:
        start = belief.about(model).estimate
        (fit,) = spread(workers, [Job(name="base model", call=partial(calibrate, comparison, start=start))])
    base = Hypothesis(candidates=(), comparison=comparison, fit=fit)
    found = singles(workers, base, candidates) if pairs is None else taken_over(workers, base, candidates, pairs)
    judge = _Judge(workers, candidates, content)
    diagnosis = judge.decided(found)
    if diagnosis.supported is diagnosis.base:
        return diagnosis
    known: dict[str, Limits] = {}
    if diagnosis.leading_pair is None:
        first = found.ranking[0].best
        found = arrived(workers, found)
        tried = diagnosis.pairs if found.ranking[0].best is first else []
        diagnosis = judge.decided(found, tried, seconds=seconds)
        # Another variant may have come first meanwhile, of whose parameters there are none.
        now = found.ranking[0].best
        same = [*map(str, now.candidates)] == [*map(str, first.candidates)] and diagnosis.supported is now
        known = found.intervals if same else {}
    diagnosis = replace(diagnosis, intervals=known)
    return with_arrived_pair(workers, diagnosis, partial(judge.decided, found))


def with_arrived_pair(
    workers: Workers | None, diagnosis: Diagnosis, decided: Callable[[Sequence[Ranked]], Diagnosis]
) -> Diagnosis:
    """Return a diagnosis whose named pair, where there is one, no profile leads above, as no single effect's does.

    decided: decides again, by pairs of which one has risen.
    """
    pair = diagnosis.named_pair
    if pair is None:
        return diagnosis
    named, limits = profiled(workers, pair.best)
    if named is not pair.best:
        gain = pair.gain + named.fit.log_evidence - pair.best.fit.log_evidence
        risen = [replace(pair, best=named, gain=gain) if one is pair else one for one in diagnosis.pairs]
        diagnosis = decided(sorted(risen, key=lambda one: -one.gain))
    return replace(diagnosis, intervals=limits if diagnosis.supported is named else {})


class _Judge:
    """Decides what is missing, by hypotheses that it holds against the campaign, each once."""

    def __init__(self, workers: Workers | None, candidates: Sequence[Candidate], content: Content) -> None:
        self._workers, self._candidates, self._content = workers, candidates, content
        self._known: dict[int, tuple[Hypothesis, Version, list[Failure]]] = {}
        self._powers: tuple[Hypothesis, list[Power]] | None = None

    def _of(self, one: Hypothesis) -> tuple[Hypothesis, Version, list[Failure]]:
        if id(one) not in self._known:
            version = _judged(one)
            # The hypothesis is kept with it: what no longer lives may lend its place to another.
            self._known[id(one)] = one, version, what_is_left(one, version)
        return self._known[id(one)]

    def _versions(self, told_of: Sequence[Hypothesis]) -> dict[str, Version]:
        """Return hypotheses as they are held against the campaign, by name."""
        return {name_of(one): self._of(one)[1] for one in told_of}

    def _left(self, told_of: Sequence[Hypothesis]) -> dict[str, list[Failure]]:
        """Return what is left of hypotheses that counts, by name."""
        return {name_of(one): self._of(one)[2] for one in told_of}

    def _power(self, base: Hypothesis) -> list[Power]:
        """Return what the campaign could have shown of every candidate."""
        if self._powers is None or self._powers[0] is not base:
            self._powers = base, _powers(self._workers, base, self._candidates)
        return self._powers[1]

    def decided(self, found: Singles, tried: Sequence[Ranked] = (), *, seconds: bool = False) -> Diagnosis:
        """Return what the base model and single effects say, and pairs: where one does not suffice, or if asked for.

        tried: the pairs, where they are known.
        """
        first, pairs = found.ranking[0], list(tried)
        fails = bool(failed_checks(self._left([first.best])[first.name]))
        beside: list[Hypothesis] | None = None
        pair: Ranked | None = None
        if not pairs and (fails or (seconds and is_sure(found.ranking))):
            pairs, fitted = pairs_of(self._workers, found.base, self._candidates, found.ranking, suffices=not fails)
            beside = None if fails else fitted
        if pairs:
            pairs = led(pairs, self._left([one.best for one in close_pairs(pairs)]))
            left = self._left([first.best, *(one.best for one in close_pairs(pairs))])
            if (pair := leading_pair(found.ranking, pairs, left)) is not None:
                found = with_halves_refitted(self._workers, found, pair)
        base, ranking = found.base, found.ranking
        if ranking[0].name != first.name:
            beside = None
        told_of = [base, *(one.best for one in [*not_ruled_out(ranking), *close_pairs(pairs)] if one.best is not base)]
        left, powers = self._left(told_of), self._power(base)
        halves = [] if pair is None else [better_half(ranking, pair)]
        return Diagnosis(
            content=self._content,
            base=base,
            ranking=ranking,
            pairs=pairs,
            beside=beside,
            powers=powers,
            judged=self._versions([*told_of, *halves]),
            left=left,
            not_tried=not_tried(base.comparison.model, self._content),
            verdict=decide(ranking, pairs, powers, left),
        )


def better_half(ranking: Sequence[Ranked], pair: Ranked) -> Hypothesis:
    """Return of the effects of a pair the one that alone gains more."""
    return max((one for one in ranking if one.name in pair.best.names), key=lambda one: one.gain).best


def _judged(hypothesis: Hypothesis) -> Version:
    """Return a hypothesis held against the campaign; lobes are for those that are drawn."""
    title = f"With {hypothesis.name.replace('_', ' ')}" if hypothesis.name else "Calibrated base model"
    return version(title, hypothesis.comparison, hypothesis.fit, fitted(hypothesis.fit), ())


def what_is_left(hypothesis: Hypothesis, judged: Version) -> list[Failure]:
    """Return what a hypothesis fails in, but for how large its own effects are."""
    return but_for_effects(judged.failures, hypothesis.comparison.model, hypothesis.fit)


def _powers(workers: Workers | None, base: Hypothesis, candidates: Sequence[Candidate]) -> list[Power]:
    """Return what each candidate would have left in the campaign, the most first."""
    slope = slope_of(base)
    jobs = [Job(name=f"power for {one}", call=partial(power, base, one, slope)) for one in candidates]
    return sorted(spread(workers, jobs), key=lambda one: -one.nats)


def name_of(hypothesis: Hypothesis) -> str:
    """Return the name of a hypothesis, as the ranking has it."""
    return hypothesis.name or NOTHING
