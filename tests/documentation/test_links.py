"""Every link of the repository's pages leads to a file that is there, and to a heading that it has."""

import re
from pathlib import Path

import pytest

from tests.documentation.commands import ROOT

PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\]\((?!https?:)([^)#\s]*)(?:#([^)\s]+))?\)")
#: Pages whose headings are written when the site is built; its links are followed there.
WRITTEN = ROOT / "docs" / "reference"


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as they are made from them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^a-z0-9 _-]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_a_page_lead_somewhere(page):
    for name, anchor in LINK.findall(page.read_text(encoding="utf-8")):
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), name
        if anchor and WRITTEN not in target.parents:
            assert anchor in anchors(target), f"{name}#{anchor}"
