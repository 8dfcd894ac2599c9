"""The how-to pages do what they say: their commands run as they stand, in order, and answer what stands below them."""

import inspect
import io
import re
import shutil
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import fields
from pathlib import Path

import pytest

from chatter_core.stages import ARROWS, Stages
from chatter_core.units import SUFFIXES
from pipeline import figures
from pipeline.command_line import main
from tests.documentation.commands import HOW_TO, ROOT, Block, blocks, words_of

#: Commands that have workers of their own: here they stay in this process, which changes no answer.
SPREAD = ("sweep", "dataset", "compare", "diagnose", "improve")
#: Printed numbers have three or four digits; the last may round differently on another machine.
LAST_DIGIT = 5e-3


def shell(line: str) -> None:
    """Run a line of a shell, the program within this process."""
    words = words_of(line)
    if words is None:
        print(subprocess.run(["bash", "-c", line], check=True, capture_output=True, text=True).stdout)
        return
    refused = words[-2:] == ["||", "true"]
    words = words[:-2] if refused else words
    assert main([*words, *(["cluster=serial"] if words[0] in SPREAD else [])]) == (2 if refused else 0), line


def alike(said: str, printed: str) -> bool:
    """Whether two lines have the same words, and numbers that are equal but for their last digit."""
    one, other = said.split(), printed.split()
    return len(one) == len(other) and all(map(_alike, one, other))


def _alike(one: str, other: str) -> bool:
    try:
        return float(one) == pytest.approx(float(other), rel=LAST_DIGIT)
    except ValueError:
        return one == other or ("," in one and alike(one.replace(",", " "), other.replace(",", " ")))


def outcome(block: Block, namespace: dict[str, object]) -> str:
    """Run a block and return what it prints; names of Python blocks live on in the namespace."""
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        if block.language == "python":
            exec(block.text, namespace)
        else:
            for line in block.lines:
                shell(line)
    return said.getvalue()


def follow(page: list[Block]) -> None:
    """Do what a page says, block by block."""
    printed, namespace, answered = "", {}, True
    for block in page:
        if block.mark.startswith("file: "):
            Path(block.mark.removeprefix("file: ")).write_text(block.text)
        elif block.language in ("sh", "python"):
            answered = block.is_run
            printed += outcome(block, namespace) if answered else ""
        elif block.language == "text" and answered:
            for line in block.text.splitlines():
                assert any(alike(line, other) for other in printed.splitlines()), (line, printed)


@pytest.mark.parametrize("page", HOW_TO, ids=lambda page: page.stem)
def test_a_how_to_does_what_it_says(page, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "docs" / "examples", tmp_path / "docs" / "examples")
    shutil.copytree(ROOT / "tests" / "data" / "campaigns" / "r01", tmp_path / "tests" / "data" / "campaigns" / "r01")
    monkeypatch.chdir(tmp_path)
    # A study's figures take longer than the study, and are drawn in tests of their own.
    monkeypatch.setattr(figures, "write", lambda lobes, folder, preload: [])
    follow(blocks(page))


def test_lines_are_alike_up_to_the_last_digit_of_their_numbers():
    assert alike("limit depths at this speed: 2.049 mm", "limit depths at this speed:  2.05 mm")
    assert alike("0.1,2,8.4381332,11000", "0.1,2,8.4381331,11000")
    assert not alike("limit depths at this speed: 2.049 mm", "limit depths at this speed: 2.1 mm")
    assert not alike("0.1,2,8.4381332,11000", "0.1,4,8.4381332,11000")


def test_the_page_on_own_effects_lists_every_arrow_and_every_unit_of_a_name():
    page = (ROOT / "docs" / "how_to" / "own_effect.md").read_text()
    arrows = re.findall(r"^\| .+? \| `(\w+)` \| `\((.+?)\)` -> ", page, re.MULTILINE)
    base = {field.name: field.default for field in fields(Stages) if field.name in ARROWS}
    assert arrows == [(name, ", ".join(inspect.signature(arrow).parameters)) for name, arrow in base.items()]
    units = re.findall(r"^\| `_(\w+)` \| `(.+?)`", page, re.MULTILINE)
    assert units == [(suffix, unit) for suffix, (_, unit) in SUFFIXES.items()]
