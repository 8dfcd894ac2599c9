"""How far something is, where it takes long."""

import pytest

from pipeline import progress


@pytest.mark.parametrize(("patience", "told"), [(-1.0, "3 of 3 machines (100 %)"), (1e9, "")])
def test_how_far_something_is_is_shown_once_it_takes_long(monkeypatch, capsys, patience, told):
    monkeypatch.setattr(progress, "PATIENCE", patience)
    assert list(progress.watched("abc", 3, "machines")) == ["a", "b", "c"]
    err = capsys.readouterr().err
    assert err.startswith(told)
    assert bool(err) == bool(told)
