"""The cuts of a campaign, trials and limit depths alike, sorted by what has to be computed anew for them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from chatter_core.chain import Structure
from chatter_core.contact import KnownForces
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.margin import (
    FARTHEST,
    LIMIT_REACH,
    REACH,
    SLOPE_STEP,
    Growth,
    crossing_lines,
    followed_margins,
    margins,
    shared,
)
from chatter_core.evidence.measured import DIRECTIONS, Trials
from chatter_core.evidence.parameters import Array
from chatter_core.floquet import MethodSettings
from chatter_core.machine import Machine
from chatter_core.stability import critical_multipliers, evaluate, known_forces, motions
from chatter_core.stages import Indices, Stages

#: Spectral radii below this are as good as none.
SMALLEST_RADIUS = 1e-30
#: Motions beside the critical one that may be heard where they grow too.
OTHERS = 3
#: Where they all die faster than this, ln|mu| per tooth period, none of them grows in a model that hardly differs.
FAR_FROM_GROWING = -0.05


@dataclass(frozen=True, kw_only=True)
class Setup:
    """Cuts of one machine, set up as for them: points (cut,) among all, speed_index (cut,) among their group's."""

    machine: Machine
    points: Indices
    speed_index: Indices


@dataclass(frozen=True, kw_only=True)
class Group:
    """Cuts that share bearings and modes: machine, its distinct speeds (speed,) [rad/s], setups of the cut."""

    machine: Machine
    spindle_speed: Array
    setups: tuple[Setup, ...]


@dataclass(frozen=True, kw_only=True)
class Cuts:
    """All cuts, the trials first: axial_depth [m] and heard, whether a chatter frequency is known, (cut,).

    trials: how many of them are trials; groups: by what they share.
    """

    axial_depth: Array
    heard: NDArray[np.bool_]
    trials: int
    groups: tuple[Group, ...]

    def __len__(self) -> int:
        return len(self.axial_depth)

    @property
    def reach(self) -> Array:
        """How far from a cut its crossing is looked for, in ln(depth) (cut,): farther for limit depths."""
        return np.where(np.arange(len(self)) < self.trials, REACH, LIMIT_REACH)


@dataclass(frozen=True, kw_only=True)
class CutPrediction:
    """Prediction of cuts, all (cut,).

    margin: distance from the boundary in ln(depth), positive where unstable, NaN where the model has no answer;
    crossing: where that boundary lies, from the cut, NaN where none is in reach; slope: of ln|mu| per ln(depth) there,
    and left: what is left of ln|mu|, NaN as long as no prediction nearby has needed them; chatter_frequency [rad/s], of
    the critical motion, NaN where none was asked for; other_frequency (cut, other): of others that grow too, NaN where
    there are none; share (cut, 1 + other): of each in the growth of all; runner_up: ln|mu| per tooth period of the
    motion next to the critical one, NaN where unknown, and that of a prediction nearby where it was taken over;
    tooth_passing frequency [rad/s]; solved: whether the bearings have an equilibrium. forces: that repeat in the cuts
    of a setup, by its first cut, where a prediction nearby has needed them.
    """

    margin: Array
    crossing: Array
    slope: Array
    left: Array
    chatter_frequency: Array
    other_frequency: Array
    share: Array
    runner_up: Array
    tooth_passing: Array
    solved: NDArray[np.bool_]
    forces: dict[int, KnownForces | None] = field(default_factory=dict, init=False)


def cuts_of(campaign: Campaign) -> Cuts:
    """Return the cuts of a campaign: its trials as each was set up, then its limit depths.

    See docs/physics.md#margin.
    """
    parts = [part for part in (campaign.trials, campaign.limits) if part is not None]
    speed = np.concatenate([np.empty(0), *(part.spindle_speed for part in parts)])
    depths = [part.axial_depth if isinstance(part, Trials) else part.limit_depth for part in parts]
    heard = np.zeros(len(speed), dtype=bool)
    count = 0
    if campaign.trials is not None:
        count = len(campaign.trials)
        heard[:count] = np.isfinite(campaign.trials.chatter_frequency)
    return Cuts(
        axial_depth=np.concatenate([np.empty(0), *depths]),
        heard=heard,
        trials=count,
        groups=tuple(_group(campaign, machine, points, speed) for machine, points in _by_preload(campaign, speed)),
    )


def note_lines(
    known: CutPrediction, stages: Stages, cuts: Cuts, setup: Setup, built: Structure, method: MethodSettings
) -> None:
    """Note ``crossing_lines`` of a prediction, by its own stages and structure, where they are not noted yet.

    Predictions nearby follow its crossings by them, however many they are, and find the motions that unlike teeth force
    from the forces that are noted, too.

    See docs/physics.md#margin.
    """
    first = int(setup.points[0])
    if first not in known.forces:
        known.forces[first] = _forces(known, stages, cuts, setup, built)
    crossing = known.crossing[setup.points]
    if np.isnan(known.slope[setup.points][np.isfinite(crossing)]).any():
        place = np.log(cuts.axial_depth[setup.points])
        growth = _growth(replace(stages, known_forces=known.forces[first]), built, method)
        lines = crossing_lines(growth, setup.speed_index, place, crossing)
        known.slope[setup.points], known.left[setup.points] = lines


def _forces(known: CutPrediction, stages: Stages, cuts: Cuts, setup: Setup, built: Structure) -> KnownForces | None:
    """Return the forces that repeat where a prediction was looked at, by its own stages and structure.

    That is at its crossings and at cuts that are heard there; None where teeth are not moved unlike.
    """
    points = setup.points
    crossing = known.crossing[points]
    # Those of a crossing lead to those just beyond it.
    at_the_cut = where_it_chatters(known.margin[points], crossing) == 0.0
    heard = cuts.heard[points] & np.isfinite(known.margin[points]) & at_the_cut
    at = np.concatenate([crossing, np.zeros(len(points))])
    asked = np.flatnonzero(np.concatenate([np.isfinite(crossing), heard]))
    if not len(asked):
        return None
    place = np.tile(np.log(cuts.axial_depth[points]), 2)
    speed, log_depth, _, _ = shared(np.tile(setup.speed_index, 2), place, at, asked)
    return known_forces(stages, built, speed, np.exp(log_depth))


def _growth(stages: Stages, built: Structure, method: MethodSettings) -> Growth:
    """Return what answers speeds' indices and ln(depth) with ln|mu|."""

    def growth(speed: Indices, log_depth: Array) -> Array:
        found = critical_multipliers(stages, built, speed, np.exp(log_depth), method, np.ones(len(speed)))
        # A motion that dies within a period has no logarithm.
        return np.log(np.maximum(np.abs(found), SMALLEST_RADIUS))

    return growth


def predict_cuts(
    stages: Stages, cuts: Cuts, setup: Setup, built: Structure, method: MethodSettings, near: CutPrediction | None
) -> CutPrediction:
    """Predict the cuts of one setup with its structure; arrays are (cut,) of the setup.

    ``near``: a prediction of the same cuts by a model that hardly differs, from which crossings are followed by the
    lines that are noted in it, and motions found from the forces that are.

    See docs/physics.md#margin.
    """
    if near is not None:
        stages = replace(stages, known_forces=near.forces[int(setup.points[0])])
    depth, growth = cuts.axial_depth[setup.points], _growth(stages, built, method)
    if near is None:
        margin, crossing = margins(growth, setup.speed_index, np.log(depth), cuts.reach[setup.points])
    else:
        before = (near.margin, near.crossing, near.slope, near.left, cuts.reach)
        known = (one[setup.points] for one in before)
        margin, crossing = followed_margins(growth, setup.speed_index, np.log(depth), *known)
    found = CutPrediction(
        margin=margin,
        crossing=crossing,
        slope=np.full(len(depth), np.nan),
        left=np.full(len(depth), np.nan),
        **_silent(len(depth)),
        solved=built.solved[setup.speed_index],
    )
    heard = np.flatnonzero(cuts.heard[setup.points])
    if not len(heard):
        return found
    found.tooth_passing[heard] = stages.machine.tool.teeth * built.spindle_speed[setup.speed_index[heard]]
    where = where_it_chatters(margin, crossing)
    if near is not None:
        moved = np.abs(where - where_it_chatters(near.margin, near.crossing)[setup.points])
        found.runner_up[heard] = np.where(moved <= FARTHEST, near.runner_up[setup.points], np.nan)[heard]
    alone = found.runner_up[heard] < FAR_FROM_GROWING
    one, several, at = heard[alone], heard[~alone], depth * np.exp(where)
    if len(one):
        critical = evaluate(stages, built, setup.speed_index[one], at[one], method, np.ones(len(one)))
        found.chatter_frequency[one] = critical.chatter_frequency
    if len(several):
        _hear(found, several, *motions(stages, built, setup.speed_index[several], at[several], method, 1 + OTHERS))
    return found


def unanswered_cuts(setup: Setup, built: Structure) -> CutPrediction:
    """Return the prediction of the cuts of a setup that a model has no answer for.

    See docs/physics.md#margin.
    """
    margin, crossing, slope, left = np.full((4, len(setup.points)), np.nan)
    silent, solved = _silent(len(setup.points)), np.zeros(len(setup.points), dtype=bool)
    silent["tooth_passing"] = setup.machine.tool.teeth * built.spindle_speed[setup.speed_index]
    return CutPrediction(margin=margin, crossing=crossing, slope=slope, left=left, solved=solved, **silent)


def _hear(found: CutPrediction, heard: Indices, growth: Array, frequency: Array) -> None:
    """Fill in what is heard in some of the cuts (heard,), by what ``motions`` tells of them."""
    found.chatter_frequency[heard] = frequency[:, 0]
    found.runner_up[heard] = growth[:, 1]
    grows = np.nan_to_num(growth, nan=0.0, neginf=0.0).clip(min=0.0)
    # Where nothing grows, at a crossing, it is the critical motion that would.
    grows[~grows.any(axis=1), 0] = 1.0
    found.share[heard] = grows / grows.sum(axis=1, keepdims=True)
    found.other_frequency[heard] = np.where(grows > 0.0, frequency, np.nan)[:, 1:]


def _silent(count: int) -> dict[str, Array]:
    """Return what is known of the motion of so many cuts of which nothing was asked."""
    share = np.zeros((count, 1 + OTHERS))
    share[:, 0] = 1.0
    return {
        "chatter_frequency": np.full(count, np.nan),
        "other_frequency": np.full((count, OTHERS), np.nan),
        "share": share,
        "runner_up": np.full(count, np.nan),
        "tooth_passing": np.full(count, np.nan),
    }


def together(parts: Sequence[CutPrediction], places: Sequence[Indices]) -> CutPrediction:
    """Return the predictions of parts of the cuts as one, each at its places among all; all are told.

    See docs/physics.md#margin.
    """
    order = np.argsort(np.concatenate(places))
    return CutPrediction(
        **{
            one.name: np.concatenate([getattr(part, one.name) for part in parts])[order]
            for one in fields(CutPrediction)
            if one.name != "forces"
        }
    )


def where_it_chatters(margin: Array, crossing: Array) -> Array:
    """Return in ln(depth) from each cut (cut,) where its chatter is looked at.

    That is the cut itself, or where the model stays quiet just beyond the crossing somewhat deeper, where it would
    chatter: where ln|mu| leaps the motion on this side of it is another one.

    See docs/physics.md#margin.
    """
    return np.where((margin < 0.0) & (crossing > 0.0), crossing + SLOPE_STEP, 0.0)


def _group(campaign: Campaign, machine: Machine, points: Indices, speed: Array) -> Group:
    distinct = np.unique(speed[points])
    return Group(
        machine=machine,
        spindle_speed=distinct,
        setups=tuple(
            Setup(machine=cut, points=among, speed_index=np.searchsorted(distinct, speed[among]))
            for cut, among in _by_process(campaign, machine, points)
        ),
    )


def _by_preload(campaign: Campaign, speed: Array) -> Iterator[tuple[Machine, Indices]]:
    """Yield machine and points of every distinct preload."""
    machine, preload = campaign.machine, np.full(len(speed), np.nan)
    # Measured tip modes know no preload; whoever read the campaign has said so.
    if campaign.trials is not None and machine.spindle is not None:
        preload[: len(campaign.trials)] = campaign.trials.preload
    for value in np.unique(preload):
        points = np.flatnonzero(np.isnan(preload) if np.isnan(value) else preload == value)
        yield (machine if np.isnan(value) else machine.with_preload(float(value))), points


def machines_as_cut(campaign: Campaign) -> list[Machine]:
    """Return the machine in every process in which it has cut, none where nothing was cut.

    See docs/physics.md#comparison.
    """
    points = np.arange(len(campaign.cut_speeds))
    return [machine for machine, _ in _by_process(campaign, campaign.machine, points)]


def _by_process(campaign: Campaign, machine: Machine, points: Indices) -> Iterator[tuple[Machine, Indices]]:
    """Yield machine and points of every distinct immersion, feed and direction among points."""
    own, trials = machine.process, campaign.trials
    setups = np.tile([own.radial_immersion, own.feed_per_tooth, DIRECTIONS.index(own.direction)], (len(points), 1))
    if trials is not None:
        is_trial = points < len(trials)
        direction = np.where(trials.direction == NO_WORD, np.nan, trials.direction)
        stated = np.stack([trials.radial_immersion, trials.feed_per_tooth, direction], axis=-1)[points[is_trial]]
        setups[is_trial] = np.where(np.isnan(stated), setups[is_trial], stated)
    for immersion, feed, direction in np.unique(setups, axis=0):
        among = points[(setups == (immersion, feed, direction)).all(axis=1)]
        update = {
            "radial_immersion": float(immersion),
            "feed_per_tooth": float(feed),
            "direction": DIRECTIONS[int(direction)],
        }
        yield machine.model_copy(update={"process": own.model_copy(update=update)}), among
