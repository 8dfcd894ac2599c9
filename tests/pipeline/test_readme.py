"""The README's machines run, and what it says of commands is true."""

import re
import shlex
from functools import partial
from pathlib import Path

import pytest
import yaml

from pipeline.command_line import main
from pipeline.configuration import compose_settings, groups, sort_words
from pipeline.design import DatasetSettings

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()
REST = {
    "tool": {"teeth": 2, "diameter_mm": 10.0, "helix_angle_deg": 0.0, "rake_angle_deg": 0.0},
    "cutting": {"kt_mpa": 600.0, "kn": 0.33, "friction_coefficient": 0.0},
    "process": {"direction": "down", "radial_immersion": 0.5, "feed_per_tooth_mm": 0.1},
}


@pytest.mark.parametrize("block", re.findall(r"```yaml\n(.*?)```", README, re.DOTALL), ids=["built", "measured"])
def test_machines_of_the_readme_run(block, tmp_path, capsys):
    machine = {**REST, **yaml.safe_load(block)}
    file = tmp_path / "machine.yaml"
    file.write_text(yaml.safe_dump(machine))
    assert main(["point", f"machine={file}", "spindle_speed_rpm=9000", "axial_depth_mm=0.5"]) == 0
    assert "spectral radius" in capsys.readouterr().out


def test_words_of_the_readme_are_understood(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lines = [line for line in README.splitlines() if line.strip().startswith("python -m pipeline")]
    points = [shlex.split(line, comments=True)[3:] for line in lines if " point " in line]
    assert points
    for words in points:
        assert main(words) == 0
    assert '"spectral_radius"' in capsys.readouterr().out


def test_the_readme_shows_the_pictures_of_the_tutorial():
    shown = re.findall(r"!\[[^\]]+\]\(docs/(images/tutorial_\w+\.png)\)", README)
    assert shown == re.findall(r"\((images/tutorial_\w+\.png)\)", (ROOT / "docs" / "tutorial.md").read_text())[::-1]
    assert all((ROOT / "docs" / name).is_file() for name in shown)


def test_every_shipped_choice_composes():
    for group, choices in groups().items():
        for choice in choices:
            words = [f"{group}={choice}"] + (["cluster.address=tcp://localhost:1"] if choice == "address" else [])
            if group == "design" or choice in (*groups()["design"], "dataset_small", "dataset_overnight"):
                vary = {"machine": {"vary": {"tool.teeth": [2, 4]}}} if choice == "parameter_study" else {}
                with_it = compose_settings(sort_words(words, ()), DatasetSettings, change=partial(_vary, vary))
                assert with_it.design.title
            else:
                assert compose_settings(sort_words(words, ())).study


def _vary(level, data):
    data["design"] |= level


def test_makefile_has_a_target_for_every_verb():
    from pipeline.command_line import VERBS

    makefile = (ROOT / "Makefile").read_text()
    for verb in VERBS:
        assert re.search(rf"^{verb}:.*## ", makefile, re.MULTILINE)
