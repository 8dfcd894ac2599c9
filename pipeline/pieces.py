"""Pieces of work that the verbs of a campaign share: cuts held out, and the lobes that are drawn."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from chatter_core.evidence import CampaignModel, Comparison
from chatter_core.evidence.assessment import Ended, Limits, interval, interval_end
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.boundary import Field, deviation, setups, sure_field
from chatter_core.evidence.fit import Fit
from chatter_core.evidence.held_out import groups, held_out
from chatter_core.evidence.intervals import SIDES
from chatter_core.evidence.parameters import Array
from pipeline.jobs import Job

#: Setups of the cuts of which lobes are drawn, those with most cuts.
DRAWN_SETUPS = 4
#: How sure lobes are is computed in so many shares of their speeds.
SHARES = 2


def held_out_jobs(comparison: Comparison, calibrated: Array, before: Array, *, anew: bool = True) -> list[Job]:
    """Return a job for each group of cuts, told by a calibration without them; none where speeds are too few.

    calibrated, before, anew: as for ``held_out``.
    """
    return [
        Job(
            name=f"cuts held out, group {group + 1}",
            call=partial(held_out, comparison, calibrated, before, group, anew=anew),
        )
        for group in range(groups(comparison.model.campaign))
    ]


def lobe_jobs(model: CampaignModel, belief: Belief, name: str) -> list[Job]:
    """Return the jobs for the lobes of each setup that is drawn, with what is known of the parameters."""
    calls: dict[str, Callable[..., Any]] = {name: sure_field}
    for part in range(SHARES):
        calls[f"{name}, how sure, part {part + 1}"] = partial(deviation, share=(part, SHARES))
    return [
        Job(name=of_what, call=partial(call, model, belief, setup))
        for setup in range(min(len(setups(model)), DRAWN_SETUPS))
        for of_what, call in calls.items()
    ]


def lobes(answers: Sequence[Any]) -> list[Field]:
    """Return the lobes that the answers of ``lobe_jobs`` make."""
    setups_apart = (answers[first : first + 1 + SHARES] for first in range(0, len(answers), 1 + SHARES))
    return [sure.with_deviation(np.concatenate(parts)) for sure, *parts in setups_apart]


def interval_jobs(comparison: Comparison, fit: Fit, names: Sequence[str]) -> list[Job]:
    """Return two jobs for the profile interval of each of some parameters, its lower end and its upper one."""
    return [
        Job(
            name=f"{word} end of the interval of {name}",
            call=partial(interval_end, comparison, fit, name, side),
        )
        for name in names
        for side, word in zip(SIDES, ("lower", "upper"), strict=True)
    ]


def intervals(fit: Fit, names: Sequence[str], ends: Sequence[Ended]) -> dict[str, Limits]:
    """Return the intervals that the answers of ``interval_jobs`` make, by parameter."""
    pairs = zip(ends[::2], ends[1::2], strict=True)
    return {name: interval(fit, name, low, high) for name, (low, high) in zip(names, pairs, strict=True)}
