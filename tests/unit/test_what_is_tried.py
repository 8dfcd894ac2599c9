"""Which effects a diagnosis tries on a machine, in which variants, and why others are not."""

from typing import ClassVar

import numpy as np
import pytest

from chatter_core.effects import Scan
from chatter_core.effects.directional_asymmetry import DirectionalAsymmetry
from chatter_core.evidence import base_model
from chatter_core.evidence.measured import DIRECTIONS
from pipeline.campaigns import model_of
from pipeline.diagnosis import candidate_of, candidates_of, not_tried
from pipeline.model_file import Content
from tests.synthetic import campaign, machine_of_modes, tip_machine, trials

SPEED, DEPTH = np.array([800.0, 900.0]), np.array([1e-3, 2e-3])


def restored(content, machine):
    """The numbers of modes to which higher modes are restored, and why not where none are."""
    model = model_of(campaign(machine, trials=trials(SPEED, DEPTH)), content)
    found = [one.settings["modes"] for one in candidates_of(model, content) if one.name == "higher_modes"]
    return found, not_tried(model, content).get("higher_modes")


@pytest.mark.parametrize(
    ("kept", "expected"), [(1, [2, 3, 4, 6, 8]), (2, [3, 4, 6, 8]), (4, [6, 8]), (7, [8]), (None, [])]
)
def test_modes_that_a_model_keeps_are_not_restored_to_it(reference_machine, kept, expected):
    found, why = restored(Content(modes=kept), reference_machine)
    assert (found, why) == (expected, None)


def test_where_all_modes_are_kept_it_is_said_why_none_are_restored(reference_machine):
    found, why = restored(Content(modes=8), reference_machine)
    assert (found, why) == ([], "restores modes that are there: the model keeps 8 of an axis")


@pytest.mark.parametrize(("measured", "expected"), [(2, [2]), (5, [2, 3, 4])])
def test_no_more_modes_are_restored_than_were_measured(measured, expected):
    assert restored(Content(modes=1), machine_of_modes(measured)) == (expected, None)


@pytest.mark.parametrize(
    ("teeth", "expected"),
    [(2, ["linear"]), (3, ["linear", "sinusoidal"]), (4, ["linear", "alternating"]), (5, ["linear"])],
)
def test_pitches_are_tried_that_say_something_else_of_so_many_teeth(teeth, expected):
    machine = tip_machine(teeth=teeth)
    found = candidates_of(base_model(campaign(machine, trials=trials(SPEED, DEPTH))), Content())
    assert [one.settings["pattern"] for one in found if one.name == "variable_pitch"] == expected


def test_of_one_measured_mode_none_are_restored():
    assert restored(Content(modes=1), machine_of_modes(1)) == (
        [],
        "modes is 2, allowed: up to 1, as many as were measured of an axis",
    )


def test_what_is_told_of_parameters_that_are_unused_is_left_out():
    class Odd(DirectionalAsymmetry):
        scan: ClassVar[Scan | None] = Scan(parameter="rear_difference", values=(0.5, 1.0))
        heard: ClassVar[str | None] = "rear_difference"

    modes, seats = (candidate_of(Odd(where=where, axis="y"), np.inf) for where in ("modes", "seats"))
    assert (modes.shapes, modes.scan, modes.heard) == ((), None, None)
    name, turn = (f"{Odd.name()}.{one}" for one in ("rear_difference", "turn_deg"))
    assert (seats.shapes, seats.scan, seats.heard) == ((name, turn), (name, (0.5, 1.0)), name)


SLOT, DOWN = {"direction": "slot", "radial_immersion": 1.0}, {"direction": "down", "radial_immersion": 0.5}


@pytest.mark.parametrize(("described", "cut"), [(SLOT, DOWN), (DOWN, SLOT), (DOWN, DOWN)])
def test_an_immersion_may_err_on_a_machine_or_on_its_cuts(described, cut):
    assert why_no_error_of_immersion(described, cut) is None


def test_the_immersion_of_nothing_but_slots_cannot_err():
    why = why_no_error_of_immersion(SLOT, SLOT)
    assert why == "process.direction is slot, whose radial immersion cannot err"


def why_no_error_of_immersion(described, cut):
    """Why an error of the immersion is not tried on a machine that is described in one process and cut in another."""
    stated = {
        "direction": np.full(len(SPEED), DIRECTIONS.index(cut["direction"]), dtype=np.int8),
        "radial_immersion": np.full(len(SPEED), cut["radial_immersion"]),
    }
    made = campaign(tip_machine(**described), trials=trials(SPEED, DEPTH, **stated))
    model = model_of(made, Content())
    tried, why = {one.name for one in candidates_of(model, Content())}, not_tried(model, Content())
    assert tried.isdisjoint(why)
    assert "radial_immersion_error" in tried | set(why)
    return why.get("radial_immersion_error")
