"""Effects on the command line: named in a list, their values changed one by one, every mistake one sentence."""

import json
from pathlib import Path

import pytest

from pipeline import campaigns
from pipeline.campaigns import Asked, options_of
from pipeline.command_line import main
from pipeline.configuration import compose_settings, words_for
from pipeline.verbs.campaigns import CompareOptions
from pipeline.verbs.studies import SweepOptions
from tests.documentation.commands import ROOT
from tests.pipeline.studies import WORDS

POINT = ["point", "spindle_speed_rpm=3000", "axial_depth_mm=2", "modes=2", "format=json"]


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    assert main([*POINT, *words]) == 0
    return json.loads(capsys.readouterr().out)


def read(words: list[str]) -> Asked:
    sorted_words = words_for(CompareOptions, words)
    return campaigns.read(options_of(sorted_words, CompareOptions), sorted_words)


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


TURNING = "remark: effects.speed_dependent_bearing changes nothing, since the bearings turn already; say "
KEPT = "remark: effects.higher_modes changes nothing, since it restores up to 4 modes of an axis and 4 are kept; say "


@pytest.mark.parametrize(
    ("words", "remarks"),
    [
        (["effects=[speed_dependent_bearing]"], [TURNING]),
        (["effects=[speed_dependent_bearing]", "base=static_bearing"], []),
        (
            ["effects=[higher_modes]", "effects.higher_modes.share=0.2", "effects.higher_modes.modes=2"],
            ["remark: effects.higher_modes changes nothing, since it restores up to 2 modes of an axis and 2 are kept"],
        ),
        (["effects=[higher_modes]"], []),
    ],
)
def test_an_effect_that_finds_what_it_restores_there_already_is_remarked(capsys, words, remarks):
    answered = answer(capsys, *words)
    found = answered["remarks"]
    assert [one[: len(said)] for one, said in zip(found, remarks, strict=True)] == remarks
    base = answer(capsys, *[word for word in words if not word.startswith("effects")])
    assert (answered["spectral_radius"] == base["spectral_radius"]) is bool(remarks)


SWEEP = ["sweep", "study=smoke", "grid.mode_count={values: [4]}", "grid.modal_parameters=[dynamic]"]
DATASET = ["dataset", "study=dataset_small"]


@pytest.mark.parametrize(
    ("verb", "more", "said"),
    [
        (SWEEP, [], [f"{TURNING}base=static_bearing where", f"{KEPT}grid.mode_count=N with fewer"]),
        (SWEEP, ["grid.modal_parameters=[dynamic,static]"], [KEPT]),
        (SWEEP, ["grid.mode_count={values: [1,4]}", "grid.modal_parameters=[static]"], []),
        (DATASET, [], [f"{TURNING}design.modal_parameters=static where", f"{KEPT}design.mode_count=N with fewer"]),
        (DATASET, ["design.modal_parameters=static", "design.mode_count=2"], []),
    ],
)
def test_a_study_remarks_effects_that_change_nothing_anywhere_in_it(capsys, monkeypatch, verb, more, said):
    monkeypatch.setattr(f"pipeline.{verb[0]}.execute_words", lambda *args, **options: 0)
    overridden = {word.partition("=")[0] for word in more}
    words = [word for word in verb if word.partition("=")[0] not in overridden] + more
    assert main([*words, "effects=[higher_modes,speed_dependent_bearing]"]) == 0
    found = [line for line in capsys.readouterr().out.splitlines() if line.startswith("remark: ")]
    assert [one[: len(start)] for one, start in zip(found, said, strict=True)] == said


def test_a_campaign_remarks_effects_that_change_nothing(capsys):
    campaign = ROOT / "tests" / "data" / "campaigns" / "d01"
    words = [f"campaign={campaign}", "effects=[higher_modes,speed_dependent_bearing]"]
    for base, said in (([], [TURNING, KEPT]), (["base=static_bearing", "modes=2"], [])):
        read([*words, *base])
        found = [one for one in capsys.readouterr().out.splitlines() if "changes nothing" in one]
        assert [one[: len(start)] for one, start in zip(found, said, strict=True)] == said


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


def test_what_says_nothing_with_what_is_chosen_makes_no_other_study():
    def settings(values: str):
        words = ["effects=[directional_asymmetry]", f"effects.directional_asymmetry={{{values}}}"]
        return compose_settings(words_for(SweepOptions, [*WORDS, *words]))

    modes, rear = "where: modes, axis: y, stiffness_loss: 0.1", ", rear_difference: 0.0, turn_deg: 0.0"
    assert settings(modes).fingerprint() == settings(modes + rear).fingerprint()
    of_seats = settings(modes.replace("modes", "seats") + rear).scientific()["effects"]["directional_asymmetry"]
    assert (of_seats["rear_difference"], of_seats["turn_deg"]) == (0.0, 0.0)
