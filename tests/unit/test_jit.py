"""The compiler's cache on disk: kept where it can be, and no reason to fail where it is damaged or full."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from chatter_core.jit import compiled

PROGRAM = """
from chatter_core.jit import compiled

@compiled
def twice(number):
    return 2 * number

print(twice(21), sum(twice.stats.cache_hits.values()))
"""


def run(folder: Path) -> tuple[str, str]:
    program = folder / "program.py"
    if not program.exists():
        program.write_text(PROGRAM)
    done = subprocess.run(
        [sys.executable, str(program)],
        env={**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": str(Path(__file__).parents[2])},
        capture_output=True,
        text=True,
        check=True,
    )
    answer, hits = done.stdout.split()
    assert done.stderr == ""
    return answer, hits


@pytest.mark.parametrize(("ending", "kept"), [("nbc", 0), ("nbc", 40), ("nbi", 0), ("nbi", 40)])
def test_a_damaged_cache_is_made_again(tmp_path, ending, kept):
    assert run(tmp_path) == ("42", "0")
    assert run(tmp_path) == ("42", "1")
    for file in (tmp_path / "cache").rglob(f"*.{ending}"):
        file.write_bytes(file.read_bytes()[:kept])
    assert run(tmp_path) == ("42", "0")
    assert run(tmp_path) == ("42", "1")


def test_a_file_in_the_place_of_the_cache_is_no_reason_to_fail(tmp_path):
    (tmp_path / "cache").write_text("")
    assert run(tmp_path) == ("42", "0")


FIRST = """
FACTOR = {factor}

def unrelated(): ...
"""
SECOND = """
from chatter_core.jit import compiled
from parts.first import FACTOR, unrelated

@compiled
def twice(number):
    return FACTOR * number
"""
THIRD = """
from chatter_core.jit import compiled
from parts import second

@compiled
def around(number):
    return second.twice(number)
"""
CALLING = """
from parts.third import around

print(around(21), sum(around.stats.cache_hits.values()))
"""


def test_what_a_compiled_function_takes_from_other_files_is_compiled_anew_with_it(tmp_path):
    """A chain of three files; the change leaves size and time of the first as they were, as in an unpacked image."""
    (tmp_path / "parts").mkdir()
    (tmp_path / "program.py").write_text(CALLING)
    for name, text in (("first", FIRST.format(factor=2)), ("second", SECOND), ("third", THIRD)):
        (tmp_path / "parts" / f"{name}.py").write_text(text)
        os.utime(tmp_path / "parts" / f"{name}.py", (1e9, 1e9))
    assert run(tmp_path) == ("42", "0")
    assert run(tmp_path) == ("42", "1")
    (tmp_path / "parts" / "first.py").write_text(FIRST.format(factor=9))
    os.utime(tmp_path / "parts" / "first.py", (1e9, 1e9))
    # Python's own cache looks at size and time alone.
    shutil.rmtree(tmp_path / "parts" / "__pycache__", ignore_errors=True)
    assert run(tmp_path) == ("189", "0")


def test_what_has_no_file_is_compiled_all_the_same():
    space = {"__name__": None, "odd": type("Odd", (), {"__module__": ["no name"]})()}
    exec("def twice(number): return 2 * number", space)
    assert compiled(space["twice"])(21) == 42
