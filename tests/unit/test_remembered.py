"""States of bearings and reduced rotors are remembered: nothing may hang on what was asked before."""

import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields, replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from chatter_core.bearing import SpeedLaw, axisymmetric, state_along
from chatter_core.chain import structure
from chatter_core.joint import Joint
from chatter_core.machine import Machine
from chatter_core.spindle import ReducedRotor, Rotor, _reduced, assemble, reduce_rotor, reduced
from chatter_core.stages import Stages

SPEEDS = np.linspace(0.0, 2500.0, 7)


def forget() -> None:
    _reduced.cache_clear()
    axisymmetric._state.cache_clear()
    axisymmetric._next_station.cache_clear()


def felt(stages: Stages) -> np.ndarray:
    """Return what the tip and the bearing are over speed."""
    found = structure(stages, SPEEDS, mode_count=4)
    assert found.bearing is not None
    of_bearing = [getattr(found.bearing, field.name) for field in fields(found.bearing) if field.name != "preload"]
    return np.column_stack([found.modes.natural_frequency, found.modes.modal_mass, *of_bearing])


def with_preload_rising(machine: Machine, share: float) -> Stages:
    """Return stages whose preload rises with speed by so much at 2500 rad/s."""
    return replace(Stages(machine=machine), preload=lambda spindle, speed: 100.0 * (1.0 + share * speed / 2500.0))


def test_a_rotor_is_the_same_whoever_asks_first(reference_machine: Machine) -> None:
    """Numbers of threads change the order of summation."""
    found = []
    for threads in (1, 2):
        forget()
        with threadpool_limits(threads):
            found.append(reduced(reference_machine.spindle))
    np.testing.assert_array_equal(found[0].stiffness, found[1].stiffness)
    np.testing.assert_array_equal(found[0].tip, found[1].tip)


def test_rotors_are_made_one_at_a_time(reference_machine: Machine, monkeypatch: pytest.MonkeyPatch) -> None:
    """The number of threads is one of the process: who is done sets it back, for whoever still computes as well."""
    at_it, most = [0], [0]

    def slow(rotor: Rotor) -> ReducedRotor:
        at_it[0] += 1
        most[0] = max(most[0], at_it[0])
        time.sleep(0.05)  # long enough for the others to come in, were they let
        at_it[0] -= 1
        return reduce_rotor(rotor)

    monkeypatch.setattr("chatter_core.spindle.reduce_rotor", slow)
    forget()
    border = reference_machine.spindle.sections[0].length
    joints = [(Joint(position=border, lateral_compliance=c, rotational_compliance=0.0),) for c in (1e-9, 1e-8, 1e-7)]
    with ThreadPoolExecutor(len(joints)) as pool:
        list(pool.map(lambda one: reduced(reference_machine.spindle, one), joints))
    assert most == [1]


def test_what_is_remembered_of_a_rotor_cannot_be_changed(reference_machine: Machine) -> None:
    rotor = reduced(reference_machine.spindle)
    for name in ("stiffness", "gyroscopic", "seat", "tip", "joint"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(rotor, name)[...] = 0.0


def test_a_law_is_not_asked_beyond_the_highest_speed(reference_machine: Machine) -> None:
    """A table of measured preloads ends somewhere, and a law that falls with speed leaves no preload in the end."""
    highest = 2000.0

    def preload(speed: np.ndarray) -> np.ndarray:
        assert speed.max() <= highest
        return np.full_like(speed, 100.0)

    law = SpeedLaw(ball_speed=lambda speed: speed, preload=preload, ring_growth=np.zeros_like)
    state = state_along(reference_machine.bearing, law, np.array([0.0, highest]), "constant")
    assert state.solved.all()


@pytest.mark.parametrize("share", [0.0, 1e-9, 0.5])
def test_what_is_remembered_of_one_law_is_not_taken_for_another(reference_machine: Machine, share: float) -> None:
    with threadpool_limits(1):
        forget()
        alone = felt(with_preload_rising(reference_machine, share))
        forget()
        for other in (0.0, 1e-9, 0.5):
            felt(with_preload_rising(reference_machine, other))
        np.testing.assert_array_equal(felt(with_preload_rising(reference_machine, share)), alone)
        assert axisymmetric._state.cache_info().hits >= 1


def test_joints_of_one_compliance_may_loosen_otherwise(reference_machine: Machine) -> None:
    """How a joint loosens is not among what is remembered, and comes with the rotor nevertheless."""
    spindle = reference_machine.spindle
    border = spindle.sections[0].length
    laws = (lambda speed: 1.0 + speed, lambda speed: 1.0 + 2.0 * speed)
    for law in laws:
        joint = Joint(position=border, lateral_compliance=1e-8, rotational_compliance=1e-5, loosening=law)
        found, plain = reduced(spindle, (joint,)), reduce_rotor(assemble(spindle, joints=(joint,)))
        seats = np.full((3, len(spindle.bearings)), 1e8)
        speeds = np.array([0.0, 1.0, 3.0])
        # The same numbers but for rounding: the plain one may be made with more threads.
        np.testing.assert_allclose(
            np.linalg.eigvalsh(found.supported(seats, speeds)),
            np.linalg.eigvalsh(plain.supported(seats, speeds)),
            rtol=1e-8,
        )
