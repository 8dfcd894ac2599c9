"""Docstrings of the physics lead to the page that explains them."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import chatter_core

PAGE = (Path(__file__).parents[2] / "docs" / "physics.md").read_text(encoding="utf-8")
#: Modules around the physics: names, units, errors, threads, what a user writes and measures.
NOT_PHYSICS = {"errors", "units", "variables", "machine", "reading", "method", "jit", "threads"} | {
    "campaign", "columns", "findings", "measured", "table", "uff",
}  # fmt: skip


def anchors() -> set[str]:
    """Return the anchors of the page's headings, as they are made from them."""
    headings = re.findall(r"^##+ (.+)$", PAGE, re.MULTILINE)
    return {re.sub(r"[^a-z0-9 -]", "", heading.lower()).replace(" ", "-") for heading in headings}


def functions() -> Iterator[tuple[str, str]]:
    """Yield name and docstring of every public function of the physics."""
    for module in pkgutil.walk_packages(chatter_core.__path__, "chatter_core."):
        if module.name.rpartition(".")[2] in NOT_PHYSICS:
            continue
        for name, member in inspect.getmembers(importlib.import_module(module.name), inspect.isfunction):
            if member.__module__ == module.name and not name.startswith("_"):
                yield f"{module.name}.{name}", inspect.getdoc(member) or ""


@pytest.mark.parametrize(("name", "doc"), [pytest.param(*pair, id=pair[0]) for pair in functions()])
def test_every_public_function_points_to_its_equations(name: str, doc: str) -> None:
    found = re.search(r"docs/physics\.md#([a-z0-9-]+)", doc)
    assert found, name
    assert found[1] in anchors()


def test_every_link_of_the_page_leads_somewhere() -> None:
    assert set(re.findall(r"\(#([a-z0-9-]+)\)", PAGE)) <= anchors()


def test_every_source_is_listed_and_used() -> None:
    listed = set(re.findall(r"^\| \[([A-Z][A-Z0-9]?)\]", PAGE, re.MULTILINE))
    body = PAGE.split("## Sources")[0]
    assert set(re.findall(r"\[([A-Z][A-Z0-9]?)\](?!\()", body)) == listed
