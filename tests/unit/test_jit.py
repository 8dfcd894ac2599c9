"""The compiler's cache on disk: kept where it can be, and no reason to fail where it is damaged or full."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

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


CALLED = """
from chatter_core.jit import compiled

@compiled
def twice(number):
    return {factor} * number
"""
CALLING = """
from called import twice
from chatter_core.jit import compiled

@compiled
def around(number):
    return twice(number)

print(around(21), sum(around.stats.cache_hits.values()))
"""


def test_what_a_compiled_function_calls_is_compiled_with_it(tmp_path):
    (tmp_path / "program.py").write_text(CALLING)
    (tmp_path / "called.py").write_text(CALLED.format(factor=2))
    assert run(tmp_path) == ("42", "0")
    assert run(tmp_path) == ("42", "1")
    (tmp_path / "called.py").write_text(CALLED.format(factor=10))
    assert run(tmp_path) == ("210", "0")
