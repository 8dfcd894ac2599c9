"""Measure speed and error side by side and write a table: ``python -m benchmarks [output=FILE]``."""

import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

from benchmarks import points, tasks
from benchmarks.cases import cases


def main(words: list[str]) -> int:
    """Measure, print and write the tables."""
    output = Path(dict(word.split("=", 1) for word in words).get("output", "results/bench.md"))
    lines: list[str] = []

    def tell(*new: str) -> None:
        lines.extend(new)
        print("\n".join(new), flush=True)

    with threadpool_limits(1):
        tell(*points.HEADER)
        for case in cases():
            tell(*points.rows_of(case))
        tell("", *points.floor_lines(), "", *points.growth_lines())
        tell("", *tasks.single_lines())
    tell("", *tasks.study_lines())
    output.parent.mkdir(parents=True, exist_ok=True)
    output.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"written: {output}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
