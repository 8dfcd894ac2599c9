"""The judgement written down: report.md, tables and figures."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from benchmarks.blind import figures, kept
from benchmarks.blind.ablations import ABLATIONS, WHOLE
from benchmarks.blind.judgement import MODELS, Case, confusion, is_sure_and_wrong, share_of
from benchmarks.blind.kept import DONE, Task
from benchmarks.blind.opening import case_of, predict_held_out, why_not_predicted
from benchmarks.blind.running import spread_calls
from benchmarks.blind.summary import (
    Row,
    by_kind,
    case_row,
    difference,
    group_table,
    markdown,
    row_of,
    rows_of,
    share_text,
    target_table,
)
from benchmarks.blind.tables import write_rows
from benchmarks.blind.targets import Target, mean_interval, targets

Tasks = dict[tuple[str, str], list[Task]]

GENERATED, OWN = "campaigns", "own_campaigns"


def write(root: Path, tasks: Tasks, workers: int) -> list[Path]:
    """Open the truth of all tasks, judge them, and write everything; return the paths.

    Raises ValueError when a diagnosis is not there yet.
    """
    missing = [str(task) for of in tasks.values() for task in of if not task.path.exists()]
    if missing:
        raise ValueError(f"the truth stays sealed: {len(missing)} diagnoses are not there, {missing[0]} first")
    opened = [(root, campaigns, task) for (campaigns, name), of in tasks.items() if name == WHOLE for task in of]
    spread_calls(predict_held_out, opened, workers)
    cases = {key: [case_of(root, key[0], task) for task in of] for key, of in tasks.items()}
    lines, rows = text_of(cases), table_of(cases)
    lines += _provenance([task for of in tasks.values() for task in of])
    for given in opened:
        if reason := why_not_predicted(*given):
            lines.append(f"- kept-back cuts not predicted: {given[-1]}: {reason}")
    paths, whole = [root / "report.md"], cases[GENERATED, WHOLE]
    paths[0].write_text("\n".join(lines) + "\n", encoding="utf-8")
    tables = {
        "table": rows,
        "targets": [_target_row(one) for one in targets(whole)],
        "cases": [case_row(one) for one in whole],
    }
    for name, of_it in tables.items():
        paths.append(root / f"{name}.csv")
        write_rows(paths[-1], of_it)
    drawn = {
        "reliability": figures.reliability_diagram,
        "confusion": figures.confusion_figure,
        "held_out_error": figures.error_figure,
    }
    for name, draw in drawn.items():
        paths.append(root / f"{name}.png")
        draw(whole).savefig(paths[-1], dpi=150)
    return paths


def table_of(cases: dict[tuple[str, str], list[Case]]) -> list[Row]:
    """Return the rows of table.csv: groups of whole campaigns, then the ablations by kind."""
    rows = rows_of(cases[GENERATED, WHOLE])
    for (campaigns, name), of in cases.items():
        if (campaigns, name) != (GENERATED, WHOLE):
            title = name if campaigns == GENERATED else "own model"
            rows += [row_of(title, kind, some) for kind, some in by_kind(of)]
    return rows


def text_of(cases: dict[tuple[str, str], list[Case]]) -> list[str]:
    """Return the lines of the report."""
    whole = cases[GENERATED, WHOLE]
    rows = rows_of(whole)

    def of_table(name: str) -> list[Row]:
        return [row for row in rows if row["table"] == name]

    return [
        "# Hidden effects, diagnosed blind",
        "",
        f"{len(whole)} campaigns of machines that hide nothing, one effect, two, or something without a name; seeds "
        f"{min(case.seed for case in whole)} to {max(case.seed for case in whole)}. What the words mean stands in "
        "docs/blind.md.",
        "",
        "## Targets",
        "",
        *target_table(targets(whole)),
        "",
        "Shares have Wilson's intervals, means and the calibration error those of cases drawn anew. An effect is worth",
        "5 nats where its own hypothesis gained them in the diagnosis that is judged.",
        "",
        *_section("By what is hidden", group_table("hidden", of_table("hidden"))),
        *_section("By strength, one effect", group_table("strength", of_table("strength"))),
        *_section("By kind of measurement", group_table("measured", of_table("data"))),
        *_section("Hidden against answered", _confusion_table(whole)),
        *_section("Ablations that must hurt", _ablations(cases)),
        *_section("The program's own model", _own(cases)),
    ]


def _section(title: str, lines: Sequence[str]) -> list[str]:
    return [f"## {title}", "", *lines, ""]


def _confusion_table(cases: Sequence[Case]) -> list[str]:
    names, columns, table = confusion(cases)
    told = [[name, *(str(count) if count else "" for count in row)] for name, row in zip(names, table, strict=True)]
    return markdown(["hidden", *columns], told)


def _ablations(cases: dict[tuple[str, str], list[Case]]) -> list[str]:
    """Return each ablation beside the same campaigns with everything."""
    whole = {case.seed: case for case in cases[GENERATED, WHOLE]}
    rows = []
    for (campaigns, name), of in cases.items():
        if campaigns == GENERATED and name != WHOLE and of:
            same = [whole[case.seed] for case in of]
            ablation = ABLATIONS[name]
            rows.append([name, f"everything, the same {len(of)}", "", *_ablation_numbers(same)])
            rows.append([name, ablation.text, ablation.expected, *_ablation_numbers(of)])
    if not rows:
        return ["None was asked for."]
    numbers = ["most probable is right", "an effect named", "named wrongly", "failed"]
    return markdown(["ablation", "measured", "must come of it", *numbers], rows)


def _ablation_numbers(cases: Sequence[Case]) -> list[str]:
    told = (
        share_of(cases, lambda case: case.first_is_right),
        share_of(cases, lambda case: case.verdict == "effect"),
        share_of(cases, is_sure_and_wrong),
        share_of(cases, lambda case: case.failed),
    )
    return [share_text(one.value, one.low, one.high) for one in told]


def _own(cases: dict[tuple[str, str], list[Case]]) -> list[str]:
    """Return how much easier campaigns of the program's own model are than those of the same seeds."""
    own = cases.get((OWN, WHOLE), [])
    if not own:
        return ["None was asked for."]
    seeds = {case.seed for case in own}
    same = [case for case in cases[GENERATED, WHOLE] if case.seed in seeds]
    first = [share_of(of, lambda case: case.first_is_right) for of in (own, same)]
    value, low, high = difference(first[0], first[1])
    rows = [
        ["most probable is right", *(share_text(one.value, one.low, one.high) for one in first),
         f"{100.0 * value:+.0f} ({100.0 * low:+.0f} to {100.0 * high:+.0f})"]
    ]  # fmt: skip
    for model in MODELS:
        means = [mean_interval([case.errors[model] for case in of if model in case.errors]) for of in (own, same)]
        gap = 100.0 * (means[0][0] - means[1][0])
        told = f"{gap:+.1f}" if np.isfinite(gap) else "-"
        rows.append([f"held-out outcome error, {model}", *(share_text(*one) for one in means), told])
    header = [f"the same {len(own)} seeds", "own model", "generator", "difference [percentage points]"]
    return markdown(header, rows)


def _provenance(tasks: Sequence[Task]) -> list[str]:
    """Return with what the answers were computed, and which failed."""
    answers = [kept.read(task.path) for task in tasks]
    programs = sorted({answer["program"] for answer in answers})
    now = kept.program_digest()
    lines = ["## Computed with", "", f"Program {', '.join(programs)} (digests of its sources); now {now}."]
    if len(programs) > 1 or programs != [now]:
        lines.append("Not all answers are of the program as it is now.")
    for task, answer in zip(tasks, answers, strict=True):
        if answer["state"] != DONE:
            lines.append(f"- failed: {task}: {answer['reason'].splitlines()[-1]}")
    return lines


def _target_row(target: Target) -> Row:
    return {
        "target": target.name,
        "at_least": "" if target.at_least is None else target.at_least,
        "at_most": "" if target.at_most is None else target.at_most,
        "measured": "" if np.isnan(target.value) else f"{target.value:.6g}",
        "low": "" if np.isnan(target.low) else f"{target.low:.6g}",
        "high": "" if np.isnan(target.high) else f"{target.high:.6g}",
        "count": target.count,
        "met": "" if target.met is None else target.met,
    }
