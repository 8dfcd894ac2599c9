"""A model that changes while its trials are cut: tools wear, spindles warm up, clamps work loose."""

from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chatter_core.evidence.corrections.terms import Correction
from chatter_core.evidence.cuts import CutPrediction, together
from chatter_core.evidence.parameters import Array
from chatter_core.evidence.prediction import QUANTITIES, CampaignModel, Prediction
from chatter_core.stability import Stability, without_result

#: Stretches of consecutive trials, at most; within one of them nothing changes.
STRETCHES = 8


@dataclass(frozen=True, kw_only=True)
class OrderedPrediction(Prediction):
    """A prediction with its parts: of each stretch of trials, and of everything else."""

    parts: tuple[Prediction, ...]
    rest: Prediction


@dataclass(frozen=True, kw_only=True)
class OrderedModel(CampaignModel):
    """A model of a campaign, one of whose terms is a correction against the order of the trials.

    Each stretch of consecutive trials has a model of its own, at its mean trial; everything that was measured
    without trials stands at the first, for it was measured before them.
    """

    @cached_property
    def stretches(self) -> tuple[NDArray[np.intp], ...]:
        """Rows of the trials of every stretch, in their order."""
        trials = self.campaign.trials
        assert trials is not None
        order = np.argsort(trials.trial, kind="stable")
        return tuple(np.array_split(order, min(STRETCHES, len(order))))

    @cached_property
    def models(self) -> tuple[CampaignModel, ...]:
        """The model of every stretch, with its trials alone."""
        return tuple(self._model_of(rows) for rows in self.stretches)

    @cached_property
    def untried(self) -> CampaignModel:
        """The model of everything but the trials."""
        return CampaignModel(**self._settings() | {"campaign": replace(self.campaign, trials=None)})

    def predict(
        self, values: Array, near: Prediction | None = None, quantities: tuple[str, ...] = QUANTITIES
    ) -> OrderedPrediction:
        """Predict as ``CampaignModel`` does, every stretch by its own model."""
        known = near if isinstance(near, OrderedPrediction) else None
        parts = tuple(
            model.predict(self._own(model, values), known.parts[number] if known else None, quantities)
            for number, model in enumerate(self.models)
        )
        rest = self.untried.predict(self._own(self.untried, values), known.rest if known else None, quantities)
        others = {field.name: getattr(rest, field.name) for field in fields(Prediction)}
        own = {
            "values": values,
            "cuts": self._together(parts, rest),
            "trials": self.cuts.trials,
            "structures": tuple(built for part in (*parts, rest) for built in part.structures),
        }
        return OrderedPrediction(**others | own, parts=parts, rest=rest)

    def stability(self, prediction: Prediction, offset: Array) -> Stability:
        """Return the stability of every cut as ``CampaignModel`` does."""
        assert isinstance(prediction, OrderedPrediction)
        highest = max(int(built.cut_modes.label.max()) for built in prediction.structures)
        result = without_result(len(self.cuts), highest)
        for model, rows, part in zip(self.models, self.stretches, prediction.parts, strict=True):
            result.overwrite(rows, model.stability(part, offset[rows]))
        if len(self.untried.cuts):
            limits = np.arange(self.cuts.trials, len(self.cuts))
            result.overwrite(limits, self.untried.stability(prediction.rest, offset[limits]))
        return result

    def _settings(self) -> dict[str, Any]:
        """Return the fields of the plain model that this one is."""
        return {field.name: getattr(self, field.name) for field in fields(CampaignModel)}

    def _model_of(self, rows: NDArray[np.intp]) -> CampaignModel:
        trials = self.campaign.trials
        assert trials is not None
        campaign = replace(
            self.campaign,
            trials=trials.at(rows),
            receptances=(),
            natural_frequencies=None,
            stiffness=None,
            limits=None,
        )
        middle = float(trials.trial[rows].mean())
        terms = tuple(
            replace(term, at=middle) if isinstance(term, Correction) and term.at is not None else term
            for term in self.terms
        )
        return CampaignModel(**self._settings() | {"campaign": campaign, "terms": terms})

    def _own(self, model: CampaignModel, values: Array) -> Array:
        """Return the values of the parameters that a part's model has."""
        known = self.named(values)
        return np.array([known[parameter.name] for parameter in model.parameters])

    def _together(self, parts: tuple[Prediction, ...], rest: Prediction) -> CutPrediction | None:
        """Return the prediction of all cuts from those of the stretches and of the limit depths."""
        if any(part.cuts is None for part in parts):
            return None
        told = [part.cuts for part in (*parts, rest) if part.cuts is not None]
        tried = sum(map(len, self.stretches))
        return together(told, [*self.stretches, *([np.arange(tried, len(self.cuts))] if rest.cuts is not None else [])])
