"""The entry of the command line, before any module of it is loaded."""

import sys
from importlib.machinery import ModuleSpec

import pytest

from pipeline import __main__ as entry

COMMAND_LINE = "pipeline.command_line"


class StoppedThere:
    """Ctrl-C while the command line is being loaded."""

    def find_spec(self, name: str, *where: object) -> ModuleSpec | None:
        if name == COMMAND_LINE:
            raise KeyboardInterrupt
        return None


def test_ctrl_c_while_modules_are_loaded_ends_with_a_word(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delitem(sys.modules, COMMAND_LINE, raising=False)
    monkeypatch.setattr(sys, "meta_path", [StoppedThere(), *sys.meta_path])
    assert entry.main() == 130
    assert capsys.readouterr().err == "stopped at once\n"


def test_a_command_has_the_exit_code_of_what_it_asks_for(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["chatter", "no_such_verb"])
    assert entry.main() == 2
    assert "no_such_verb" in capsys.readouterr().err
