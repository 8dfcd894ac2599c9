"""One table of checks that every effect passes: a file added to chatter_core/effects is in it.

A class and a yaml of one stem; the nulls are the base model bit for bit; values stay within bounds; an effect
survives pickling; a strong one changes what it says it changes, and leaves the rest bit for bit.
"""

import itertools
import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from chatter_core.chain import structure
from chatter_core.effects import ActiveEffect, Effect, activate, apply_effects, effect_class, effect_names, variants
from chatter_core.effects._using import null_values
from chatter_core.errors import InvalidInput
from chatter_core.evidence.parameters import log_prior
from chatter_core.floquet import MethodSettings
from chatter_core.machine import Machine
from chatter_core.reading import load_yaml
from chatter_core.stability import critical_multipliers
from chatter_core.stages import Stages
from tests.synthetic import machine_of_modes

VALUES = Path(__file__).parents[2] / "configs" / "effects"
METHOD = MethodSettings(name="collocation", tolerance=1e-4)
SPEEDS = np.array([4000.0, 14000.0]) * math.pi / 30.0
DEPTH = np.array([1.5e-3, 0.8e-3])
#: Effects that need another base than the full one, and what it is.
BASES = {"speed_dependent_bearing": {"modal_parameters": "static"}, "higher_modes": {"mode_count": 1}}

EVERY = pytest.mark.parametrize("name", effect_names())


def results(stages: Stages, name: str) -> dict[str, list[NDArray]]:
    """Return what a model says of bearings, of the tip's modes and of cuts."""
    built = structure(stages, SPEEDS, **{"mode_count": 4, **BASES.get(name, {})})
    index = np.array([0, 1])
    cut = critical_multipliers(stages, built, index, DEPTH, METHOD, np.ones(2))
    modes = built.modes
    bearing = [] if built.bearing is None else [built.bearing.radial_stiffness, built.bearing.axial_load]
    lines = stages.receptance(modes, np.linspace(1e3, 2e4, 50))
    return {"bearing": bearing, "modes": [modes.natural_frequency, modes.damping_ratio, lines], "cut": [cut]}


def alike(one: list[NDArray], other: list[NDArray]) -> bool:
    """Return whether two lists of arrays are one, bit for bit."""
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))


def configured(name: str) -> ActiveEffect:
    return activate(name, load_yaml(VALUES / f"{name}.yaml"))


def at(effect: Effect, values) -> ActiveEffect:
    return ActiveEffect(effect=effect, values=tuple(values))


def test_classes_and_values_pair_up():
    assert {file.stem for file in VALUES.glob("*.yaml")} == set(effect_names())


@EVERY
def test_an_effect_is_declared_in_full(name: str):
    kind = effect_class(name)
    assert kind.__name__ == "".join(word.capitalize() for word in name.split("_"))
    assert {kind.stage, *(one.acts_on for one in variants(name))} <= set(Stages.__dataclass_fields__)
    assert set(kind.shapes) < {parameter.name for parameter in kind.declared}
    assert set(kind.changes) <= {"bearing", "modes", "cut"}
    assert "Source: " in (kind.__doc__ or "")
    assert "docs/physics.md#" + name.replace("_", "-") in (kind.__doc__ or "")
    for parameter in kind.declared:
        assert parameter.doc
        assert parameter.prior_mean == parameter.null, "the prior is centred on the null"


@EVERY
def test_the_null_is_the_base_model_bit_for_bit(name: str, reference_machine: Machine):
    expected = results(Stages(machine=reference_machine), name)
    for effect in variants(name):
        if name == "holder_joint" and effect != configured(name).effect:
            continue
        nulls = null_values(effect)
        stages = at(effect, nulls).apply(Stages(machine=reference_machine))
        assert stages == Stages(machine=reference_machine)
        # With only the shape displaced nothing acts either.
        for index, parameter in enumerate(effect.used):
            if parameter.name in effect.shapes:
                shaped = nulls.copy()
                shaped[index] = 0.5 * (parameter.null + parameter.upper)
                found = results(at(effect, shaped).apply(Stages(machine=reference_machine)), name)
                assert all(alike(found[key], expected[key]) for key in expected)


@EVERY
def test_a_strong_value_changes_what_it_says_and_nothing_else(name: str, reference_machine: Machine):
    base, active = results(Stages(machine=reference_machine), name), configured(name)
    found = results(apply_effects(reference_machine, [active]), name)
    for key in base:
        if key in active.effect.changes:
            assert not any(np.array_equal(a, b) for a, b in zip(base[key][-1:], found[key][-1:], strict=True)), key
        else:
            assert alike(base[key], found[key]), key


@EVERY
def test_the_smallest_step_from_the_null_is_small(name: str, reference_machine: Machine):
    """A fit moves by shares of the prior's width: the model follows without a jump."""
    base, effect = results(Stages(machine=reference_machine), name), configured(name).effect
    values = null_values(effect)
    for index, parameter in enumerate(effect.used):
        if parameter.name not in effect.shapes:
            values[index] = parameter.aside(1e-6)
    found = results(at(effect, values).apply(Stages(machine=reference_machine)), name)
    # A millionth of a width moves no multiplier by more than some ten thousandth of itself.
    assert np.abs(found["cut"][0]) == pytest.approx(np.abs(base["cut"][0]), rel=1e-4)


@EVERY
def test_values_outside_the_bounds_get_one_sentence(name: str):
    data = load_yaml(VALUES / f"{name}.yaml")
    for parameter in effect_class(name).declared:
        for wrong in (parameter.lower - 1.0, parameter.upper + 1.0, "much", True, math.nan, 10**400):
            with pytest.raises(InvalidInput) as refused:
                activate(name, {**data, parameter.name: wrong})
            (problem,) = refused.value.problems
            assert problem.startswith(f"effects.{name}.{parameter.name}: found ")
            assert "allowed: " in problem
        assert log_prior((parameter,), np.array([parameter.lower - 1.0])) == -np.inf


@EVERY
def test_keys_and_settings_are_checked(name: str):
    data = load_yaml(VALUES / f"{name}.yaml")
    first = next(iter(data))
    with pytest.raises(InvalidInput, match=rf"effects.{name}.{first}: missing; needed: "):
        activate(name, {key: value for key, value in data.items() if key != first})
    with pytest.raises(InvalidInput, match=rf"effects.{name}.{first}x: unknown key; did you mean {first}"):
        activate(name, {**data, f"{first}x": 1.0})
    for setting in effect_class(name).settings:
        with pytest.raises(InvalidInput, match=rf"effects.{name}.{setting.name}: found 'sideways', allowed: "):
            activate(name, {**data, setting.name: "sideways"})


def test_a_parameter_that_says_nothing_with_what_is_chosen():
    modes = {"where": "modes", "axis": "y", "stiffness_loss": 0.3}
    left_out, at_null = (
        activate("directional_asymmetry", {**modes, **other}) for other in ({}, {"rear_difference": 0, "turn_deg": 0})
    )
    assert left_out == at_null
    assert [one.name for one in left_out.effect.parameters] == ["directional_asymmetry.stiffness_loss"]
    with pytest.raises(InvalidInput) as refused:
        activate("directional_asymmetry", {**modes, "rear_difference": 0.5})
    assert refused.value.problems == [
        "effects.directional_asymmetry.rear_difference: found 0.5, which says nothing with where=modes, axis=y; "
        "allowed: 0, or none"
    ]
    with pytest.raises(InvalidInput, match=r"directional_asymmetry.rear_difference: missing; needed: "):
        activate("directional_asymmetry", {**modes, "where": "seats", "turn_deg": 0.0})


@EVERY
def test_an_effect_survives_pickling(name: str, reference_machine: Machine):
    active = configured(name)
    again = pickle.loads(pickle.dumps(active))
    assert again == active
    one, other = (results(effect.apply(Stages(machine=reference_machine)), name) for effect in (active, again))
    assert all(alike(one[key], other[key]) for key in one)


@EVERY
def test_a_machine_of_measured_modes_is_told_what_is_missing(name: str):
    kind, machine = effect_class(name), machine_of_modes(4)
    if kind.needs:
        with pytest.raises(InvalidInput, match=rf"effects.{name}: acts on spindle and bearing; this machine has"):
            apply_effects(machine, [configured(name)])
    else:
        assert apply_effects(machine, [configured(name)]) != Stages(machine=machine)


def test_effects_that_would_do_nothing_say_why(reference_machine: Machine):
    plain = reference_machine.spindle.model_copy(update={"beam": "euler_bernoulli", "discs": ()})
    without_inertia = reference_machine.model_copy(update={"spindle": plain})
    with pytest.raises(InvalidInput, match=r"gyroscopic_coupling: beam euler_bernoulli has no rotary inertia"):
        apply_effects(without_inertia, [configured("gyroscopic_coupling")])
    described = machine_of_modes(1).described()
    along_x = [mode for mode in described["tip"]["modes"] if mode["axis"] == "x"]
    one_axis = Machine.model_validate({**described, "tip": {"modes": along_x}})
    values = {"where": "modes", "axis": "y", "stiffness_loss": 0.3}
    with pytest.raises(InvalidInput, match=r"directional_asymmetry.axis: found 'y', along which no mode was measured"):
        apply_effects(one_axis, [activate("directional_asymmetry", values)])


def test_seats_that_hang_on_the_speed_do_so_with_bearings_at_standstill(reference_machine: Machine):
    """What a user exchanges there gets the spindle's speed, whatever the balls feel."""
    before = Stages(machine=reference_machine)

    def softer(spindle, state):
        return before.seat_stiffness(spindle, state) / (1.0 + (state.spindle_speed[:, None] / 1200.0) ** 2)

    speed = np.array([1200.0])
    plain, soft = (
        structure(one, speed, mode_count=2, modal_parameters="static").modes.natural_frequency
        for one in (before, replace(before, seat_stiffness=softer))
    )
    assert (soft < 0.9 * plain).all()


def test_names_are_found_and_unknown_ones_get_the_nearest():
    with pytest.raises(InvalidInput, match=r"effects: found 'proces_damping'; did you mean process_damping\?"):
        effect_class("proces_damping")
    for foreign in ("_base", "os", "../stages", "chatter_core.stages"):
        with pytest.raises(InvalidInput, match="effects: found"):
            effect_class(foreign)


def test_the_order_in_which_effects_are_named_does_not_matter(reference_machine: Machine):
    names = [name for name in effect_names() if name not in BASES]
    together = [configured(name) for name in names]
    expected = results(apply_effects(reference_machine, together), "")
    for order in itertools.islice(itertools.permutations(together), 1, 5000, 1700):
        found = results(apply_effects(reference_machine, order), "")
        assert all(alike(found[key], expected[key]) for key in expected)
    found = results(apply_effects(reference_machine, together[::-1]), "")
    assert all(alike(found[key], expected[key]) for key in expected)


def test_no_effect_stands_twice(reference_machine: Machine):
    with pytest.raises(InvalidInput, match="effects: thermal_preload stands twice"):
        apply_effects(reference_machine, [configured("thermal_preload")] * 2)


def test_parameters_of_all_effects_have_names_of_their_own():
    names = [parameter.name for name in effect_names() for parameter in variants(name)[0].parameters]
    assert len(set(names)) == len(names)
