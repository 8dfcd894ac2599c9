"""Effects in a comparison with measurements: the same stages as in a sweep, and parameters that a fit recovers."""

import numpy as np
import pytest

from chatter_core.effects import ActiveEffect, apply_effects, effect_class, effect_names, variants
from chatter_core.evidence import base_model
from chatter_core.evidence.calibration import calibrate
from chatter_core.evidence.comparison import Comparison
from chatter_core.evidence.measured import Limits
from chatter_core.evidence.prediction import FITTING_METHOD
from chatter_core.lobes import lobe_block
from chatter_core.machine import Machine
from chatter_core.stages import Stages
from tests.synthetic import RPM, campaign, tip_machine, trials

#: Stages up to this one belong to the structure, the rest to the cut: what a change has computed anew.
LAST_OF_STRUCTURE = "cut_modes"


def first_limits(stages: Stages, speeds, mode_count: int):
    return lobe_block(
        stages,
        spindle_speed=speeds,
        axial_depth=np.linspace(2e-4, 8e-3, 30),
        mode_count=mode_count,
        modal_parameters="dynamic",
        method=FITTING_METHOD,
    ).limit_depth[:, 0]


@pytest.mark.parametrize("name", effect_names())
def test_what_a_parameter_touches_is_computed_anew(name: str):
    kind = effect_class(name)
    order = list(Stages.__dataclass_fields__)
    last = order.index(LAST_OF_STRUCTURE)
    expected = {"structure" if order.index(one.acts_on) <= last else "cut" for one in variants(name)}
    assert {parameter.touches for parameter in kind.declared} == expected


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("thermal_preload", [1.0, 1.5]),
        ("housing_compliance", [0.01, 0.0]),
        ("process_damping", [2e5]),
        ("cutting_speed_coefficient", [0.3]),
    ],
)
def test_a_fit_sees_the_limit_depths_of_a_sweep(name: str, values: list[float], reference_machine: Machine):
    effect, speeds = variants(name)[0], np.array([5000.0, 14000.0]) * RPM
    stages = apply_effects(reference_machine, [ActiveEffect(effect=effect, values=tuple(values))])
    shares = np.log([0.9, 1.1])
    depth = first_limits(stages, speeds, 4) * np.exp(shares)
    model = base_model(campaign(reference_machine, trials=trials(speeds, depth)), effects=(effect,))
    at = model.nulls
    for parameter, value in zip(effect.parameters, values, strict=True):
        at[[one.name for one in model.parameters].index(parameter.name)] = value
    # Limit depths are found to 5e-7 m, margins to 1e-5.
    assert model.predict(at).margin == pytest.approx(shares, abs=2e-3)
    assert np.abs(model.predict(model.nulls).margin - shares).max() > 0.01


def test_a_fit_recovers_process_damping_from_limit_depths():
    """Noise-free limit depths of slow and fast cuts, with k_t a tenth too low on the sheet.

    Only the ratio of forces to stiffness is seen here, so the tenth is shared by k_t and the stiffness; the growth of
    the limit towards low speed is the effect alone.
    """
    machine, speeds = tip_machine(), np.linspace(800.0, 6000.0, 14) * RPM
    (effect,) = variants("process_damping")
    truth = ActiveEffect(effect=effect, values=(3e4,))
    cutting = machine.cutting.model_copy(update={"specific_cutting_energy": 770e6})
    limit = first_limits(apply_effects(machine.model_copy(update={"cutting": cutting}), [truth]), speeds, 1)
    found = np.isfinite(limit)
    table = Limits(spindle_speed=speeds[found], limit_depth=limit[found], uncertainty=0.02 * limit[found])
    fit = calibrate(Comparison(model=base_model(campaign(machine, limits=table), effects=(effect,))))
    named = dict(zip([parameter.name for parameter in fit.parameters], fit.estimate, strict=True))
    assert named["process_damping.coefficient_n_m"] == pytest.approx(3e4, rel=0.1)
