"""The command line: answers, exit codes, and one clear message for every bad input."""

import gc
import json
import os
from dataclasses import replace

import numpy as np
import pytest
import yaml

from chatter_core import chain
from chatter_core.contact import forced_contact
from pipeline import point
from pipeline.command_line import main

POINT = ["point", "spindle_speed_rpm=12000", "axial_depth_mm=1"]


def answer(capsys, *words):
    keys = {word.partition("=")[0] for word in words}
    code = main([*(word for word in POINT if word.partition("=")[0] not in keys), "format=json", *words])
    return code, json.loads(capsys.readouterr().out)


def test_point_answers_bearing_and_modes_of_the_reference_machine(capsys):
    code, said = answer(capsys, "spindle.beam=euler_bernoulli")
    assert code == 0
    # An independent solve of the same equations, to the digits it was printed with.
    front = said["bearings"][0]
    assert front["inner_contact_angle_deg"] == pytest.approx(18.0, abs=0.06)
    assert front["outer_contact_angle_deg"] == pytest.approx(9.75, abs=0.006)
    assert front["radial_stiffness_n_um"] == pytest.approx(35.9, abs=0.06)
    modes = [m for m in said["modes"] if m["axis"] == "x"]
    assert [m["natural_frequency_hz"] for m in modes] == pytest.approx([528, 723, 1418, 2445], abs=0.6)
    assert [m["modal_stiffness_n_um"] for m in modes] == pytest.approx([34.6, 47.7, 18.5, 6.0], abs=0.06)
    assert said["status"] == "ok"
    assert said["spectral_radius"] < 1.0
    assert said["limit_depths_mm"][0] > 1.0
    assert said["bifurcation"] in ("hopf", "flip", "fold")
    # It rests only while a verb is loaded.
    assert gc.isenabled()


def test_point_beyond_the_limit_says_chatter(capsys):
    assert main(["point", "spindle_speed_rpm=14000", "axial_depth_mm=1.5"]) == 0
    assert "chatter: spectral radius" in capsys.readouterr().out


def test_the_boundary_above_a_depth_beyond_the_grid_is_found(capsys):
    words = ["spindle_speed_rpm=8000", "modes=1"]
    code, said = answer(capsys, *words, "axial_depth_mm=12")
    assert (code, said["limits_complete"]) == (0, True)
    (limit,) = said["limit_depths_mm"]
    assert 6.0 < limit < 12.0
    # Limit depths are told to six digits.
    _, there = answer(capsys, *words, f"axial_depth_mm={limit}")
    assert there["spectral_radius"] == pytest.approx(1.0, abs=1e-4)
    assert main(["point", *words, "axial_depth_mm=12"]) == 0
    assert f"limit depths at this speed: {limit:.4g} mm\n" in capsys.readouterr().out
    assert main(["point", *words, "axial_depth_mm=1"]) == 0
    assert "limit depths at this speed: none down to 6 mm\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("limits", "complete", "radius", "told"),
    [
        ([2.0, 3.5], True, 0.9, "2 mm, 3.5 mm"),
        ([2.0], False, 0.9, "2 mm, perhaps others: the search down to 6 mm was not complete"),
        ([], False, 1.1, "none found: the search down to 6 mm was not complete"),
        ([], True, 1.1, "shallower than all depths looked at"),
    ],
)
def test_limit_depths_say_whether_others_may_have_been_missed(limits, complete, radius, told):
    said = {"limit_depths_mm": limits, "limits_complete": complete, "spectral_radius": radius}
    assert point._limits(said, 6.0) == told


@pytest.mark.parametrize("effect", ["tool_runout", "variable_pitch"])
def test_uneven_teeth_whose_motion_is_not_found_are_told_so(effect, capsys, monkeypatch):
    def unfound(*arguments):
        met = forced_contact(*arguments)
        return replace(met, found=np.zeros_like(met.found))

    monkeypatch.setattr(chain, "forced_contact", unfound)
    code, said = answer(capsys, "spindle_speed_rpm=8000", "axial_depth_mm=2", f"effects=[{effect}]")
    assert (code, said["status"]) == (1, "not_converged")
    assert "no motion that repeats with the revolution was found for these uneven teeth" in said["reason"]
    assert "tolerance" not in said["reason"]


def test_point_where_a_bearing_cannot_run_is_marked(capsys):
    code, said = answer(capsys, "spindle_speed_rpm=200000", "spindle.preload_type=rigid")
    assert code == 1
    assert said["status"] == "outside_validity"
    assert said["spectral_radius"] is None
    assert "no equilibrium" in said["reason"]


def test_a_machine_of_measured_tip_modes_runs_without_bearing_and_spindle(capsys, tmp_path):
    mode = {"axis": "x", "natural_frequency_hz": 146.5, "damping_ratio": 0.0038, "stiffness_n_um": 2.18}
    machine = {
        "tip": {"modes": [mode]},
        "tool": {"teeth": 1, "diameter_mm": 19.05, "helix_angle_deg": 0.0, "rake_angle_deg": 0.0},
        "cutting": {"kt_mpa": 550.0, "kn": 0.3636, "friction_coefficient": 0.0},
        "process": {"direction": "up", "radial_immersion": 0.237, "feed_per_tooth_mm": 0.1},
    }
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(machine))
    code, said = answer(capsys, f"machine={file}")
    assert code == 0
    assert said["bearings"] == []
    assert [m["axis"] for m in said["modes"]] == ["x"]


MACHINE = """
bearing:
  pitch_diameter_mm: 60.0
  ball_diameter_mm: 8.731
  ball_count: {balls}
  contact_angle_deg: 15.0
  inner_groove_conformity: 0.57
  outer_groove_conformity: 0.54
  ball: {{youngs_modulus_gpa: 206.0, poisson_ratio: 0.3, density_kg_m3: 7800.0}}
  ring: {{youngs_modulus_gpa: 206.0, poisson_ratio: 0.3, density_kg_m3: 7800.0}}
spindle:
  sections:
    - {{part: tool, {length}, outer_diameter_mm: {diameter}, {steel}}}
    - {{part: shaft, length_mm: 300.0, outer_diameter_mm: 50.0, {steel}}}
  bearings: [{{position_mm: 100.0}}, {{position_mm: {rear}}}]
  preload_n: 100.0
  preload_type: constant
  damping: {{kind: modal, ratio: 0.02}}
tool: {{teeth: 4, diameter_mm: 16.0, helix_angle_deg: 30.0, rake_angle_deg: 10.0}}
cutting: {{kt_mpa: 900.0, kn: 0.3, friction_coefficient: 0.2}}
process: {{direction: down, radial_immersion: 0.4, feed_per_tooth_mm: 0.08}}
"""
STEEL = "youngs_modulus_gpa: 206.0, poisson_ratio: 0.3, density_kg_m3: 7800.0"
GOOD = {"steel": STEEL, "balls": "19", "length": "length_mm: 66.0", "diameter": "14.5", "rear": "300.0"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"balls": "30"}, "bearing: 30 balls of 8.731 mm do not fit on a pitch circle of 60 mm: allowed at most 21"),
        ({"balls": "19.5"}, "bearing.ball_count: found 19.5, allowed: a whole number"),
        ({"balls": "true"}, "bearing.ball_count: found true, a number or word is needed"),
        ({"diameter": "-14.5"}, "spindle.sections[0].outer_diameter_mm: found -14.5, allowed: at least 0.1"),
        ({"diameter": ".nan"}, "spindle.sections[0].outer_diameter_mm: found nan, allowed: a finite number"),
        ({"length": "length_m: 0.066"}, "spindle.sections[0].length_m: unknown key; did you mean length_mm?"),
        ({"length": "length_mm: 66 mm"}, "spindle.sections[0].length_mm: found '66 mm', allowed: a finite number"),
        ({"rear": "500.0"}, "bearings[1].position_mm 500 lies outside the rotor, which ends at 366 mm"),
        ({"rear": "[1"}, "no valid yaml"),
        ({"rear": "1.0, position_mm: 2.0"}, "key 'position_mm' stands twice"),
        ({"rear": "!!python/object/apply:os.system ['true']"}, "no valid yaml: a tag"),
        ({"rear": "!!float abc"}, "no valid yaml: a tag"),
        ({"rear": "2024-13-45"}, "spindle.bearings[1].position_mm: found '2024-13-45', allowed: a finite number"),
        ({"rear": "0x_"}, "position_mm: found '0x_', allowed: a finite number"),
        ({"rear": "60:0.0"}, "position_mm: found '60:0.0', allowed: a finite number"),
        ({"rear": "9" * 5000}, "position_mm: found inf, allowed: a finite number"),
        ({"balls": "9" * 5000}, "bearing.ball_count: found inf, allowed: a finite number"),
        ({"rear": '"${oops"'}, "position_mm: found '${oops', allowed: a finite number"),
        ({"rear": "[" * 300 + "]" * 300}, "nested too deeply"),
        ({"rear": "&here 300, count: *here"}, "an alias (*name) is not allowed"),
        ({"rear": "100.5"}, "two seats are nearer than 1 mm"),
        ({"steel": STEEL.replace("206.0", "1e-300")}, "youngs_modulus_gpa: found 1e-300, allowed: at least 0.001"),
    ],
)
def test_a_wrong_machine_file_gets_one_message(change, message, capsys, tmp_path):
    file = tmp_path / "machine.yaml"
    file.write_text(MACHINE.format(**{**GOOD, **change}))
    assert main([*POINT, f"machine={file}"]) == 2
    captured = capsys.readouterr()
    assert message in captured.err
    assert str(file) in captured.err
    assert "Traceback" not in captured.err
    assert captured.out == ""


@pytest.mark.parametrize(
    ("words", "messages"),
    [
        (["sweep", "study=refernce"], ["study: found 'refernce'; did you mean reference?"]),
        (["sweep", "studdy=reference"], ["studdy: unknown key; did you mean study?"]),
        (["sweep", "tool.teth=3"], ["tool.teth: unknown key; did you mean teeth?"]),
        (["sweep", "spindel.preload_n=3"], ["spindel: unknown key; did you mean spindle?"]),
        (
            ["sweep", "tool.teeth=-3", "cutting.kn=x", "process.direction=sideways"],
            [
                "tool.teeth: found -3, allowed: at least 1",
                "cutting.kn: found 'x', allowed: a finite number",
                "process.direction: found 'sideways', allowed: one of 'up', 'down' or 'slot'",
            ],
        ),
        (["sweep", "grid.axial_depth_mm=[]"], ["grid.axial_depth_mm"]),
        (["sweep", "grid.axial_depth_mm=[2,1]"], ["grid.axial_depth_mm: values must ascend"]),
        (["sweep", "grid.spindle_speed_rpm=[0,100]"], ["grid.spindle_speed_rpm: found 0, allowed: more than 0"]),
        (["sweep", "grid.axial_depth_mm=[1,2,2]"], ["found 2 after 2"]),
        (["sweep", "grid.spindle_speed_rpm=null"], ["spindle_speed_rpm: found nothing, allowed: a number, a list"]),
        (["sweep", "grid.spindle_speed_rpm.count=true"], ["count: found true, a number or word is needed"]),
        (["sweep", "grid.spindle_speed_rpm=&a [1, *a]"], ["an alias (*name) is not allowed"]),
        (["sweep", "grid.spindle_speed_rpm=" + "[" * 2000], ["nested too deeply"]),
        (["sweep", "spindle.sections[9].length_mm=1"], ["spindle.sections[9].length_mm: '1' cannot be put there"]),
        (["sweep", "grid.mode_count=[50]", "cluster=serial"], ["error: grid.mode_count: found 50, allowed at most 20"]),
        (["sweep", "cluster=address", "cluster.address=nonsense"], ["found 'nonsense', allowed: tcp://host:port"]),
        (["point", "spindle_speed_rpm=9000", "axial_depth_mm=1", "modes=50"], ["modes: found 50, allowed at most 20"]),
        (
            ["point", "spindle_speed_rpm=9000", "axial_depth_mm=1", "mode_count=3"],
            ["mode_count: not for point; say modes="],
        ),
        (
            ["point", "spindle_speed_rpm=9000", "axial_depth_mm=1", "grid.mode_count=1"],
            ["grid.mode_count: not for point, which takes grid.axial_depth_mm alone"],
        ),
        (
            ["point", "spindle_speed_rpm=9000", "axial_depth_mm=1", "format=xml"],
            ["format: found 'xml', allowed: one of"],
        ),
        (["paper", "study=smoke"], ["study: not for paper"]),
        (
            ["paper", "grid.mode_count=[1, 2]", "grid.mode_selection=only"],
            ["mode_count: not for", "selection: not for"],
        ),
        (["paper", "grid.spindle_speed_rpm=[9000]"], ["found 1 from 9000 to 9000, for paper allowed: at least 10"]),
        (["report", "output=nowhere", "study=smoke"], ["study: not for report"]),
        (["compare", "campaign=a", "campaign=b"], ["error: campaign: found 'a' and 'b', allowed: one of them"]),
        (["sweep", "study=smoke", "study=reference"], ["study: found 'smoke' and 'reference', allowed: one of them"]),
        (["dataset", "design=a.yaml", "design=b.yaml"], ["design: found 'a.yaml' and 'b.yaml', allowed: one of them"]),
        (["template", "output=s3://bucket/mine"], ["output: found the address 's3://bucket/mine', allowed: a path"]),
        (["sweep", "machine=s3://bucket/m.yaml"], ["machine: found the address 's3://bucket/m.yaml', allowed: a path"]),
        (["dataset", "design=s3://bucket/d.yaml"], ["design: found the address 's3://bucket/d.yaml', allowed: a path"]),
        (["sweep", "output=s3://bucket/mine"], ["a path on this machine; say store=ADDRESS for an object store"]),
        (["template", "output=" + "a/" * 1000], ["output: leads through 1000 folders, allowed: at most 200"]),
        (["contrast", "first=" + "a/" * 1000, "second=b"], ["holds no lobes.zarr"]),
        (["sweep", "machine=" + "a/" * 1000 + "b.yaml"], ["no such file"]),
        (["report", "output=" + "x" * 5000], ["File name too long"]),
        (["sweep", "grid.mode_count=[1.5]"], ["mode_count: found [1.5], allowed: whole numbers from 1 to 100"]),
        (["sweep", "grid.mode_count=[99]"], ["error: grid.mode_count: found 99, allowed at most"]),
        (["sweep", "grid.mode_count=[101]"], ["error: grid.mode_count: found [101], allowed: whole numbers from 1 to"]),
        (
            ["sweep", "grid.spindle_speed_rpm.count=1000000", "grid.axial_depth_mm.count=1000000"],
            ["cells, allowed: at most"],
        ),
        (["sweep", "process.direction=slot"], ["process: direction 'slot' needs radial_immersion 1, found 0.4"]),
        (
            ["sweep", "method.intervals=40"],
            ["method: method 'collocation' takes tolerance, and not intervals or order"],
        ),
        (["sweep", "cluster.kind=address"], ["cluster.address: needed for kind 'address'"]),
        (["sweep", "retry_failed=perhaps"], ["retry_failed: found 'perhaps', allowed: one of 'true' or 'false'"]),
        (["sweep", "machine=nowhere/machine.yaml"], ["nowhere/machine.yaml: no such file"]),
        (["sweep", "reference"], ["reference: expected key=value; did you mean study=reference?"]),
        (["sweep", "--study=smoke"], ["--study=smoke: expected key=value; did you mean study=smoke?"]),
        (["sweep", "--output", "x"], ["--output: expected key=value; did you mean output=...?"]),
        (["sweep", "preload_n=100"], ["preload_n: unknown key; did you mean grid.preload_n or spindle.preload_n?"]),
        # Hints name what the verb takes: no groups of others, and no keys of these.
        (["compare", "count=100"], ["count: unknown key; did you mean cluster.job.count?"]),
        (
            ["point", "spindle_speed_rpm=9000", "axial_depth_mm=1", "qq.x=1"],
            ["qq: unknown key; allowed: bearing, spindle, tip, tool, cutting, process, method, effects, margins, grid"],
        ),
        (["sweep", "effects.proces_damping.c=1"], ["effects.proces_damping: unknown effect; did you mean process_dam"]),
        (["sweep", "study=dataset_small"], ["compute it with: python -m pipeline dataset study=dataset_small"]),
        (["dataset", "study=smoke"], ["compute it with: python -m pipeline sweep study=smoke"]),
        (["compare", "campaign=mesured"], ["no such folder; a campaign is", "; did you mean measured?"]),
        (["identify", "frf=measured/frff.csv"], ["frff.csv: no such file; did you mean measured/frf.csv?"]),
        (["sweep", "machine=mesured/machine.yml"], ["no such file; did you mean measured/machine.yml?"]),
        (["compare", "campaign=measured/frf.csv"], ["frf.csv: is a file; a campaign is", "; did you mean measured?"]),
        (["--versoin"], ["--versoin: unknown; did you mean --version?"]),
        (["study=smoke"], ["study=smoke: expected a verb first; python -m pipeline help lists them"]),
        (["help", "sweeep"], ["sweeep: unknown verb; did you mean sweep?"]),
        (["sweeep"], ["sweeep: unknown verb; did you mean sweep?"]),
        (["point", "spindle_speed_rpm=12000"], ["axial_depth_mm: missing; needed: axial depth of cut"]),
        (["point", "spindle_speed_rpm=fast", "axial_depth_mm=1"], ["spindle_speed_rpm: found 'fast'"]),
        (
            [*POINT, "preload_n=100", "spindle.preload_n=200"],
            ["preload_n: says the same as spindle.preload_n; say one of the two"],
        ),
        (
            ["sweep", "spindle.preload_n=250", "grid.preload_n=[100,200]"],
            ["spindle.preload_n: says nothing beside grid.preload_n=[100,200]; say one of the two"],
        ),
        (["sweep", "spindle.preload_n=250", "grid.preload_nn=3"], ["grid.preload_nn: unknown key"]),
        ([*POINT, "machine=" + "a" * 300, "nonsense=3"], ["allowed: reference, or FILE.yaml", "nonsense: unknown key"]),
        ([*POINT, "machine=own"], ["machine: found 'own'; did you mean own/machine.yaml?"]),
        ([*POINT, "machine=."], ["machine: found '.'; allowed: reference, or FILE.yaml"]),
        ([*POINT, "spindle.sections=[]"], ["spindle.sections: found [], allowed: at least 1 entry"]),
        ([*POINT, "effects=[clamp]"], ["effects: found 'clamp'", "in the folder that effects_path=DIR names"]),
        (["report"], ["output: missing"]),
        (["report", "output=nowhere"], ["output: nowhere holds no lobes.zarr"]),
    ],
)
def test_wrong_words_get_every_message_and_exit_code_two(words, messages, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "measured").mkdir()
    (tmp_path / "measured" / "frf.csv").touch()
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "machine.yaml").touch()
    assert main(words) == 2
    captured = capsys.readouterr()
    for message in messages:
        assert message in captured.err
    assert not (tmp_path / "s3:").exists()
    assert "Traceback" not in captured.err
    assert all(line.startswith("error: ") for line in captured.err.splitlines())
    assert not list(tmp_path.rglob("*.zarr"))


def test_a_wrong_entry_of_a_list_is_told_once(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "grid.spindle_speed_rpm=[.nan]"]) == 2
    assert capsys.readouterr().err == (
        "error: grid.spindle_speed_rpm.values[0]: found nan, allowed: a finite number, in the unit that the key names\n"
    )


@pytest.mark.parametrize("words", [["grid.mode_count=[50]"], ["cluster=address", "cluster.address=nonsense"]])
def test_what_is_refused_leaves_nothing_behind(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sweep", "study=smoke", "output=mine", "cluster=serial", *words]) == 2
    assert list(tmp_path.iterdir()) == []


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_computed(capsys, tmp_path):
    file = tmp_path / "file"
    file.write_text("mine")
    for words in (["sweep", "study=smoke", "cluster=serial"], POINT):
        assert main([*words, f"output={file}"]) == 2
        captured = capsys.readouterr()
        assert "cannot be used as a folder" in captured.err
        assert captured.out == ""
    assert file.read_text() == "mine"


def test_a_pipe_is_no_machine_file(capsys, tmp_path):
    os.mkfifo(tmp_path / "machine.yaml")
    assert main([*POINT, f"machine={tmp_path / 'machine.yaml'}"]) == 2
    assert "is no file" in capsys.readouterr().err
