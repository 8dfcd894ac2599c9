"""The card of a data set: what it is, what is in it, how it was chosen, how to load and to cite it."""

import html
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jinja2 import Environment, PackageLoader

from chatter_core.variables import CUT_STATUS, DATASET, DATASET_INPUTS
from pipeline.dataset_tables import numbered, stable_throughout
from pipeline.design import PARTS, Design

FILE = "card.md"


def write(data: xr.Dataset, counts: Mapping[str, int], output: Path) -> Path:
    """Write the card of a data set into a folder and return the path; counts: of cuts and speeds by status."""
    environment = Environment(loader=PackageLoader("pipeline"), autoescape=False, keep_trailing_newline=True)
    environment.filters["prose"] = prose
    path = output / FILE
    path.write_text(environment.get_template("dataset_card.md").render(**_told(data, counts)), encoding="utf-8")
    return path


def prose(text: str) -> str:
    """Return text as Markdown, and what shows it as HTML, have it: as it is written, whatever stands in it."""
    return re.sub(r"([\\`*_\[\]|~#])", r"\\\1", html.escape(text, quote=False))


def _told(data: xr.Dataset, counts: Mapping[str, int]) -> dict[str, Any]:
    attributes, speed = data.attrs, data["spindle_speed"].values
    design = Design.model_validate(attributes["settings"]["design"])
    sizes = np.bincount(data["split"].values, minlength=len(PARTS))
    words = attributes["input_words"]
    return {
        "title": attributes["title"],
        "machines": data.sizes["machine"],
        "cuts": data.sizes["cut"],
        "speeds": len(speed),
        "first_speed": f"{speed[0]:g}",
        "last_speed": f"{speed[-1]:g}",
        "deepest": f"{design.deepest:g}",
        "variables": [
            {"name": name, "dims": ", ".join(one.dims), "unit": one.unit or "of its key", "meaning": one.doc}
            for name, one in {**DATASET_INPUTS, **DATASET, "status": CUT_STATUS}.items()
        ],
        "counts": {name: count for name, count in counts.items() if count},
        "stable": int(stable_throughout(data).sum()),
        "inputs": _inputs(data, design),
        "formulas": {**design.machine.formulas, **design.cut.formulas},
        "constraints": [*design.machine.constraints, *design.cut.constraints],
        "sampling": design.sampling,
        "seed": design.seed,
        "parts": ", ".join(f"{part} {size} machines" for part, size in zip(PARTS, sizes, strict=True)),
        "words": "; ".join(f"`{key}` {prose(numbered(those))}" for key, those in words.items()) or "none",
        "licence": attributes["licence"],
        "version": attributes["versions"]["milling-chatter"],
        "code": attributes["code"],
        "fingerprint": attributes["fingerprint"][:16],
        "created": attributes["created"],
    }


def _inputs(data: xr.Dataset, design: Design) -> list[dict[str, str]]:
    """Return every input with its distribution and the range of what was drawn."""
    numbers = data["input"].values.reshape(-1, data.sizes["input_key"])
    found = []
    for place, (key, varied) in enumerate(design.varied.items()):
        said = varied.model_dump(exclude_none=True, exclude={"distribution"})
        how = ", ".join(f"{name} {_plain(value)}" for name, value in said.items())
        least, most = (varied.value(float(number)) for number in (numbers[:, place].min(), numbers[:, place].max()))
        range_ = f"{least:.6g} to {most:.6g}" if not isinstance(least, str) else "words"
        found.append({"key": key, "how": f"{varied.distribution}: {how}", "range": range_})
    return found


def _plain(value: Any) -> str:
    return " ".join(map(str, value)) if isinstance(value, tuple | list) else f"{value:g}"
