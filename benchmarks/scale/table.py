"""The tables of what was measured, and what a thousand million cells cost by it."""

from collections.abc import Iterator
from typing import Any

#: Phases of a study with what each is of, in the order in which they come.
PHASES = {
    "created": ("created", "creation: bearing and modes at every speed"),
    "start": ("compute", "start: which chunks are missing"),
    "run": ("compute", "run: handing out, beside the workers"),
    "end": ("compute", "end: closing the workers and the store"),
    "resume": ("resume", "resume of a finished store"),
    "status": ("status", "status"),
    "verify": ("verify", "verify: every byte read back"),
    "report": ("report", "report"),
}
CELLS = 1e9


def lines(found: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of all tables."""
    sizes = [size for size in found if size.isdigit()]
    yield from _driver(found, sizes, "Peak memory of the process, MiB", lambda cost, _: f"{cost['peak_mib']:.0f}")
    yield from _driver(
        found,
        sizes,
        "Processor time of the process, ms a chunk",
        lambda cost, n: f"{1e3 * cost['processor_seconds'] / n:.2f}",
    )
    yield from _driver(found, sizes, "Time, ms a chunk", lambda cost, n: f"{1e3 * cost['seconds'] / n:.2f}")
    yield from _header("Files", sizes)
    for key, label in (
        ("files", "files a chunk"),
        ("inodes", "files and folders a chunk"),
        ("bytes_on_disk", "bytes a chunk takes on the disk"),
    ):
        yield _row(label, [f"{found[size]['files'][key] / int(size):.1f}" for size in sizes])
    if found.get("physics"):
        yield from _physics(found["physics"])
        yield from _billion(found, sizes[-1])


def _driver(found: dict[str, Any], sizes: list[str], title: str, told: Any) -> Iterator[str]:
    """Yield a table of phases over sizes."""
    yield from _header(title, sizes)
    for name, (phase, label) in PHASES.items():
        cells = []
        for size in sizes:
            cost = found[size][phase].get(name, found[size][phase])
            cells.append(told(cost, found[size]["compute"]["computed"] if name == "run" else int(size)))
        yield _row(label, cells)


def _header(title: str, sizes: list[str]) -> Iterator[str]:
    yield from ("", _row(title, [f"{int(size):_} chunks".replace("_", " ") for size in sizes]))
    yield _row("---", ["---:"] * len(sizes))


def _row(label: str, cells: list[str]) -> str:
    return f"| {label} | {' | '.join(cells)} |"


def _physics(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Yield a table of what a chunk of the reference machine costs."""
    yield from ("", "| Cells of a chunk | evaluated | seconds of a core | cells a second | bytes a cell | files |")
    yield "| ---: | --- | ---: | ---: | ---: | ---: |"
    for row in rows:
        rate, size = row["cells"] / row["seconds"], row["bytes"] / row["cells"]
        yield f"| {row['cells']} | {row['which']} | {row['seconds']:.2f} | {rate:.0f} | {size:.1f} | {row['files']} |"


def _billion(found: dict[str, Any], largest: str) -> Iterator[str]:
    """Yield a table of what so many cells cost: cores by the chunks of the reference machine, the driver by a study."""
    study, chunks = found[largest], int(largest)
    start, end, verify = (
        study[phase].get(name, study[phase])["processor_seconds"] / chunks
        for phase, name in (("compute", "start"), ("compute", "end"), ("verify", ""))
    )
    run = study["compute"]["run"]["processor_seconds"] / study["compute"]["computed"]
    yield from ("", f"| {CELLS:.0e} cells in chunks of | " + " | ".join(_BILLION) + " |")
    yield _row("---", ["---:"] * len(_BILLION))
    for row in found["physics"]:
        number, each = CELLS / row["cells"], row["seconds"]
        yield _row(
            f"{row['cells']}, {row['which']}",
            [
                f"{number:.0f}",
                f"{number * each / 3600.0:.0f}",
                f"{number * run / 3600.0:.1f}",
                f"{each / run:.0f}",
                f"{number * (start + end) / 60.0:.0f}",
                f"{number * verify / 3600.0:.1f}",
                f"{number * row['files'] / 1e6:.1f}",
                f"{number * row['bytes'] / 1e9:.0f}",
            ],
        )


_BILLION = (
    "chunks",
    "core hours",
    "driver's hours",
    "workers that one driver keeps busy",
    "minutes of start and end",
    "hours of verify",
    "million files",
    "GB",
)
