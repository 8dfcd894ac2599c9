"""The program that is tried: a diagnosis of one folder as plain data, and what its models say of other cuts.

``python -m benchmarks.blind.program CAMPAIGN ANSWER.json [--frozen]`` is one diagnosis in a process of its own, which
knows one campaign and no truth.
"""

import argparse
import contextlib
import io
import json
import os
import tempfile
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

# The matrices are small: a second thread makes them slower.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from threadpoolctl import threadpool_limits

from benchmarks.blind.tables import Rows, read_rows, write_rows
from chatter_core.evidence import CampaignModel, base_model, read_campaign
from chatter_core.evidence.belief import PRIORS
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.parameters import Array, Parameter, column
from chatter_core.evidence.prediction import QUANTITIES, Prediction
from chatter_core.stages import Stages, Term
from pipeline import model_file, predict
from pipeline.after_verdict import intervals_of
from pipeline.diagnosis import Diagnosis, check_enough, diagnose
from pipeline.diagnosis_document import document
from pipeline.model_file import Content

#: Columns that a kept-back cut has and a planned one has not.
JUDGED_COLUMNS = ("outcome", "chatter_frequency_hz")


@dataclass(kw_only=True)
class Tally:
    """Counts evaluations of the cuts."""

    evaluations: int = 0


@dataclass(frozen=True, kw_only=True)
class Counted(CampaignModel):
    """A model that counts how often its cuts are evaluated; copies of it, of parts of the campaign too, count along."""

    tally: Tally = field(compare=False)

    def predict(
        self, values: Array, near: Prediction | None = None, quantities: tuple[str, ...] = QUANTITIES
    ) -> Prediction:
        """Predict as the model does; what is taken over from nearby is not counted."""
        found = super().predict(values, near, quantities)
        if found.cuts is not None and (near is None or found.cuts is not near.cuts):
            self.tally.evaluations += 1
        return found


@dataclass(frozen=True, kw_only=True)
class Frozen:
    """A term whose parameters stay at their nulls: what the data sheets say is taken to be true."""

    term: Term

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None."""
        return ()

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages as the term makes them at its nulls."""
        return self.term.apply(stages, column(self.term.parameters, "null"))


def model_of(folder: Path, *, frozen: bool, tally: Tally) -> CampaignModel:
    """Return the model that a diagnosis of a campaign begins with; ``frozen``: without nuisances of the machine."""
    model = base_model(read_campaign(folder))
    if frozen:
        model = replace(model, terms=tuple(Frozen(term=term) for term in model.terms))
    return Counted(**{one.name: getattr(model, one.name) for one in fields(model)}, tally=tally)


def answer(folder: Path, *, frozen: bool = False) -> dict[str, Any]:
    """Diagnose a campaign and return what is kept of it, as plain data.

    document: diagnosis.json, but for calibrations of ranked effects; chances: of what each hypothesis still fails in
    that counts, by its name; models: model files of the refitted base and of the best supported model; evaluations of
    the cuts; times [s].
    """
    begun, spent, tally = time.perf_counter(), time.process_time(), Tally()
    with threadpool_limits(1):
        model = model_of(folder, frozen=frozen, tally=tally)
        check_enough(model)
        found = diagnose(None, model, PRIORS, Content())
        found = replace(found, intervals=intervals_of(None, found))
    told = document(found, folder.name, given=None)
    # Model files hold the calibration of the two that count; that of a dozen others is nine tenths of a document.
    told["ranking"] = [{key: value for key, value in one.items() if key != "calibration"} for one in told["ranking"]]
    return {
        "document": told,
        "chances": {name: [float(one.chance) for one in left] for name, left in found.left.items()},
        "models": models(found),
        "evaluations": tally.evaluations,
        "processor_s": time.process_time() - spent,
        "wall_s": time.perf_counter() - begun,
    }


def models(found: Diagnosis) -> dict[str, str]:
    """Return the model files of the refitted base and of the model that the answer stands for."""
    return {"refitted": _model_text(found.base), "answered": _model_text(found.best)}


def _model_text(hypothesis: Hypothesis) -> str:
    content = Content()
    for candidate in hypothesis.candidates:
        content = content.with_effect(candidate.name, candidate.settings)
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "model.yaml"
        model_file.write(path, hypothesis.comparison.model.campaign, hypothesis.fit, content)
        return path.read_text(encoding="utf-8")


def planned(cuts: Rows) -> Rows:
    """Return cuts, rows of stability.csv, as they are before anybody has judged them."""
    return [{key: value for key, value in row.items() if key not in JUDGED_COLUMNS} for row in cuts]


def predicted_outcomes(folder: Path, cuts: Rows, model: str | None) -> list[str]:
    """Return what ``predict`` says of cuts, rows of stability.csv whose labels it does not get to see.

    model: a model file's text; without it the machine as described. A cut without an answer is "".
    """
    with tempfile.TemporaryDirectory() as scratch:
        trials, predictions, file = (Path(scratch) / name for name in ("trials.csv", "predictions.csv", "model.yaml"))
        write_rows(trials, planned(cuts))
        words = [f"campaign={folder}", f"trials={trials}", f"predictions={predictions}"]
        if model is not None:
            file.write_text(model, encoding="utf-8")
            words.append(f"model={file}")
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            predict.run(words)
        return [row["predicted_outcome"] for row in read_rows(predictions)]


def held_out_outcomes(folder: Path, cuts: Rows, texts: Mapping[str, str]) -> dict[str, list[str]]:
    """Return the predicted outcomes of cuts by model: nominal, and those of the model files in ``texts``."""
    with threadpool_limits(1):
        named: dict[str, str | None] = {"nominal": None, **texts}
        return {name: predicted_outcomes(folder, cuts, text) for name, text in named.items()}


def _end_with_parent() -> None:
    """End this process when whoever started it has gone, and with it the other end of standard input."""
    # Not through sys.stdin, whose lock a thread that waits would still hold when the interpreter ends.
    while os.read(0, 1):
        pass
    with contextlib.suppress(OSError):  # nobody may be left to read it
        os.write(2, b"standard input has ended, as it does with whoever started this: no answer is written\n")
    os._exit(1)


def main() -> None:
    """Diagnose the campaign that the command line names."""
    ends = "It ends when its standard input does, as it does with whoever started it."
    parser = argparse.ArgumentParser(prog="python -m benchmarks.blind.program", description=__doc__, epilog=ends)
    parser.add_argument("campaign", type=Path)
    parser.add_argument("answer", type=Path, help="file to write")
    parser.add_argument("--frozen", action="store_true", help="nuisances of the machine stay as described")
    arguments = parser.parse_args()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    found = answer(arguments.campaign, frozen=arguments.frozen)
    arguments.answer.write_text(json.dumps(found, allow_nan=False), encoding="utf-8")


if __name__ == "__main__":
    main()
