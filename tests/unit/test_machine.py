"""Descriptions: units at the border, SI inside, and nothing that cannot exist."""

import math

import pytest
import yaml
from pydantic import ValidationError

from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine, Tip
from chatter_core.reading import read_machine
from chatter_core.units import SUFFIXES, si_factor, split_key
from chatter_core.variables import CELL_STATUS, DIMENSIONS, STRUCTURE, SWEEP


def test_keys_carry_the_unit_and_attributes_are_si(reference_machine):
    # Powers of ten and pi / 180: rounding alone.
    assert reference_machine.bearing.pitch_diameter == pytest.approx(0.060, rel=1e-15)
    assert reference_machine.bearing.contact_angle == pytest.approx(math.radians(15.0), rel=1e-15)
    assert reference_machine.bearing.ball.youngs_modulus == pytest.approx(206e9, rel=1e-15)
    assert reference_machine.cutting.specific_cutting_energy == pytest.approx(900e6, rel=1e-15)
    assert reference_machine.spindle.preload == 100.0


def test_a_description_is_written_as_it_was_read(reference_machine):
    written = reference_machine.described()
    assert written["bearing"]["ball_diameter_mm"] == 8.731
    assert Machine.model_validate(yaml.safe_load(yaml.safe_dump(written))) == reference_machine


@pytest.mark.parametrize(
    ("key", "quantity", "suffix"),
    [
        ("pitch_diameter_mm", "pitch_diameter", "mm"),
        ("stiffness_n_um", "stiffness", "n_um"),
        ("mass_coefficient_1_s", "mass_coefficient", "1_s"),
        ("gyroscopic_moment_n_m", "gyroscopic_moment", "n_m"),
        ("teeth", "teeth", ""),
        ("kn", "kn", ""),
    ],
)
def test_units_are_read_off_the_keys(key, quantity, suffix):
    assert split_key(key) == (quantity, suffix)
    assert si_factor(key) == (SUFFIXES[suffix][0] if suffix else 1.0)


def test_every_key_with_a_unit_is_scaled_and_every_variable_has_known_dimensions():
    for variable in [*SWEEP.values(), *STRUCTURE.values(), CELL_STATUS]:
        assert set(variable.dims) <= set(DIMENSIONS)
        assert variable.doc
        assert variable.suffix == "" or variable.suffix in SUFFIXES


def changed(machine, **parts):
    return Machine.model_validate({**machine.described(), **parts})


@pytest.mark.parametrize(
    ("part", "change", "message"),
    [
        ("spindle", {"bearings": [{"position_mm": 104.0}]}, "at least two seats"),
        ("spindle", {"bearings": [{"position_mm": 104.0}, {"position_mm": 104.0}]}, "two seats are nearer than 1 mm"),
        ("spindle", {"damping": {"kind": "modal", "mass_coefficient_1_s": 1.0}}, "missing: ratio; not allowed: mass"),
        ("spindle", {"damping": {"kind": "modal", "ratio": 1.2}}, "less than 1"),
        ("tool", {"helix_angle_deg": 90.0}, "less than 80"),
        ("bearing", {"inner_groove_conformity": 0.5}, "greater than or equal to 0.501"),
    ],
)
def test_what_cannot_exist_is_refused(part, change, message, reference_machine):
    described = reference_machine.described()
    with pytest.raises(ValidationError, match=message):
        changed(reference_machine, **{part: {**described[part], **change}})


def test_a_machine_has_one_source_of_modes(reference_machine):
    mode = {"axis": "x", "natural_frequency_hz": 500.0, "damping_ratio": 0.02, "stiffness_n_um": 10.0}
    with pytest.raises(ValidationError, match="either bearing and spindle, or tip; found: bearing, spindle, tip"):
        changed(reference_machine, tip={"modes": [mode]})
    with pytest.raises(ValidationError, match="either bearing and spindle, or tip; found: spindle"):
        changed(reference_machine, bearing=None)


def test_tip_modes_are_given_alike_at_every_speed():
    def mode(axis, speed):
        return {
            "axis": axis, "natural_frequency_hz": 500.0, "damping_ratio": 0.02, "stiffness_n_um": 10.0,
            "spindle_speed_rpm": speed,
        }  # fmt: skip

    with pytest.raises(ValidationError, match="same number of modes per axis"):
        Tip.model_validate({"modes": [mode("x", 0.0), mode("y", 0.0), mode("x", 1000.0)]})


def test_a_disc_and_a_seat_lie_on_the_rotor(reference_machine):
    disc = {
        "position_mm": 600.0, "width_mm": 20.0, "outer_diameter_mm": 120.0, "inner_diameter_mm": 55.0,
        "density_kg_m3": 7800.0,
    }  # fmt: skip
    spindle = reference_machine.described()["spindle"]
    with pytest.raises(
        ValidationError, match=r"discs\[0\].position_mm 600 lies outside the rotor, which ends at 484 mm"
    ):
        changed(reference_machine, spindle={**spindle, "discs": [disc]})


def test_a_machine_file_is_read_with_every_finding(tmp_path, reference_machine):
    file = tmp_path / "machine.yaml"
    described = reference_machine.described()
    file.write_text(yaml.safe_dump(described))
    assert read_machine(file) == reference_machine
    described["tool"].update(teeth=0, diamter_mm=3.0)
    del described["cutting"]["kn"]
    file.write_text(yaml.safe_dump(described))
    with pytest.raises(InvalidInput) as caught:
        read_machine(file)
    assert caught.value.problems == [
        f"{file}: tool.teeth: found 0, allowed: at least 1",
        f"{file}: tool.diamter_mm: unknown key; did you mean diameter_mm?",
        f"{file}: cutting.kn: missing; needed: normal force over friction-free tangential force, k_n",
    ]


def test_a_missing_file_suggests_a_near_one(tmp_path):
    (tmp_path / "machine.yaml").write_text("{}")
    with pytest.raises(InvalidInput, match=r"no such file; did you mean .*machine\.yaml"):
        read_machine(tmp_path / "machin.yaml")


def test_a_folder_in_the_place_of_a_file_is_told_with_the_file_in_it(tmp_path):
    (tmp_path / "model.yaml").write_text("")
    with pytest.raises(InvalidInput, match=rf"^{tmp_path}: is no file; did you mean {tmp_path}/model.yaml\?$"):
        read_machine(tmp_path)
