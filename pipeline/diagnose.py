"""What is missing in a model, from a campaign: the verb."""

from pathlib import Path

from pipeline import diagnosis_document, diagnosis_page, judging, model_file
from pipeline.after_verdict import completed, with_pictures
from pipeline.campaigns import Asked
from pipeline.cluster import Workers
from pipeline.diagnosis import Diagnosis, check_enough, diagnose
from pipeline.judging import MODEL, Verb
from pipeline.verbs.campaigns import DiagnoseOptions


def run(words: list[str]) -> int:
    """Diagnose a campaign and write what was found; return the exit code."""
    return judging.run(VERB, words)


def _diagnose(workers: Workers | None, asked: Asked) -> Diagnosis:
    found = diagnose(workers, asked.model, asked.belief, asked.content)
    return with_pictures(workers, completed(workers, found, asked.belief))


def _write(found: Diagnosis, asked: Asked, output: Path) -> list[Path]:
    paths = diagnosis_page.write(found, asked.name, asked.given, output)
    of_what = (asked.model.campaign, found.supported.fit, found.supported_content)
    model_file.write(output / MODEL, *of_what, remarks=found.stands_for)
    return [*paths, output / MODEL]


def _lost(found: Diagnosis) -> int:
    return found.version(found.supported).compared.prediction.failed


VERB = Verb(
    options=DiagnoseOptions,
    files=(*diagnosis_page.FILES, MODEL),
    check=check_enough,
    compute=_diagnose,
    write=_write,
    summary=diagnosis_page.summary,
    facts=lambda found, asked: {"diagnosis": diagnosis_document.document(found, asked.name, asked.given)},
    lost=_lost,
)
