"""Nuisances change what they say, within the bounds of the machine's keys, and nothing else."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chatter_core.errors import InvalidInput
from chatter_core.evidence import base_model, read_campaign
from chatter_core.evidence.measured import OUTCOMES
from chatter_core.evidence.nuisances import log_bounds, machine_nuisances, measurement_parameters, scaled
from chatter_core.stages import Stages, apply_terms
from tests.synthetic import campaign, receptance, tip_machine, trials

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
#: Nuisance -> keys that it multiplies; every other number of a machine stays.
KEYS = {
    "specific_cutting_energy": {"kt_mpa"},
    "kn": {"kn"},
    "damping": {"mass_coefficient_1_s", "stiffness_coefficient_s", "ratio", "damping_ratio"},
    "shaft_stiffness": {"sections.youngs_modulus_gpa"},
    "preload": {"preload_n"},
    "tip_frequency": {"natural_frequency_hz"},
    "tip_stiffness": {"stiffness_n_um"},
}


def numbers(value, path=()):
    """Yield (path, number) of a description as the user would write it."""
    if isinstance(value, dict):
        for key, part in value.items():
            yield from numbers(part, (*path, key))
    elif isinstance(value, list):
        for part in value:
            yield from numbers(part, path)
    elif isinstance(value, float):
        yield path, value


def machines(reference):
    modal = reference.model_dump()
    modal = reference.spindle.model_copy(update={"damping": type(reference.spindle.damping)(kind="modal", ratio=0.03)})
    return {"spindle": reference, "modal": reference.model_copy(update={"spindle": modal}), "tip": tip_machine()}


@pytest.mark.parametrize("kind", ["spindle", "modal", "tip"])
def test_each_nuisance_multiplies_its_keys_and_nothing_else(reference_machine, kind):
    machine = machines(reference_machine)[kind]
    before = list(numbers(machine.described()))
    for nuisance in machine_nuisances(machine):
        (parameter,) = nuisance.parameters
        stages = nuisance.apply(Stages(machine=machine), np.array([0.01]))
        moved = []
        for (path, old), (_, new) in zip(before, numbers(stages.machine.described()), strict=True):
            mine = any(path[-key.count(".") - 1 :] == tuple(key.split(".")) for key in KEYS[parameter.name])
            # A value is written with 15 digits.
            assert new == pytest.approx(old * math.exp(0.01) if mine else old, rel=1e-12 if mine else 0.0), path
            moved.append(mine)
        assert any(moved), parameter.name
        assert stages.tip_modes is Stages(machine=machine).tip_modes


def test_the_set_follows_from_the_machine(reference_machine):
    def names(machine):
        return [nuisance.parameter.name for nuisance in machine_nuisances(machine)]

    cut = ["specific_cutting_energy", "kn", "damping"]
    assert names(reference_machine) == [*cut, "shaft_stiffness", "preload"]
    assert names(tip_machine()) == [*cut, "tip_frequency", "tip_stiffness"]
    without = reference_machine.cutting.model_copy(update={"kn": 0.0})
    assert "kn" not in names(reference_machine.model_copy(update={"cutting": without}))
    damping = reference_machine.spindle.damping.model_copy(
        update={"mass_coefficient": 0.0, "stiffness_coefficient": 0.0}
    )
    spindle = reference_machine.spindle.model_copy(update={"damping": damping})
    assert "damping" not in names(reference_machine.model_copy(update={"spindle": spindle}))


def test_nulls_leave_the_very_machine(reference_machine):
    terms = machine_nuisances(reference_machine)
    assert apply_terms(reference_machine, terms, np.zeros(len(terms))).machine is reference_machine


def test_bounds_are_those_of_the_keys_and_beyond_is_a_sentence():
    machine = tip_machine()
    low, high = log_bounds(machine.cutting, ("specific_cutting_energy",))
    # 0.1 to 1e5 MPa around 700, but for the clearance.
    assert low == pytest.approx(math.log(0.1 / 700.0), abs=1e-8)
    assert high == pytest.approx(math.log(1e5 / 700.0), abs=1e-8)
    for nuisance in machine_nuisances(machine):
        for end in (nuisance.parameter.lower, nuisance.parameter.upper):
            if math.isfinite(end):
                nuisance.apply(Stages(machine=machine), np.array([end]))
        beyond = nuisance.parameter.upper + 0.01
        with pytest.raises(InvalidInput, match=r"a factor of .* makes it .*, allowed .*(at most|less than)"):
            nuisance.apply(Stages(machine=machine), np.array([beyond]))
    with pytest.raises(InvalidInput, match=r"^kt_mpa: a factor of 148.413 makes it 103889, allowed at least 0.1 and"):
        scaled(machine.cutting, ("specific_cutting_energy",), 5.0)


def test_measurements_have_parameters_of_their_own():
    machine = tip_machine()
    assert measurement_parameters(campaign(machine)) == ()
    both = (receptance(np.array([1.0])), receptance(np.array([1.0]), axis=1))
    found = measurement_parameters(campaign(machine, receptances=both))
    assert [parameter.name for parameter in found] == [
        f"receptance_{number}_{what}" for number in (1, 2) for what in ("gain", "phase", "frequency")
    ]
    assert {parameter.touches for parameter in found} == {"measurement"}
    labels = campaign(machine, trials=trials([600.0], [1e-3]))
    assert [p.name for p in measurement_parameters(labels)] == ["mislabelled", "outcome_width"]
    marginal = trials([600.0], [1e-3], outcome=np.array([OUTCOMES.index("marginal")], dtype=np.int8))
    assert [p.name for p in measurement_parameters(campaign(machine, trials=marginal))][2:] == ["marginal_width"]
    assert len(measurement_parameters(read_campaign(CAMPAIGNS / "d02"))) == 2 * 3 + 2


def test_the_factor_of_the_preload_keeps_every_measured_preload_within_its_bounds(reference_machine):
    cuts = replace(trials(np.array([800.0, 900.0, 1000.0]), np.full(3, 1e-3)), preload=np.array([0.11, np.nan, 9.9e5]))
    measured = campaign(reference_machine, trials=cuts)
    assert measured.extreme_preloads == (0.11, 9.9e5)
    (preload,) = (p for p in base_model(measured).parameters if p.name == "preload")
    # Allowed are 0.1 to 1e6 N; but for the clearance.
    assert (preload.lower, preload.upper) == pytest.approx((math.log(0.1 / 0.11), math.log(1e6 / 9.9e5)), abs=1e-8)
    widest = campaign(reference_machine, trials=replace(cuts, preload=np.array([0.1, np.nan, 1e6])))
    assert "preload" not in [p.name for p in base_model(widest).parameters]
    alone = campaign(reference_machine, trials=trials(np.array([800.0]), np.array([1e-3])))
    (own,) = (p for p in base_model(alone).parameters if p.name == "preload")
    assert own.upper == pytest.approx(math.log(1e6 / reference_machine.spindle.preload), abs=1e-8)
