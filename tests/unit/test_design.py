"""Designs: what is drawn follows its distributions, the seed alone, and the constraints; what is wrong is told."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy import stats

from chatter_core.errors import InvalidInput
from chatter_core.reading import sentences
from pipeline.design import Design, described, draw

BASE = {
    "tool": {"diameter_mm": 16.0, "teeth": 4},
    "spindle": {"preload_n": 100.0, "sections": [{"length_mm": 66.0, "outer_diameter_mm": 14.5}]},
    "process": {"direction": "down", "radial_immersion": 0.4},
    "effects": {},
}
UNIFORM = {"distribution": "uniform", "low": 8.0, "high": 24.0}


def design(**said):
    said = {"sampling": "sobol", "machines": 64, "seed": 7} | said
    rest = {"title": "t", "deepest_mm": 10.0, "mode_count": 4, "spindle_speed_rpm": [10000.0]}
    return Design.model_validate({key: value for key, value in (rest | said).items() if value is not None})


def told(**said):
    with pytest.raises(ValidationError) as caught:
        design(**said)
    return "; ".join(sentences(caught.value, Design))


@pytest.mark.parametrize(
    ("varied", "expected"),
    [
        (UNIFORM, stats.uniform(8.0, 16.0)),
        ({"distribution": "log_uniform", "low": 10.0, "high": 1000.0}, stats.loguniform(10.0, 1000.0)),
        ({"distribution": "normal", "mean": 5.0, "standard_deviation": 2.0}, stats.norm(5.0, 2.0)),
        (
            {"distribution": "normal", "mean": 5.0, "standard_deviation": 2.0, "low": 4.0, "high": 9.0},
            stats.truncnorm(-0.5, 2.0, 5.0, 2.0),
        ),
    ],
)
@pytest.mark.parametrize("sampling", ["sobol", "latin_hypercube", "random"])
def test_numbers_follow_their_distribution(varied, expected, sampling):
    found = draw(design(sampling=sampling, machines=1024, machine={"vary": {"spindle.preload_n": varied}}), BASE)
    # Kolmogorov's test at one in a thousand; sequences that fill evenly pass it by far.
    assert stats.kstest(found.machines[:, 0], expected.cdf).pvalue > 1e-3


def test_whole_numbers_and_words_come_as_often_as_they_should():
    vary = {
        "tool.teeth": {"distribution": "integer", "low": 2, "high": 5},
        "process.direction": {"distribution": "choice", "values": ["up", "down"], "weights": [3, 1]},
    }
    found = draw(design(machines=1024, machine={"vary": vary}), BASE).machines
    # A Sobol sequence of 2^10 points has the same number of them in each of 2^k equal parts.
    assert [int((found[:, 0] == teeth).sum()) for teeth in (2, 3, 4, 5)] == [256] * 4
    assert int((found[:, 1] == 0).sum()) == 768
    level = design(machine={"vary": vary}).machine
    one = described(BASE, level, np.array([3.0, 1.0]))
    assert one["tool"]["teeth"] == 3
    assert isinstance(one["tool"]["teeth"], int)
    assert one["process"]["direction"] == "down"
    assert BASE["tool"]["teeth"] == 4


@pytest.mark.parametrize("sampling", ["sobol", "random"])
def test_fewer_machines_are_the_first_of_more(sampling):
    said = {"sampling": sampling, "machine": {"vary": {"tool.diameter_mm": UNIFORM}}}
    few, many = (draw(design(machines=count, **said), BASE).machines for count in (50, 200))
    np.testing.assert_array_equal(few, many[:50])


@pytest.mark.parametrize("sampling", ["sobol", "latin_hypercube", "random", "saltelli"])
def test_the_seed_alone_decides(sampling):
    said = {"sampling": sampling, "machine": {"vary": {"tool.diameter_mm": UNIFORM, "spindle.preload_n": UNIFORM}}}
    one, same, other = (draw(design(seed=seed, **said), BASE) for seed in (1, 1, 2))
    np.testing.assert_array_equal(one.machines, same.machines)
    np.testing.assert_array_equal(one.split, same.split)
    assert (one.machines != other.machines).any()


def test_formulas_follow_and_constraints_hold_for_machines_and_for_cuts():
    said = {
        "machine": {
            "vary": {"tool": {"diameter_mm": UNIFORM}, "spindle.preload_n": {**UNIFORM, "high": 400.0}},
            "formulas": {"spindle.sections[0].outer_diameter_mm": "0.9 * tool.diameter_mm"},
            "constraints": ["spindle.preload_n <= 10 * tool.diameter_mm"],
        },
        "cut": {
            "vary": {"process.radial_immersion": {"distribution": "uniform", "low": 0.05, "high": 1.0}},
            "constraints": ["process.radial_immersion * tool.diameter_mm < 8"],
        },
        "cuts_per_machine": 3,
    }
    made = design(**said)
    found = draw(made, BASE)
    assert found.machines.shape == (64, 2)
    assert found.cuts.shape == (64, 3, 1)
    assert (found.machines[:, 1] <= 10.0 * found.machines[:, 0]).all()
    assert (found.cuts[:, :, 0] * found.machines[:, :1] < 8.0).all()
    machine = described(BASE, made.machine, found.machines[5])
    assert machine["spindle"]["sections"][0]["outer_diameter_mm"] == 0.9 * machine["tool"]["diameter_mm"]


def test_grid_has_every_combination_and_every_machine_the_same_cuts():
    said = {
        "sampling": "grid",
        "machines": None,
        "machine": {"vary": {"tool.teeth": [2, 4], "spindle.preload_n": {**UNIFORM, "levels": 3}}},
        "cut": {"vary": {"process.direction": ["up", "down"]}},
    }
    found = draw(design(**said), BASE)
    assert found.machines.tolist() == [[t, p] for t in (2.0, 4.0) for p in (8.0, 16.0, 24.0)]
    assert found.cuts.shape == (6, 2, 1)
    assert (found.cuts[:, :, 0] == [0.0, 1.0]).all()


def test_one_at_a_time_begins_with_the_description_itself():
    vary = {"tool.diameter_mm": UNIFORM, "process.direction": ["up", "down"]}
    found = draw(design(sampling="one_at_a_time", machines=None, machine={"vary": vary}), BASE).machines
    assert found.tolist() == [[16.0, 1.0], [8.0, 1.0], [24.0, 1.0], [16.0, 0.0], [16.0, 1.0]]


@pytest.mark.parametrize(
    ("key", "varied"),
    [
        ("tool.teeth", [2, 3]),
        ("tool.teeth", ["a", "b"]),
        ("process.direction", UNIFORM),
        ("tool", UNIFORM),
        ("spindle.sections[0].outer_diameter_mm", {"distribution": "integer", "low": 10, "high": 20}),
    ],
)
def test_one_at_a_time_refuses_what_cannot_say_what_the_description_says(key, varied):
    with pytest.raises(InvalidInput, match=r"the description says .*, which is not among its values"):
        draw(design(sampling="one_at_a_time", machines=None, machine={"vary": {key: varied}}), BASE)


@pytest.mark.parametrize(("sampling", "machines"), [("one_at_a_time", None), ("saltelli", 8)])
def test_analyses_have_one_cut_of_each_machine(sampling, machines):
    """Their rows are read by their place: further cuts would be taken for other machines."""
    said = {"sampling": sampling, "machines": machines, "machine": {"vary": {"tool.diameter_mm": UNIFORM}}}
    assert "cuts_per_machine: not allowed" in told(cuts_per_machine=2, **said)


@pytest.mark.parametrize("machines", [1, 2, 7, 10, 1000])
def test_parts_are_as_large_as_their_shares_say(machines):
    said = {"sampling": "random", "machines": machines, "machine": {"vary": {"tool.diameter_mm": UNIFORM}}}
    sizes = np.bincount(draw(design(**said), BASE).split, minlength=3)
    assert sizes.sum() == machines
    # Rounded to whole machines, each end of a part by at most a half.
    np.testing.assert_array_less(np.abs(sizes - machines * np.array([0.8, 0.1, 0.1])), 1.0 + 1e-9)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({}, "nothing varies"),
        ({"machine": {"vary": {"a..b": UNIFORM}}}, "a..b: the key is not of the form"),
        ({"machine": {"vary": {"tool.teeth": {**UNIFORM, "low": 30.0}}}}, "low less than high"),
        ({"machine": {"vary": {"tool.teeth": {"distribution": "gauss"}}}}, "allowed: distribution: one of 'uniform', "),
        ({"machine": {"vary": {"tool.teeth": {}}}}, "found {}, allowed: keys and values, distribution among them"),
        ({"machine": {"vary": {"tool.teeth": [None]}}}, "choice.values: found None, allowed: numbers or words"),
        ({"machine": {"vary": {"tool.teeth": [[1]]}}}, "choice.values: found [1], allowed: numbers or words"),
        ({"machine": {"vary": {"tool.teeth": ["a", 1]}}}, "found numbers and words"),
        ({"machine": {"vary": {"tool.teeth": [True]}}}, "true"),
        ({"machine": {"vary": {"tool.teeth": UNIFORM}, "formulas": {"tool.a": "1 +"}}}, "no formula"),
        ({"machine": {"vary": {"tool.teeth": UNIFORM}}, "cut": {"vary": {"bearing.x": UNIFORM}}}, "keys of tool"),
        ({"machine": {"vary": {"tool.teeth": UNIFORM}}, "cut": {"vary": {"tool.teeth": UNIFORM}}}, "in one of them"),
        ({"sampling": "grid", "machine": {"vary": {"tool.teeth": [2]}}}, "machines: not allowed"),
        ({"sampling": "grid", "machines": None, "machine": {"vary": {"tool.teeth": UNIFORM}}}, "levels: missing"),
        ({"machines": None, "machine": {"vary": {"tool.teeth": UNIFORM}}}, "machines: missing"),
        ({"sampling": "saltelli", "machines": 12, "machine": {"vary": {"tool.teeth": UNIFORM}}}, "a power of two"),
        ({"sampling": "grid", "machines": None, "machine": {"vary": {"tool.teeth": [10**400, 2]}}}, "at most 1e+100"),
        ({"machine": {"vary": {"tool.teeth": {**UNIFORM, "high": 1e308}}}}, "high"),
        ({"machine": {"vary": {"tool": {"teeth": [2]}, "tool.teeth": [3]}}}, "tool.teeth stands twice"),
        ({"machine": {"vary": {"": [2]}}}, "the key is not of the form"),
        ({"machine": {"vary": {"effects.tool_runout": [2]}}}, "found a whole effect"),
        ({"machines": 10_000, "cuts_per_machine": 1_000, "machine": {"vary": {"tool.teeth": [2]}}}, "at most 1000000"),
        ({"sampling": "saltelli", "machines": 2**19, "machine": {"vary": {"tool.teeth": [2]}}}, "at most 1000000"),
        (
            {
                "cuts_per_machine": 100,
                "spindle_speed_rpm": {"start": 1.0, "stop": 2.0, "count": 1_000_000},
                "machine": {"vary": {"tool.teeth": [2]}},
            },
            "at most 10000000 together",
        ),
        (
            {"title": "a\n# b", "machine": {"vary": {"tool.teeth": [2]}}},
            "title: found 'a\\n# b', allowed: 1 to 200 letters",
        ),
        ({"splits": {"train": 0.5}, "machine": {"vary": {"tool.teeth": UNIFORM}}}, "allowed: 1"),
    ],
)
def test_what_is_wrong_is_told(said, words):
    assert words in told(**said)


@pytest.mark.parametrize(
    ("level", "words"),
    [
        ({"constraints": ["tool.diameter_mm > 100"]}, "too few to go on"),
        (
            {"constraints": ["tool.diametre_mm > 1"]},
            "tool.diametre_mm is not said of this machine; did you mean diameter_mm?",
        ),
        ({"constraints": ["tool.diameter_mm"]}, "allowed: a comparison"),
        ({"formulas": {"tool.a": "1 / (tool.teeth - 4)"}}, "division by zero"),
        ({"formulas": {"tool.a": "process.direction"}}, "a finite number"),
        ({"formulas": {"spindle.sections[3].length_mm": "1"}}, "no entry [3]"),
        # What a formula must never do: reach into Python, or take all memory.
        ({"formulas": {"tool.a": "tool.clear()"}}, "has no value"),
        ({"formulas": {"tool.a": "tool.__class__"}}, "has no value"),
        ({"formulas": {"tool.a": "9 ** 9 ** 9 ** 9"}}, "has no value"),
        ({"formulas": {"tool.a": "'%999999999d' % 3"}}, "has no value"),
        ({"formulas": {"tool.a": "open('x')"}}, "has no value"),
        ({"formulas": {"tool.a": "9 ** 400"}}, "has no value"),
        ({"formulas": {"tool.a": "9" * 400}}, "a finite number"),
        ({"formulas": {"tool.a": "f'{1:>999999999}'"}}, "has no value"),
    ],
)
def test_what_cannot_be_drawn_is_told(level, words):
    with pytest.raises(InvalidInput) as caught:
        draw(design(machine={"vary": {"tool.diameter_mm": UNIFORM}, **level}), BASE)
    assert words in str(caught.value)
