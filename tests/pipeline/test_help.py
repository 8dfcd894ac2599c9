"""Help of every verb comes from its declaration, and says what is true of it."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline import shipped
from pipeline.command_line import main
from pipeline.configuration import sort_words
from pipeline.dataset import own_words
from pipeline.usage import HEAD
from pipeline.verbs import VERBS

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("verb", VERBS)
def test_help_on_a_verb_has_its_options_choices_and_examples(verb, capsys):
    kind = VERBS[verb]
    assert main(["help", verb]) == 0
    told = capsys.readouterr().out
    assert main([verb, "--help"]) == 0
    assert capsys.readouterr().out == told
    assert told.startswith(kind.summary())
    for name, field in kind.fields().items():
        assert re.search(rf"^  {name}=.*", told, re.MULTILINE)
        assert field.description
    for group in kind.groups:
        assert all(choice in told for choice in shipped.groups()[group])
    assert 2 <= len(kind.examples) <= 5
    assert all(line in told for line in kind.examples)
    assert max(map(len, told.splitlines())) <= 120


def test_help_on_the_program_has_its_verbs_groups_and_effects(capsys):
    assert main(["--help"]) == 0
    told = capsys.readouterr().out
    groups = [choice for choices in shipped.groups().values() for choice in choices]
    assert all(word in told for word in [*VERBS, *groups, *shipped.effects()])
    # Without a word it is given, too, but what was asked for is not done.
    assert main([]) == 2
    assert capsys.readouterr().out == told


@pytest.mark.parametrize("verb", VERBS)
def test_what_an_unknown_key_is_answered_with_are_words_that_the_verb_takes(verb, capsys):
    assert main([verb, "qqqq=1"]) == 2
    [told] = [line for line in capsys.readouterr().err.splitlines() if "qqqq" in line]
    named = told.removeprefix("error: qqqq: unknown key; allowed: ").split(", ")
    assert named == [*VERBS[verb].fields(), *VERBS[verb].groups]


@pytest.mark.parametrize("example", [line for kind in VERBS.values() for line in kind.examples])
def test_examples_are_words_that_their_verb_takes(example):
    verb, *words = shlex.split(example)
    kind = VERBS[verb]
    found = sort_words(own_words(words).others if verb == "dataset" else words, kind.fields())
    kind.read(found.options)
    assert {*found.choices} <= {*kind.groups}
    assert all(word.partition(".")[0] in kind.groups for word in found.values)


def test_bounds_and_defaults_are_those_of_the_declaration(capsys):
    main(["help", "point"])
    told = " ".join(capsys.readouterr().out.split())
    assert "spindle_speed_rpm=NUMBER spindle speed; more than 0, at most 1e+06; needed" in told
    assert "modal_parameters=dynamic|static bearings at speed or rest; default dynamic" in told


def test_versions_are_told_of_what_numbers_depend_on(capsys):
    for word in ("--version", "version", "-V"):
        assert main([word]) == 0
        told = capsys.readouterr().out
        assert re.search(r"^milling-chatter \S+\nPython 3\.\S+, numpy \d+\.\d+\S*, scipy ", told)


@pytest.mark.parametrize("words", [["help"], ["help", "sweep"], ["completion", "words", "chatter sweep st"]])
def test_help_and_completion_load_nothing_that_computes(words):
    # What a key stroke waits for is told by what is loaded, and not by a clock.
    script = (
        f"import sys, json; from pipeline.command_line import main; main({words!r}); "
        "print(json.dumps(sorted(sys.modules)), file=sys.stderr)"
    )
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True, capture_output=True, text=True)
    heavy = {"numpy", "scipy", "numba", "hydra", "dask", "zarr", "xarray", "pandas", "matplotlib"}
    assert not heavy & set(json.loads(ended.stderr))


def test_what_no_process_has_a_use_for_at_its_start_is_not_loaded():
    # Half a second each, of every process of every run.
    script = (
        "import sys, json, pipeline.sweep, pipeline.dataset, pipeline.task; of_a_sweep = sorted(sys.modules); "
        "import pipeline.improve; "
        "print(json.dumps([of_a_sweep, sorted(sys.modules)]))"
    )
    ended = subprocess.run([sys.executable, "-c", script], cwd=ROOT, check=True, capture_output=True, text=True)
    of_a_sweep, of_an_improvement = map(set, json.loads(ended.stdout))
    assert {"numba", "zarr"} <= of_a_sweep
    assert not {"scipy.stats", "SALib", "bokeh", "matplotlib"} & of_a_sweep
    assert not {"scipy.stats", "SALib", "bokeh"} & of_an_improvement


@pytest.mark.parametrize("words", [["help", "help"], ["help", "-V"], ["--help", "--version"], ["completion", "-h"]])
def test_help_on_what_is_no_verb_is_that_of_the_program(words, capsys):
    assert main(words) == 0
    assert capsys.readouterr().out.startswith(HEAD)
