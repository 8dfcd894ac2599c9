"""A calibrated model that the program wrote is one that it reads."""

from types import SimpleNamespace

import numpy as np
import pytest

from chatter_core.evidence import base_model
from chatter_core.evidence.parameters import column
from pipeline import model_file
from tests.synthetic import campaign, tip_machine, trials


@pytest.mark.parametrize("kn", [0.3, 0.7, 1.1])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_fit_that_ended_at_bounds_is_read_again(tmp_path, kn, side):
    machine = tip_machine()
    machine = machine.model_copy(update={"cutting": machine.cutting.model_copy(update={"kn": kn})})
    model = base_model(campaign(machine, trials=trials([600.0], [0.001])))
    bounds, widths = column(model.parameters, side), column(model.parameters, "prior_width")
    fit = SimpleNamespace(
        parameters=model.parameters,
        # Fits end within a hundred widths of their priors, and a file may say no more.
        estimate=np.where(abs(bounds) < 100.0 * widths, bounds, 0.0),
        standard_deviation=np.full(len(bounds), 0.1),
        correlation=np.eye(len(bounds)),
    )
    file = tmp_path / "model.yaml"
    model_file.write(file, model.campaign, fit, model_file.Content())
    belief = model_file.belief_of(model_file.read(file, machine), file, model)
    # A factor at its bound keeps the machine within its own.
    model.stages(belief.estimate)
    # Written with eight digits.
    np.testing.assert_allclose(belief.estimate, fit.estimate, rtol=5e-8)
