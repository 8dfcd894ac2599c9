"""What a run tells, and where: people, scripts and logs each get what they can use."""

import io
import json
import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

from pipeline import point
from pipeline.command_line import main
from pipeline.telling import command
from tests.pipeline.studies import CELLS, CHUNKS, sweep

ROOT = Path(__file__).parents[2]
POINT = ["point", "spindle_speed_rpm=12000", "axial_depth_mm=1"]
SMALL = [
    "study=smoke", "grid.spindle_speed_rpm=[9000]", "grid.axial_depth_mm=[1]", "grid.mode_count=[1]",
    "grid.modal_parameters=[dynamic]", "cluster=serial",
]  # fmt: skip
DOCUMENTED = (ROOT / "docs" / "command_line.md").read_text()
ENDS = {"verb", "written", "remarks", "errors", "exit_code"}


@pytest.fixture(autouse=True)
def without_report(monkeypatch):
    """Leave out tables and figures, which take longer than everything else."""
    monkeypatch.setattr("pipeline.report.write", lambda place: [place.output / "report.html"])


@pytest.fixture
def study(tmp_path, capsys):
    """A small finished study; what computing it told is forgotten."""
    assert sweep(tmp_path / "study") == 0
    capsys.readouterr()
    return tmp_path / "study"


def object_of(capsys, *words, code=0):
    """The one object on standard output, and what people are told."""
    assert main([*words, "format=json"]) == code
    told = capsys.readouterr()
    found = json.loads(told.out)
    assert all(f"`{key}`" in DOCUMENTED for key in found)
    return found, told.err


def test_every_verb_of_a_study_tells_scripts_its_results(study, capsys):
    place = f"output={study}"
    expected = {
        "status": {"cells": {"ok": CELLS}, "state": "complete", "chunks_total": CHUNKS},
        "verify": {"damaged": [], "torn_lines": 0},
        "report": {"written": [str(study / "report.html")]},
        "journal": {"torn_lines": 0},
    }
    for verb, facts in expected.items():
        told, people = object_of(capsys, verb, place)
        assert told.keys() >= ENDS | {*facts}
        assert {key: told[key] for key in facts} == facts
        assert (told["verb"], told["exit_code"], told["errors"]) == (verb, 0, [])
        assert people
    assert [event["event"] for event in object_of(capsys, "journal", place)[0]["events"]][-1] == "end"
    packed, _ = object_of(capsys, "pack", place)
    assert packed["files_now"] < packed["files_before"]


def test_a_sweep_tells_its_cells_by_status_and_its_store(tmp_path, capsys):
    told, people = object_of(capsys, "sweep", *SMALL, f"output={tmp_path}")
    assert (told["cells"], told["cells_failed"], told["cells_total"]) == ({"ok": 1}, 0, 1)
    assert told["store"] == str(tmp_path / "lobes.zarr")
    assert told["written"] == [str(tmp_path / "report.html")]
    assert f"store:   {tmp_path / 'lobes.zarr'}" in people


def test_damage_is_told_to_scripts_with_the_exit_code(study, capsys):
    file = next((study / "lobes.zarr" / "status").glob("c.*"))
    file.write_bytes(b"not what was written")
    told, people = object_of(capsys, "verify", f"output={study}", code=1)
    assert len(told["damaged"]) == 1
    assert told["exit_code"] == 1
    assert told["errors"] == [line.removeprefix("error: ") for line in people.splitlines() if line[:6] == "error:"]


def test_bad_input_leaves_no_object(capsys):
    assert main([*POINT, "tool.teth=3", "format=json"]) == 2
    assert capsys.readouterr() == ("", "error: tool.teth: unknown key; did you mean teeth?\n")


@pytest.mark.parametrize("words", [POINT, ["sweep", *SMALL, "output={folder}"], ["template", "output={folder}"]])
def test_quiet_tells_nothing_where_all_is_well(words, tmp_path, capsys):
    assert main([*(word.format(folder=tmp_path / "new") for word in words), "quiet=true"]) == 0
    assert capsys.readouterr() == ("", "")


def test_quiet_tells_errors_and_scripts_get_their_object(capsys):
    assert main([*POINT, "quiet=true", "tool.teeth=0"]) == 2
    assert capsys.readouterr() == ("", "error: tool.teeth: found 0, allowed: at least 1\n")
    told, people = object_of(capsys, *POINT, "quiet=true")
    assert told["status"] == "ok"
    assert people == ""
    assert main([*POINT, "quiet=perhaps"]) == 2
    assert "quiet: found 'perhaps', allowed: one of 'true' or 'false'" in capsys.readouterr().err


def test_what_a_law_or_its_worker_prints_is_kept_out_of_the_object(capfd, monkeypatch):
    computed = point.run

    def printing(words):
        print("by a law")
        subprocess.run([sys.executable, "-c", "print('by a worker')"], check=True)
        return computed(words)

    monkeypatch.setattr(point, "run", printing)
    told, people = object_of(capfd, *POINT, "quiet=true")
    assert told["status"] == "ok"
    assert sorted(people.splitlines()) == ["by a law", "by a worker"]
    assert main(POINT) == 0
    assert capfd.readouterr().out.startswith("by a law\nby a worker\n")


def test_a_command_is_told_as_the_program_was_called_and_can_be_pasted(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/home/ada/.venv/bin/chatter", "sweep"])
    assert command("sweep", "grid.preload_n=[100, 300]") == "chatter sweep 'grid.preload_n=[100, 300]'"
    monkeypatch.setattr(sys, "argv", ["/home/ada/chatter/pipeline/__main__.py", "sweep"])
    assert command("verify", "output=a b", "repair=true") == "python -m pipeline verify 'output=a b' repair=true"


def seen_on_a_terminal(**environment):
    """What a meter writes to standard error where that is a terminal."""
    ours, theirs = pty.openpty()
    script = (
        "from pipeline.progress import Meter\n"
        "with Meter(3, 0) as meter:\n"
        "    [meter.advance(1) for _ in range(3)]"
    )  # fmt: skip
    kept = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR")}
    subprocess.run(
        [sys.executable, "-c", script],
        stderr=theirs,
        cwd=ROOT,
        check=True,
        env={**kept, "TERM": "xterm", **environment},
    )
    os.close(theirs)
    seen = os.read(ours, 65536).decode()
    os.close(ours)
    return seen


def test_a_bar_and_colours_are_for_terminals_that_want_them(capsys):
    coloured = seen_on_a_terminal()
    assert "3/3" in coloured
    assert "\x1b[3" in coloured
    # A bar without colours: their codes begin with 3 or 38.
    assert "3/3" in seen_on_a_terminal(NO_COLOR="1")
    assert "\x1b[3" not in seen_on_a_terminal(NO_COLOR="1")
    plain = seen_on_a_terminal(TERM="dumb")
    assert plain.startswith("3 of 3 cells (100 %), ")
    assert "\x1b" not in plain


def test_a_closed_standard_error_takes_nothing_to_standard_output(study, monkeypatch, capsys):
    monkeypatch.setattr(sys, "stderr", None)
    assert main(["status", f"output={study}", "format=json"]) == 0
    assert json.loads(capsys.readouterr().out)["state"] == "complete"
    assert main(["status", f"output={study / 'nowhere'}"]) == 2
    assert capsys.readouterr().out == ""


def test_what_cannot_be_told_aside_ends_no_run_and_what_cannot_be_answered_does(tmp_path, monkeypatch, capsys):
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no device that is always full")
    # Without a buffer, which could not be closed.
    with io.TextIOWrapper(full.open("wb", buffering=0), write_through=True) as nowhere:
        monkeypatch.setattr(sys, "stderr", nowhere)
        assert main(["template", f"output={tmp_path / 'new'}", "format=json"]) == 0
        assert main(["template", "output=", "format=json"]) == 2
        monkeypatch.undo()
        capsys.readouterr()
        monkeypatch.setattr(sys, "stdout", nowhere)
        assert main(["help"]) == 2
        assert capsys.readouterr().err == "error: standard output: No space left on device\n"


def test_letters_that_a_stream_does_not_have_are_told_by_their_numbers(tmp_path, monkeypatch):
    ascii_alone = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", ascii_alone)
    assert main(["template", f"output={tmp_path}/Fräsen ☃"]) == 0
    assert rb"Fr\xe4sen \u2603/machine.yaml" in ascii_alone.buffer.getvalue()


def test_endless_words_are_cut_short(capsys):
    for words in (["a" * 10**5], ["sweep", "b" * 10**5], ["sweep", "study=" + "c" * 10**5]):
        assert main(words) == 2
        assert len(capsys.readouterr().err) < 1000


@pytest.mark.parametrize("word", ["output=\udcff", "output=\udcc3.zarr", "\udcff=3"])
def test_words_that_are_no_text_are_refused(word, capsys):
    assert main(["sweep", "study=smoke", word]) == 2
    assert "holds bytes that are no UTF-8 text" in capsys.readouterr().err
