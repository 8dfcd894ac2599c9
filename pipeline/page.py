"""Pages: a template filled in, with its pictures inside."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, select_autoescape


def write(page: Path, template: str, **values: Any) -> None:
    """Write a page of one of the templates; what stands in values does nothing to it."""
    environment = Environment(loader=PackageLoader("pipeline"), autoescape=select_autoescape())
    page.write_text(environment.get_template(template).render(**values), encoding="utf-8")


def embedded(pictures: Sequence[Path], captions: Mapping[str, str]) -> list[dict[str, str]]:
    """Return pictures as pages hold them, each with the caption of its name."""
    return [{"caption": captions[path.stem], "data": base64.b64encode(path.read_bytes()).decode()} for path in pictures]


def downloads(files: Sequence[Path]) -> list[dict[str, str]]:
    """Return files as pages hold them for whoever wants to keep them."""
    return [{"name": path.name, "data": base64.b64encode(path.read_bytes()).decode()} for path in files]
