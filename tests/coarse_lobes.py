"""Lobes of campaigns drawn coarsely, for the tests of folders whose ``conftest.py`` takes this in."""

from collections.abc import Iterator
from functools import partial

import pytest

from pipeline import pieces


@pytest.fixture(scope="session", autouse=True)
def drawn_coarsely() -> Iterator[None]:
    """Let the lobes of campaigns be drawn coarsely in this process: no number hangs on them, and they take long."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(pieces, "sure_field", partial(pieces.sure_field, grid=(40, 12)))
        patched.setattr(pieces, "deviation", partial(pieces.deviation, grid=(40, 12), coarse_grid=(20, 6)))
        yield
