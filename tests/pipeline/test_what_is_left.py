"""What a verdict leaves: sizes of nuisances count as failures, an effect's own do not; unfinished fits are told."""

from types import SimpleNamespace

import numpy as np
import pytest

from chatter_core.effects import variants
from chatter_core.evidence.candidates import Candidate
from chatter_core.evidence.failures import Failure
from chatter_core.evidence.next_measurement import of_cut
from chatter_core.evidence.next_trial import NextTrial
from chatter_core.evidence.nuisances import machine_nuisances
from chatter_core.evidence.ranking import NOTHING, Ranked
from chatter_core.evidence.scores import Score
from chatter_core.evidence.verdict import Verdict
from pipeline import after_verdict, diagnosis
from pipeline.diagnosis import Diagnosis, what_is_left
from pipeline.diagnosis_document import (
    WORTH_ITS_COST,
    next_measurements_data,
    next_trial_data,
    ranked_data,
    unsettled,
)
from pipeline.diagnosis_page import ranking_rows, summary
from pipeline.improvement import half_of
from pipeline.model_file import Content
from tests.synthetic import RPM, tip_machine


def failure(quantity, **band):
    return Failure(quantity=quantity, band=band, excess=1.0, chance=1e-4, text="It fails.")


def left(at_bound):
    """Return the parameters whose sizes count, with an effect's size at its bound or not."""
    (effect,) = variants("radial_immersion_error")
    (size,) = effect.parameters
    nuisance = next(one for one in machine_nuisances(tip_machine()) if one.parameter.name == "kn")
    hypothesis = SimpleNamespace(
        comparison=SimpleNamespace(model=SimpleNamespace(terms=(nuisance, effect))),
        fit=SimpleNamespace(parameters=(nuisance.parameter, size), at_bound=np.array([False, at_bound])),
    )
    judged = SimpleNamespace(
        failures=[
            failure("outcome", trial=[3.0, 9.0]),
            failure("calibration", parameter="kn"),
            failure("calibration", parameter=size.name),
        ]
    )
    return [one.band.get("parameter", one.quantity) for one in what_is_left(hypothesis, judged)]


@pytest.mark.parametrize(("at_bound", "counts"), [(False, ["outcome", "kn"]), (True, ["outcome", "kn", "own"])])
def test_the_size_of_an_effect_counts_only_at_its_bound(at_bound, counts):
    assert left(at_bound) == [name.replace("own", "radial_immersion_error.offset") for name in counts]


def told_of(base, best=None):
    """Return the cautions of a diagnosis whose base model and best hypothesis ended their climbs for such reasons."""
    ends = {"the posterior has an edge": False, "the next step promises 0.001 nats": True}
    first, last = (
        SimpleNamespace(name=name, fit=SimpleNamespace(converged=ends[reason], reason=reason))
        for name, reason in (("", base), ("holder_joint", best or base))
    )
    return unsettled(SimpleNamespace(base=first, best=first if best is None else last))


def test_a_verdict_comes_with_a_word_about_every_fit_under_it_that_has_not_arrived():
    edge, end = "the posterior has an edge", "the next step promises 0.001 nats"
    of_base = f"The calibration of the base model did not converge: {edge}. Take its numbers with care."
    of_best = f"The fit with holder_joint did not converge: {edge}. Take its numbers with care."
    assert told_of(edge, edge) == [of_base, of_best]
    assert told_of(end, edge) == [of_best]
    assert told_of(edge, end) == told_of(edge) == [of_base]
    assert told_of(end, end) == told_of(end) == []


@pytest.mark.parametrize("worth", [True, False])
def test_a_cut_is_asked_for_only_where_it_is_expected_to_tell_something(worth):
    gain = WORTH_ITS_COST * (2.0 if worth else 0.5)
    cut = NextTrial(spindle_speed=RPM * 9000.0, axial_depth=1e-3, probability=(0.2, 0.7), expected_gain=gain)
    ranking = [SimpleNamespace(name=name) for name in ("none", "holder_joint")]
    named = {"ranking": ranking, "contenders": ranking, "verdict": SimpleNamespace(kind="ambiguous")}
    found = SimpleNamespace(next_trial=cut, next_measurements=[of_cut("cut", cut)], **named)
    told = next_trial_data(found)["text"]
    asked = "A cut at 9000 rpm and 1 mm would chatter with 20 % by none and 70 % by holder_joint: expected to tell 0.02"
    assert told.startswith(asked if worth else "No cut at the speeds and depths of the campaign would part none from h")
    found.verdict.kind = "unexplained"
    doubt = ", if one of the two is right, against which a check speaks."
    assert next_trial_data(found)["text"] == (told.removesuffix(".") + doubt if worth else told)
    assert [one["text"] for one in next_measurements_data(found)] == [
        "cut at 9000 rpm and 1 mm: 0.02 nats for 1 cut"
    ] * worth


def test_a_cut_that_is_set_up_otherwise_is_proposed_only_where_it_tells_more():
    def cut(gain):
        return NextTrial(spindle_speed=RPM * 9000.0, axial_depth=1e-3, probability=(0.2, 0.7), expected_gain=gain)

    cuts = [("cut", cut(1.0)), ("same feed", cut(1.04)), ("more feed", cut(1.5)), ("less", cut(0.5)), ("no", None)]
    plain, measurements = after_verdict._next({after_verdict.CUTS: cuts, after_verdict.RESPONSES: [[]]})
    assert plain is cuts[0][1]
    assert [one.kind for one in measurements] == ["more feed", "cut"]
    _, measurements = after_verdict._next(
        {after_verdict.CUTS: [("cut", None), *cuts[1:]], after_verdict.RESPONSES: [[]]}
    )
    assert [one.kind for one in measurements] == ["more feed", "same feed", "less"]


def half(name, *, variant="", moved=True):
    """One effect of a pair, alone."""
    candidate = Candidate(
        name=name, settings={"axis": variant} if variant else {}, term=None, shapes=(), place=(0, 0, name)
    )
    return SimpleNamespace(name=name, names=(name,), candidates=(candidate,), moved=moved)


def with_a_pair(kind="effect", *, leads=True, **halves):
    """A diagnosis that has tried a and b together; of which kind, whether the pair leads, and what is known of a."""
    a, b, base = half("a", **halves), half("b"), SimpleNamespace(name="", names=())
    both = SimpleNamespace(
        name="a + b", names=("a", "b"), candidates=(*half("a", variant="x").candidates, *b.candidates)
    )
    gains = {NOTHING: (0.0, base), "b": (5.0, b), "a": (9.0, a), "c": (20.0, half("c"))}
    ranking = [Ranked(name=name, probability=0.2, gain=gain, best=best) for name, (gain, best) in gains.items()]
    pair = Ranked(name="a + b", probability=0.0, gain=40.0, best=both)
    empty = dict.fromkeys(("powers", "beside"), None) | {"judged": {}, "left": {}, "not_tried": {}}
    verdict = Verdict(kind=kind, missing=("a", "b") if kind == "effect" else (), text="")
    found = Diagnosis(
        content=Content(effects={"d": {}}), base=base, ranking=ranking, pairs=[pair], verdict=verdict, **empty
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(diagnosis, "leading_pair", lambda *_: pair if leads else None)
        told = [one.name for one in after_verdict._told_of_others(found)]
        return found.better_half, told, half_of(found, a) if kind == "effect" and leads else ""


def test_of_a_pair_that_is_named_the_better_half_is_told_first():
    better, told, called = with_a_pair(variant="x")
    assert (better.name, told) == ("a", ["", "a", "a + b"])
    assert called == "d + a"
    assert with_a_pair(variant="y")[-1] == "d + a (axis y)"
    # What does nothing alone is the base model by another name.
    better, told, _ = with_a_pair(moved=False)
    assert (better, told) == (None, ["", "a + b"])
    for kind, leads in (("unexplained", True), ("none", True), ("effect", False)):
        assert with_a_pair(kind, leads=leads)[0] is None


def ranked(name, gain):
    best = SimpleNamespace(name=name, names=tuple(name.split(" + ")), candidates=(), fit=SimpleNamespace(parameters=()))
    return Ranked(name=name, probability=0.1, gain=gain, best=best)


@pytest.mark.parametrize(
    ("others", "second"),
    [
        ({"a": 40.0, "b": 30.0, "a + c": 45.0}, "a + c"),
        ({"a": 40.0, "b": 30.0, "a + c": 35.0}, "a"),
        ({"a": 40.0, "b": 30.0, "d": 42.0, "a + c": 35.0}, "d"),
    ],
)
def test_a_leading_pair_is_to_be_parted_from_what_gains_most_beside_it(others, second):
    first, *rest = (ranked(name, gain) for name, gain in {"a + b": 50.0, NOTHING: 0.0, **others}.items())
    pairs = [first, *(one for one in rest if "+" in one.name)]
    found = SimpleNamespace(leading_pair=first, pairs=pairs, ranking=[one for one in rest if "+" not in one.name])
    assert [one.name for one in Diagnosis.contenders.fget(found)] == ["a + b", second]


def score(value, **other):
    return Score(value=value, low=np.nan, high=np.nan, count=9, **other)


@pytest.mark.parametrize(
    ("base", "best", "quantity", "change", "head"),
    [
        ({"outcome": score(0.4), "limit_depth": score(0.3)}, {"outcome": score(0.1), "limit_depth": score(0.2)},
         "outcome", "40.0 to 10.0 %", "held-out error\n"),
        ({"limit_depth": score(0.3, at_least=True)}, {"limit_depth": score(0.2)}, "limit_depth",
         "at least 30.0 to 20.0 %", "held-out error of limit depths\n"),
        ({}, {}, None, "", "held-out error\n"),
    ],
)  # fmt: skip
def test_a_ranking_tells_the_held_out_error_of_what_was_judged(monkeypatch, base, best, quantity, change, head):
    monkeypatch.setattr("pipeline.diagnosis_document.fit_data", lambda fit: {})
    effect = ranked("a", 9.0)
    found = SimpleNamespace(
        held_out={name: told for name, told in ((NOTHING, base), ("a", best)) if told},
        ranking=[effect], pair=None, verdict=SimpleNamespace(kind="effect", text=""), corrections=None, not_tried={},
        next_trial=None, base=effect.best, best=effect.best, judged={NOTHING: SimpleNamespace(failures=[])},
    )  # fmt: skip
    monkeypatch.setattr("pipeline.diagnosis_document.unsettled", lambda found: [])
    told = ranked_data(found, effect)
    values = [told["heldout_error_before"], told["heldout_error_after"]]
    expected = [scores[quantity].value for scores in (base, best)] if quantity else [None, None]
    assert (told["heldout_quantity"], values) == (quantity, expected)
    assert [row[3] for row in ranking_rows(found)] == [change]
    assert head in summary(found)
