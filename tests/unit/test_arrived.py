"""What lies below a place that its own profiles come upon is fitted again: pairs of effects, and calibrations."""

from types import SimpleNamespace

import numpy as np
import pytest

from chatter_core.evidence import Comparison, base_model, calibrate
from chatter_core.evidence.belief import PRIORS
from chatter_core.evidence.failures import Failure
from chatter_core.evidence.fit import maximise, result
from chatter_core.evidence.ranking import NOTHING, Ranked
from chatter_core.evidence.verdict import Verdict, decide
from pipeline import compare, diagnosis
from pipeline.diagnosis import Diagnosis, with_arrived_pair
from tests.synthetic import RPM, campaign, measured, receptance, tip_machine, trials

LINES = np.linspace(400.0, 800.0, 60) * 2.0 * np.pi


def hypothesis(*names, evidence=0.0):
    return SimpleNamespace(names=names, name=" + ".join(names), fit=SimpleNamespace(log_evidence=evidence))


def ranked(best, gain):
    return Ranked(name=best.name or NOTHING, probability=0.5, gain=gain, best=best)


FAILURE = Failure(quantity="outcome", band={}, excess=0.3, chance=1e-3, text="It fails there.")
BASE, FIRST = hypothesis(), hypothesis("a", evidence=20.0)
BEST, OTHER = hypothesis("a", "b", evidence=40.0), hypothesis("a", "c", evidence=39.0)


def decided(pairs):
    """Return a diagnosis by these pairs; the first effect leaves a check failed, and no pair does."""
    ranking, left = (
        [ranked(FIRST, 20.0), ranked(BASE, 0.0)],
        {"a": [FAILURE], NOTHING: [FAILURE], "a + b": [], "a + c": []},
    )
    return Diagnosis(
        content=None, base=BASE, ranking=ranking, pairs=pairs, powers=[], judged={}, left=left, beside=None,
        not_tried={}, verdict=decide(ranking, pairs, [], left),
    )  # fmt: skip


def test_a_pair_that_a_profile_leads_above_is_fitted_again_and_decided_again(monkeypatch):
    pairs = [ranked(BEST, 40.0), ranked(OTHER, 39.0)]
    tied = decided(pairs)
    assert (tied.verdict.kind, tied.verdict.missing) == ("ambiguous", ("a", "b", "c"))
    risen, limits = hypothesis("a", "b", evidence=45.0), {"b.size": "an interval"}
    monkeypatch.setattr(diagnosis, "profiled", lambda _, named: (risen if named is BEST else named, limits))
    found = with_arrived_pair(None, tied, decided)
    assert (found.verdict.kind, found.verdict.missing) == ("effect", ("a", "b"))
    assert found.supported is risen
    assert [one.gain for one in found.pairs] == [45.0, 39.0]
    assert found.intervals == limits


def test_a_pair_that_stays_where_it_was_keeps_its_verdict_and_gets_its_intervals(monkeypatch):
    limits = {"b.size": "an interval"}
    monkeypatch.setattr(diagnosis, "profiled", lambda _, named: (named, limits))
    before = decided([ranked(BEST, 40.0)])
    found = with_arrived_pair(None, before, None)
    assert (found.verdict, found.pairs, found.intervals) == (before.verdict, before.pairs, limits)


@pytest.mark.parametrize("pairs", [[], [ranked(BEST, 25.0)]])
def test_what_names_no_pair_is_left_alone(pairs):
    before = decided(pairs)
    assert isinstance(before.verdict, Verdict)
    assert with_arrived_pair(None, before, None) is before


def test_a_calibration_that_stopped_short_is_fitted_again_from_where_its_profiles_lead(monkeypatch):
    cuts = trials(np.linspace(3000.0, 6000.0, 12) * RPM, np.linspace(1e-3, 4e-3, 12))
    planned = campaign(tip_machine(), trials=cuts, receptances=(receptance(LINES), receptance(LINES, axis=1)))
    comparison = Comparison(model=base_model(measured(planned, base_model(planned).nulls, np.random.default_rng(4))))
    arrived = calibrate(comparison)
    start = arrived.estimate + 3.0 * np.where(arrived.fixed, 0.0, arrived.standard_deviation)
    short = result(comparison, maximise(comparison, [start], ~arrived.fixed, 1, smallest_gain=np.inf), 0, -np.inf)
    assert short.log_posterior < arrived.log_posterior - 2.0
    monkeypatch.setattr(compare, "calibrate", lambda *_, **__: short)
    found = compare.compute(None, comparison, PRIORS)
    # A climb ends where a step promises a third of a nat.
    assert found.refitted.fit.log_posterior > arrived.log_posterior - 1.0
