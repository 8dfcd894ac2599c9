"""What was measured row by row, limiting depths, modes and stiffnesses, beside what is predicted."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence import likelihood
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import Prediction


@dataclass(frozen=True, kw_only=True)
class Rows:
    """Measured rows of a quantity, all (row,).

    what: they are, in words; spindle_speed [rad/s]; apart: ln(measured / predicted), NaN without an answer; error:
    its standard deviation.
    """

    quantity: str
    what: str
    spindle_speed: Array
    apart: Array
    error: Array | float


def rows_of(campaign: Campaign, prediction: Prediction, judged: NDArray[np.bool_]) -> Iterator[Rows]:
    """Yield what was measured row by row, as far as it was; judged: (cut,), the cuts to judge by.

    See docs/physics.md#comparison.
    """
    limits, modes, stiffness = campaign.limits, campaign.natural_frequencies, campaign.stiffness
    if limits is not None:
        own = judged[len(judged) - len(limits) :]
        yield Rows(
            quantity="limit_depth",
            what="limiting depths",
            spindle_speed=limits.spindle_speed[own],
            apart=prediction.limit_margin[own],
            error=(limits.uncertainty / limits.limit_depth)[own],
        )
    if modes is not None:
        for quantity, what, measured, predicted, width in (
            (
                "natural_frequency",
                "natural frequencies",
                modes.natural_frequency,
                prediction.natural_frequency,
                likelihood.NATURAL_FREQUENCY_ERROR,
            ),
            (
                "damping_ratio",
                "damping ratios",
                modes.damping_ratio,
                prediction.damping_ratio,
                likelihood.DAMPING_RATIO_ERROR,
            ),
        ):
            some = np.isfinite(measured)
            yield Rows(
                quantity=quantity,
                what=what,
                spindle_speed=modes.spindle_speed[some],
                apart=np.log(measured / predicted)[some],
                error=width,
            )
    if stiffness is not None:
        for what, measured, predicted in (
            ("radial stiffnesses", stiffness.radial_stiffness, prediction.radial_stiffness),
            ("axial stiffnesses", stiffness.axial_stiffness, prediction.axial_stiffness),
        ):
            some = np.isfinite(measured)
            yield Rows(
                quantity="bearing_stiffness",
                what=what,
                spindle_speed=stiffness.spindle_speed[some],
                apart=np.log(measured / predicted)[some],
                error=likelihood.STIFFNESS_ERROR,
            )
