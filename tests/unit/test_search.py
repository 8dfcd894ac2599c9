"""The search for single effects: what cannot come near the best any more is not climbed, or looked at again."""

from dataclasses import replace

import numpy as np
import pytest

from chatter_core.evidence import base_model, pursuit
from chatter_core.evidence.ranking import NOTHING
from pipeline import search
from pipeline.diagnosis import candidates_of
from pipeline.model_file import Content
from tests.synthetic import campaign, trials
from tests.unit.test_candidates import ASYMMETRY, COEFFICIENT, PROCESS_DAMPING, base_of, candidate, judged

IMMERSION = candidate("radial_immersion_error")
CANDIDATES = [IMMERSION, PROCESS_DAMPING, ASYMMETRY]
NAMES = [one.name for one in CANDIDATES]


@pytest.fixture(scope="module")
def base():
    return base_of(judged(COEFFICIENT))


@pytest.fixture
def done(monkeypatch):
    """What was done with each effect, and its name, in turn."""
    steps = []

    def noted(step):
        own = getattr(pursuit, step)

        def call(first, *others):
            name = (others[0] if others else first.candidates)[-1].name
            steps.append((step, name))
            return own(first, *others)

        return call

    for step in ("look", "pursue", "stay"):
        monkeypatch.setattr(search, step, noted(step))
    return steps


def of(done, step):
    return [name for what, name in done if what == step]


def test_what_takes_longest_comes_first(reference_machine):
    """Unequal teeth, of which pitches are looked at value by value, then all else that is."""
    plan = campaign(reference_machine, trials=trials(np.array([800.0]), np.array([1e-3])))
    found = candidates_of(base_model(plan), Content())
    kinds = [(one.name in ("tool_runout", "variable_pitch"), one.scan is not None) for one in found]
    assert kinds == sorted(kinds, reverse=True)
    assert len(set(kinds)) == 4


def test_what_promises_far_less_than_another_gained_is_not_climbed(base, done, monkeypatch):
    monkeypatch.setattr(search, "GROUNDS", 1)
    everything = search.singles(None, base, CANDIDATES)
    assert of(done, "look") == NAMES
    assert of(done, "pursue") == NAMES
    done.clear()
    # All but the most promising waits.
    monkeypatch.setattr(search, "CLOSE", 0.0)
    monkeypatch.setattr(search, "OUT_OF_REACH", 1.0)
    found = search.singles(None, base, CANDIDATES)
    assert [one.name for one in found.fitted] == NAMES
    # The asymmetry moves modes: whatever it promises, it is climbed.
    assert of(done, "pursue") == ["process_damping", "directional_asymmetry"]
    assert of(done, "stay") == ["radial_immersion_error"]
    at_null = found.fitted[0]
    assert not at_null.moved
    assert at_null.fit.log_likelihood == pytest.approx(base.fit.log_likelihood, abs=1e-6)
    # With a CLOSE of none the best is not climbed to its end, but to where a step promises less than 0.3 nats: a few
    # such steps would follow.
    assert found.ranking[0].gain == pytest.approx(everything.ranking[0].gain, abs=1.2)


def test_what_promises_much_without_the_motion_that_it_forces_is_climbed(base, done, monkeypatch):
    """Where the motion hides what the right delays gain, an effect would stay at its null for it."""

    def look(*arguments):
        seen = pursuit.look(*arguments)
        hidden = seen.candidates[-1].name == "radial_immersion_error"
        return replace(seen, still=[(100.0, seen.at_null.values)]) if hidden else seen

    monkeypatch.setattr(search, "look", look)
    monkeypatch.setattr(search, "GROUNDS", 1)
    monkeypatch.setattr(search, "CLOSE", 0.0)
    monkeypatch.setattr(search, "OUT_OF_REACH", 1.0)
    search.singles(None, base, CANDIDATES)
    # It counts for itself: what another has to come near to is what is promised of it as it is.
    assert of(done, "pursue") == NAMES
    assert of(done, "stay") == []


def test_beside_a_better_base_model_only_what_is_in_reach_is_looked_at_again(base, done, monkeypatch):
    # Any base model counts as risen, and nothing but the best as in reach.
    monkeypatch.setattr(search, "RISEN", -np.inf)
    monkeypatch.setattr(search, "OUT_OF_REACH", 1.0)
    found = search.singles(None, base, CANDIDATES)
    assert of(done, "look") == [*NAMES, "process_damping"]
    assert of(done, "stay") == ["radial_immersion_error", "directional_asymmetry"]
    nothing = next(one for one in found.ranking if one.name == NOTHING).best.fit
    # What was left keeps what it had, or stands at its null beside the better base model.
    for one in found.fitted:
        assert one.fit.log_likelihood >= nothing.log_likelihood - 1e-6


def test_what_was_not_climbed_is_looked_at_again_for_what_it_promised(base, monkeypatch):
    nested = pursuit.ground(base)
    at_null = [pursuit.stay(base.comparison, [one], nested) for one in CANDIDATES]
    near, asked = [at_null[0], pursuit.fit_hypothesis(base.comparison, [PROCESS_DAMPING], nested), at_null[2]], []
    best = near[1].fit.log_evidence

    def beside(workers, base, candidates, wanted):
        asked.append(list(wanted))
        return near, [best - 10.0, best, best - 40.0]

    monkeypatch.setattr(search, "_beside", beside)
    monkeypatch.setattr(search, "RISEN", -np.inf)
    monkeypatch.setattr(search, "OUT_OF_REACH", 20.0)
    search.singles(None, base, CANDIDATES)
    assert asked == [[True, True, True], [True, True, False]]


@pytest.mark.parametrize(("highest", "end"), [(36.0, 36.0), (0.0, 0.0)])
def test_all_other_shapes_of_what_is_named_are_climbed_from(base, monkeypatch, highest, end):
    named = pursuit.stay(base.comparison, [candidate("tool_runout")], pursuit.ground(base))
    phase = [p.name for p in named.fit.parameters].index("tool_runout.phase_deg")
    starts = []

    def climbed(hypothesis, start):
        starts.append(start)
        height = named.fit.log_posterior + (1.0 if start[phase] == highest else -1.0)
        return replace(hypothesis, fit=replace(hypothesis.fit, estimate=start, log_posterior=height))

    monkeypatch.setattr(search, "refit_from", climbed)
    (found,) = search._best_shapes(None, [named])
    assert found.fit.estimate[phase] == end
    assert [start[phase] for start in starts] == [-72.0, -36.0, 36.0, 72.0]


def test_what_is_tied_with_the_first_gets_the_same_chance_to_arrive(base, monkeypatch):
    """A rival that another shape leads higher takes the first's place, and is profiled in its stead."""
    nested = pursuit.ground(base)
    first, rival, behind = (
        pursuit.stay(base.comparison, [candidate(name, variant)], nested)
        for name, variant in (("process_damping", 0), ("tool_runout", 0), ("radial_immersion_error", 0))
    )
    heights = {first.name: 20.0, rival.name: 19.5, behind.name: 5.0}

    def raised(one, gain):
        evidence, posterior = base.fit.log_evidence + gain, base.fit.log_posterior + gain
        return replace(one, fit=replace(one.fit, log_evidence=evidence, log_posterior=posterior))

    climbed, profiled = [], []

    def climb(hypothesis, start):
        climbed.append(hypothesis.name)
        return raised(hypothesis, 23.0) if hypothesis.name == rival.name else hypothesis

    def profile(workers, named):
        profiled.append(named.name)
        return named, {}

    monkeypatch.setattr(search, "refit_from", climb)
    monkeypatch.setattr(search, "refit", lambda one, start: one)
    monkeypatch.setattr(search, "profiled", profile)
    fitted = [raised(one, heights[one.name]) for one in (first, rival, behind)]
    found = search.arrived(None, search.Singles(base=base, fitted=fitted))
    # Process damping has no other shape.
    assert set(climbed) == {rival.name}
    assert profiled == [rival.name]
    assert found.ranking[0].name == rival.name
    assert found.ranking[0].gain == pytest.approx(23.0)
    # Where nothing rises everything stays what it was.
    climbed.clear()
    monkeypatch.setattr(search, "refit_from", lambda one, start: one)
    found = search.arrived(None, search.Singles(base=base, fitted=fitted))
    assert found.base is base
    assert all(now is before for now, before in zip(found.fitted, fitted, strict=True))
