"""What pages tell a reader to type: their blocks in order, and the words of every command."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from pipeline.verbs import VERBS

ROOT = Path(__file__).parents[2]
#: Pages whose blocks are run as they stand.
HOW_TO = sorted((ROOT / "docs" / "how_to").glob("*.md"))
#: Pages for people who use the program or work on it.
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")), *HOW_TO]
#: What starts the program.
PROGRAM = re.compile(rf"(?:python -m pipeline|^\s*chatter(?= (?:{'|'.join(VERBS)}))) (.*)")
_BLOCK = re.compile(
    r"(?:<!-- (?P<mark>[^\n]*) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
#: Code of a page, in a block of its own, indented, or between backticks.
_CODE = re.compile(r"^```\w*\n(.*?)^```$|^    ([^\n]*)$|`([^`\n]+)`", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, its text, and what the comment above it says of it."""

    language: str
    text: str
    mark: str

    @property
    def is_run(self) -> bool:
        return not self.mark.startswith("not run: ")

    @property
    def lines(self) -> list[str]:
        """The commands of a block, each on one line."""
        return self.text.replace("\\\n", " ").splitlines()


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page that name their language."""
    found = _BLOCK.finditer(page.read_text(encoding="utf-8"))
    return [Block(one["language"], one["text"], one["mark"] or "") for one in found]


def words_of(line: str) -> list[str] | None:
    """Return the words of a line that starts the program, None of another one."""
    found = PROGRAM.search(line)
    return shlex.split(re.split(r" \| ", found[1])[0], comments=True) if found else None


def asked_for(page: Path, verb: str) -> list[str]:
    """Return the words of the command of a page with a verb; there must be one."""
    lines = (line for block in blocks(page) if block.language == "sh" for line in block.lines)
    (found,) = (words for line in lines if (words := words_of(line)) and words[0] == verb)
    return found


def answer_below(page: Path, verb: str) -> str:
    """Return the answer that a page quotes below its command with a verb."""
    found = blocks(page)
    (place,) = (n for n, block in enumerate(found) if any((words_of(line) or [""])[0] == verb for line in block.lines))
    return found[place + 1].text


def code(page: Path) -> Iterator[str]:
    """Yield every line of a page that is code."""
    text = re.sub(r"\\\n\s*", " ", page.read_text(encoding="utf-8"))
    for found in _CODE.finditer(text):
        yield from next(filter(None, found.groups()), "").splitlines()
