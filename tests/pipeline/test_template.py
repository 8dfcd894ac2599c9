"""The template: a campaign that lacks nothing but measurements, and says what goes where."""

import shutil
from pathlib import Path

import pytest

from chatter_core.errors import InvalidInput
from chatter_core.evidence import read_campaign
from chatter_core.evidence.measured import TABLES
from chatter_core.machine import Bearing, Cutting, Damping, Machine, Process, Section, Spindle, Tip, TipMode, Tool
from chatter_core.reading import load_value, read_machine
from pipeline.command_line import main

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"


@pytest.fixture
def template(tmp_path, capsys):
    """The folder that the command writes."""
    folder = tmp_path / "mine"
    assert main(["template", f"output={folder}"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        f"written: {folder / name}" for name in ("machine.yaml", *(table.file for table in TABLES), "README.txt")
    ]
    return folder


def test_a_template_lacks_nothing_but_measurements(template):
    with pytest.raises(InvalidInput) as caught:
        read_campaign(template)
    (problem,) = caught.value.problems
    assert problem.startswith(f"{template}: no measurement yet; needed: rows in one at least of stability.csv, ")


def test_a_template_is_filled_in_file_by_file(template):
    shutil.copy(CAMPAIGNS / "d01" / "stability.csv", template)
    campaign = read_campaign(template)
    assert len(campaign.trials) == 92
    assert campaign.remarks == tuple(
        f"{table.file}: holds a header and no rows, nothing was read from it" for table in TABLES[1:]
    )


def test_its_machine_is_the_reference_machine_with_every_key_explained(template, reference_machine):
    assert read_machine(template / "machine.yaml") == reference_machine
    lines = (template / "machine.yaml").read_text().splitlines()
    for model in (Machine, Bearing, Spindle, Section, Damping, Tip, TipMode, Tool, Cutting, Process):
        for name, field in model.model_fields.items():
            key = field.alias or name
            assert any(f"{key}:" in line and f"# {field.description}" in line for line in lines), key


def test_keys_behind_a_hash_can_be_used(template):
    lines = (template / "machine.yaml").read_text().splitlines()
    start = lines.index(next(line for line in lines if line.startswith("# tip:")))
    end = lines.index(next(line for line in lines if line.startswith("tool:")))
    values = {"axis": "x", "natural_frequency_hz": 500.0, "damping_ratio": 0.02, "stiffness_n_um": 10.0}
    bare = "\n".join(line.removeprefix("# ").replace("#   ", "  ", 1) for line in lines[start:end])
    for key, value in (values | {"spindle_speed_rpm": 0.0}).items():
        bare = bare.replace(f"{key}:", f"{key}: {value}")
    assert Tip.model_validate(load_value(bare)["tip"]).modes[0].described() == values | {"spindle_speed_rpm": 0.0}


def test_its_page_explains_every_column(template):
    page = (template / "README.txt").read_text()
    for table in TABLES:
        assert table.file in page
        assert (template / table.file).read_text() == ",".join(column.key for column in table.columns) + "\n"
        for column in table.columns:
            assert f"{column.doc}; {column.allowed}" in page


def test_a_folder_with_something_in_it_is_left_alone(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("mine")
    assert main(["template", f"output={tmp_path}"]) == 2
    assert capsys.readouterr().err == f"error: output: {tmp_path} is not empty; name a new folder\n"
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "output: missing; needed: a new folder for the campaign"),
        (["output=mine", "study=smoke"], "study: not for template, which takes output=DIR alone"),
        (["output=mine", "machine=mine.yaml"], "machine: not for template"),
        (["output=mine", "tool.teeth=3"], "tool.teeth=3: not for template"),
        (["outptu=mine"], "outptu: unknown key; did you mean output?"),
    ],
)
def test_wrong_words_are_told(words, message, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["template", *words]) == 2
    assert message in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
