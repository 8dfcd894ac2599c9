"""The measurement that would part two hypotheses best for what it costs: cuts of several kinds, and receptances."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from chatter_core.evidence.belief import Belief, fitted
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.candidates import Hypothesis
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.measured import DIRECTIONS, Receptance, measuring_ranges
from chatter_core.evidence.newton import Climb
from chatter_core.evidence.next_trial import NextTrial
from chatter_core.evidence.parameters import Array, column
from chatter_core.evidence.planned import planned_campaign
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.machine import Machine
from chatter_core.tip import AXES

#: What measurements cost, in cuts. A guess of what a shop spends on each: a hammer at rest, a probe without contact
#: where the tool turns, and a cut with another feed, width or direction is a cut.
CUT, AT_REST, TURNING = 1.0, 3.0, 8.0
#: More than this need not be known: it settles the question [nats].
SETTLED = 10.0
#: Feeds and widths that are tried, over those of the machine.
OTHER_FEEDS, OTHER_WIDTHS = (0.4, 2.0), (0.5, 1.5)
#: Milling the other way. A slot does both, and its width is the tool's.
OTHER_WAY = {"down": "up", "up": "down"}
#: Frequencies of a planned receptance [rad/s], where none was measured that shows the range.
FREQUENCIES = 2.0 * np.pi * np.linspace(100.0, 4000.0, 391)


@dataclass(frozen=True, kw_only=True)
class NextMeasurement:
    """A measurement that was not made: kind, in words; spindle_speed [rad/s]; axial_depth [m] of a cut, else None.

    expected_gain: the evidence that it is expected to bring for the right one of two hypotheses [nats]; cost, in cuts.
    """

    kind: str
    spindle_speed: float
    axial_depth: float | None
    expected_gain: float
    cost: float

    @property
    def worth(self) -> float:
        """Gain for its cost, as far as a gain is needed."""
        return min(self.expected_gain, SETTLED) / self.cost


def other_cuts(machine: Machine) -> dict[str, dict[str, float]]:
    """Return kinds of cuts that differ from the machine's own in one setting, with that setting (SI).

    A direction is given by its position in measured.DIRECTIONS. The machine's own settings are those of its
    description, whatever the trials of a campaign state.

    See docs/physics.md#diagnosis.
    """
    process, kinds = machine.process, {}
    for share in OTHER_FEEDS:
        feed = share * process.feed_per_tooth
        kinds[f"cut with {1e3 * feed:.3g} mm per tooth"] = {"feed_per_tooth": feed}
    if process.direction not in OTHER_WAY:
        return kinds
    for share in OTHER_WIDTHS:
        width = share * process.radial_immersion
        if width < 1.0:
            kinds[f"cut with a radial immersion of {width:.2f}"] = {"radial_immersion": width}
    if process.radial_immersion < 1.0:
        other = OTHER_WAY[process.direction]
        kinds[f"cut in {other}-milling"] = {"direction": DIRECTIONS.index(other)}
    return kinds


def of_cut(kind: str, cut: NextTrial) -> NextMeasurement:
    """Return a cut as one measurement among others.

    See docs/physics.md#diagnosis.
    """
    return NextMeasurement(
        kind=kind,
        spindle_speed=cut.spindle_speed,
        axial_depth=cut.axial_depth,
        expected_gain=cut.expected_gain,
        cost=CUT,
    )


def next_receptances(one: Hypothesis, other: Hypothesis) -> list[NextMeasurement]:
    """Return every receptance that may be measured, at rest and turning, along and across the axes.

    See docs/physics.md#diagnosis.
    """
    campaign = one.comparison.model.campaign
    planned = _planned(campaign)
    of_one, of_other = (_predicted(hypothesis, campaign, planned) for hypothesis in (one, other))
    # Along an axis without modes nothing moves, and there is nothing to measure.
    moves = [min(both) > 0.0 for both in zip(measuring_ranges(of_one), measuring_ranges(of_other), strict=True)]
    planned, of_one, of_other = (list(itertools.compress(these, moves)) for these in (planned, of_one, of_other))
    if not planned:
        return []
    told = zip(_told(one, campaign, of_other), _told(other, campaign, of_one), strict=True)
    # Where one of both has no answer, nothing can be said of what it would tell.
    gains = np.nan_to_num([divergence(*both) for both in told])
    return [
        NextMeasurement(
            kind=f"receptance {AXES[response.output_axis]} over {AXES[response.input_axis]}",
            spindle_speed=response.spindle_speed,
            axial_depth=None,
            expected_gain=float(gain),
            cost=TURNING if response.spindle_speed else AT_REST,
        )
        for response, gain in zip(planned, gains, strict=True)
    ]


def _planned(campaign: Campaign) -> list[Receptance]:
    """Return the responses that may be measured; their values are not known."""
    speeds = [0.0]
    if len(campaign.cut_speeds):
        highest = float(campaign.cut_speeds.max())
        speeds += [0.5 * highest, highest]
    frequency = campaign.receptances[0].frequency if campaign.receptances else FREQUENCIES
    return [
        Receptance(
            source="",
            spindle_speed=speed,
            output_axis=along,
            input_axis=of,
            frequency=frequency,
            value=np.ones(len(frequency), dtype=complex),
        )
        for speed in speeds
        for along, of in ((0, 0), (1, 1), (0, 1))
    ]


def _model(hypothesis: Hypothesis, campaign: Campaign, responses: list[Receptance]) -> CampaignModel:
    """Return the model of a hypothesis of a campaign in which nothing but responses is measured."""
    alone = replace(planned_campaign(campaign, None), receptances=tuple(responses))
    return replace(hypothesis.comparison.model, campaign=alone)


def _known(hypothesis: Hypothesis, model: CampaignModel) -> Belief:
    """Return what is known of a model's parameters; the sensors of what is not measured yet are only as good as any."""
    machine = {parameter.name for term in model.terms for parameter in term.parameters}
    belief = fitted(hypothesis.fit)
    kept = [place for place, name in enumerate(belief.names) if name in machine]
    return Belief(
        names=tuple(belief.names[place] for place in kept),
        estimate=belief.estimate[kept],
        deviation=belief.deviation[kept],
        correlation=belief.correlation[np.ix_(kept, kept)],
    ).about(model)


def _predicted(hypothesis: Hypothesis, campaign: Campaign, planned: list[Receptance]) -> list[Receptance]:
    """Return the planned responses as a hypothesis expects them."""
    model = _model(hypothesis, campaign, planned)
    prediction = model.predict(_known(hypothesis, model).estimate, quantities=("receptance",))
    return [replace(one, value=value) for one, value in zip(planned, prediction.receptances, strict=True)]


def _told(hypothesis: Hypothesis, campaign: Campaign, values: list[Receptance]) -> list[tuple[Array, Array]]:
    """Return of each response how far it lies from what a hypothesis expects (coordinate,), were it as in ``values``.

    With it the hypothesis's own doubt: J L (coordinate, parameter), where J are the derivatives and L L^T the
    covariance of its parameters. Both in deviations of the measurement.
    """
    model = _model(hypothesis, campaign, values)
    problem = Comparison(model=model, quantities=("receptance",))
    known = _known(hypothesis, model)
    here = problem.evaluate(known.estimate)
    slope = Climb(problem, known.deviation > 0.0).derivatives(known.estimate, here, known.deviation)[0]
    width = known.deviation / column(problem.parameters, "prior_width")
    doubt = slope @ np.linalg.cholesky(known.correlation * np.outer(width, width) + 1e-12 * np.eye(len(width)))
    ends = np.cumsum([2 * len(response.frequency) for response in values])[:-1]
    return list(zip(np.split(here.coordinates, ends), np.split(doubt, ends), strict=True))


def divergence(one: tuple[Array, Array], other: tuple[Array, Array]) -> float:
    """Return the mean of both Kullback-Leibler divergences of what two hypotheses expect of a response [nats].

    Either expects a normal distribution of covariance S = 1 + D D^T, its doubt D and the measurement's errors:
    1/4 (tr(S_1^-1 S_2) + tr(S_2^-1 S_1) - 2 n + r_1^T S_1^-1 r_1 + r_2^T S_2^-1 r_2).

    one, other: distance r (coordinate,) and doubt D (coordinate, parameter), in deviations of the measurement.

    See docs/physics.md#diagnosis.
    """
    return 0.25 * sum(_seen_by(*own) + _spread_by(own[1], others[1]) for own, others in ((one, other), (other, one)))


def _seen_by(apart: Array, doubt: Array) -> float:
    """Return r^T S^-1 r: what a hypothesis does not know of itself may make up for a distance."""
    seen = doubt.T @ apart
    return float(apart @ apart - seen @ np.linalg.solve(np.eye(len(seen)) + doubt.T @ doubt, seen))


def _spread_by(doubt: Array, others: Array) -> float:
    """Return tr(S^-1 S') - n: how much farther the other's doubt spreads than one's own."""
    own, both = doubt.T @ doubt, doubt.T @ others
    inner = np.linalg.inv(np.eye(len(own)) + own)
    return float((others**2).sum() - np.trace(inner @ own) - np.trace(inner @ both @ both.T))
