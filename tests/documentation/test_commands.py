"""Every command on every page is one that the program understands: its words are read, and nothing is computed."""

import os
import re
import subprocess

import pytest

from pipeline import dataset, sweep
from pipeline.configuration import sort_words
from pipeline.verbs import VERBS
from tests.documentation.commands import PAGES, ROOT, code, words_of

EXAMPLES = ROOT / "docs" / "examples"
#: What stands for files and names that the reader has.
OF_THE_READER = {
    "machine": EXAMPLES / "notebooks" / "machine.yaml",
    "design": ROOT / "configs" / "design" / "sensitivity.yaml",
    "effects_path": EXAMPLES / "own_effects",
    "study": "reference",
}
#: Verbs whose words make the settings of a study.
STUDIES = {"sweep": sweep, "dataset": dataset}
COMMANDS = {
    f"{page.stem}: {' '.join(words)}": words for page in PAGES for line in code(page) if (words := words_of(line))
}
#: What make hands on to the commands that it runs, and variables that its own command line may set.
OF_MAKE = {"MAKEFLAGS", "MAKELEVEL", "MFLAGS", "MAKEOVERRIDES", "ARGS", "STUDY", "CAMPAIGN", "SEEDS", "FOLDER"}
MADE = sorted({found[1] for page in PAGES for line in code(page) if (found := re.match(r"\s*(make [a-z].*)", line))})


def with_own_files(word: str) -> str:
    """Return a word with something that is there in the place of what the reader has."""
    key, _, value = word.partition("=")
    own = value.endswith(".yaml") or value == "NAME" or key == "effects_path"
    return f"{key}={OF_THE_READER[key]}" if own and key in OF_THE_READER else word


def assert_understood(words: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Raise InvalidInput where the program would not take these words; studies are composed, and not computed."""
    verb, rest = words[0], [with_own_files(word) for word in words[1:] if word not in ("||", "true")]
    if verb in STUDIES:
        monkeypatch.setattr(STUDIES[verb], "execute_words", lambda *args, **options: 0)
        assert STUDIES[verb].run(rest) == 0
    else:
        sort_words(rest, tuple(VERBS[verb].fields()))


@pytest.mark.parametrize("words", COMMANDS.values(), ids=COMMANDS.keys())
def test_words_of_a_page_are_understood(words, monkeypatch):
    monkeypatch.chdir(ROOT)
    if words == ["--help"] or "VERB" in words:
        return
    assert_understood(words, monkeypatch)


@pytest.mark.parametrize("line", MADE)
def test_targets_of_a_page_are_there_and_run_what_is_understood(line, monkeypatch):
    monkeypatch.chdir(ROOT)
    target, *rest = re.split(r"\s+#|\s{2,}", line.strip("`"))[0].removeprefix("make ").split(" ", 1)
    command = f"make --dry-run {target} {' '.join(rest)}"
    # What the tests themselves were called with by make is not the page's.
    own = {name: value for name, value in os.environ.items() if name not in OF_MAKE}
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, env=own)
    assert done.returncode == 0, done.stderr
    for made in done.stdout.replace("\\\n", " ").splitlines():
        if (words := words_of(made)) is not None:
            assert_understood(words, monkeypatch)
