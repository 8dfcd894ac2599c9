"""Settings of small sweeps."""

import pytest

from pipeline.configuration import compose_settings, sort_words


def settings_of(*words: str):
    return compose_settings(sort_words(list(words), ()))


@pytest.fixture
def small():
    """13 speeds x 12 depths x 2 mode counts x 2 kinds of parameters in chunks of 3 speeds, serial."""
    return settings_of("study=smoke", "cluster=serial", "cluster.cells_per_task=36")
