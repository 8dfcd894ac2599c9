"""The command ``identify``: from a file of receptances to a machine that runs, or to one clear message."""

import csv
import json

import numpy as np
import pytest
import yaml

from pipeline.__main__ import main

MODES = {"x": ((700.0, 0.02, 3e7), (1900.0, 0.04, 8e6)), "y": ((720.0, 0.02, 3e7), (1850.0, 0.04, 9e6))}
HEAD = ["spindle_speed_rpm", "frequency_hz", "output_axis", "input_axis", "real_um_n", "imag_um_n"]


def rows(axis="x", force=None, rpm=0, scale=1.0):
    """Return the lines of a receptance without noise."""
    frequency = np.arange(100.0, 3000.1, 10.0)
    natural, ratio, stiffness = np.array(MODES[axis]).T
    r = frequency[:, None] / natural
    values = scale * 1e6 * (1.0 / (stiffness * (1.0 - r**2 + 2j * ratio * r))).sum(axis=1)
    return [[rpm, f, axis, force or axis, v.real, v.imag] for f, v in zip(frequency, values, strict=True)]


def written(tmp_path, lines, head=HEAD):
    file = tmp_path / "frf.csv"
    with file.open("w", newline="") as stream:
        csv.writer(stream).writerows([head, *lines])
    return file


def test_a_machine_is_written_that_runs(tmp_path, capsys):
    file = written(tmp_path, [*rows("x"), *rows("y"), *rows("x", force="y", scale=0.1)])
    machine = tmp_path / "out" / "machine_tip.yaml"
    assert main(["identify", f"frf={file}", "machine=reference", f"output={machine}"]) == 0
    said = capsys.readouterr().out
    assert "left out: x over y at 0 rpm, a cross receptance" in said
    assert "x at 0 rpm: residual" in said
    for axis in "xy":
        assert (tmp_path / "out" / f"machine_tip_{axis}_0rpm.png").stat().st_size > 10_000
    described = yaml.safe_load(machine.read_text())
    assert list(described) == ["tip", "tool", "cutting", "process"]
    found = [
        (mode["natural_frequency_hz"], mode["damping_ratio"], mode["stiffness_n_um"] * 1e6)
        for mode in described["tip"]["modes"]
    ]
    # Without noise, and written with six digits.
    assert np.array(found) == pytest.approx(np.array([*MODES["x"], *MODES["y"]]), rel=2e-6)
    # Three per cent of gain at least; more from 291 lines of the expected error.
    assert 0.03 * 30.0 < described["tip"]["modes"][0]["stiffness_deviation_n_um"] < 0.06 * 30.0
    assert main(["point", f"machine={machine}", "spindle_speed_rpm=9000", "axial_depth_mm=0.5", "format=json"]) == 0
    assert json.loads(capsys.readouterr().out)["status"] == "ok"


def test_modes_of_one_number_that_are_far_apart_are_told(tmp_path, capsys):
    y_at_speed = [[9000, *row[1:2], "x", "x", *row[4:]] for row in rows("y")]
    file = written(
        tmp_path, [row for row in rows() if row[1] > 1000.0] + [row for row in y_at_speed if row[1] < 1000.0]
    )
    assert main(["identify", f"frf={file}", "modes=1", f"output={tmp_path / 'm.yaml'}"]) == 0
    assert "doubtful: mode 1 is at 1900 Hz for x at 0 rpm, at 720 Hz for x at 9000 rpm" in capsys.readouterr().out


def test_one_axis_without_a_machine_says_what_is_missing(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["identify", f"frf={written(tmp_path, rows('y'))}", "modes=2", "lowest_frequency_hz=200"]) == 0
    said = capsys.readouterr().out
    assert "no receptance of x: the machine is rigid in that axis" in said
    assert "to be added to the machine before it runs: tool, cutting, process" in said
    machine = tmp_path / "results" / "identify" / "machine_tip.yaml"
    assert [mode["axis"] for mode in yaml.safe_load(machine.read_text())["tip"]["modes"]] == ["y", "y"]
    assert "To be added before it runs" in machine.read_text()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        pytest.param(lambda r: r[5].__setitem__(1, "abc"), "line 7: frequency_hz: found 'abc'", id="no number"),
        pytest.param(lambda r: r[5].__setitem__(4, ""), "line 7: real_um_n: found ''", id="empty cell"),
        pytest.param(lambda r: r[5].__setitem__(5, "inf"), "line 7: imag_um_n: found 'inf'", id="infinite"),
        pytest.param(lambda r: r[5].__setitem__(2, "z"), "line 7: axes: found 'z' and 'x', allowed: x, y", id="axis"),
        pytest.param(lambda r: r.append(r[5]), "line 293: frequency_hz: 150 stands twice for x over x", id="twice"),
        pytest.param(lambda r: r[9].pop(), "line 11: imag_um_n: found ''", id="short row"),
        pytest.param(lambda r: r.__delitem__(slice(9, None)), "found 9 lines", id="too few"),
    ],
)
def test_bad_rows_get_one_message_and_exit_code_two(tmp_path, capsys, change, said):
    lines = rows()
    change(lines)
    assert main(["identify", f"frf={written(tmp_path, lines)}", f"output={tmp_path / 'm.yaml'}"]) == 2
    caught = capsys.readouterr()
    assert said in caught.err
    assert "Traceback" not in caught.err
    assert not (tmp_path / "m.yaml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        pytest.param(["frf=none.csv"], "none.csv: no such file", id="no file"),
        pytest.param([], "frf: missing; needed: CSV file", id="no frf"),
        pytest.param(["frf={frf}", "modes=0"], "modes: found '0', allowed: at least 1", id="no modes"),
        pytest.param(["frf={frf}", "modes=7"], "x at 0 rpm: modes: found 7, but", id="more modes than there are"),
        pytest.param(["frf={frf}", "output=m.txt"], "allowed: a file name ending in .yaml", id="output"),
        pytest.param(["frf={frf}", "lowest_frequency_hz=2500"], "no resonance from 2500 Hz to 3000 Hz", id="band"),
        pytest.param(["frf={frf}", "machine=no.yaml"], "no.yaml: no such file", id="no machine"),
        pytest.param(["frf={frf}", "mode=2"], "mode: unknown key; did you mean modes?", id="key"),
        pytest.param(["frf=."], "Is a directory", id="folder"),
    ],
)
def test_bad_words_get_one_message_and_exit_code_two(tmp_path, capsys, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    file = written(tmp_path, rows())
    assert main(["identify", *(word.format(frf=file) for word in words)]) == 2
    assert said in capsys.readouterr().err


def test_a_machine_is_not_written_over_itself(tmp_path, capsys):
    machine = tmp_path / "machine.yaml"
    machine.write_text("tip: {}\n")
    words = ["identify", f"frf={written(tmp_path, rows())}", f"machine={machine}", f"output={machine}"]
    assert main(words) == 2
    assert "is an input of the same command" in capsys.readouterr().err
    assert machine.read_text() == "tip: {}\n"


def test_missing_columns_and_foreign_files_are_told(tmp_path, capsys):
    file = written(tmp_path, [], head=HEAD[:4])
    assert main(["identify", f"frf={file}"]) == 2
    assert "missing columns: real_um_n, imag_um_n" in capsys.readouterr().err
    file.write_bytes(b"\xff\xfe\x00\x01")
    assert main(["identify", f"frf={file}"]) == 2
    assert "is no CSV text" in capsys.readouterr().err
