"""What may be corrected, and against what: quantities of the chain, each by a smooth factor over one variable."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from chatter_core.bearing import BearingState
from chatter_core.cutting import ForceCoefficients
from chatter_core.evidence.campaign import Campaign
from chatter_core.evidence.corrections.curve import Curve, curve_over
from chatter_core.evidence.parameters import Array, Parameter, Touches
from chatter_core.evidence.prediction import CampaignModel
from chatter_core.machine import Machine, Spindle
from chatter_core.stages import KnownModes, Stages
from chatter_core.tip import TipModes

#: Width of ln(factor) before the data. At one width of their priors the effects that are known change the damping by
#: 0.3 at 10 000 rpm and the force by 0.15 ln(10), or 0.35, over a decade of speed: a factor of 1.5 is usual here. A
#: bearing's stiffness goes with the cube root of its preload, as a Hertzian contact's does: preload that doubles, which
#: warming up may do, makes it 1.26 times as large.
AMPLITUDE, STIFFNESS_AMPLITUDE = 0.4, 0.25
#: Fewer distinct places than this are no course of anything.
FEWEST_PLACES = 2

#: Spindle speeds (any,) [rad/s] -> factors (any,) of a quantity.
Factor = Callable[[Array], Array]


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """What is multiplied by a factor.

    name; words, as texts write it; change: of the stages, at one factor for each spindle speed; touches; amplitude:
    width of the logarithm of its factor before the data; held_by: name of the nuisance that multiplies the same
    quantity whatever the speed, "" where none does.
    """

    name: str
    words: str
    change: Callable[[Stages, Factor], Stages]
    touches: Touches
    amplitude: float = AMPLITUDE
    held_by: str = ""


@dataclass(frozen=True, kw_only=True)
class Axis:
    """What a quantity is corrected against: name, a key's with its unit; words; where: a cut lies on it.

    where: machine as set up for a cut, and spindle speeds (any,) [rad/s] -> places (any,). None for the order of the
    trials, which no machine knows.
    """

    name: str
    words: str
    where: Callable[[Machine, Array], Array] | None


def _scaled_seats(stages: Stages, factor: Factor) -> Stages:
    before = stages.seat_stiffness

    def seat_stiffness(spindle: Spindle, state: BearingState) -> Array:
        return before(spindle, state) * factor(state.spindle_speed)[:, None]

    return replace(stages, seat_stiffness=seat_stiffness)


def _stiffened_modes(stages: Stages, factor: Factor) -> Stages:
    """Return the stages with modes of another stiffness and the same mass."""
    before = stages.tip_modes

    def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
        modes = before(known, spindle_speed, mode_count)
        root = np.sqrt(factor(spindle_speed))[:, None]
        return replace(modes, natural_frequency=modes.natural_frequency * root)

    return replace(stages, tip_modes=tip_modes)


def _damped_modes(stages: Stages, factor: Factor) -> Stages:
    before = stages.tip_modes

    def tip_modes(known: KnownModes, spindle_speed: Array, mode_count: int) -> TipModes:
        return before(known, spindle_speed, mode_count).damped(factor(spindle_speed))

    return replace(stages, tip_modes=tip_modes)


def _scaled_force(stages: Stages, factor: Factor) -> Stages:
    before = stages.force_coefficients

    def force_coefficients(machine: Machine, spindle_speed: Array) -> ForceCoefficients:
        found, scale = before(machine, spindle_speed), factor(spindle_speed)
        return ForceCoefficients(tangential=found.tangential * scale, radial=found.radial * scale)

    return replace(stages, force_coefficients=force_coefficients)


def _speed(machine: Machine, spindle_speed: Array) -> Array:
    return spindle_speed


def _feed(machine: Machine, spindle_speed: Array) -> Array:
    return np.full_like(spindle_speed, machine.process.feed_per_tooth)


def _immersion(machine: Machine, spindle_speed: Array) -> Array:
    return np.full_like(spindle_speed, machine.process.radial_immersion)


SEATS = Quantity(
    name="seat_stiffness",
    words="stiffness of the bearing seats",
    change=_scaled_seats,
    touches="structure",
    amplitude=STIFFNESS_AMPLITUDE,
)
MODES = Quantity(
    name="modal_stiffness",
    words="stiffness of the modes",
    change=_stiffened_modes,
    touches="structure",
    amplitude=STIFFNESS_AMPLITUDE,
)
DAMPING = Quantity(
    name="damping", words="damping of the modes", change=_damped_modes, touches="structure", held_by="damping"
)
FORCE = Quantity(
    name="cutting_force",
    words="cutting force",
    change=_scaled_force,
    touches="cut",
    held_by="specific_cutting_energy",
)

SPEED = Axis(name="spindle_speed_rpm", words="spindle speed", where=_speed)
FEED = Axis(name="feed_per_tooth_mm", words="feed per tooth", where=_feed)
IMMERSION = Axis(name="radial_immersion", words="radial immersion", where=_immersion)
TRIAL = Axis(name="trial", words="the order of the trials", where=None)


@dataclass(frozen=True, kw_only=True)
class Correction:
    """A quantity times f(x), ln f a smooth curve: a term of the model like a nuisance, and no effect that has a name.

    at: the place on the axis of everything that is predicted, where the axis is the order of the trials.
    """

    quantity: Quantity
    axis: Axis
    curve: Curve
    at: float | None = None

    @property
    def name(self) -> str:
        """Name of the quantity and of what it is corrected against."""
        return f"{self.quantity.name}_against_{self.axis.name}"

    def __str__(self) -> str:
        return f"{self.quantity.words} against {self.axis.words}"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Coordinates of the curve, independent and of unit width."""
        return tuple(
            Parameter(
                name=f"{self.name}.{number + 1}",
                unit="",
                doc=f"coordinate {number + 1} of the curve of the {self}",
                prior_width=1.0,
                touches=self.quantity.touches,
            )
            for number in range(self.curve.count)
        )

    def apply(self, stages: Stages, values: Array) -> Stages:
        """Return the stages with the quantity multiplied; where the curve is zero, as they were."""
        if not values.any():
            return stages
        return self.quantity.change(stages, lambda speed: np.exp(self._log_factor(stages.machine, speed, values)))

    def _log_factor(self, machine: Machine, spindle_speed: Array, values: Array) -> Array:
        if self.axis.where is None:
            assert self.at is not None
            place = np.full_like(spindle_speed, self.at)
        else:
            place = self.axis.where(machine, spindle_speed)
        return self.curve.log_factor(place, values)


def corrections_of(model: CampaignModel, values: Array) -> tuple[Correction, ...]:
    """Return every correction that a campaign can tell something about, of a model at values (parameter,).

    A quantity that a nuisance multiplies as a whole has a curve of mean zero. Bearings that feel no speed at these
    values have no stiffness against it.

    See docs/physics.md#corrections.
    """
    return tuple(_corrections(model, values))


def _corrections(model: CampaignModel, values: Array) -> Iterator[Correction]:
    campaign, nuisances = model.campaign, {parameter.name for parameter in model.parameters}
    stiff = SEATS if campaign.machine.spindle is not None else MODES
    pairs = [(DAMPING, SPEED), (FORCE, SPEED), (FORCE, FEED), (FORCE, IMMERSION), (FORCE, TRIAL), (stiff, TRIAL)]
    if stiff == MODES or _bearings_feel_speed(model, values):
        pairs.insert(0, (stiff, SPEED))
    for quantity, axis in pairs:
        places = measured_places(campaign, quantity, axis)
        if len(np.unique(places)) >= FEWEST_PLACES:
            # The order of trials has one number for all that was measured before them: the first.
            at = float(places.min()) if axis == TRIAL else None
            level = quantity.held_by not in nuisances
            curve = curve_over(places, amplitude=quantity.amplitude, level=level)
            yield Correction(quantity=quantity, axis=axis, curve=curve, at=at)


def _bearings_feel_speed(model: CampaignModel, values: Array) -> bool:
    return bool(model.stages(values).bearing_speed(np.ones(1), "dynamic").any())


def measured_places(campaign: Campaign, quantity: Quantity, axis: Axis) -> Array:
    """Return where on an axis something was measured (any,) that a quantity has a part in; in SI.

    See docs/physics.md#corrections.
    """
    trials, process = campaign.trials, campaign.machine.process
    if axis == SPEED:
        return _speeds(campaign, uncut=quantity != FORCE)
    if trials is None:
        return np.empty(0)
    if axis == TRIAL:
        return trials.trial.astype(float)
    stated = {FEED.name: trials.feed_per_tooth, IMMERSION.name: trials.radial_immersion}[axis.name]
    own = {FEED.name: process.feed_per_tooth, IMMERSION.name: process.radial_immersion}[axis.name]
    # Limiting depths are the machine's as it is set up.
    of_limits = [] if campaign.limits is None else [own]
    return np.append(np.where(np.isnan(stated), own, stated), of_limits)


def _speeds(campaign: Campaign, *, uncut: bool) -> Array:
    """Return all spindle speeds of cuts (any,) [rad/s], and those at which anything else was measured."""
    speeds = [campaign.cut_speeds]
    if uncut:
        speeds.append(np.array([one.spindle_speed for one in campaign.receptances]))
        if campaign.natural_frequencies is not None:
            speeds.append(campaign.natural_frequencies.spindle_speed)
    return np.concatenate(speeds)
