"""The site is built without a warning; all its links lead somewhere, and nothing is fetched from a network."""

import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from tests.documentation.commands import ROOT

#: What a browser fetches by itself: element -> attribute. A link of a page is followed by who wants to.
FETCHED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "object": "data"}


class Html(HTMLParser):
    """What a page is linked to, what it fetches, and the places in it that links lead to."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.fetched: set[str] = set()
        self.places: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = {key: value or "" for key, value in attrs}
        self.places |= {found["id"]} if "id" in found else set()
        self.links |= {found["href"]} if tag == "a" and "href" in found else set()
        self.fetched |= {found[FETCHED[tag]]} if found.get(FETCHED.get(tag, "")) else set()


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> dict[Path, Html]:
    """Every page of the site, built as ``make docs`` builds it."""
    folder = tmp_path_factory.mktemp("docs")
    words = ["--fail-on-warning", "--quiet", "--doctree-dir", str(folder / "doctrees"), "docs", str(folder / "site")]
    done = subprocess.run([sys.executable, "-m", "sphinx", *words], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    pages = (page for page in (folder / "site").rglob("*.html") if "_static" not in page.parts)
    return {page: Html(page) for page in pages}


def test_every_link_leads_to_a_place_of_a_page(site):
    assert len(site) > 20
    for page, html in site.items():
        for link in html.links | html.fetched:
            parts = urlsplit(link)
            if parts.scheme:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            assert target.exists(), (page.name, link)
            if parts.fragment and target in site:
                assert unquote(parts.fragment) in site[target].places, (page.name, link)


def test_nothing_is_fetched_from_a_network(site):
    for page, html in site.items():
        assert not [address for address in html.fetched if urlsplit(address).scheme not in ("", "data")], page.name
    (folder,) = {page.parent for page in site if page.name == "search.html"}
    for style in folder.rglob("*.css"):
        assert "url(http" not in style.read_text(encoding="utf-8").replace('"', "").replace("'", ""), style.name
