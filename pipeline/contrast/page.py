"""The page of two studies held against each other."""

import json
from pathlib import Path

from pipeline import page
from pipeline.contrast import findings, tables
from pipeline.contrast.contrasted import Contrast
from pipeline.contrast.lines import STUDIES
from pipeline.contrast.plots import contrast_plots
from pipeline.page import PageTable, provenance, table_of
from pipeline.plots import embed
from pipeline.settings import Margins

#: Rows of a table on the page; the CSV files hold all.
PAGE_ROWS = 24
CAPTIONS = {
    "limits": "Both studies at the speeds that are held against each other; the stars are the cuts that remove most.",
    "ratio": "Below one the second study chatters at smaller depths.",
    "changes": "Cells that both studies have, each by its own spectral radius.",
}


def write(html: Path, found: Contrast, margins: Margins, written: list[Path]) -> Path:
    """Write the page; written: tables that it offers. Returns its path."""
    first, second = found.studies
    verb = "sweep" if first.is_sweep else "dataset"
    page.write(
        html,
        "contrast.html",
        title="Two studies held against each other",
        subtitle=f"first: {first.place}; second: {second.place}",
        warnings=findings.warnings(found),
        findings=findings.findings(found),
        tables=_tables(found, margins),
        plots=embed(contrast_plots(found)),
        captions=CAPTIONS,
        **page.offered(written),
        opening=f"first: {first.place}, second: {second.place}",
        provenance=[
            (f"{name}: {what}", value)
            for name, one in zip(STUDIES, found.studies, strict=True)
            for what, value in provenance(one.attributes, verb)
        ],
        settings=json.dumps(
            {name: one.attributes["settings"] for name, one in zip(STUDIES, found.studies, strict=True)}, indent=1
        ),
    )
    return html


def _tables(found: Contrast, margins: Margins) -> list[PageTable]:
    made = {
        "What was asked otherwise": tables.settings_table(found),
        "Limit depths of the second over the first, line by line": tables.lines_table(found),
        "Where another mode dominates the boundary": tables.modes_table(found),
        f"Cuts that remove most, {margins}": tables.best_table(found),
    }
    return [table_of(title, table.head(PAGE_ROWS)) for title, table in made.items() if len(table)]
