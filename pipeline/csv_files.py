"""Tables as CSV files."""

from collections.abc import Mapping
from pathlib import Path

import pandas as pd


def write(tables: Mapping[str, pd.DataFrame], folder: Path) -> list[Path]:
    """Write tables into a folder, each under its name, and return the paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = {name: folder / f"{name}.csv" for name in tables}
    for name, table in tables.items():
        table.to_csv(paths[name], index=False, float_format="%.8g")
    return list(paths.values())
