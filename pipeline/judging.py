"""The steps of a verb that judges a model by a campaign: read, compute, and leave an answer in a folder.

An answer never takes the place of what was measured, of what is read, of a study, or of what was said of another
campaign.
"""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from chatter_core.evidence import CampaignModel
from chatter_core.reading import shown
from pipeline import comparison_document, diagnosis_document, improvement_page, model_file
from pipeline.answer_folder import refuse_foreign, refuse_unwritten, require_room, write_whole
from pipeline.campaigns import Asked, options_of, read
from pipeline.cluster import Workers, open_client
from pipeline.configuration import words_for
from pipeline.json_text import parsed
from pipeline.locking import held_for_results
from pipeline.telling import complain, fact, say, wrote
from pipeline.verbs.campaigns import JudgingOptions

#: What becomes of an answer that has lost its workers.
NOT_KEPT = "the same command begins again"
Found = TypeVar("Found")

#: Where every answer holds its model.
MODEL = "model.yaml"
#: Documents by which a folder says of which campaign its answer is.
DOCUMENTS = (comparison_document.DOCUMENT, diagnosis_document.DOCUMENT)


@dataclass(frozen=True, kw_only=True)
class Verb(Generic[Found]):
    """A verb that judges a model by a campaign.

    options: what it takes; files: all that its answers may consist of; check: raises InvalidInput where a
    campaign is not enough; compute: the answer; write: puts it into a folder and returns the paths; summary: for a
    terminal; facts: for scripts; lost: how many data the answer's model has nothing
    to say of.
    """

    options: type[JudgingOptions]
    files: tuple[str, ...]
    check: Callable[[CampaignModel], None]
    compute: Callable[[Workers | None, Asked], Found]
    write: Callable[[Found, Asked, Path], list[Path]]
    summary: Callable[[Found], str]
    facts: Callable[[Found, Asked], dict[str, Any]]
    lost: Callable[[Found], int]


def run(verb: Verb[Found], words: list[str]) -> int:
    """Answer the words of a command line; return the exit code.

    Raises InvalidInput for bad input and where the answer cannot be written, StoreInUse where another run holds
    its folder.
    """
    sorted_words = words_for(verb.options, words)
    options = options_of(sorted_words, verb.options)
    with threadpool_limits(1):
        asked = read(options, sorted_words)
        verb.check(asked.model)
        output = options.output or Path("results") / f"{options.verb()}-{asked.name}"
        _refuse_loss(verb, output, options, asked)
        with held_for_results(output):
            with open_client(asked.cluster) as client:
                workers = None if client is None else Workers(client, asked.cluster.patience, NOT_KEPT)
                found = verb.compute(workers, asked)
            written = _write(verb, found, asked, output)
    for line in comparison_document.origin(asked.given, asked.content):
        say(line)
    say(verb.summary(found))
    fact(campaign=asked.name, **verb.facts(found, asked))
    wrote(written)
    lost = verb.lost(found)
    if lost:
        complain(f"the calibrated model has no answer for {lost} data; they count as far off")
    return 1 if lost else 0


def _refuse_loss(verb: Verb[Found], output: Path, options: JudgingOptions, asked: Asked) -> None:
    """Raise InvalidInput where the answer would take the place of what is read, or of another campaign's answer."""
    if output.resolve() == options.campaign.resolve():
        raise InvalidInput([f"output: {output} is the folder of the campaign itself; name another"])
    if asked.content.effects_path == output.resolve():
        raise InvalidInput([f"output: {output} is the folder of the effects; name another"])
    # Links may lead round in circles in the place of an answer.
    places = [os.path.realpath(output / file) for file in verb.files]
    if options.model is not None and os.path.realpath(options.model) in places:
        raise InvalidInput([f"output: {output} holds the model that is read; name another folder"])
    for document in DOCUMENTS:
        before = _campaign_of(output / document)
        if before is None:
            refuse_unwritten(output, [document])
        if before not in (None, asked.name):
            raise InvalidInput([f"output: {output} holds the answer for campaign {shown(before)}; name another folder"])
    _refuse_namesake(output, asked)
    refuse_foreign(output, DOCUMENTS)
    require_room(output, verb.files)
    if not any((output / document).exists() for document in DOCUMENTS):
        refuse_unwritten(output, verb.files)


def _refuse_namesake(output: Path, asked: Asked) -> None:
    """Raise InvalidInput where the answer is for another campaign of the same name."""
    why = model_file.another_campaign(output / MODEL, asked.model.campaign)
    if why:
        other = f"another campaign that is called {shown(asked.name)}: {why}"
        raise InvalidInput([f"output: {output} holds the answer for {other}; name another folder"])


def _campaign_of(document: Path) -> str | None:
    """Return the campaign that a document speaks of, None where there is none that can be read."""
    try:
        return str(parsed(document.read_text(encoding="utf-8"))["campaign"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _write(verb: Verb[Found], found: Found, asked: Asked, output: Path) -> list[Path]:
    """Write everything and return the paths."""
    # What an earlier answer had to show, and this one has not, would speak of other measurements, or of another model:
    # of an improvement its history, too, where a diagnosis takes the place of its first one.
    replaced = diagnosis_document.DOCUMENT in verb.files and _campaign_of(output / improvement_page.LAST) == asked.name
    earlier = improvement_page.FILES if replaced else ()
    return write_whole(lambda folder: verb.write(found, asked, folder), output, [*verb.files, *earlier])
