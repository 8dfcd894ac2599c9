"""What a model says of everything that a campaign measured, for one vector of parameter values."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from chatter_core.chain import Structure, structure, unsolved_structure
from chatter_core.errors import InvalidInput, OwnLawFails
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.cuts import CutPrediction, Cuts, cuts_of, note_lines, predict_cuts, together, unanswered_cuts
from chatter_core.evidence.measured import Receptance
from chatter_core.evidence.nuisances import SENSOR, machine_nuisances, measurement_parameters
from chatter_core.evidence.parameters import Array, Parameter, column
from chatter_core.floquet import MethodSettings
from chatter_core.machine import Machine
from chatter_core.stability import Stability, evaluate, too_slow, without_result
from chatter_core.stages import ComplexArray, Stages, Term, apply_terms
from chatter_core.tip import TipModes, most_modes
from chatter_core.variables import STATUS

#: Modes of an axis in the cut, and in a receptance, whose lines between the peaks feel all that lie above.
CUT_MODES, RECEPTANCE_MODES = 4, 20
#: Accuracy while fitting: the boundary moves by far less than trials can tell.
FITTING_METHOD = MethodSettings(name="collocation", tolerance=1e-3)
#: Models whose parameters differ by less than this share of the priors' widths hardly differ.
NEARBY = 0.025

#: What can be compared, by the names that answers use.
QUANTITIES = (
    "outcome",
    "chatter_frequency",
    "receptance",
    "natural_frequency",
    "damping_ratio",
    "bearing_stiffness",
    "limit_depth",
)
#: Those that depend on the structure alone, and cost next to nothing.
STRUCTURAL = ("receptance", "natural_frequency", "damping_ratio", "bearing_stiffness")


@dataclass(frozen=True, kw_only=True)
class Prediction:
    """Everything predicted for ``values``; None or empty where nothing was measured or asked for.

    cuts: the trials, then the limit depths, of which ``trials`` are trials; receptances: (line,) each [m/N], as
    the sensors would show them; natural_frequency [rad/s], damping_ratio, radial_stiffness and axial_stiffness
    [N/m]: (row,) of their tables. NaN marks what the model cannot answer. structures: of each group of cuts,
    and response: of the receptances, for whoever predicts values nearby.
    """

    values: Array
    cuts: CutPrediction | None
    trials: int
    receptances: tuple[ComplexArray, ...]
    natural_frequency: Array
    damping_ratio: Array
    radial_stiffness: Array
    axial_stiffness: Array
    structures: tuple[Structure, ...]
    response: Structure | None

    @property
    def margin(self) -> Array:
        """Distance of each trial from the boundary in ln(depth), positive where unstable (trial,)."""
        return self.cuts.margin[: self.trials] if self.cuts is not None else np.empty(0)

    @property
    def chatter_frequency(self) -> Array:
        """Chatter frequency (trial,) [rad/s], NaN where none was measured."""
        return self.cuts.chatter_frequency[: self.trials] if self.cuts is not None else np.empty(0)

    def motions(self, heard: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
        """Return frequency [rad/s] and share of every motion that may be heard in some of the trials (heard, motion).

        The critical one comes first. With them the tooth passing frequency (heard,) [rad/s].
        """
        assert self.cuts is not None
        which = np.flatnonzero(heard)
        frequency = np.column_stack([self.cuts.chatter_frequency[which], self.cuts.other_frequency[which]])
        return frequency, self.cuts.share[which], self.cuts.tooth_passing[which]

    @property
    def limit_margin(self) -> Array:
        """Ln of measured over predicted limit depth (row,), the nearest one; LIMIT_REACH where none is."""
        return self.cuts.margin[self.trials :] if self.cuts is not None else np.empty(0)

    @property
    def lost(self) -> tuple[bool, ...]:
        """Which of the receptances the model has no answer for."""
        return tuple(bool(np.isnan(response).all()) for response in self.receptances)

    @property
    def failed(self) -> int:
        """How many measured cuts, responses, modes and stiffnesses the model could not answer."""
        cuts = self.cuts.margin if self.cuts is not None else np.empty(0)
        return sum(self.lost) + sum(
            int(np.isnan(array).sum()) for array in (cuts, self.natural_frequency, self.radial_stiffness)
        )

    @property
    def asked(self) -> int:
        """How many measured cuts, responses, modes and stiffnesses the model was asked for."""
        cuts = self.cuts.margin.size if self.cuts is not None else 0
        return cuts + len(self.receptances) + self.natural_frequency.size + self.radial_stiffness.size


@dataclass(frozen=True, kw_only=True)
class CampaignModel:
    """A model of what a campaign measured: the machine as described, seen through terms.

    terms: nuisances and effects, applied in this order; campaign: what was measured, and the sensors' own
    parameters with it; cut_modes, receptance_modes: modes of an axis, at most; method: of Floquet analysis;
    forced_motion: as ``Stages`` has it; forgiving: whether values that a law of the user's own has no answer to count
    as without one, as a fit needs it.
    The vector of parameters holds the terms' parameters, then the measurements'.
    """

    campaign: Campaign
    terms: tuple[Term, ...]
    cut_modes: int = CUT_MODES
    receptance_modes: int = RECEPTANCE_MODES
    method: MethodSettings = FITTING_METHOD
    forced_motion: bool = True
    forgiving: bool = False

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """All parameters, in the order of the vector.

        Raises InvalidInput when two have one name.
        """
        own = tuple(parameter for term in self.terms for parameter in term.parameters)
        together = (*own, *measurement_parameters(self.campaign))
        names = [parameter.name for parameter in together]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InvalidInput([f"parameter {name}: two terms of the model have one of this name" for name in twice])
        return together

    @property
    def nulls(self) -> Array:
        """Values of the machine as described (parameter,)."""
        return column(self.parameters, "null")

    def stages(self, values: Array, machine: Machine | None = None) -> Stages:
        """Return the stages at values (parameter,), of the campaign's machine or of one with other settings."""
        stages = apply_terms(self.campaign.machine if machine is None else machine, self.terms, values)
        return replace(stages, forced_motion=self.forced_motion)

    def has_unlike_teeth(self, values: Array) -> bool:
        """Return whether teeth are unlike, which takes many times as long as where they are all alike."""
        stages = self.stages(values)
        try:
            with stages.blaming():
                return stages.teeth(stages.machine.tool).repeat > 1
        except OwnLawFails as failure:
            self.forgive(failure)
            return False

    def named(self, values: Array) -> dict[str, float]:
        """Return the values by name."""
        return {parameter.name: float(value) for parameter, value in zip(self.parameters, values, strict=True)}

    def predict(
        self, values: Array, near: Prediction | None = None, quantities: tuple[str, ...] = QUANTITIES
    ) -> Prediction:
        """Predict what was measured, as far as it belongs to ``quantities``.

        ``near``: a prediction of the same quantities for other values. What no differing parameter touches
        is taken over from it; where values hardly differ, crossings are followed from it.

        Raises InvalidInput when a parameter takes the machine out of its bounds, and OwnLawFails where a law of the
        user's own has a slip, or no answer and the model is not forgiving.
        """
        changed = self._changed(values, near)
        kept = near if "structure" not in changed else None
        cuts: CutPrediction | None = None
        structures: tuple[Structure, ...] = ()
        if {"outcome", "chatter_frequency", "limit_depth"} & set(quantities) and len(self.cuts):
            structures = self._structures(values) if kept is None else kept.structures
            same = kept is not None and "cut" not in changed
            cuts = kept.cuts if kept is not None and same else self._predict_cuts(values, structures, near)
        response, receptances = self._respond(values, kept) if "receptance" in quantities else (None, ())
        frequency, damping = self._modes(values, kept, quantities)
        radial, axial = self._stiffness(values, kept, quantities)
        return Prediction(
            values=values,
            cuts=cuts,
            trials=self.cuts.trials,
            receptances=receptances,
            natural_frequency=frequency,
            damping_ratio=damping,
            radial_stiffness=radial,
            axial_stiffness=axial,
            structures=structures,
            response=response,
        )

    def forgive(self, failure: OwnLawFails) -> None:
        """Raise the failure of a law of the user's own again, unless it hangs on values and the model is forgiving."""
        if not (self.forgiving and failure.hangs_on_values):
            raise failure

    def stability(self, prediction: Prediction, offset: Array) -> Stability:
        """Return the stability of every cut (cut,) at ln(depth) ``offset`` (cut,) from its own depth.

        prediction: of the cuts, whose bearings and modes are taken over. Raises OwnLawFails as ``predict`` does.
        """
        depth = self.cuts.axial_depth * np.exp(offset)
        modes = max(int(built.cut_modes.label.max()) for built in prediction.structures)
        result = without_result(len(depth), modes)
        for group, built in zip(self.cuts.groups, prediction.structures, strict=True):
            for setup in group.setups:
                at, plain = depth[setup.points], np.ones(len(setup.points))
                try:
                    stages = self.stages(prediction.values, setup.machine)
                    found = evaluate(stages, built, setup.speed_index, at, self.method, plain)
                except OwnLawFails as failure:
                    self.forgive(failure)
                    found = without_result(len(at), modes, STATUS["outside_validity"])
                result.overwrite(setup.points, found)
        return result

    def unresolved(self, prediction: Prediction) -> NDArray[np.bool_]:
        """Return the cuts (cut,) without an answer at which the machine as described turns too slowly for any.

        What that machine lacks does not change it: such cuts say nothing of what is missing.
        """
        if prediction.cuts is None:
            return np.zeros(0, dtype=bool)
        lost = np.isnan(prediction.cuts.margin)
        if not lost.any():
            return lost
        slow = np.zeros(len(lost), dtype=bool)
        for group, built in zip(self.cuts.groups, self._structures(self.nulls), strict=True):
            for setup in group.setups:
                slow[setup.points] = too_slow(self.stages(self.nulls, setup.machine), built)[setup.speed_index]
        return lost & slow

    def _changed(self, values: Array, near: Prediction | None) -> set[str]:
        """Return what the parameters touch whose values differ from those nearby."""
        if near is None:
            return {"structure"}
        return {self.parameters[index].touches for index in np.flatnonzero(values != near.values)}

    @cached_property
    def cuts(self) -> Cuts:
        """The campaign's cuts, sorted by what they share."""
        return cuts_of(self.campaign)

    def _structures(self, values: Array) -> tuple[Structure, ...]:
        count = self.available(self.cut_modes)
        return tuple(self._structure(values, group.machine, group.spindle_speed, count) for group in self.cuts.groups)

    def _structure(self, values: Array, machine: Machine, speeds: Array, count: int) -> Structure:
        """Return bearings and modes, unsolved where values without an answer are forgiven."""
        try:
            return structure(self.stages(values, machine), speeds, mode_count=count)
        except OwnLawFails as failure:
            self.forgive(failure)
            return unsolved_structure(speeds, mode_count=count)

    def _predict_cuts(self, values: Array, structures: tuple[Structure, ...], near: Prediction | None) -> CutPrediction:
        """Return the prediction of all cuts."""
        known = None
        if near is not None and near.cuts is not None:
            apart = np.abs(values - near.values) / column(self.parameters, "prior_width")
            known = near.cuts if apart.max() <= NEARBY else None
        parts, places = [], []
        for number, group in enumerate(self.cuts.groups):
            for setup in group.setups:
                stages, built = self.stages(values, setup.machine), structures[number]
                places.append(setup.points)
                try:
                    if known is not None:
                        assert near is not None
                        own = self.stages(near.values, setup.machine)
                        note_lines(known, own, self.cuts, setup, near.structures[number], self.method)
                    parts.append(predict_cuts(stages, self.cuts, setup, built, self.method, known))
                except OwnLawFails as failure:
                    self.forgive(failure)
                    parts.append(unanswered_cuts(setup, built))
        return together(parts, places)

    def available(self, most: int) -> int:
        """Return how many modes of an axis are asked for: ``most``, or all that were measured."""
        tip = self.campaign.machine.tip
        return most if tip is None else min(most, most_modes(tip))

    def _respond(self, values: Array, kept: Prediction | None) -> tuple[Structure | None, tuple[ComplexArray, ...]]:
        """Return the receptances as the sensors would show them, and the structure behind them."""
        measured = self.campaign.receptances
        if not measured:
            return None, ()
        stages = self.stages(values)
        speeds = np.unique([one.spindle_speed for one in measured])
        built = kept.response if kept is not None else None
        if built is None:
            built = self._structure(values, self.campaign.machine, speeds, self.available(self.receptance_modes))
        sensors = self._sensors(values)
        responses = []
        for number, one in enumerate(measured):
            if kept is not None and np.array_equal(sensors[number], self._sensors(kept.values)[number]):
                responses.append(kept.receptances[number])
                continue
            gain, phase, scale = sensors[number]
            modes = built.modes.at(np.searchsorted(speeds, [one.spindle_speed]))
            seen = self._seen(stages, modes, one, one.frequency * np.exp(-scale))
            responses.append(seen * np.exp(gain + 1j * phase))
        return built, tuple(responses)

    def _seen(self, stages: Stages, modes: TipModes, one: Receptance, frequency: Array) -> ComplexArray:
        """Return a response at frequencies (line,) [rad/s], NaN where there are no modes or no answer is forgiven."""
        try:
            with np.errstate(invalid="ignore"):
                return stages.receptance(modes, frequency)[0, :, one.output_axis, one.input_axis]
        except OwnLawFails as failure:
            self.forgive(failure)
            return np.full(len(frequency), np.nan, dtype=complex)

    def _sensors(self, values: Array) -> Array:
        """Return gain, phase and frequency scale of every response (response, 3)."""
        first = sum(len(term.parameters) for term in self.terms)
        count = len(self.campaign.receptances)
        return values[first : first + len(SENSOR) * count].reshape(count, len(SENSOR))

    def _modes(self, values: Array, kept: Prediction | None, quantities: tuple[str, ...]) -> tuple[Array, Array]:
        """Return natural frequency and damping ratio (row,) of the measured modes, told by their number."""
        measured = self.campaign.natural_frequencies
        if measured is None or not {"natural_frequency", "damping_ratio"} & set(quantities):
            return np.empty(0), np.empty(0)
        if kept is not None:
            return kept.natural_frequency, kept.damping_ratio
        speeds, row = np.unique(measured.spindle_speed, return_inverse=True)
        count = self.available(int(measured.mode.max()))
        modes = self._structure(values, self.campaign.machine, speeds, count).modes
        # The first axis that has a mode of this number; where none has, the model has no answer.
        alike = modes.label == measured.mode[:, None]
        first = alike.argmax(axis=1)
        found = (modes.natural_frequency[row, first], modes.damping_ratio[row, first])
        return np.where(alike.any(axis=1), found[0], np.nan), np.where(alike.any(axis=1), found[1], np.nan)

    def _stiffness(self, values: Array, kept: Prediction | None, quantities: tuple[str, ...]) -> tuple[Array, Array]:
        """Return radial and axial stiffness (row,) of the single bearing at its own preloads."""
        measured, machine = self.campaign.stiffness, self.campaign.machine
        if measured is None or "bearing_stiffness" not in quantities:
            return np.empty(0), np.empty(0)
        if kept is not None:
            return kept.radial_stiffness, kept.axial_stiffness
        radial, axial = np.full((2, len(measured.preload)), np.nan)
        for preload in np.unique(measured.preload) if machine.spindle is not None else ():
            rows = np.flatnonzero(measured.preload == preload)
            preloaded = machine.with_preload(float(preload))
            bearing = self._structure(values, preloaded, measured.spindle_speed[rows], 1).bearing
            if bearing is not None:
                radial[rows], axial[rows] = bearing.radial_stiffness, bearing.axial_stiffness
        return radial, axial


def base_model(campaign: Campaign, effects: tuple[Term, ...] = ()) -> CampaignModel:
    """Return the model of a campaign whose machine may err as data sheets do, and effects after that.

    See docs/physics.md#model-and-nuisances.
    """
    return CampaignModel(
        campaign=campaign, terms=(*machine_nuisances(campaign.machine, campaign.extreme_preloads), *effects)
    )
