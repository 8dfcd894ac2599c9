"""Diagnose, add what is missing, calibrate again, and go on until nothing more is supported: the verb."""

from pathlib import Path
from typing import Any

from pipeline import diagnosis_document, diagnosis_page, improvement_page, judging, model_file
from pipeline.campaigns import Asked
from pipeline.diagnosis import check_enough
from pipeline.improvement import Improvement, improve
from pipeline.judging import MODEL, Verb
from pipeline.verbs.campaigns import ImproveOptions


def run(words: list[str]) -> int:
    """Improve a model by a campaign and write what was found; return the exit code."""
    return judging.run(VERB, words)


def summary(found: Improvement) -> str:
    """Return the gist as text for a terminal."""
    table = found.history.to_string(index=False, float_format=lambda value: f"{value:.3g}", na_rep="")
    return "\n".join([diagnosis_page.summary(found.diagnoses[0]), table, *found.stand_for])


def facts(found: Improvement, asked: Asked) -> dict[str, Any]:
    """Return what scripts are told: what was added, in whose place too, the errors, and the last diagnosis."""
    return {
        "added": found.added,
        "stand_for": found.stand_for,
        "history": found.history.to_dict(orient="records"),
        "diagnosis": diagnosis_document.document(found.diagnoses[-1], asked.name, asked.given),
    }


def _write(found: Improvement, asked: Asked, output: Path) -> list[Path]:
    paths = improvement_page.write(found, asked.name, asked.given, output)
    model_file.write(output / MODEL, asked.model.campaign, found.final.fit, found.content, remarks=found.stand_for)
    return [*paths, output / MODEL]


def _lost(found: Improvement) -> int:
    return found.final_version.compared.prediction.failed


VERB = Verb(
    options=ImproveOptions,
    files=(*improvement_page.FILES, MODEL),
    check=check_enough,
    compute=improve,
    write=_write,
    summary=summary,
    facts=facts,
    lost=_lost,
)
