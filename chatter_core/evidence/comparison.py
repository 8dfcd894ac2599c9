"""A model held against a campaign: what each datum says of it, and what a fit asks."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from chatter_core.cards import Card, ShownAsCard
from chatter_core.evidence import likelihood
from chatter_core.evidence.likelihood import Contribution
from chatter_core.evidence.margin import LIMIT_REACH
from chatter_core.evidence.measured import measuring_ranges
from chatter_core.evidence.nuisances import (
    TYPICAL_MARGINAL_WIDTH,
    TYPICAL_MISLABELLED,
    TYPICAL_OUTCOME_WIDTH,
)
from chatter_core.evidence.parameters import Array, Evaluation, Parameter
from chatter_core.evidence.prediction import QUANTITIES, STRUCTURAL, CampaignModel, Prediction


@dataclass(frozen=True, kw_only=True)
class Compared:
    """State of an evaluation: the prediction, and what every quantity says of it."""

    prediction: Prediction
    contributions: dict[str, Contribution]

    @property
    def log_likelihoods(self) -> dict[str, float]:
        """Log-likelihood of each quantity that was measured."""
        return {name: float(found.log_density.sum()) for name, found in self.contributions.items()}

    @property
    def coordinates_of(self) -> dict[str, slice]:
        """Which coordinates of an evaluation belong to each quantity."""
        parts, first = {}, 0
        for name, found in self.contributions.items():
            parts[name] = slice(first, first + found.coordinates.size)
            first += found.coordinates.size
        return parts


@dataclass(frozen=True, kw_only=True, repr=False)
class Comparison(ShownAsCard):
    """The problem of a fit: a model of a campaign, judged by some quantities.

    by_size: whether responses count by the logarithms of their sizes, roughly.
    """

    model: CampaignModel
    quantities: tuple[str, ...] = QUANTITIES
    by_size: bool = False

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The model's parameters."""
        return self.model.parameters

    def card(self) -> Card:
        """Return by what the model is judged, and every parameter with what is plausible of it."""
        columns = ("parameter", "meaning", "plausible", "unit")
        rows = tuple((p.name, p.doc, f"{p.prior_mean:g} +- {p.prior_width:g}", p.unit) for p in self.parameters)
        return Card(title=f"Comparison by {', '.join(self.quantities)}", rows=rows, columns=columns)

    @property
    def structural(self) -> "Comparison | None":
        """The same by what costs next to nothing, receptances above all; None where no such thing was measured."""
        campaign = self.model.campaign
        measured = campaign.receptances or campaign.natural_frequencies or campaign.stiffness
        kept = tuple(name for name in self.quantities if name in STRUCTURAL)
        return replace(self, quantities=kept) if measured and kept else None

    @property
    def coarse(self) -> "Comparison | None":
        """The structural one by the sizes of responses, which lead from far away to near a maximum."""
        return None if self.structural is None else replace(self.structural, by_size=True)

    @property
    def smooth(self) -> "Comparison | None":
        """The same without what jumps when parameters move, chatter frequencies; None where nothing else is left."""
        kept = tuple(name for name in self.quantities if name != "chatter_frequency")
        trials = self.model.campaign.trials
        jumps = trials is not None and bool(np.isfinite(trials.chatter_frequency).any())
        return replace(self, quantities=kept) if jumps and kept and kept != self.quantities else None

    @property
    def still(self) -> "Comparison":
        """The same as if the chips of unlike teeth forced no motion: worse, and several times as fast."""
        return replace(self, model=replace(self.model, forced_motion=False))

    @cached_property
    def _weights_and_ranges(self) -> list[tuple[float, float]]:
        """Weight of each line and measuring range [m/N] of every response."""
        responses = self.model.campaign.receptances
        ranges = measuring_ranges(responses)
        weights = likelihood.line_weights([one.value for one in responses], ranges)
        return list(zip(weights, ranges, strict=True))

    def compare(self, values: Array, near: Prediction | None = None) -> Compared:
        """Predict at values (parameter,) and return what every measured quantity says of it.

        Raises InvalidInput when a parameter takes the machine out of its bounds.
        """
        prediction = self.model.predict(values, near, self.quantities)
        found = {
            **self._of_trials(values, prediction),
            **self._of_receptances(prediction),
            **self._of_tables(prediction),
        }
        return Compared(
            prediction=prediction, contributions={name: found[name] for name in self.quantities if name in found}
        )

    def evaluate(self, values: Array, near: Evaluation | None = None) -> Evaluation:
        """Evaluate values for a fit; ``near`` is an evaluation of this comparison."""
        known = near.state.prediction if near is not None and isinstance(near.state, Compared) else None
        compared = self.compare(values, known)
        parts = list(compared.contributions.values())
        # Data of a quantity have as many coordinates each: one number, two parts, or a probability per outcome.
        each = np.concatenate([np.full(len(part.log_density), part.coordinates.shape[1]) for part in parts])
        return Evaluation(
            log_density=np.concatenate([part.log_density for part in parts]),
            coordinates=np.concatenate([part.coordinates.ravel() for part in parts]),
            score=np.concatenate([part.score.ravel() for part in parts]),
            datum=np.repeat(np.arange(len(each)), each),
            state=compared,
        )

    def outcome_probabilities(self, values: Array, margin: Array) -> Array:
        """Return the probability of every outcome (trial, category) at margins (trial,)."""
        named = self.model.named(values)
        marginal = named.get("marginal_width")
        return likelihood.outcome_probabilities(
            margin,
            mislabelled=TYPICAL_MISLABELLED * float(np.exp(named["mislabelled"])),
            width=TYPICAL_OUTCOME_WIDTH * float(np.exp(named["outcome_width"])),
            marginal_width=None if marginal is None else TYPICAL_MARGINAL_WIDTH * float(np.exp(marginal)),
        )

    def _of_trials(self, values: Array, prediction: Prediction) -> dict[str, Contribution]:
        trials = self.model.campaign.trials
        if trials is None or prediction.cuts is None:
            return {}
        probability = self.outcome_probabilities(values, prediction.margin)
        found = {"outcome": likelihood.outcome(trials.outcome, probability)}
        heard = np.isfinite(trials.chatter_frequency)
        if heard.any():
            measured = trials.chatter_frequency[heard]
            frequency, share, tooth_passing = prediction.motions(heard)
            residual = likelihood.to_lines(measured[:, None], frequency, tooth_passing[:, None])
            scale = likelihood.frequency_scale(measured, prediction.margin[heard])
            found["chatter_frequency"] = likelihood.chatter_frequency(residual, share, scale, tooth_passing)
        return found

    def _of_receptances(self, prediction: Prediction) -> dict[str, Contribution]:
        """Return what all responses say, one after the other."""
        if not prediction.receptances:
            return {}
        pairs = zip(self.model.campaign.receptances, prediction.receptances, self._weights_and_ranges, strict=True)
        law = likelihood.receptance_by_size if self.by_size else likelihood.receptance
        parts = [law(measured.value, predicted, *known) for measured, predicted, known in pairs]
        return {
            "receptance": Contribution(
                log_density=np.concatenate([part.log_density for part in parts]),
                coordinates=np.concatenate([part.coordinates for part in parts]),
                score=np.concatenate([part.score for part in parts]),
            )
        }

    def _of_tables(self, prediction: Prediction) -> dict[str, Contribution]:
        """Return what natural frequencies, damping ratios, stiffnesses and limit depths say, as far as measured."""
        campaign, found = self.model.campaign, {}
        if campaign.natural_frequencies is not None and len(prediction.natural_frequency):
            measured, stated = campaign.natural_frequencies, np.isfinite(campaign.natural_frequencies.damping_ratio)
            apart = np.log(measured.natural_frequency / prediction.natural_frequency)
            found["natural_frequency"] = likelihood.gaussian(apart, likelihood.NATURAL_FREQUENCY_ERROR)
            if stated.any():
                apart = np.log(measured.damping_ratio[stated] / prediction.damping_ratio[stated])
                found["damping_ratio"] = likelihood.gaussian(apart, likelihood.DAMPING_RATIO_ERROR)
        if campaign.stiffness is not None and len(prediction.radial_stiffness):
            stated = np.isfinite(campaign.stiffness.axial_stiffness)
            apart = np.log(
                np.concatenate([campaign.stiffness.radial_stiffness, campaign.stiffness.axial_stiffness[stated]])
                / np.concatenate([prediction.radial_stiffness, prediction.axial_stiffness[stated]])
            )
            found["bearing_stiffness"] = likelihood.gaussian(apart, likelihood.STIFFNESS_ERROR)
        if campaign.limits is not None and len(prediction.limit_margin):
            error = campaign.limits.uncertainty / campaign.limits.limit_depth
            found["limit_depth"] = likelihood.limit_depth(prediction.limit_margin, error, LIMIT_REACH)
        return found
