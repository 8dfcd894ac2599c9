"""The command ``identify``: from a file of receptances to a machine that runs, or to one clear message."""

import csv
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import pyuff
import yaml

from chatter_core.evidence import read_campaign
from chatter_core.evidence.measured import RECEPTANCE
from pipeline.command_line import main

MODES = {"x": ((700.0, 0.02, 3e7), (1900.0, 0.04, 8e6)), "y": ((720.0, 0.02, 3e7), (1850.0, 0.04, 9e6))}
HEAD = [column.key for column in RECEPTANCE.columns if not column.optional]
CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"


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
    assert "x over x at 0 rpm: residual" in said
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
    said = capsys.readouterr().out
    assert "doubtful: mode 1 is at 1900 Hz for x over x at 0 rpm, at 720 Hz for x over x at 9000 rpm" in said


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
        pytest.param(lambda r: r[5].__setitem__(1, "abc"), "line 7, column frequency_hz: found 'abc'", id="no number"),
        pytest.param(lambda r: r[5].__setitem__(4, ""), "line 7, column real_um_n: is empty", id="empty cell"),
        pytest.param(lambda r: r[5].__setitem__(5, "inf"), "line 7, column imag_um_n: found 'inf'", id="infinite"),
        pytest.param(
            lambda r: r[5].__setitem__(2, "z"), "column output_axis: found 'z', allowed: one of x, y", id="axis"
        ),
        pytest.param(lambda r: r.append(r[5]), "and frequency_hz as in line 7; keep one of them", id="twice"),
        pytest.param(lambda r: r[9].pop(), "line 11: found 5 cells, allowed: 6, as in the header", id="short row"),
        pytest.param(lambda r: r.clear(), "frf.csv: holds a header and no rows", id="no rows"),
        pytest.param(lambda r: r.__delitem__(slice(9, None)), "x over x at 0 rpm: frequency: found 9 lines", id="few"),
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
        pytest.param([], "frf: missing; needed: frf=FILE with receptances, or campaign=DIR", id="no frf"),
        pytest.param(["frf={frf}", "modes=0"], "modes: found '0', allowed: at least 1", id="no modes"),
        pytest.param(
            ["frf={frf}", "modes=7"], "x over x at 0 rpm: modes: found 7, but", id="more modes than there are"
        ),
        pytest.param(["frf={frf}", "output=m.txt"], "allowed: a file name ending in .yaml", id="output"),
        pytest.param(["frf={frf}", "lowest_frequency_hz=2500"], "no resonance from 2500 Hz to 3000 Hz", id="band"),
        pytest.param(
            ["frf={frf}", "lowest_frequency_hz=2500", "highest_frequency_hz=900"],
            "error: lowest_frequency_hz: found 2500, allowed: less than highest_frequency_hz, which is 900\n",
            id="no band",
        ),
        pytest.param(
            ["frf={frf}", "lowest_frequency_hz=9000", "highest_frequency_hz=9500"],
            "error: lowest_frequency_hz, highest_frequency_hz: found 9000 to 9500, which leaves 0 of the",
            id="band beside",
        ),
        pytest.param(["frf={frf}", "machine=no.yaml"], "no.yaml: no such file", id="no machine"),
        pytest.param(["frf={frf}", "mode=2"], "mode: unknown key; did you mean modes?", id="key"),
        pytest.param(["frf=."], "error: .: is no file", id="folder"),
        pytest.param(["frf={frf}", "campaign=."], "campaign: found beside frf, allowed: one of them", id="both"),
        pytest.param(["campaign=none"], "none: no such folder; a campaign is a folder", id="no campaign"),
        pytest.param(
            ["campaign=.", "machine=a.yaml"], "machine: not beside campaign, whose machine.yaml", id="two machines"
        ),
        pytest.param(["campaign=.", "tool.teeth=3"], "tool.teeth=3: not beside campaign", id="a machine's value"),
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
    # Nor over any other machine: a spindle that was described is gone for good.
    assert main(["identify", words[1], f"output={machine}"]) == 2
    assert "holds something that no earlier answer is" in capsys.readouterr().err
    assert machine.read_text() == "tip: {}\n"
    for _ in range(2):
        assert main(["identify", words[1], f"output={tmp_path / 'tip.yaml'}"]) == 0


def test_responses_without_a_mode_are_told(tmp_path, capsys):
    file = written(tmp_path, [[0, float(hertz), "x", "x", 0.1, 0.0] for hertz in range(1, 100)])
    assert main(["identify", f"frf={file}", f"output={tmp_path / 'tip.yaml'}"]) == 2
    assert f"{file}: " in capsys.readouterr().err
    assert not (tmp_path / "tip.yaml").exists()


def test_a_campaign_keeps_its_machine(tmp_path, capsys):
    folder = tmp_path / "mine"
    shutil.copytree(CAMPAIGNS / "r01", folder, ignore=shutil.ignore_patterns("SOURCE.txt"))
    assert main(["identify", f"campaign={folder}"]) == 2
    assert f"{folder}: receptances: found none, needed: one direct receptance" in capsys.readouterr().err
    written(folder, [*rows("x"), *rows("y")])
    machine = folder / "machine.yaml"
    assert main(["identify", f"campaign={folder}", f"output={machine}"]) == 2
    assert "is an input of the same command" in capsys.readouterr().err
    found = tmp_path / "tip.yaml"
    assert main(["identify", f"campaign={folder}", f"output={found}"]) == 0
    assert "# Tip modes identified from mine;" in found.read_text()
    described, own = yaml.safe_load(found.read_text()), read_campaign(folder).machine.described()
    assert {key: described[key] for key in own if key != "tip"} == {key: own[key] for key in own if key != "tip"}
    assert [mode["natural_frequency_hz"] for mode in described["tip"]["modes"]] == pytest.approx(
        [mode[0] for axis in "xy" for mode in MODES[axis]], rel=2e-6
    )


def test_a_measured_campaign_gives_a_machine_that_runs(tmp_path, capsys):
    machine = tmp_path / "tip.yaml"
    assert main(["identify", f"campaign={CAMPAIGNS / 'd02'}", f"output={machine}"]) == 0
    assert main(["point", f"machine={machine}", "spindle_speed_rpm=9000", "axial_depth_mm=0.5", "format=json"]) == 0
    assert '"status": "ok"' in capsys.readouterr().out


@pytest.mark.parametrize("derivatives", [0, 2], ids=["receptance", "accelerance"])
def test_a_universal_file_gives_the_machine_of_its_table(tmp_path, capsys, derivatives):
    lines = rows()
    hertz, value = np.array([row[1] for row in lines]), np.array([row[4] + 1j * row[5] for row in lines]) * 1e-6
    file = tmp_path / "tip.uff"
    record = {
        "type": 58,
        "func_type": 4,
        "rsp_node": 1,
        "rsp_dir": 1,
        "ref_node": 1,
        "ref_dir": 1,
        "x": hertz,
        "data": value * (2j * np.pi * hertz) ** derivatives,
        "abscissa_spec_data_type": 18,
        "ordinate_spec_data_type": {0: 8, 2: 12}[derivatives],
        "orddenom_spec_data_type": 13,
    }
    pyuff.UFF(str(file)).write_sets(record, mode="overwrite")
    of_file, of_table = tmp_path / "a.yaml", tmp_path / "b.yaml"
    assert main(["identify", f"frf={file}", f"output={of_file}"]) == 0
    assert "remark: tip.uff: names no units (dataset 164), SI is assumed\n" in capsys.readouterr().out
    assert main(["identify", f"frf={written(tmp_path, lines)}", f"output={of_table}"]) == 0
    assert capsys.readouterr().out.startswith("x over x at 0 rpm: residual")
    frequencies = [
        [mode["natural_frequency_hz"] for mode in yaml.safe_load(machine.read_text())["tip"]["modes"]]
        for machine in (of_file, of_table)
    ]
    # Without noise, and written with six digits.
    assert frequencies[0] == pytest.approx(frequencies[1], rel=2e-6)


def test_what_the_reader_remarks_is_told_line_by_line(tmp_path, capsys):
    lines = [[0, 0.0, "x", "x", 0.1, 0.0], *rows(), *(row for row in rows("y") if row[1] != 150.0)]
    file = written(tmp_path, [[*row, "Ada"] for row in lines], head=[*HEAD, "operator"])
    assert main(["identify", f"frf={file}", f"output={tmp_path / 'm.yaml'}"]) == 0
    assert capsys.readouterr().out.splitlines()[:3] == [
        "unknown column, not used: 'frf.csv: operator'",
        "left out: x over x at 0 rpm, its line at 0 Hz",
        "",
    ]
    # A receptance in m/N taken for one in um/N: the remark says what the refusal cannot.
    assert main(["identify", f"frf={written(tmp_path, rows(scale=1e-6))}", f"output={tmp_path / 'm.yaml'}"]) == 2
    said = capsys.readouterr()
    assert said.out.startswith("remark: frf.csv: receptance x over x at 0 rpm has a median of ")
    assert said.out.count("\n") == 2
    assert "stiffness_n_um: found" in said.err


def test_missing_columns_and_foreign_files_are_told(tmp_path, capsys):
    file = written(tmp_path, [], head=HEAD[:4])
    assert main(["identify", f"frf={file}"]) == 2
    said = capsys.readouterr().err
    for column in HEAD[4:]:
        assert f"line 1, column {column}: missing; needed: " in said
    file.write_bytes(b"\xff\xfe\x00\x01\xff")
    assert main(["identify", f"frf={file}"]) == 2
    assert "no text in UTF-8 or UTF-16" in capsys.readouterr().err
    file = file.rename(tmp_path / "frf.unv")
    assert main(["identify", f"frf={file}"]) == 2
    assert "frf.unv: holds no frequency response in dataset 58" in capsys.readouterr().err


def test_a_link_is_not_followed_out_of_its_folder(tmp_path, capsys):
    link = tmp_path / "here" / "frf.csv"
    link.parent.mkdir()
    link.symlink_to(written(tmp_path, rows()))
    assert main(["identify", f"frf={link}"]) == 2
    assert "leads out of its folder" in capsys.readouterr().err
