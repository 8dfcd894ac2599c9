"""The truth is opened: what is kept of a diagnosis, beside what was hidden, makes a case."""

import json
from pathlib import Path
from typing import Any

from benchmarks.blind import kept, program, shared_amplitudes
from benchmarks.blind.judgement import NOTHING, Case, balanced_error
from benchmarks.blind.kept import FAILED, Task
from benchmarks.blind.tables import read_rows

Data = dict[str, Any]

TRUTHS = {"campaigns": "truth", "own_campaigns": "own_truth"}


def truth_folder(root: Path, campaigns: str, seed: int) -> Path:
    """Return the folder that holds the truth of a campaign."""
    return root / TRUTHS[campaigns] / str(seed)


def case_of(root: Path, campaigns: str, task: Task) -> Case:
    """Return the case of a task."""
    answer = kept.read(task.path)
    seed = answer["seed"]
    truth = json.loads((truth_folder(root, campaigns, seed) / "truth.json").read_text(encoding="utf-8"))
    strengths = truth["strengths"]
    known: Data = {
        "seed": seed,
        "kind": truth["kind"],
        "effects": tuple(truth["effect_names"] or truth["foreign"]),
        "strength": sum(strengths) / len(strengths) if strengths else None,
        "flips": truth.get("label_flips", 0.0),
        "data": data_of(task.campaign),
    }
    if answer["state"] == FAILED:
        return Case(**known)
    document = answer["document"]
    ranking = {one["effect"]: one for one in document["ranking"]}
    shared = ranking.get(truth["effect_names"][0]) if truth["kind"] == "one" else None
    return Case(
        **known,
        verdict=document["verdict"],
        missing=tuple(document["missing"]),
        probabilities={
            NOTHING: document["probability_of_none"], **{name: one["probability"] for name, one in ranking.items()}
        },
        gains={name: one["score"] for name, one in ranking.items()},
        covered=shared_amplitudes.covered(truth, shared) if shared else {},
        errors=held_out_errors(root, campaigns, task, answer),
        evaluations=answer["evaluations"],
        processor_s=answer["processor_s"],
    )  # fmt: skip


def data_of(folder: Path) -> str:
    """Return the kind of measurement of a campaign, by its files alone."""
    if (folder / "frf.csv").exists():
        rotating = any(float(row["spindle_speed_rpm"]) > 0.0 for row in read_rows(folder / "frf.csv"))
        return "cuts, responses at rest and rotating" if rotating else "cuts, responses at rest"
    others = any((folder / name).exists() for name in ("modes.csv", "bearing.csv"))
    return "cuts, modes or bearings" if others else "cuts alone"


def prediction_file(root: Path, campaigns: str, task: Task) -> Path:
    """Return where the predictions of kept-back cuts are kept."""
    return root / "predictions" / campaigns / task.ablation / task.path.name


def predict_held_out(root: Path, campaigns: str, task: Task) -> str:
    """Predict the kept-back cuts of a campaign by three models and keep it; return how it went.

    Runs on any worker; what is there of the same answer is not computed again.
    """
    answer = kept.read(task.path)
    path = prediction_file(root, campaigns, task)
    belongs_to = [answer["program"], answer["campaign"], kept.program_digest()]
    if answer["state"] == FAILED or (path.exists() and kept.read(path)["belongs_to"] == belongs_to):
        return "there"
    cuts = read_rows(truth_folder(root, campaigns, answer["seed"]) / "stability_test.csv")
    try:
        found = {"outcomes": program.held_out_outcomes(task.campaign, cuts, answer["models"]), "reason": ""}
    except Exception as error:  # Whatever a model cannot predict must not cost the other cases.
        found = {"outcomes": {}, "reason": repr(error)}
    kept.write(path, {"belongs_to": belongs_to, **found})
    return str(found["reason"]) or "predicted"


def why_not_predicted(root: Path, campaigns: str, task: Task) -> str:
    """Return why the kept-back cuts of a campaign were not predicted, "" where they were."""
    path = prediction_file(root, campaigns, task)
    return str(kept.read(path)["reason"]) if path.exists() else ""


def held_out_errors(root: Path, campaigns: str, task: Task, answer: Data) -> dict[str, float]:
    """Return the balanced outcome error of kept-back cuts by model; none where they were not predicted."""
    path = prediction_file(root, campaigns, task)
    if not path.exists():
        return {}
    cuts = read_rows(truth_folder(root, campaigns, answer["seed"]) / "stability_test.csv")
    observed = [row["outcome"] for row in cuts]
    return {name: balanced_error(said, observed) for name, said in kept.read(path)["outcomes"].items()}
