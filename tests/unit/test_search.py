"""The search for single effects: what cannot come near the best any more is not climbed, or looked at again."""

import numpy as np
import pytest

from chatter_core.evidence.pursuit import look
from chatter_core.evidence.ranking import NOTHING
from pipeline import search
from tests.unit.test_candidates import ASYMMETRY, COEFFICIENT, PROCESS_DAMPING, base_of, candidate, judged

IMMERSION = candidate("radial_immersion_error")
CANDIDATES = [IMMERSION, PROCESS_DAMPING, ASYMMETRY]


@pytest.fixture(scope="module")
def base():
    return base_of(judged(COEFFICIENT))


@pytest.fixture
def looked_at(monkeypatch):
    """Names of the effects that were looked at, in turn."""
    asked = []

    def noted(comparison, candidates, nested, *amplitudes):
        asked.append(candidates[-1].name)
        return look(comparison, candidates, nested, *amplitudes)

    monkeypatch.setattr(search, "look", noted)
    return asked


def test_what_promises_far_less_than_another_gained_stays_where_it_promises_most(base, looked_at, monkeypatch):
    everything = search.singles(None, base, CANDIDATES)
    assert sorted(looked_at) == sorted(one.name for one in CANDIDATES)
    gained = max(one.fit.log_evidence for one in everything.fitted) - base.fit.log_evidence
    monkeypatch.setattr(search, "CLOSE", 0.0)
    monkeypatch.setattr(search, "OUT_OF_REACH", -gained)
    found = search.singles(None, base, CANDIDATES)
    assert [one.name for one in found.fitted] == [one.name for one in CANDIDATES]
    climbed, settled = everything.fitted[0], found.fitted[0]
    assert settled.fit.evaluations < climbed.fit.evaluations
    assert "not climbed" in settled.fit.reason
    # It is no higher than a climb ends, and the best is what it was.
    assert settled.fit.log_posterior <= climbed.fit.log_posterior + 1e-6
    assert found.ranking[0].name == everything.ranking[0].name == "process_damping"
    # Climbs of the base model and of the effect end where a step promises less than 0.3 nats.
    assert found.ranking[0].gain == pytest.approx(everything.ranking[0].gain, abs=0.6)


def test_beside_a_better_base_model_only_what_is_in_reach_is_looked_at_again(base, looked_at, monkeypatch):
    # Any base model counts as risen, and nothing but the best as in reach.
    monkeypatch.setattr(search, "RISEN", -np.inf)
    monkeypatch.setattr(search, "OUT_OF_REACH", 1.0)
    found = search.singles(None, base, CANDIDATES)
    assert looked_at[: len(CANDIDATES)] == [one.name for one in CANDIDATES]
    assert looked_at[len(CANDIDATES) :] == ["process_damping"]
    nothing = next(one for one in found.ranking if one.name == NOTHING).best.fit
    # What was left keeps what it had, or stands at its null beside the better base model.
    for one in found.fitted:
        assert one.fit.log_likelihood >= nothing.log_likelihood - 1e-6
