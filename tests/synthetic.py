"""Campaigns made from the model itself, with known parameters and the noise that the likelihoods state."""

from dataclasses import replace

import numpy as np

from chatter_core.evidence import Campaign, CampaignModel, base_model, likelihood
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.measured import OUTCOMES, Receptance, Trials, measuring_ranges
from chatter_core.evidence.parameters import column
from chatter_core.machine import Machine

RPM = 2.0 * np.pi / 60.0


def tip_machine(teeth=2, **process):
    """One measured mode on either axis; two straight teeth in half immersion, unless said otherwise."""
    mode = {"natural_frequency_hz": 600.0, "damping_ratio": 0.03, "stiffness_n_um": 10.0}
    return Machine.model_validate(
        {
            "tip": {"modes": [{"axis": "x", **mode}, {"axis": "y", **mode, "natural_frequency_hz": 660.0}]},
            "tool": {"teeth": teeth, "diameter_mm": 12.0, "helix_angle_deg": 0.0, "rake_angle_deg": 0.0},
            "cutting": {"kt_mpa": 700.0, "kn": 0.3, "friction_coefficient": 0.0},
            "process": {"direction": "down", "radial_immersion": 0.5, "feed_per_tooth_mm": 0.1, **process},
        }
    )


def machine_of_modes(count):
    """So many measured modes of either axis, and otherwise ``tip_machine``."""
    mode = {"damping_ratio": 0.03, "stiffness_n_um": 10.0}
    modes = [{"axis": axis, "natural_frequency_hz": 400.0 * (i + 1), **mode} for axis in "xy" for i in range(count)]
    return Machine.model_validate({**tip_machine().described(), "tip": {"modes": modes}})


def trials(spindle_speed, axial_depth, **stated):
    """Trials at speeds [rad/s] and depths [m], all stable and silent unless ``stated`` says otherwise."""
    count = len(spindle_speed)
    nothing = np.full(count, np.nan)
    given = {
        "trial": np.arange(count),
        "spindle_speed": np.asarray(spindle_speed, dtype=float),
        "axial_depth": np.asarray(axial_depth, dtype=float),
        "outcome": np.zeros(count, dtype=np.int8),
        "chatter_frequency": nothing,
        "preload": nothing,
        "radial_immersion": nothing,
        "feed_per_tooth": nothing,
        "direction": np.full(count, NO_WORD, dtype=np.int8),
        "unknown": {},
    }
    return Trials(**{**given, **stated})


def campaign(machine, **measured):
    """A campaign of a machine with what was measured and nothing else."""
    nothing = {"trials": None, "receptances": (), "natural_frequencies": None, "stiffness": None, "limits": None}
    return Campaign(machine=machine, remarks=(), unknown_columns=(), **{**nothing, **measured})


def receptance(frequency, value=None, speed=0.0, axis=0):
    """A direct response; without values, one that only says at which frequencies [rad/s] one was measured."""
    value = np.ones(len(frequency), dtype=complex) if value is None else value
    return Receptance(
        source="frf.csv", spindle_speed=speed, output_axis=axis, input_axis=axis, frequency=frequency, value=value
    )


def drawn_truth(model: CampaignModel, rng):
    """Draw parameters from their priors."""
    mean, width = column(model.parameters, "prior_mean"), column(model.parameters, "prior_width")
    drawn = mean + width * rng.standard_normal(len(mean))
    return np.clip(drawn, column(model.parameters, "lower"), column(model.parameters, "upper"))


def measured(planned: Campaign, truth, rng, effects=()) -> Campaign:
    """Measure a planned campaign on the model with these parameters: labels, frequencies, responses with noise.

    effects: of the model, beyond the machine as data sheets have it.
    """
    plan = planned.trials
    # A frequency everywhere makes the model say one everywhere.
    heard = replace(planned, trials=replace(plan, chatter_frequency=np.ones(len(plan))))
    comparison = Comparison(model=base_model(heard, tuple(effects)))
    prediction = comparison.model.predict(truth)
    probability = comparison.outcome_probabilities(truth, prediction.margin)
    chatter = rng.random(len(plan)) < probability[:, -1]
    frequency = prediction.chatter_frequency
    scale = likelihood.frequency_scale(frequency, prediction.margin)
    near = frequency + scale * rng.standard_t(likelihood.FREQUENCY_FREEDOM, len(plan))
    spacing = planned.machine.tool.teeth * plan.spindle_speed
    elsewhere = frequency + spacing * rng.uniform(-0.5, 0.5, len(plan))
    frequency = np.where(rng.random(len(plan)) < likelihood.FREQUENCY_ELSEWHERE, elsewhere, near)
    responses = []
    exact = [replace(one, value=h) for one, h in zip(planned.receptances, prediction.receptances, strict=True)]
    for one, largest in zip(exact, measuring_ranges(exact), strict=True):
        noise = rng.standard_normal((2, len(one.value)))
        error = likelihood.line_errors(one.value, largest)
        responses.append(replace(one, value=one.value + error * (noise[0] + 1j * noise[1])))
    outcome = np.where(chatter, OUTCOMES.index("chatter"), OUTCOMES.index("stable")).astype(np.int8)
    return replace(
        planned,
        trials=replace(plan, outcome=outcome, chatter_frequency=np.where(chatter, frequency, np.nan)),
        receptances=tuple(responses),
    )
