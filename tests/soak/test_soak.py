"""A small soak: killed, resumed, and equal to what was never disturbed."""

from pathlib import Path

from tests.soak.harness import soak


def test_a_study_that_is_killed_and_resumed_is_the_undisturbed_one_bit_for_bit(tmp_path: Path) -> None:
    found = soak(tmp_path, speeds=100, kills=4, seed=3)
    assert len(found.kills) == 4
    assert found.passed, found
