"""A second effect beside one that is named: looked for there, and taken over once the first belongs to the model."""

import numpy as np
import pytest

from chatter_core.evidence import Comparison, base_model
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.pursuit import fit_hypothesis, ground, refit, stay
from chatter_core.evidence.ranking import NOTHING, rank
from pipeline.search import Singles, pairs_of, taken_over, with_halves_refitted
from tests.synthetic import campaign, measured, tip_machine, trials
from tests.unit.test_candidates import ASYMMETRY, COEFFICIENT, DEPTHS, IN_Y, PROCESS_DAMPING, SPEEDS, base_of, candidate

IMMERSION = candidate("radial_immersion_error")

SIZES = {"process_damping.coefficient_n_m": COEFFICIENT, "directional_asymmetry.stiffness_loss": 0.4}


@pytest.fixture(scope="module")
def named():
    """Base model, and process damping beside it, on cuts of a machine whose modes along x are softer, too."""
    speed, depth = (axis.ravel() for axis in np.meshgrid(SPEEDS, DEPTHS, indexing="ij"))
    plan = campaign(tip_machine(), trials=trials(speed, depth))
    terms = (PROCESS_DAMPING.term, ASYMMETRY.term)
    model = base_model(plan, terms)
    truth = np.array([SIZES.get(p.name, p.null) for p in model.parameters])
    base = base_of(measured(plan, truth, np.random.default_rng(8), terms))
    first = fit_hypothesis(base.comparison, [PROCESS_DAMPING], ground(base))
    return base, refit(first, first.fit)


def test_what_is_fitted_beside_the_first_effect_is_kept_when_that_is_added(named):
    base, first = named
    ranking = Singles(base=base, fitted=[first]).ranking
    pairs, fitted = pairs_of(None, base, [PROCESS_DAMPING, ASYMMETRY, IN_Y], ranking, suffices=True)
    assert {one.name for one in pairs} == {"directional_asymmetry + process_damping"}
    assert pairs[0].gain > ranking[0].gain
    # Beside both of them nothing promises anything.
    both = Singles(base=base, fitted=[pairs[0].best]).ranking
    assert pairs_of(None, base, [IMMERSION], both, suffices=True) == ([], [])
    model = base_model(base.comparison.model.campaign, (PROCESS_DAMPING.term,))
    added = Hypothesis(candidates=(), comparison=Comparison(model=model), fit=first.fit)
    found = taken_over(None, added, [ASYMMETRY, IN_Y], fitted)
    tried = {str(pair.candidates[-1]): pair for pair in fitted}
    assert str(ASYMMETRY) in tried
    for one in found.fitted:
        pair = tried.get(str(one.candidates[-1]))
        if pair is None:
            # Of what was not tried with it nothing is known but the model without it.
            assert not one.moved
            assert one.fit.log_likelihood == pytest.approx(found.base.fit.log_likelihood, abs=1e-9)
        else:
            assert one.fit.log_posterior >= pair.fit.log_posterior - 1e-6
            # What is added first acts after what is added second: their parameters stand as they act.
            assert [p.name for p in one.fit.parameters] == [p.name for p in pair.fit.parameters]
    assert found.ranking[0].name == "directional_asymmetry"
    assert found.base.fit.log_posterior >= added.fit.log_posterior


def test_where_nothing_promised_anything_all_stays_at_its_null(named):
    _, first = named
    model = base_model(first.comparison.model.campaign, (PROCESS_DAMPING.term,))
    added = Hypothesis(candidates=(), comparison=Comparison(model=model), fit=first.fit)
    found = taken_over(None, added, [ASYMMETRY, IN_Y], [])
    assert not any(one.moved for one in found.fitted)
    assert found.ranking[0].name == NOTHING


def test_a_pair_whose_second_came_to_stand_at_its_null_is_not_fitted_again(named):
    base, first = named
    model = base_model(first.comparison.model.campaign, (PROCESS_DAMPING.term,))
    added = Hypothesis(candidates=(), comparison=Comparison(model=model), fit=first.fit)
    pair = fit_hypothesis(base.comparison, [PROCESS_DAMPING, ASYMMETRY], ground(first))
    unmoved = stay(base.comparison, [PROCESS_DAMPING, ASYMMETRY], ground(first))
    assert pair.moved
    assert not unmoved.moved
    (standing,) = taken_over(None, added, [ASYMMETRY], [unmoved]).fitted
    (moved,) = taken_over(None, added, [ASYMMETRY], [pair]).fitted
    assert not standing.moved
    assert standing.fit.reason.startswith("not climbed")
    assert moved.fit.log_evidence > standing.fit.log_evidence + 2.0


def test_a_half_that_was_not_climbed_is_fitted_from_where_its_pair_is(named):
    """Process damping explains most of what a pair gains: it is the answer once the pair has led there."""
    base, first = named
    unmoved = stay(base.comparison, [PROCESS_DAMPING], ground(base))
    other = fit_hypothesis(base.comparison, [IMMERSION], ground(base))
    beside = fit_hypothesis(base.comparison, [IMMERSION, PROCESS_DAMPING], ground(other))
    (pair,) = [one for one in rank(base, [beside]) if one.name != NOTHING]
    found = Singles(base=base, fitted=[unmoved, other])
    assert not unmoved.moved
    again = with_halves_refitted(None, found, pair)
    known = {one.name: one for one in again.fitted}
    assert again.ranking[0].name == PROCESS_DAMPING.name
    # It comes as high as the search by itself does: a climb ends where a step promises a third of a nat.
    assert known[PROCESS_DAMPING.name].fit.log_posterior > first.fit.log_posterior - 1.0
    assert known[IMMERSION.name].fit.log_posterior >= other.fit.log_posterior
