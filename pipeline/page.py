"""Pages: a template filled in, with its pictures inside."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jinja2 import Environment, PackageLoader, select_autoescape

from pipeline.telling import command

#: Bytes of tables that a page offers together.
DOWNLOADS = 600_000


@dataclass(frozen=True, kw_only=True)
class PageTable:
    """Table on a page."""

    title: str
    columns: list[str]
    rows: list[list[str]]


def cell(value: Any) -> str:
    """Return a value as a table on a page has it: numbers of at most five digits, nothing for one that is not known."""
    if not isinstance(value, float | np.floating):
        return str(value)
    return "" if np.isnan(value) else f"{value:.5g}"


def table_of(title: str, frame: pd.DataFrame) -> PageTable:
    """Return a table as a page has it."""
    columns = [str(name).replace("_", " ") for name in frame.columns]
    # By columns: a row of mixed types would turn its whole numbers into others.
    cells = [[cell(value) for value in frame[name]] for name in frame.columns]
    return PageTable(title=title, columns=columns, rows=[list(row) for row in zip(*cells, strict=True)])


def provenance(attributes: Mapping[str, Any], verb: str) -> list[tuple[str, str]]:
    """Return where a store comes from, as a page tells it; verb: that computed it."""
    versions = ", ".join(f"{name} {number}" for name, number in attributes["versions"].items())
    return [
        ("fingerprint", attributes["fingerprint"]),
        ("command", command(verb, *attributes["command"])),
        ("code", attributes["code"]),
        ("versions", versions),
        ("platform", attributes["platform"]),
        *((f"run {i}", line) for i, line in enumerate(attributes["history"], start=1)),
    ]


def write(page: Path, template: str, **values: Any) -> None:
    """Write a page of one of the templates; what stands in values does nothing to it."""
    environment = Environment(loader=PackageLoader("pipeline"), autoescape=select_autoescape())
    page.write_text(environment.get_template(template).render(**values), encoding="utf-8")


def embedded(pictures: Sequence[Path], captions: Mapping[str, str]) -> list[dict[str, str]]:
    """Return pictures as pages hold them, each with the caption of its name."""
    return [{"caption": captions[path.stem], "data": base64.b64encode(path.read_bytes()).decode()} for path in pictures]


def offered(written: Sequence[Path]) -> dict[str, Any]:
    """Return what a page offers of the tables beside it: short ones as downloads, longer ones by their names."""
    short = [path for path in written if path.stat().st_size <= DOWNLOADS / len(written)]
    return {"downloads": downloads(short), "beside": [path.name for path in written if path not in short]}


def downloads(files: Sequence[Path]) -> list[dict[str, str]]:
    """Return files as pages hold them for whoever wants to keep them."""
    return [{"name": path.name, "data": base64.b64encode(path.read_bytes()).decode()} for path in files]
