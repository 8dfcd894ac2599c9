"""Effects on the command line: named in a list, their values changed one by one, every mistake one sentence."""

import json
from pathlib import Path

import pytest

from pipeline.__main__ import main
from pipeline.configuration import compose_settings, words_for
from pipeline.verbs.studies import SweepOptions
from tests.pipeline.studies import WORDS

POINT = ["point", "spindle_speed_rpm=3000", "axial_depth_mm=2", "modes=2", "format=json"]


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    assert main([*POINT, *words]) == 0
    return json.loads(capsys.readouterr().out)


def complaint(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main([*POINT, *words]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.strip().splitlines()
    return line


def test_an_effect_at_its_null_is_the_base_model(capsys):
    base = answer(capsys)
    assert answer(capsys, "effects=[]") == base
    assert answer(capsys, "effects=[process_damping]", "effects.process_damping.coefficient_n_m=0") == base
    assert answer(capsys, "effects=process_damping")["spectral_radius"] < base["spectral_radius"]


def test_effects_add_up_in_any_order(capsys):
    one = answer(capsys, "effects=[process_damping,thermal_preload]")
    other = answer(capsys, "effects=[thermal_preload,process_damping]")
    assert one == other
    assert one["bearings"][0]["axial_load_n"] == pytest.approx(100.0 * (1.0 + 0.5 * 0.3**1.5), rel=1e-6)


def test_the_static_base_and_what_restores_it(capsys):
    restored = answer(capsys, "base=static_bearing", "effects=[speed_dependent_bearing]")
    assert restored == answer(capsys, "base=full")
    assert answer(capsys, "base=static_bearing") != restored


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["effects=[proces_damping]"], "error: effects: found 'proces_damping'; did you mean process_damping?"),
        (["effects=[process_damping,process_damping]"], "error: effects: process_damping stands twice"),
        (["effects={a: 1}"], "error: effects: found '{a: 1}', allowed: a list of names, effects=[a,b]"),
        (
            ["effects=[process_damping]", "effects.process_damping.coefficient_n_m=-3"],
            "error: effects.process_damping.coefficient_n_m: found -3 N/m, allowed: 0 to 1e+07 N/m",
        ),
        (
            ["effects.process_damping.coefficient_n_m=3"],
            "error: effects.process_damping: the effect is not on; say effects=[process_damping]",
        ),
        (["base=static"], "error: base: found 'static', allowed: one of 'full' or 'static_bearing'"),
        (
            ["base=static_bearing", "modal_parameters=dynamic"],
            "error: base: found static_bearing, which holds static parameters, beside modal_parameters=dynamic; "
            "say one of the two",
        ),
    ],
)
def test_mistakes_get_one_sentence(capsys, words, said):
    assert complaint(capsys, *words) == said


@pytest.mark.parametrize("said", ["[static]", "[dynamic, static]", "static", "["])
def test_a_base_model_and_other_parameters_of_a_sweep_contradict_each_other(capsys, tmp_path, said):
    words = ["study=smoke", "base=full", f"grid.modal_parameters={said}", f"output={tmp_path / 'new'}"]
    assert main(["sweep", *words]) == 2
    told = f"base: found full, which holds dynamic parameters, beside grid.modal_parameters={said}; say one of the two"
    assert told in capsys.readouterr().err


def test_a_base_model_may_stand_beside_parameters_that_it_holds(capsys):
    agreed = answer(capsys, "base=static_bearing", "modal_parameters=static")
    assert agreed == answer(capsys, "base=static_bearing")


def test_a_machine_without_bearings_is_told_so(capsys, tmp_path: Path):
    modes = "[{axis: x, natural_frequency_hz: 900, damping_ratio: 0.03, stiffness_n_um: 20}]"
    described = tmp_path / "machine.yaml"
    described.write_text(
        f"tip: {{modes: {modes}}}\n"
        "tool: {teeth: 4, diameter_mm: 16, helix_angle_deg: 30, rake_angle_deg: 10}\n"
        "cutting: {kt_mpa: 900, kn: 0.3, friction_coefficient: 0.2}\n"
        "process: {direction: down, radial_immersion: 0.4, feed_per_tooth_mm: 0.08}\n"
    )
    words = [word for word in POINT if not word.startswith("modes")]
    assert main([*words, f"machine={described}", "effects=[ring_expansion]"]) == 2
    assert "effects.ring_expansion: acts on spindle and bearing; this machine has measured" in capsys.readouterr().err


def test_a_study_with_effects_is_another_study():
    def settings(*words: str):
        return compose_settings(words_for(SweepOptions, [*WORDS, *words]))

    plain, damped = settings(), settings("effects=[process_damping]")
    assert "effects" not in plain.scientific()
    assert damped.scientific()["effects"] == {"process_damping": {"coefficient_n_m": 1e5}}
    other = settings("effects=[process_damping]", "effects.process_damping.coefficient_n_m=2e4")
    assert len({study.fingerprint() for study in (plain, damped, other)}) == 3
