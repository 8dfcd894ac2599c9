"""What pages tell a reader to type: their blocks in order, and the words of every command."""

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
#: Pages whose blocks are run as they stand.
HOW_TO = sorted((ROOT / "docs" / "how_to").glob("*.md"))
#: Pages for people who use the program or work on it.
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")), *HOW_TO]
#: What starts the program.
PROGRAM = re.compile(r"(?:python -m pipeline|chatter) (.*)")
_BLOCK = re.compile(r"(?:<!-- (?P<mark>[^\n]*) -->\n)?^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
#: Code of a page, in a block of its own, indented, or between backticks.
_CODE = re.compile(r"^```\w*\n(.*?)^```$|^    (.*)$|`([^`\n]+)`", re.MULTILINE | re.DOTALL)


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
    return shlex.split(found[1], comments=True) if found else None


def code(page: Path) -> Iterator[str]:
    """Yield every line of a page that is code."""
    text = re.sub(r"\\\n\s*", " ", page.read_text(encoding="utf-8"))
    for found in _CODE.finditer(text):
        yield from next(filter(None, found.groups()), "").splitlines()
