"""What a hypothesis still fails in: sizes of its own effects are no failure, sizes of nuisances are."""

from types import SimpleNamespace

import numpy as np
import pytest

from chatter_core.effects import variants
from chatter_core.evidence.failures import Failure
from pipeline.diagnosis import what_is_left


def failure(quantity, **band):
    return Failure(quantity=quantity, band=band, excess=1.0, chance=1e-4, text="It fails.")


def left(at_bound):
    """Return the parameters whose sizes count, with an effect's size at its bound or not."""
    (effect,) = variants("radial_immersion_error")
    (size,) = effect.parameters
    nuisance = SimpleNamespace(name="kn")
    hypothesis = SimpleNamespace(
        comparison=SimpleNamespace(model=SimpleNamespace(terms=(SimpleNamespace(parameters=(nuisance,)), effect))),
        fit=SimpleNamespace(parameters=(nuisance, size), at_bound=np.array([False, at_bound])),
    )
    judged = SimpleNamespace(
        failures=[
            failure("outcome", trial=[3.0, 9.0]),
            failure("calibration", parameter="kn"),
            failure("calibration", parameter=size.name),
        ]
    )
    return [one.band.get("parameter", one.quantity) for one in what_is_left(hypothesis, judged)]


@pytest.mark.parametrize(("at_bound", "counts"), [(False, ["outcome", "kn"]), (True, ["outcome", "kn", "own"])])
def test_the_size_of_an_effect_counts_only_at_its_bound(at_bound, counts):
    assert left(at_bound) == [name.replace("own", "radial_immersion_error.error") for name in counts]
