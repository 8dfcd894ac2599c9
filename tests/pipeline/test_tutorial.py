"""The tutorial's commands run as they stand, and the numbers that it quotes are those that they tell."""

import csv
import importlib.util
import io
import json
import os
import re
import shlex
import shutil
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pytest

from pipeline.__main__ import main

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "docs" / "examples"
CAMPAIGN = EXAMPLES / "paper_campaign"
TEXT = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
PROSE = " ".join(TEXT.split())
#: Commands that have workers of their own: here they stay in this process, which changes no answer.
SPREAD = ("compare", "diagnose", "improve")


@dataclass(frozen=True)
class Told:
    """What the tutorial's commands have left: history, first and last diagnosis, predictions, standard output."""

    folder: Path
    said: str

    def rows(self, path: str) -> list[dict[str, str]]:
        with (self.folder / "results" / path).open() as file:
            return list(csv.DictReader(file))

    def document(self, path: str):
        return json.loads((self.folder / "results" / path).read_text())

    def error(self, step: int, column: str) -> float:
        return float(self.rows("improve-paper_campaign/history.csv")[step][column])

    @property
    def first(self):
        return self.document("improve-paper_campaign/diagnosis.json")

    @property
    def last(self):
        return self.document("improve-paper_campaign/diagnosis_last.json")

    def nats(self, effect: str) -> float:
        return next(one["score"] for one in self.first["ranking"] if one["effect"] == effect)


def commands() -> list[list[str]]:
    """Return the words of every command in the tutorial, without those that start the program."""
    blocks = "".join(re.findall(r"```sh\n(.*?)```", TEXT, re.DOTALL)).replace("\\\n", " ")
    lines = [shlex.split(line) for line in blocks.splitlines()]
    assert all(line[:3] == ["python", "-m", "pipeline"] for line in lines)
    return [line[3:] for line in lines]


@pytest.fixture(scope="module")
def told(tmp_path_factory) -> Told:
    """What all commands leave, in their order, in a copy of the examples."""
    folder = tmp_path_factory.mktemp("tutorial")
    shutil.copytree(EXAMPLES, folder / "docs" / "examples")
    before, said = Path.cwd(), io.StringIO()
    os.chdir(folder)
    try:
        with redirect_stdout(said):
            for words in commands():
                assert main([*words, *(["cluster=serial"] if words[0] in SPREAD else [])]) == 0
    finally:
        os.chdir(before)
    return Told(folder=folder, said=said.getvalue())


def quoted(words: str) -> list[float]:
    """Return the numbers that stand in the tutorial where ``words`` has #."""
    found = re.search(re.escape(words).replace(r"\#", r"([-+]?\d+(?:\.\d+)?)"), PROSE)
    assert found, words
    return [float(number) for number in found.groups()]




def rounded(number: float, of: float, tolerance: float) -> None:
    assert number == pytest.approx(of, abs=tolerance), (number, of)


def test_the_campaign_is_what_its_script_draws(tmp_path):
    spec = importlib.util.spec_from_file_location("make_paper_campaign", CAMPAIGN / "make.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    script.make(tmp_path)
    assert (tmp_path / "machine.yaml").read_text() == (CAMPAIGN / "machine.yaml").read_text()
    for name in ("frf.csv", "stability.csv"):
        drawn, kept = (list(csv.reader((folder / name).open())) for folder in (tmp_path, CAMPAIGN))
        assert len(drawn) == len(kept)
        for fresh, old in zip(drawn, kept, strict=True):
            assert len(fresh) == len(old)
            for cell, other in zip(fresh, old, strict=True):
                # The last digit that is written may round differently on another machine.
                assert cell == other or float(cell) == pytest.approx(float(other), rel=1e-3, abs=2e-5)


def test_the_campaign_is_as_large_as_the_tutorial_says(told):
    rows = list(csv.DictReader((CAMPAIGN / "stability.csv").open()))
    speeds = {row["spindle_speed_rpm"] for row in rows}
    assert quoted("| # cuts at # speeds from") == [len(rows), len(speeds)]


def test_the_poor_model_fails_as_the_tutorial_says(told):
    errors = told.document("compare-paper_campaign/comparison.json")["errors"]
    for version in ("as_described", "calibrated", "held_out"):
        rounded(quoted("This model tells # % of the outcomes")[0], 100.0 * errors["outcome"][version]["value"], 0.5)
    rounded(quoted("Of the receptances it misses # %")[0], 100.0 * errors["receptance"]["calibrated"]["value"], 0.5)
