"""What a calibrated model says of cuts that it was not calibrated with: cross-validation by groups of speed.

Cuts at one speed share their lobe: left out one by one they would be told by their neighbours. So all cuts at
a speed are left out together. Receptances and the other measurements without cutting are taken before the
trials and stay.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.calibration import START_GAIN, calibrate
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.fit import free_parameters, maximise
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.scores import Told, told

#: Groups of speeds, at most; each is left out once.
GROUPS = 5
#: Speeds nearer than this to each other are one speed [ln].
SAME_SPEED = 0.01
#: Fewer distinct speeds than this leave nothing to learn from.
FEWEST_SPEEDS = 3


def speed_groups(campaign: Campaign) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the group of every trial (trial,) and of every limit depth (row,); none, if speeds are too few.

    Speeds are dealt to the groups in ascending order, so that each group has low ones and high ones.

    See docs/physics.md#comparison.
    """
    parts = [part.spindle_speed if part is not None else np.empty(0) for part in (campaign.trials, campaign.limits)]
    speed = np.concatenate(parts)
    place = _places(speed)
    if len(speed) == 0 or place.max() + 1 < FEWEST_SPEEDS:
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    group = place % GROUPS
    return group[: len(parts[0])], group[len(parts[0]) :]


def _places(speed: Array) -> NDArray[np.intp]:
    """Return which distinct speed each one (cut,) is, counted from the lowest.

    A place reaches as far as SAME_SPEED from its first speed: many small steps do not make one speed.
    """
    place, first, count = np.zeros(len(speed), dtype=np.intp), np.inf, -1
    for cut in np.argsort(speed, kind="stable"):
        if count < 0 or np.log(speed[cut] / first) > SAME_SPEED:
            first, count = speed[cut], count + 1
        place[cut] = count
    return place


def groups(campaign: Campaign) -> int:
    """Return how many groups of speeds there are to leave out; 0 where speeds are too few.

    See docs/physics.md#comparison.
    """
    return int(max((part.max() + 1 for part in speed_groups(campaign) if len(part)), default=0))


def held_out(comparison: Comparison, calibrated: Array, before: Array, group: int, *, anew: bool = True) -> Told:
    """Return what a model says of one group's cuts that was calibrated with all others.

    calibrated: (parameter,), by all data, where that calibration starts; before: (parameter,), what was known before
    the campaign; anew: whether it starts from there as well, and the higher end counts. Where the posterior has several
    maxima, as that of a model which lacks an effect often has, or an edge, all data have chosen among them by the
    cuts that are held out, too.

    See docs/physics.md#comparison.
    """
    model, campaign = comparison.model, comparison.model.campaign
    of_trial, of_limit = speed_groups(campaign)
    training = replace(
        comparison, model=replace(model, campaign=_among(campaign, of_trial != group, of_limit != group))
    )
    starts = [_restricted(training, model.named(calibrated))]
    known = model.named(before)
    if anew:
        own = _restricted(training, known)
        starts.append(calibrate(training, start=own, smallest_gain=START_GAIN).estimate)
    free = free_parameters(training, (), *starts)
    found = training.model.named(maximise(training, starts, free, len(starts)).values)
    # What the training labels do not tell of, such as a marginal class that only the others have, is as it was before.
    values = _restricted(comparison, known | found)
    said = told(comparison, values, model.predict(values))
    return Told(
        margin=np.where(of_trial == group, said.margin, np.nan),
        probability=np.where((of_trial == group)[:, None], said.probability, np.nan),
        chatter_frequency=np.where(of_trial == group, said.chatter_frequency, np.nan),
        limit_margin=np.where(of_limit == group, said.limit_margin, np.nan),
    )


def _restricted(comparison: Comparison, known: Mapping[str, float]) -> Array:
    """Return values (parameter,) of a comparison's own parameters."""
    return np.array([known[parameter.name] for parameter in comparison.parameters])


def together(parts: Sequence[Told]) -> Told:
    """Return what all groups' held-out cuts were said to be; each is told by one part.

    See docs/physics.md#comparison.
    """
    return Told(**{name: _only_known([getattr(part, name) for part in parts]) for name in vars(parts[0])})


def _only_known(arrays: list[Array]) -> Array:
    """Return element by element the one that is a number; NaN where none is."""
    result = arrays[0]
    for array in arrays[1:]:
        result = np.where(np.isnan(result), array, result)
    return result


def _among(campaign: Campaign, trials: NDArray[np.bool_], limits: NDArray[np.bool_]) -> Campaign:
    """Return a campaign with some of its cuts, and everything else."""
    return replace(
        campaign,
        trials=campaign.trials.at(np.flatnonzero(trials)) if campaign.trials is not None else None,
        limits=campaign.limits.at(np.flatnonzero(limits)) if campaign.limits is not None else None,
    )
