"""What a shell proposes: the words, and bash, zsh and fish themselves."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.command_line import main
from pipeline.completion import proposals
from pipeline.verbs import VERBS

ROOT = Path(__file__).parents[2]


def words(line):
    return [word for word, _ in proposals(line)]


@pytest.mark.parametrize(
    ("line", "proposed"),
    [
        ("chatter sw", ["sweep"]),
        ("chatter help im", ["improve"]),
        ("chatter completion ", ["bash", "zsh", "fish"]),
        ("chatter sweep st", ["store=", "study=", ]),
        ("chatter sweep study=o", ["study=overnight"]),
        ("chatter sweep study=overnight st", ["store="]),
        ("chatter sweep cluster=s", ["cluster=serial", "cluster=slurm"]),
        ("chatter sweep cluster.job.wall", ["cluster.job.walltime_min="]),
        ("chatter sweep grid.spindle_speed_rpm.c", ["grid.spindle_speed_rpm.count="]),
        ("chatter sweep effects.process_d", ["effects.process_damping."]),
        ("chatter sweep effects.process_damping.", ["effects.process_damping.coefficient_n_m="]),
        ("chatter sweep 'effects=[process_damping,tool_r", ["effects=[process_damping,tool_runout"]),
        ("chatter point modal_parameters=", ["modal_parameters=dynamic", "modal_parameters=static"]),
        ("chatter dataset vary.process.radial", ["vary.process.radial_immersion="]),
        ("chatter dataset formula.process.radial", ["formula.process.radial_immersion="]),
        ("chatter compare camp", ["campaign="]),
        ("chatter compare gri", []),
        ("chatter status quiet=", ["quiet=true", "quiet=false"]),
        ("chatter nonsense a", []),
        ("chatter sweep 'a", []),
    ],
)  # fmt: skip
def test_what_may_follow_is_proposed(line, proposed):
    assert words(line) == proposed


def test_all_verbs_are_proposed_with_what_they_do():
    found = dict(proposals("chatter "))
    assert {*VERBS, "help", "completion", "version"} == {*found}
    assert found["pack"].startswith("Put a finished study's chunks")


def test_paths_are_proposed_where_an_option_names_one(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "campaigns" / "first").mkdir(parents=True)
    (tmp_path / "campaigns" / ".hidden").mkdir()
    (tmp_path / "campaigns" / "plan.csv").touch()
    assert words("chatter compare campaign=ca") == ["campaign=campaigns/"]
    assert words("chatter predict trials=campaigns/") == ["trials=campaigns/first/", "trials=campaigns/plan.csv"]
    assert words("chatter sweep machine=camp") == ["machine=campaigns/"]
    assert words("chatter compare campaign=nowhere/") == []


def in_shell(shell, script, folder):
    """What a shell says, with a command ``chatter`` on its path."""
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    program = folder / "chatter"
    program.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} -m pipeline "$@"\n')
    program.chmod(0o755)
    path = f"{folder}:{os.environ['PATH']}"
    ended = subprocess.run(
        [shell, "-c", script],
        cwd=ROOT,
        env={"PATH": path, "HOME": str(folder)},
        check=True,
        capture_output=True,
        text=True,
    )
    assert ended.stderr == ""
    return ended.stdout


def test_bash_completes(tmp_path):
    # As readline calls it; = ends a word for bash, so what stands before it is not proposed again.
    asked = (
        'eval "$(chatter completion bash)"\n'
        '[[ $(complete -p chatter) == *"-F _chatter chatter" ]] || echo unbound\n'
        'ask() { COMP_LINE=$1 COMP_POINT=${#1}; _chatter; printf "<%s>" "${COMPREPLY[@]}"; echo; }\n'
        'ask "chatter sweep study=o"\nask "chatter sweep grid.spindle_speed_rpm.c"\n'
        'ask "chatter compare campaign=docs/exam"\n'
    )
    assert in_shell("bash", asked, tmp_path).splitlines() == [
        "<overnight >",
        "<grid.spindle_speed_rpm.count=>",
        "<docs/examples/>",
    ]


def test_zsh_completes(tmp_path):
    asked = (
        "compdef() { : }\ncompadd() { print -r -- $@[-1] }\n"
        'eval "$(chatter completion zsh)"\n'
        "words=(chatter sweep study=o) CURRENT=3 PREFIX=study=o\n_chatter"
    )
    assert "study=overnight" in in_shell("zsh", asked, tmp_path).splitlines()


def test_fish_completes(tmp_path):
    asked = 'chatter completion fish | source\ncomplete -C "chatter sweep study=o"'
    assert in_shell("fish", asked, tmp_path) == "study=overnight\n"


def test_another_shell_is_told_which_there_are(capsys):
    assert main(["completion", "tcsh"]) == 2
    assert capsys.readouterr().err == "error: completion: found 'tcsh'; did you mean zsh?\n"
    assert main(["completion"]) == 2
    assert "allowed: bash, zsh, fish" in capsys.readouterr().err


def test_a_folder_that_may_not_be_looked_into_is_proposed_as_a_file(tmp_path, monkeypatch):
    (tmp_path / "locked").mkdir()

    stat = os.stat

    def refused(path, **how):
        if str(path).startswith(str(tmp_path)):
            raise PermissionError(13, "Permission denied", str(path))
        return stat(path, **how)

    monkeypatch.setattr(os, "stat", refused)
    assert proposals(f"chatter sweep machine={tmp_path}/lo") == [(f"machine={tmp_path}/locked", "")]
