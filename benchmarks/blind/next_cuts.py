"""Whether the cut that a diagnosis asks for tells more than the next one of the shop: both are held against the truth.

``python -m benchmarks.blind.next_cuts FOLDER`` takes the calibration seeds of a folder that hide one effect and whose
answers are kept. The hidden effect and what was most probable beside it are fitted, the cut that would part them is
asked for and made on the true machine. Its label is worth the logarithm of how much more probable it is by the hidden
effect [nats]; so is that of every cut which the shop made by its own plan and kept back.
"""

import argparse
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks.blind.choosing import kept_cases
from benchmarks.blind.judgement import Case
from benchmarks.blind.kept_rows import keep_row, kept_rows
from benchmarks.blind.opening import truth_folder
from benchmarks.blind.program import planned
from benchmarks.blind.summary import markdown
from benchmarks.blind.tables import Rows, read_rows, write_rows
from benchmarks.blind.targets import mean_interval
from chatter_core.evidence import Comparison, base_model, calibrate, read_campaign
from chatter_core.evidence.belief import PRIORS
from chatter_core.evidence.campaign import planned_trials
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.next_trial import NextTrial, expected_chatter, next_trial
from chatter_core.evidence.pursuit import fit_hypothesis, ground
from chatter_core.parameters import Array
from chatter_core.units import si_factor
from pipeline.diagnosis import candidates_of
from pipeline.model_file import Content
from tests.hidden_effect.campaign import draw_shop
from tests.hidden_effect.hidden import thermal_history
from tests.hidden_effect.structure import Spindle
from tests.hidden_effect.trial import Condition, cut_trial

#: Folder of the rows that are kept, and the table's name.
TABLE = "next_cuts"


def rival_of(case: Case) -> str:
    """Return what was most probable beside the hidden effect."""
    others = {name: value for name, value in case.probabilities.items() if name not in case.effects}
    return max(others, key=lambda name: others[name])


def fitted(folder: Path, names: Sequence[str]) -> list[Hypothesis]:
    """Return hypotheses of single effects, or of nothing missing, fitted to a campaign."""
    comparison = Comparison(model=base_model(read_campaign(folder)))
    fit = calibrate(comparison, start=PRIORS.about(comparison.model).estimate)
    base = Hypothesis(candidates=(), comparison=comparison, fit=fit)
    nested, candidates = ground(base), candidates_of(comparison.model, Content())
    found = []
    for name in names:
        variants = [fit_hypothesis(comparison, [one], nested) for one in candidates if one.name == name]
        found.append(max(variants, key=lambda one: one.fit.log_evidence, default=base))
    return found


def label_of(seed: int, cut: NextTrial, speeds_before: Sequence[float]) -> bool:
    """Return whether a cut chatters on the true machine of a seed, after cuts at other speeds [rad/s]."""
    shop, order = draw_shop(seed), len(speeds_before)
    process = shop.papers.process
    condition = Condition(
        order=order,
        speed_rpm=cut.spindle_speed / si_factor("spindle_speed_rpm"),
        depth_m=cut.axial_depth,
        feed_per_tooth_m=process.feed_per_tooth_m,
        radial_immersion=process.radial_immersion,
        direction=process.direction,
    )
    warmed = thermal_history(shop.hidden, [*speeds_before, cut.spindle_speed])[-1]
    return cut_trial(Spindle(shop.truth, shop.hidden), condition, warmed).outcome == "chatter"


def worth(chatters: Any, by_truth: Any, by_rival: Any) -> Any:
    """Return what labels say for the truth [nats], of which both hypotheses expect chatter with some probability."""
    return np.where(chatters, np.log(by_truth / by_rival), np.log((1.0 - by_truth) / (1.0 - by_rival)))


def held_against(root: Path, case: Case) -> dict[str, Any]:
    """Return what the next cut of a seed was worth, and those that the shop made and kept back."""
    folder, truth = root / "campaigns" / str(case.seed), truth_folder(root, "campaigns", case.seed)
    rival, back = rival_of(case), read_rows(truth / "stability_test.csv")
    with threadpool_limits(1):
        both = fitted(folder, [*case.effects, rival])
        cut = next_trial(*both)
        assert cut is not None
        shown = _expected(both, back)
        made = sorted((*read_rows(folder / "stability.csv"), *back), key=lambda row: int(row["trial"]))
        speeds = [float(row["spindle_speed_rpm"]) * si_factor("spindle_speed_rpm") for row in made]
        asked = float(worth(label_of(case.seed, cut, speeds), *cut.probability))
    by_shop = worth(np.array([row["outcome"] == "chatter" for row in back]), *shown)
    return {
        "seed": case.seed,
        "hidden": case.effects[0],
        "rival": rival,
        "apart_nats": both[0].fit.log_evidence - both[1].fit.log_evidence,
        "expected_nats": cut.expected_gain,
        "asked_nats": asked,
        "kept_back_nats": float(by_shop.mean()),
        "kept_back_cuts": len(by_shop),
        "more_than": float((asked > by_shop).mean()),
    }


def _expected(hypotheses: Sequence[Hypothesis], cuts: Rows) -> list[Array]:
    """Return the probability by which each hypothesis expects each cut of a table to be called chatter, (cut,) each."""
    with tempfile.TemporaryDirectory() as scratch:
        plan = Path(scratch) / "plan.csv"
        write_rows(plan, planned(cuts))
        trials, order = planned_trials(plan, hypotheses[0].comparison.model.campaign.machine)
    return [expected_chatter(one, trials)[order] for one in hypotheses]


def keep(root: Path, case: Case, seed: int) -> str:
    """Compute and keep the row of a seed; return it in words."""
    row = held_against(root, case)
    keep_row(root, TABLE, seed, row)
    return f"asked {row['asked_nats']:+.2f}, kept back {row['kept_back_nats']:+.2f} nats"


def table(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Return the lines of a table: what a cut is worth that is asked for, and one of the shop's own [nats]."""
    groups = {
        "all": rows,
        "apart by 5 nats at most": [row for row in rows if abs(row["apart_nats"]) <= 5.0],
    }
    told = []
    for name, group in groups.items():
        cells = [_interval([row[key] for row in group]) for key in ("expected_nats", "asked_nats", "kept_back_nats")]
        told.append([name, str(len(group)), *cells, f"{np.mean([row['more_than'] for row in group]):.0%}"])
    header = ["hypotheses", "seeds", "expected of it", "the cut asked for", "a cut kept back", "is worth more than"]
    return markdown(header, told)


def _interval(values: Sequence[float]) -> str:
    mean, low, high = mean_interval(values)
    return f"{mean:.2f} ({low:.2f} to {high:.2f})"


def main() -> int:
    """Print the table; return 1 where there is nothing to try."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind.next_cuts", description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="seeds at once")
    said = parser.parse_args()
    root: Path = said.folder
    cases = [case for case, _ in kept_cases(root) if case.kind == "one"]
    cases = [case for case in cases if (root / "campaigns" / str(case.seed) / "stability.csv").exists()]
    if not cases:
        print(f"{root}: no diagnoses of calibration seeds that hide one effect are kept here")
        return 1
    rows = kept_rows(keep, [(root, case, case.seed) for case in cases], TABLE, said.workers)
    write_rows(root / f"{TABLE}.csv", rows)
    print("\n".join(table(rows)))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
