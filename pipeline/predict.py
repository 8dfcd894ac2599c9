"""What a model says of cuts that are planned: their table, with what is predicted beside it."""

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from chatter_core.errors import InvalidInput
from chatter_core.evidence.campaign import is_read, planned_trials
from chatter_core.evidence.measured import DIRECTIONS, PLANNED, Trials
from chatter_core.evidence.oddities import unused_preloads
from chatter_core.evidence.planned import PlannedCuts, planned_campaign, predict_planned
from chatter_core.reading import printable
from chatter_core.units import si_factor
from chatter_core.variables import STATUS
from pipeline.answer_folder import refuse_other_file, write_text
from pipeline.campaigns import model_of, options_of, read
from pipeline.configuration import words_for
from pipeline.errors import told_where
from pipeline.locking import check_folder, make_folder
from pipeline.telling import complain, fact, remark, say, wrote
from pipeline.verbs.campaigns import PredictOptions

#: Columns that are written beside those of the table.
PREDICTED = (
    "spectral_radius",
    "predicted_outcome",
    "probability_chatter",
    "predicted_chatter_frequency_hz",
    "status",
)


def run(words: list[str]) -> int:
    """Predict planned cuts and write them; return the exit code."""
    sorted_words = words_for(PredictOptions, words)
    options = options_of(sorted_words, PredictOptions)
    _refuse_loss(options)
    with threadpool_limits(1):
        asked = read(options, sorted_words)
        campaign = asked.model.campaign
        trials, order = planned_trials(options.trials, campaign.machine)
        _refuse_columns(trials, options)
        for line in unused_preloads(printable(options.trials.name), trials.preload, campaign.machine):
            remark(f"remark: {line}")
        model = model_of(planned_campaign(campaign, trials), asked.content)
        check_folder(options.predictions.parent, "predictions")
        found = predict_planned(model, asked.belief)
    make_folder(options.predictions.parent, "predictions")
    text = table(trials, found).iloc[order].to_csv(index=False, float_format="%.8g")
    with told_where(options.predictions, "predictions"):
        write_text(options.predictions, text)
    failed = int((found.status != STATUS["ok"]).sum())
    chatter = int((found.margin > 0.0).sum())
    stable = len(trials) - chatter - failed
    say(f"{len(trials)} cuts: {chatter} predicted with chatter, {stable} stable")
    fact(campaign=asked.name, cuts=len(trials), cuts_chatter=chatter, cuts_stable=stable, cuts_failed=failed)
    wrote([options.predictions])
    if failed:
        complain(f"no result for {failed} cuts; the column status says why")
    return 1 if failed else 0


def _refuse_loss(options: PredictOptions) -> None:
    """Raise InvalidInput where the answer would take the place of what was read."""
    place = options.predictions.resolve()
    if place.is_dir():
        raise InvalidInput([f"predictions: {options.predictions} is a folder; name a file"])
    if place == options.trials.resolve():
        raise InvalidInput([f"predictions: {options.predictions} is the table of trials itself; name another file"])
    measured = place.parent == options.campaign.resolve() and is_read(place.name)
    if measured or (options.model is not None and place == options.model.resolve()):
        raise InvalidInput([f"predictions: {options.predictions} is read for the prediction; name another file"])
    refuse_other_file(options.predictions, "predictions", lambda first: all(name in first for name in PREDICTED))
    # A pipe or a terminal takes whatever is written.
    if options.predictions.suffix.lower() != ".csv" and (place.is_file() or not place.exists()):
        raise InvalidInput([f"predictions: found {str(options.predictions)!r}, allowed: a file name ending in .csv"])


def _refuse_columns(trials: Trials, options: PredictOptions) -> None:
    """Raise InvalidInput where a column of the user's has the name of one that is written.

    A table with all of them is an earlier prediction, and is predicted anew.
    """
    taken = [name for name in PREDICTED if name in trials.unknown]
    if 0 < len(taken) < len(PREDICTED):
        raise InvalidInput(
            [f"{options.trials}: column {name} is one of those that are written; rename it" for name in taken]
        )


def table(trials: Trials, found: PlannedCuts) -> pd.DataFrame:
    """Return the trials' columns, those that they have, and what is predicted."""
    names = {code: name for name, code in STATUS.items()}
    columns: dict[str, object] = {}
    for column in PLANNED.columns:
        values = getattr(trials, column.name)
        if column.choices:
            words = [DIRECTIONS[code] if code >= 0 else "" for code in values]
            columns |= {column.key: words} if any(words) else {}
        elif not np.isnan(values).all():
            columns[column.key] = values if column.whole else values / si_factor(column.key)
    columns |= trials.unknown
    outcome = np.where(found.margin > 0.0, "chatter", np.where(np.isnan(found.margin), "", "stable"))
    predicted = (
        found.spectral_radius,
        outcome,
        found.probability_chatter,
        found.chatter_frequency / si_factor("x_hz"),
        [names[code] for code in found.status],
    )
    return pd.DataFrame({**columns, **dict(zip(PREDICTED, predicted, strict=True))})
