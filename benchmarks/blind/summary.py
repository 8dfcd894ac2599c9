"""Tables of a judgement: what answers are worth, by group of campaigns."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from benchmarks.blind.judgement import MODELS, STRENGTHS, WORDS, Case, Share, share_of, word_of
from benchmarks.blind.targets import Target

Row = dict[str, Any]
Group = tuple[str, list[Case]]


def by_effect(cases: Sequence[Case]) -> list[Group]:
    """Return cases by what is hidden: nothing, each effect, two, and each thing that has no name."""
    names: dict[str, list[Case]] = {}
    for case in cases:
        name = {"none": "nothing", "two": "two effects"}.get(case.kind) or case.effects[0]
        names.setdefault(f"{name} (no name)" if case.kind == "foreign" else name, []).append(case)
    order = {"none": 0, "one": 1, "two": 2, "foreign": 3}
    return sorted(names.items(), key=lambda group: (order[group[1][0].kind], group[0]))


def by_strength(cases: Sequence[Case]) -> list[Group]:
    """Return the cases that hide one effect, by its strength."""
    one = [case for case in cases if case.kind == "one"]
    return [(level, [case for case in one if case.level == level]) for level in STRENGTHS]


def by_data(cases: Sequence[Case]) -> list[Group]:
    """Return cases by the kind of measurement."""
    return _by(cases, lambda case: case.data)


def by_kind(cases: Sequence[Case]) -> list[Group]:
    """Return cases by how much is hidden."""
    return _by(cases, lambda case: case.kind)


def _by(cases: Sequence[Case], key: Callable[[Case], str]) -> list[Group]:
    return [(name, [case for case in cases if key(case) == name]) for name in sorted({key(case) for case in cases})]


def row_of(table: str, name: str, cases: Sequence[Case]) -> Row:
    """Return a row: how many, the share whose most probable answer is right, and how many answers are worth what."""
    first = share_of(cases, lambda case: case.first_is_right)
    words = [word_of(case) for case in cases]
    return {
        "table": table,
        "group": name,
        "count": len(cases),
        "most_probable_right": first.value,
        "low": first.low,
        "high": first.high,
        **{word: words.count(word) for word in WORDS},
    }


def rows_of(cases: Sequence[Case]) -> list[Row]:
    """Return the rows of all tables of whole campaigns."""
    tables = {"hidden": by_effect, "strength": by_strength, "data": by_data}
    return [
        row_of(table, name, of) for table, groups in tables.items() for name, of in groups(cases) if of
    ]  # fmt: skip


def case_row(case: Case) -> Row:
    """Return the row of a campaign: what is hidden, what was answered, and how its models err on cuts kept back.

    None stands where there is nothing to say.
    """
    return {
        "seed": case.seed,
        "hidden": " + ".join(case.effects),
        "strength": case.strength,
        "label_flips": case.flips,
        "data": case.data,
        "verdict": case.verdict,
        "missing": " + ".join(case.missing),
        "worth": word_of(case),
        "most_probable": case.first,
        "probability": case.probabilities.get(case.first),
        **{f"error_{model}": case.errors.get(model) for model in MODELS},
        **{f"amplitudes_{word}": _amplitudes(case, held=held) for word, held in (("held", True), ("missed", False))},
        "evaluations": case.evaluations,
        "processor_s": case.processor_s,
    }


def _amplitudes(case: Case, *, held: bool) -> str:
    """Return which shared amplitudes have an interval that holds the truth, or has missed it."""
    return " ".join(name for name, covered in case.covered.items() if covered is held)


def markdown(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    line = "| " + " | ".join(header) + " |"
    return [line, "|" + " --- |" * len(header), *("| " + " | ".join(row) + " |" for row in rows)]


def group_table(title: str, rows: Sequence[Row]) -> list[str]:
    """Return the lines of a table of groups."""
    header = [title, "campaigns", "most probable is right", *(word.replace("_", " ") for word in WORDS)]
    told = [
        [
            row["group"],
            str(row["count"]),
            share_text(row["most_probable_right"], row["low"], row["high"]),
            *(str(row[word]) if row[word] else "" for word in WORDS),
        ]
        for row in rows
    ]
    return markdown(header, told)


def target_table(found: Sequence[Target]) -> list[str]:
    """Return the lines of the table of targets."""
    rows = [
        [one.name, wanted(one), number(one.value, one), f"{number(one.low, one)} to {number(one.high, one)}",
         str(one.count), {True: "yes", False: "no", None: ""}[one.met]]
        for one in found
    ]  # fmt: skip
    return markdown(["target", "wanted", "measured", "95 % interval", "of", "met"], rows)


def wanted(target: Target) -> str:
    """Return what is wanted of a number."""
    limits = ((">=", target.at_least), ("<=", target.at_most))
    return ", ".join(f"{sign} {number(value, target)}" for sign, value in limits if value is not None)


def number(value: float, target: Target) -> str:
    """Return a number of a target."""
    if not np.isfinite(value):
        return "-"
    return f"{100.0 * value:.1f} %" if target.percent else f"{value:.0f}"


def share_text(value: float, low: float, high: float) -> str:
    """Return a share in percent, with its interval."""
    return "-" if not np.isfinite(value) else f"{100.0 * value:.0f} % ({100.0 * low:.0f} to {100.0 * high:.0f})"


def difference(one: Share, other: Share) -> tuple[float, float, float]:
    """Return the difference of two independent shares and its interval from those of both (Newcombe's).

    Source: R. G. Newcombe, Stat. Med. 17 (1998) 873-890, method 10.
    """
    value = one.value - other.value
    below = np.hypot(one.value - one.low, other.high - other.value)
    above = np.hypot(one.high - one.value, other.value - other.low)
    return value, value - below, value + above
