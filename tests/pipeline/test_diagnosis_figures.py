"""Pictures and lists of answers show what their numbers say, and of which model."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from chatter_core.evidence.measured import OUTCOMES, Limits
from chatter_core.evidence.power import Power
from chatter_core.evidence.ranking import Ranked
from pipeline import comparison_figures, diagnosis_figures, diagnosis_page
from pipeline.comparison_document import origin
from pipeline.model_file import Content
from tests.synthetic import campaign, tip_machine, trials


def power(name: str, **nats: float) -> Power:
    return Power(candidate=name, nats=sum(nats.values()), by_quantity=nats)


POWERS = [
    power("tool_runout", outcome=77.4, chatter_frequency=60.3),
    power("process_damping", outcome=-0.5, chatter_frequency=4.5),
]


def test_what_could_have_been_seen_is_drawn_from_nothing_quantity_by_quantity_and_together():
    """On an axis that is not straight a bar that stands on another would look smaller, or larger, than it is."""
    (axes,) = diagnosis_figures.power(SimpleNamespace(powers=POWERS)).axes
    bars = {container.get_label(): [bar.get_width() for bar in container] for container in axes.containers}
    assert all(bar.get_x() == 0.0 for container in axes.containers for bar in container)
    assert bars["together"] == pytest.approx([4.0, 137.7])
    assert bars["outcome"] == pytest.approx([0.0, 77.4])
    assert bars["chatter frequency"] == pytest.approx([4.5, 60.3])
    assert axes.get_xlim()[1] > 137.7
    (apart,) = diagnosis_figures.power(SimpleNamespace(powers=[power("a", outcome=4e3, receptance=-2e3)])).axes
    assert apart.get_xlim()[1] > 4e3
    assert [label.get_text() for label in axes.get_yticklabels()] == ["process damping", "tool runout"]


def test_what_could_have_been_seen_is_listed_the_most_first():
    head, *lines = diagnosis_page.power_lines(SimpleNamespace(powers=POWERS))
    assert head.endswith("10 are seen:")
    assert [line.split() for line in lines] == [["137.7", "tool_runout"], ["4.0", "process_damping"]]


def test_a_ranking_is_drawn_with_its_pairs_and_says_every_gain():
    def ranked(name: str, probability: float, gain: float) -> Ranked:
        return Ranked(name=name, probability=probability, gain=gain, best=SimpleNamespace())

    # A loss that rounds to nothing is none.
    found = SimpleNamespace(
        ranking=[ranked("higher_modes", 1.0, 805.0), ranked("none", 0.0, -0.01), ranked("tool_runout", 0.0, -1234.5)],
        pairs=[ranked("higher_modes + tool_runout", np.nan, 846.0)],
        supported=SimpleNamespace(name="higher_modes + tool_runout"),
        verdict=SimpleNamespace(missing=("higher_modes", "tool_runout")),
    )
    left, right = diagnosis_figures.ranking(found).axes
    names = [label.get_text() for label in left.get_yticklabels()]
    assert names == ["higher modes", "nothing missing", "tool runout", "higher modes + tool runout"]
    assert [text.get_text() for text in right.texts] == ["+805.0", "+0.0", "-1234.5", "+846.0"]
    assert len(left.patches) == 3
    colours = [bar.get_facecolor() for bar in right.patches]
    assert colours[0] == colours[2] == colours[3] != colours[1]
    assert right.get_xlim()[1] > 846.0


def legend(*outcomes: str, **more: object) -> list[str]:
    """Return the legend of cuts with these outcomes, and of what else was measured."""
    codes = np.array([OUTCOMES.index(one) for one in outcomes], dtype=np.int8)
    plan = campaign(tip_machine(), trials=trials(np.full(len(codes), 300.0), np.full(len(codes), 1e-3), outcome=codes))
    plan = replace(plan, **more)
    found = SimpleNamespace(comparison=SimpleNamespace(model=SimpleNamespace(campaign=plan)))
    return [
        str(entry.get_label())
        for entry in [*comparison_figures._trial_key(found), *comparison_figures._limit_key(found)]
    ]


def test_legends_have_the_outcomes_that_there_are_and_limit_depths():
    assert legend("stable", "chatter") == ["stable", "chatter", "told right", "told wrongly"]
    neither = "marginal: neither right nor wrong"
    assert legend("marginal", "stable") == ["stable", "marginal", "told right", "told wrongly", neither]
    limits = Limits(spindle_speed=np.array([300.0]), limit_depth=np.array([1e-3]), uncertainty=np.array([1e-4]))
    assert legend("stable", limits=limits)[-1] == "limit depth, measured, and its uncertainty"


def test_answers_say_of_which_model_they_are():
    assert origin(None, Content()) == []
    assert origin("fit.yaml", Content()) == ["The model to begin with, as described, is that in fit.yaml."]
    poor = Content(base="static_bearing", modes=1, effects={"tool_runout": {}})
    assert origin(None, poor) == ["The model that was asked has bearings as at rest, 1 mode of each axis, tool runout."]
    assert origin(None, Content(modes=2)) == ["The model that was asked has 2 modes of each axis."]
