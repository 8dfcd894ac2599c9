"""What people see of an object, in a console and in a notebook."""

from pathlib import Path
from types import SimpleNamespace

import pytest

import chatter_core
from chatter_core.cards import Card
from chatter_core.effects import effect_names, variants
from chatter_core.evidence import Comparison, base_model
from chatter_core.evidence.fit import fit
from chatter_core.evidence.ranking import Ranked
from chatter_core.evidence.verdict import Verdict
from chatter_core.machine import Machine
from pipeline.diagnosis import Diagnosis
from tests.analytic.test_fit import linear

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"


def test_a_card_is_lines_of_text_and_a_table_in_which_nothing_acts():
    card = Card(title="Two", rows=(("a", "<b>"), ("long", "1")), columns=("name", "value"))
    assert card.text() == "Two\n  name  value\n  a     <b>\n  long  1"
    assert "<caption>Two</caption>" in card.html()
    assert "&lt;b&gt;" in card.html()
    assert card.html().count("<tr>") == 3


def test_a_machine_shows_bearings_preload_length_tool_and_process(reference_machine):
    told = repr(reference_machine)
    for part in ("19 balls of 8.731 mm", "100 N on each, constant", "484 mm in 4 sections", "4 teeth, 16 mm", "down"):
        assert part in told
    assert str(reference_machine) == told
    assert "<td" in reference_machine._repr_html_()


def test_a_machine_of_measured_modes_shows_them(reference_machine):
    mode = {"axis": "x", "natural_frequency_hz": 922.0, "damping_ratio": 0.011, "stiffness_n_um": 1.34}
    cut = {key: value for key, value in reference_machine.described().items() if key in ("tool", "cutting", "process")}
    assert "measured modes: x 922 Hz, x 922 Hz, x 922 Hz, x 922 Hz and 2 more" in repr(
        Machine.model_validate({"tip": {"modes": [mode] * 6}, **cut})
    )


@pytest.mark.parametrize("name", effect_names())
def test_an_effect_shows_its_parameters(name):
    for one in variants(name):
        card = one.card()
        assert card.title.startswith(f"{name}, on {one.acts_on}")
        assert [row[0] for row in card.rows] == [parameter.name for parameter in one.used]


def test_a_campaign_and_a_comparison_show_what_is_in_them():
    campaign = chatter_core.read_campaign(CAMPAIGNS / "r02")
    assert "trial cuts" in repr(campaign)
    assert f"{len(campaign.trials)}: " in repr(campaign)
    comparison = Comparison(model=base_model(campaign))
    assert [row[0] for row in comparison.card().rows] == [one.name for one in comparison.parameters]


def test_a_fit_shows_estimates_with_deviations():
    found = fit(linear()[0])
    card = found.card()
    assert card.columns[:3] == ("parameter", "estimate", "+-")
    assert [row[0] for row in card.rows] == [one.name for one in found.parameters]
    assert card.rows[0][1:3] == (f"{found.estimate[0]:.4g}", f"{found.standard_deviation[0]:.4g}")
    assert "converged" in repr(found)


def test_a_diagnosis_shows_its_verdict_and_ranking():
    ranked = Ranked(name="process_damping", probability=0.93, gain=12.34, best=SimpleNamespace())
    verdict = Verdict(kind="effect", missing=("process_damping",), text="This is missing.")
    card = Diagnosis.card(SimpleNamespace(verdict=verdict, ranking=[ranked] * 9))
    assert card.title == "Diagnosis: effect. This is missing."
    assert card.rows == (("process_damping", "0.930", "+12.3"),) * 5
