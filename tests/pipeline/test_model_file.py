"""A calibrated model that the program wrote is one that it reads."""

from types import SimpleNamespace

import numpy as np
import pytest
import yaml

from chatter_core.errors import InvalidInput
from chatter_core.evidence import base_model
from chatter_core.evidence.parameters import column
from pipeline import model_file
from pipeline.campaigns import model_of
from pipeline.command_line import main
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


def written(folder, effects):
    """Write a model of a machine with measured tip modes that has effects; return its file."""
    content = model_file.Content(effects=effects)
    model = model_of(campaign(tip_machine(), trials=trials([600.0], [0.001])), content)
    parameters = model.parameters
    fit = SimpleNamespace(
        parameters=parameters,
        estimate=column(parameters, "prior_mean"),
        standard_deviation=np.full(len(parameters), 0.1),
        correlation=np.eye(len(parameters)),
    )
    model_file.write(folder / "model.yaml", model.campaign, fit, content)
    return folder / "model.yaml"


def without(file, *names):
    """Take parameters out of a model file, with what they correlate with; all if none is named."""
    content = yaml.safe_load(file.read_text())
    kept = [i for i, one in enumerate(content["parameters"]) if names and one["name"] not in names]
    content["correlation"] = [[content["correlation"][i][j] for j in kept] for i in kept]
    content["parameters"] = [content["parameters"][i] for i in kept]
    file.write_text(yaml.safe_dump(content))


def problems_of(file, effects):
    made = campaign(tip_machine(), trials=trials([600.0], [0.001]))
    found = model_file.read(file, made.machine)
    try:
        model_file.belief_of(found, file, model_of(made, model_file.Content(effects=effects)))
    except InvalidInput as error:
        return error.problems
    return []


DAMPED = {"process_damping": {}}


@pytest.mark.parametrize(
    ("names", "missing"),
    [
        (("process_damping.coefficient_n_m",), ["process_damping.coefficient_n_m"]),
        (("kn",), ["kn"]),
        ((), ["specific_cutting_energy", "kn", "damping", "tip_frequency", "tip_stiffness",
              "process_damping.coefficient_n_m"]),
        (("mislabelled", "outcome_width"), []),
    ],
)  # fmt: skip
def test_a_model_file_that_lost_parameters_of_its_model_is_refused_with_their_names(tmp_path, names, missing):
    file = written(tmp_path, DAMPED)
    assert problems_of(file, DAMPED) == []
    without(file, *names)
    why = "missing; needed: every parameter of the model, so restore it or fit the model again"
    assert problems_of(file, DAMPED) == [f"{file}: parameters: {name}: {why}" for name in missing]


def test_an_effect_added_by_hand_without_its_parameters_is_refused(tmp_path):
    (told,) = problems_of(written(tmp_path, {}), DAMPED)
    assert "parameters: process_damping.coefficient_n_m: missing" in told


@pytest.mark.parametrize(
    ("key", "value", "told"),
    [
        ("base", "static_bearing", "base: static_bearing holds bearings at rest"),
        ("effects", {"holder_joint": {"joint": "tool/holder"}}, "effects.holder_joint: acts on spindle and bearing"),
        ("modes", 5, "modes: found 5, allowed: 1 to 1"),
    ],
)
def test_what_a_model_cannot_be_on_its_machine_is_told_with_its_file(tmp_path, capsys, key, value, told):
    file = written(tmp_path, {})
    content = yaml.safe_load(file.read_text())
    (tmp_path / "campaign").mkdir()
    (tmp_path / "campaign" / "machine.yaml").write_text(yaml.safe_dump(content["machine"]))
    (tmp_path / "campaign" / "modes.csv").write_text("spindle_speed_rpm,mode,natural_frequency_hz\n0,1,600\n")
    file.write_text(yaml.safe_dump(content | {key: value}))
    assert main(["compare", f"campaign={tmp_path / 'campaign'}", f"model={file}", f"output={tmp_path / 'out'}"]) == 2
    assert f"error: {file}: {told}" in capsys.readouterr().err
