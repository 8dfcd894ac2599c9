"""Where fits from the truth begin, and how they are told; how high they and the search come is no matter of a test."""

import numpy as np
import pytest

from benchmarks.blind.from_truth import BEGINNINGS, start_at, table, true_nuisances
from chatter_core.effects import variants
from chatter_core.evidence import base_model
from tests.hidden_effect.campaign import draw_shop, hide
from tests.hidden_effect.design import Plan
from tests.hidden_effect.drawing import draw_machine
from tests.hidden_effect.effects import NAMED, prepared
from tests.synthetic import campaign


def test_all_effects_that_can_be_hidden_have_a_beginning():
    assert BEGINNINGS.keys() == NAMED.keys()


@pytest.mark.parametrize("name", NAMED)
@pytest.mark.parametrize("strength", [0.0, 1.0], ids=["weak", "strong"])
def test_a_beginning_is_a_place_of_the_program_s_own_law(name, strength):
    rng = np.random.default_rng(3)
    machine = prepared(draw_machine(rng)[0], name, strength)
    plan = Plan(kind="one", effects=(name,), strengths=(strength,))
    beginning = BEGINNINGS[name](hide(plan, machine, rng), machine)
    fitting = [one for one in variants(name) if all(getattr(one, k) == v for k, v in beginning.settings.items())]
    assert fitting
    for effect in fitting:
        by_name = {parameter.name.split(".")[-1]: parameter for parameter in effect.parameters}
        for values in beginning.values:
            assert values.keys() == by_name.keys()
            assert any(value != by_name[key].null for key, value in values.items())


def test_nuisances_of_the_truth_are_those_of_the_model(reference_machine):
    model = base_model(campaign(reference_machine))
    true = true_nuisances(draw_shop(1001))
    assert true.keys() <= {parameter.name for parameter in model.parameters}
    start = start_at(model.parameters, true)
    known = dict(zip((parameter.name for parameter in model.parameters), start, strict=True))
    assert all(known[name] == pytest.approx(value) for name, value in true.items())


def test_what_the_search_misses_most_comes_first():
    row = {"hidden": "tool_runout", "strength": 0.5, "from_truth_nats": 20.0, "evidence_nats": 1.0}
    told = table([{**row, "seed": 1, "searched_nats": 21.0}, {**row, "seed": 2, "searched_nats": 5.0}])
    assert told[2:] == [
        "| 2 | tool_runout | 0.50 | 5.0 | 20.0 | 15.0 |",
        "| 1 | tool_runout | 0.50 | 21.0 | 20.0 | 0.0 |",
    ]
