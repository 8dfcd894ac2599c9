"""The chain in a few lines: the numbers of the lobes, told in the units of the shop, and a notebook that runs."""

import json
from pathlib import Path

import matplotlib
import numpy as np
import pytest

import chatter_core
from chatter_core.errors import InvalidInput
from chatter_core.lobes import lobe_block  # noqa: F401  # the name of a module must not hide the function

NOTEBOOKS = Path(__file__).parents[2] / "docs" / "examples" / "notebooks"


@pytest.fixture
def machine():
    return chatter_core.read_machine(NOTEBOOKS / "machine.yaml")


def test_reference_machine_has_its_limit_depths(reference_machine):
    found = chatter_core.stability_lobes(reference_machine, [12000, 14000, 16000, 18000])
    # Found once by an independent order-1 semi-discretization with n = 60, and good to 3 % here.
    assert found.first_limit_mm == pytest.approx([2.07, 0.87, 0.95, 0.98], rel=0.03)
    assert found.natural_frequency_hz.shape == (4, 2, 4)
    told = repr(found)
    assert "4 spindle speeds, 12000 to 18000 rpm" in told
    assert "shallowest limit  0.8" in told


def test_what_is_stable_is_told_so_and_effects_act(machine):
    found = chatter_core.stability_lobes(machine, 9000.0, deepest_mm=0.01, mode_count=1)
    assert np.isnan(found.first_limit_mm).all()
    assert "stable down to 0.01 mm" in repr(found)
    plain, damped = (
        chatter_core.stability_lobes(machine, [2500.0], effects=effects)
        for effects in (None, {"process_damping": {"coefficient_n_m": 2e4}})
    )
    assert damped.first_limit_mm > plain.first_limit_mm


def test_speeds_without_a_result_are_not_told_as_stable(reference_machine):
    """Of a spindle that hardly turns Floquet analysis says nothing."""
    found = chatter_core.stability_lobes(reference_machine, [50.0, 12000.0])
    assert found.known.tolist() == [False, True]
    assert "no result at 1 of them" in repr(found)
    assert "12000 rpm" in repr(found)
    alone = chatter_core.stability_lobes(reference_machine, 50.0)
    assert "no result at 1 of them" in repr(alone)
    assert "stable" not in repr(alone)


@pytest.mark.parametrize(
    ("words", "told"),
    [
        ({"spindle_speed_rpm": [-1.0]}, "spindle_speed_rpm"),
        ({"spindle_speed_rpm": [[1.0]]}, "spindle_speed_rpm"),
        ({"spindle_speed_rpm": 9000.0, "deepest_mm": 0.0}, "deepest_mm"),
        ({"spindle_speed_rpm": 9000.0, "effects": {"proces_damping": {}}}, "process_damping"),
        ({"spindle_speed_rpm": 9000.0, "mode_count": 1000}, "mode_count"),
        ({"spindle_speed_rpm": 9000.0, "mode_count": 0}, "mode_count: found 0, allowed: whole numbers from 1"),
        ({"spindle_speed_rpm": 9000.0, "mode_count": 2.0}, "mode_count: found 2.0"),
        ({"spindle_speed_rpm": 9000.0, "modal_parameters": "Dynamic"}, "found 'Dynamic', allowed: dynamic, static"),
    ],
)
def test_what_is_wrong_is_told(machine, words, told):
    with pytest.raises(InvalidInput, match=told):
        chatter_core.stability_lobes(machine, **words)


def test_a_machines_file_is_no_machine():
    with pytest.raises(InvalidInput, match=r"machine: found 'machine.yaml', allowed: a machine, as read_machine"):
        chatter_core.stability_lobes("machine.yaml", [5000.0])


def test_unknown_names_are_no_attributes():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = chatter_core.nothing


def test_the_notebook_runs(monkeypatch):
    matplotlib.use("Agg")
    monkeypatch.chdir(NOTEBOOKS)
    names: dict[str, object] = {}
    for cell in json.loads((NOTEBOOKS / "lobes.ipynb").read_text())["cells"]:
        if cell["cell_type"] == "code":
            exec("".join(cell["source"]), names)
    assert isinstance(names["lobes"], chatter_core.Lobes)
