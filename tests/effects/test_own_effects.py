"""Effects of the user's own: the worked example of docs/ as it stands, and what is said where one is not right."""

import json
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr

from chatter_core.effects import activate, apply_effects, effect_class, effect_names, own_effects, variants
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.stages import Stages
from pipeline.__main__ import main
from tests.pipeline.studies import WORDS

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "own_effects"
POINT = ["point", "spindle_speed_rpm=10000", "axial_depth_mm=1", "modes=2", "format=json"]
ON = [f"effects_path={EXAMPLE}", "effects=[loosening_clamp]"]


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    assert main([*POINT, *words]) == 0
    return json.loads(capsys.readouterr().out)


def copy_of_the_example(folder: Path, name: str = "loosening_clamp") -> Path:
    for ending in ("py", "yaml"):
        (folder / f"{name}.{ending}").write_text((EXAMPLE / f"loosening_clamp.{ending}").read_text())
    return folder


def test_the_example_acts_at_a_point(capsys):
    base, softer = answer(capsys), answer(capsys, *ON)
    assert answer(capsys, f"effects_path={EXAMPLE}") == base
    assert answer(capsys, *ON, "effects.loosening_clamp.loss=0") == base
    assert softer["spectral_radius"] != base["spectral_radius"]
    both = answer(capsys, *ON[:1], "effects=[loosening_clamp,process_damping]")
    assert both["spectral_radius"] != softer["spectral_radius"]


@pytest.mark.parametrize("cluster", ["serial", "local"])
def test_the_example_goes_through_a_sweep(tmp_path: Path, cluster: str):
    words = [*WORDS, *ON, f"cluster={cluster}"]
    words += ["cluster.workers=1"] if cluster == "local" else []
    output = tmp_path / "study"
    assert main(["sweep", *words, f"output={output}"]) == 0
    attributes = zarr.open_group(output / "lobes.zarr", mode="r").attrs.asdict()
    assert attributes["settings"]["effects"] == {"loosening_clamp": {"loss": 0.3}}
    assert list(attributes["settings"]["own_effects"]) == ["loosening_clamp"]
    assert str(EXAMPLE) not in json.dumps(attributes["settings"])
    plain = tmp_path / "plain"
    assert main(["sweep", *WORDS, "cluster=serial", f"output={plain}"]) == 0
    one, other = (zarr.open_group(path / "lobes.zarr", mode="r")["spectral_radius"][...] for path in (output, plain))
    assert not np.array_equal(one, other, equal_nan=True)


def test_a_changed_file_is_another_study(tmp_path: Path, capsys):
    folder = tmp_path / "effects"
    folder.mkdir()
    words = [*WORDS, "cluster=serial", f"output={tmp_path / 'study'}", "effects=[loosening_clamp]"]
    assert main(["sweep", *words, f"effects_path={copy_of_the_example(folder)}"]) == 0
    moved = tmp_path / "moved"
    folder.rename(moved)
    assert main(["sweep", *words, f"effects_path={moved}"]) == 0
    file = moved / "loosening_clamp.py"
    file.write_text(file.read_text().replace("-0.5 * loss", "-0.6 * loss"))
    assert main(["sweep", *words, f"effects_path={moved}"]) == 2
    assert "they differ in: own_effects.loosening_clamp" in capsys.readouterr().err


def test_a_copy_in_another_process_is_the_same(tmp_path: Path, reference_machine: Machine):
    active = activate("loosening_clamp", {"loss": 0.2}, EXAMPLE)
    assert pickle.loads(pickle.dumps(active)) == active
    (tmp_path / "active").write_bytes(pickle.dumps(active))
    script = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb')))"
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "active")], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str(active)
    assert active.effect.name() == "loosening_clamp"
    assert variants("loosening_clamp", EXAMPLE) == (active.effect,)
    assert apply_effects(reference_machine, [active]) != Stages(machine=reference_machine)


def test_own_effects_stand_among_the_programs():
    assert own_effects(EXAMPLE) == ("loosening_clamp",)
    assert set(effect_names(EXAMPLE)) - set(effect_names()) == {"loosening_clamp"}
    with pytest.raises(InvalidInput, match=r"found 'loosening_clam'; did you mean loosening_clamp\?"):
        effect_class("loosening_clam", EXAMPLE)


def test_folders_that_are_not_right_are_told_everything_at_once(tmp_path: Path):
    with pytest.raises(InvalidInput, match=r"effects_path: .*nowhere is not a folder"):
        own_effects(tmp_path / "nowhere")
    copy_of_the_example(tmp_path, "process_damping")
    copy_of_the_example(tmp_path, "Clamp-2")
    (tmp_path / "alone.py").write_text("")
    (tmp_path / "lonely.yaml").write_text("")
    (tmp_path / "_helper.py").write_text("raise RuntimeError")
    with pytest.raises(InvalidInput) as told:
        own_effects(tmp_path)
    assert [problem.removeprefix(f"effects_path: {tmp_path}/") for problem in told.value.problems] == [
        "alone.py: alone.yaml is missing beside it",
        "lonely.yaml: lonely.py is missing beside it",
        "Clamp-2.py: an effect's name has small letters, digits and _, a letter first",
        "process_damping.py: the program has an effect of this name; give yours another",
    ]


EXAMPLE_TEXT = (EXAMPLE / "loosening_clamp.py").read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import nothing_of_this_name", r"mine.py cannot be loaded: ModuleNotFoundError: No module named 'nothing_"),
        ("1 / 0", r"mine.py cannot be loaded: ZeroDivisionError: division by zero"),
        ("raise SystemExit(7)", r"mine.py cannot be loaded: SystemExit: 7"),
        ("def (", r"mine.py cannot be loaded: SyntaxError: "),
        ("", r"effects: mine.py holds 0 effects, allowed: exactly one"),
        (
            EXAMPLE_TEXT.replace('"cut_modes"', '"cut_mode"'),
            r"mine.py: stage: found 'cut_mode'; did you mean cut_modes\?",
        ),
        (EXAMPLE_TEXT.replace("def transform", "def transfer"), r"mine.py: LooseningClamp does not say transform"),
        (EXAMPLE_TEXT.replace("changes:", "alters:"), r"mine.py: LooseningClamp does not say changes"),
    ],
)
def test_files_that_are_no_effect_get_one_sentence(tmp_path: Path, capsys, text: str, said: str):
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "mine.yaml").write_text("loss: 0.1\n")
    with pytest.raises(InvalidInput, match=said):
        effect_class("mine", tmp_path)
    assert main([*POINT, f"effects_path={tmp_path}", "effects=[mine]"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


def test_no_yaml_names_a_folder(tmp_path: Path, capsys):
    machine = tmp_path / "machine.yaml"
    machine.write_text(f"effects_path: {EXAMPLE}\n")
    assert main([*POINT, f"machine={machine}"]) == 2
    assert "effects_path: unknown key" in capsys.readouterr().err
