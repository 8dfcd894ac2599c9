"""What other tempers, priors and thresholds would have answered, from kept diagnoses and without a fit.

``python -m benchmarks.blind.choosing FOLDER [--temper 0.3 0.5] [--nothing-missing 2 3] [--named 0.8] ...`` prints a
grid for the calibration seeds and those of the first test, which are spent; those of later ones it does not read. The
program's own rules are asked, ``rank`` and ``decide``, with other numbers in place of their constants. Pairs stand
where the diagnosis tried some: where it did not, other numbers cannot bring one forth.
"""

import argparse
import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np

from benchmarks.blind import kept
from benchmarks.blind.ablations import WHOLE
from benchmarks.blind.judgement import (
    NOTHING,
    Case,
    calibration_error,
    is_sure_and_wrong,
    reliability,
    stated_probability,
    stating,
    word_of,
)
from benchmarks.blind.kept import DONE
from benchmarks.blind.opening import case_of
from benchmarks.blind.summary import markdown
from benchmarks.blind.tables import write_rows
from chatter_core.evidence import ranking, verdict
from tests.hidden_effect.design import CALIBRATION_SEEDS, TEST_SEEDS

#: No probability counts as less than this in a log score: one case must not decide.
LEAST = 1e-4


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """What can be chosen without fitting again; by the names of the program's constants, in lower case."""

    temper: float = ranking.TEMPER
    nothing_missing: float = ranking.NOTHING_MISSING
    named: float = verdict.NAMED
    tied_together: float = verdict.TIED_TOGETHER
    nothing_named: float = verdict.NOTHING_NAMED
    pair_gain: float = verdict.PAIR_GAIN
    pair_lead: float = verdict.PAIR_LEAD
    outstanding: float = verdict.OUTSTANDING
    gross_chance: float = verdict.GROSS_CHANCE
    check_chance: float = verdict.CHECK_CHANCE
    seen_share: float = verdict.SEEN_SHARE
    enough: float = verdict.ENOUGH

    @contextmanager
    def in_force(self) -> Iterator[None]:
        """Let the program's rules use these numbers."""
        with ExitStack() as stack:
            for name, value in vars(self).items():
                module = ranking if name in ("temper", "nothing_missing") else verdict
                stack.enter_context(mock.patch.object(module, name.upper(), value))
            yield


@dataclass(frozen=True, kw_only=True)
class Replayed:
    """What a diagnosis would have answered: kind and names of the verdict, and the probabilities."""

    verdict: str
    missing: tuple[str, ...]
    probabilities: dict[str, float]


def replay(answer: dict[str, Any], numbers: Numbers) -> Replayed:
    """Return what a kept diagnosis answers with other numbers."""
    document = answer["document"]
    singles = [_hypothesis(one["effect"], one["score"]) for one in document["ranking"]]
    powers = [
        SimpleNamespace(candidate=SimpleNamespace(name=row["effect"]), nats=row["nats"]) for row in document["power"]
    ]
    left = defaultdict(
        # What was not held against the campaign is not known to pass.
        lambda: [SimpleNamespace(chance=0.0, text="")],
        {
            name: [SimpleNamespace(chance=chance, text="") for chance in chances]
            for name, chances in answer["chances"].items()
        },
    )
    tried = [] if document["pair"] is None else [document["pair"], *document.get("other_pairs", [])]
    pairs: Any = [
        SimpleNamespace(
            name=one["effect"], gain=one["score"], best=SimpleNamespace(names=tuple(one["effect"].split(" + ")))
        )
        for one in tried
    ]
    with numbers.in_force():
        ranked: Any = ranking.rank(_hypothesis("", 0.0), singles)
        found = verdict.decide(ranked, pairs, powers, left)  # type: ignore[arg-type]
    return Replayed(
        verdict=found.kind,
        missing=tuple(found.missing),
        probabilities={one.name: one.probability for one in ranked},
    )


def _hypothesis(name: str, gain: float) -> Any:
    """Return what ``rank`` looks at of a hypothesis; its evidence over the base model's."""
    return SimpleNamespace(name=name, names=(name,), fit=SimpleNamespace(log_evidence=gain))


def replayed(case: Case, answer: dict[str, Any], numbers: Numbers) -> Case:
    """Return a case with the answer that it would have had."""
    found = replay(answer, numbers)
    return replace(case, verdict=found.verdict, missing=found.missing, probabilities=found.probabilities)


def log_score(cases: Sequence[Case]) -> float:
    """Return the mean log probability of what is hidden [nats]; what has no name is out, of two either counts.

    Source: I. J. Good, J. R. Stat. Soc. B 14 (1952) 107-114.
    """
    scores = []
    for case in cases:
        if case.kind != "foreign":
            probability = sum(case.probabilities.get(name, 0.0) for name in case.effects or (NOTHING,))
            scores.append(np.log(max(probability, LEAST)))
    return float(np.mean(scores)) if scores else np.nan


def measures(cases: Sequence[Case]) -> dict[str, float]:
    """Return what is chosen by: log score, calibration error, and how many answers are worth what."""
    said = stating(cases)
    bins = reliability([stated_probability(case) for case in said], [case.first_is_right for case in said])
    words = [word_of(case) for case in cases]
    return {
        "log_score": log_score(cases),
        "calibration_error": calibration_error(bins),
        "right": words.count("right"),
        "wrong_of_named": sum(is_sure_and_wrong(case) for case in cases if case.kind in ("one", "two")),
        "false_positives": sum(is_sure_and_wrong(case) for case in cases if case.kind == "none"),
        "wrong_of_foreign": sum(is_sure_and_wrong(case) for case in cases if case.kind == "foreign"),
        "near": words.count("near"),
        "tied": words.count("tied"),
        "unexplained_wrongly": words.count("unexplained"),
        "underpowered": words.count("underpowered"),
        "missed": words.count("missed"),
    }


def grid(cases: Sequence[tuple[Case, dict[str, Any]]], choices: dict[str, list[float]]) -> list[dict[str, float]]:
    """Return a row for every combination of numbers: the numbers that are chosen among, and the measures."""
    rows = []
    for values in itertools.product(*choices.values()):
        chosen = dict(zip(choices, values, strict=True))
        numbers = Numbers(**chosen)
        rows.append({**chosen, **measures([replayed(case, answer, numbers) for case, answer in cases])})
    return rows


def disagreeing(cases: Sequence[tuple[Case, dict[str, Any]]]) -> list[int]:
    """Return the seeds whose answer cannot be had again with the program's own numbers.

    Those were diagnosed with other numbers, or by another program.
    """
    found = []
    for case, answer in cases:
        again = replayed(case, answer, Numbers())
        stated = [again.probabilities[name] - case.probabilities[name] for name in case.probabilities]
        if (again.verdict, again.missing) != (case.verdict, case.missing) or np.abs(stated).max() > 1e-9:
            found.append(case.seed)
    return found


def kept_cases(root: Path) -> list[tuple[Case, dict[str, Any]]]:
    """Return cases and answers of the seeds to choose by that are kept in a folder, but for failed ones."""
    found = []
    for seed in (*CALIBRATION_SEEDS, *TEST_SEEDS):
        task = kept.task_of(root, "campaigns", seed, WHOLE)
        if task.path.exists() and (answer := kept.read(task.path))["state"] == DONE:
            found.append((case_of(root, "campaigns", task), answer))
    return found


def main() -> int:
    """Print the grid; return 1 where there is nothing to choose by."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind.choosing", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    for name, value in vars(Numbers()).items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=float, nargs="+", default=[value])
    arguments = vars(parser.parse_args())
    root = arguments.pop("folder")
    cases = kept_cases(root)
    if not cases:
        print(f"{root}: no diagnoses of seeds to choose by are kept here")
        return 1
    if differing := disagreeing(cases):
        print(f"not as the program answers now: {', '.join(map(str, differing))}")
    rows = grid(cases, arguments)
    print(f"{len(cases)} campaigns")
    print("\n".join(markdown(list(rows[0]), [[f"{value:.4g}" for value in row.values()] for row in rows])))
    write_rows(root / "choosing.csv", rows)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
