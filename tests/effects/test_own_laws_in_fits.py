"""Laws of users' own in fits: what has no answer at some values counts as without one, and a slip ends the run."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from chatter_core.effects import variants
from chatter_core.errors import OwnLawFails
from chatter_core.evidence import CampaignModel, Comparison, calibrate
from chatter_core.evidence.belief import Belief
from chatter_core.evidence.boundary import sure_field
from chatter_core.evidence.measured import OUTCOMES, NaturalFrequencies
from chatter_core.evidence.nuisances import SENSOR
from chatter_core.variables import STATUS
from pipeline.command_line import main
from tests.effects.test_own_laws import write
from tests.synthetic import RPM, campaign, receptance, tip_machine, trials

MACHINE = Path(__file__).parents[1] / "data" / "campaigns" / "r01" / "machine.yaml"
#: A law that has no answer where it is strong, of the cut, of the structure, and as Python tells it.
CUT = "return replace(found, tangential=found.tangential * (1.0 + size - 4.0 * (size > 0.5)))"
MODES = "return replace(found, damping_ratio=found.damping_ratio * (1.0 - 2.0 * size))"
LAWS = pytest.mark.parametrize(
    ("stage", "law"),
    [
        ("force_coefficients", CUT),
        ("tip_modes", MODES),
        ("force_coefficients", "__import__('math').log(0.5 - size); return found"),
    ],
)
SPEED, DEPTH = np.array([1500.0, 2000.0, 2500.0, 3000.0]) * RPM, np.array([1e-3, 3e-3, 1e-3, 3e-3])


def model_with(folder: Path, stage: str, law: str, touches: str = "structure", *, forgiving: bool = True):
    """A model with an effect of one's own, of a campaign whose measurements are those of the machine without it."""
    (effect,) = variants("mine", write(folder, stage, law, touches=touches))
    lines = np.linspace(1e3, 5e3, 9)
    modes = NaturalFrequencies(
        spindle_speed=np.zeros(1),
        mode=np.ones(1, dtype=int),
        natural_frequency=np.array([600.0 * 2.0 * np.pi]),
        damping_ratio=np.array([0.03]),
    )
    planned = campaign(tip_machine(), trials=trials(SPEED, DEPTH), receptances=(receptance(lines),))
    truth = CampaignModel(campaign=planned, terms=()).predict(np.zeros(3 + len(SENSOR)))
    outcome = np.where(truth.margin > 0.0, OUTCOMES.index("chatter"), OUTCOMES.index("stable")).astype(np.int8)
    heard = np.where(truth.margin > 0.0, 4e3, np.nan)
    plan = campaign(
        tip_machine(),
        trials=trials(SPEED, DEPTH, outcome=outcome, chatter_frequency=heard),
        receptances=(receptance(lines, truth.receptances[0]),),
        natural_frequencies=modes,
    )
    return CampaignModel(campaign=plan, terms=(effect,), forgiving=forgiving)


def at(model: CampaignModel, size: float) -> np.ndarray:
    return np.where([parameter.name == "mine.size" for parameter in model.parameters], size, model.nulls)


@LAWS
def test_values_without_an_answer_are_far_off_and_end_no_fit(tmp_path: Path, stage: str, law: str):
    model = model_with(tmp_path, stage, law)
    comparison = Comparison(model=model)
    weak, strong = comparison.evaluate(at(model, 0.2)), comparison.evaluate(at(model, 1.0))
    assert not weak.state.prediction.failed
    lost = strong.state.prediction
    # What the arrow has no part in is answered.
    of_structure = stage == "tip_modes"
    assert lost.failed == (lost.asked if of_structure else len(SPEED))
    assert np.isfinite(strong.log_density).all()
    assert np.isfinite(strong.coordinates).all()
    assert strong.log_density.sum() < weak.log_density.sum() - 1.0
    assert strong.coordinates.shape == weak.coordinates.shape
    # Nothing that has no answer is taken over by values nearby.
    again = comparison.evaluate(at(model, 0.2), strong)
    assert np.array_equal(again.log_density, weak.log_density)
    assert (model.stability(lost, np.zeros(4)).status == STATUS["outside_validity"]).all()
    assert not calibrate(comparison).evaluation.state.prediction.failed


def test_a_law_of_the_cut_that_cannot_be_made_takes_no_structure_with_it(tmp_path: Path):
    write(tmp_path, "force_coefficients", "return found", touches="cut")
    file = tmp_path / "mine.py"
    file.write_text(file.read_text().replace("size = values[0]", "size = __import__('math').log(1.0 - values[0])"))
    (effect,) = variants("mine", tmp_path)
    model = CampaignModel(
        campaign=campaign(tip_machine(), trials=trials(SPEED, DEPTH)), terms=(effect,), forgiving=True
    )
    lost = model.predict(at(model, 1.0))
    assert lost.failed == len(SPEED)
    assert all(built.solved.all() for built in lost.structures)
    assert not model.predict(at(model, 0.5), lost).failed


@LAWS
def test_a_model_that_forgives_nothing_tells_it(tmp_path: Path, stage: str, law: str):
    model = model_with(tmp_path, stage, law, forgiving=False)
    with pytest.raises(OwnLawFails, match=r"mine.py.*: "):
        model.predict(at(model, 1.0))


def test_a_slip_ends_a_fit_with_its_line(tmp_path: Path):
    model = model_with(tmp_path, "force_coefficients", "return found if size < 0.5 else fond")
    assert not model.predict(at(model, 0.2)).failed
    with pytest.raises(OwnLawFails, match=r"mine.py, line 18: NameError: name 'fond'"):
        model.predict(at(model, 1.0))


def test_a_field_without_an_answer_is_empty(tmp_path: Path):
    # It has an answer at the speeds of the cuts alone.
    law = "return replace(found, tangential=found.tangential * np.where(np.isin(given[1], {}), 1.0, -1.0))"
    model = model_with(tmp_path, "force_coefficients", law.format([*map(float, SPEED)]))
    belief = Belief(names=("mine.size",), estimate=np.ones(1), deviation=np.ones(1), correlation=np.eye(1))
    assert np.isnan(sure_field(model, belief, 0, (5, 4)).growth).all()


def quick(folder: Path) -> Path:
    """A campaign that is judged in a second."""
    made = folder / "quick"
    made.mkdir()
    shutil.copy(MACHINE, made)
    rows = "spindle_speed_rpm,mode,natural_frequency_hz,damping_ratio\n0,1,147,0.004\n0,5,900,\n"
    (made / "modes.csv").write_text(rows)
    return made


@pytest.mark.parametrize("verb", ["diagnose", "improve"])
@pytest.mark.parametrize(
    ("values", "said"),
    [
        ("size: 9\n", "mine.yaml: size: found 9, allowed: 0 to 2"),
        ("sise: 1\n", "mine.yaml: sise: unknown key; did you mean size?"),
        ("size: much\n", "mine.yaml: size: found 'much', allowed: a number, 0 to 2"),
        ("size: [1\n", "mine.yaml, line 2: no valid yaml: "),
    ],
)
def test_values_that_are_not_right_are_told_before_anything_is_fitted(
    tmp_path: Path, capsys, monkeypatch, verb: str, values: str, said: str
):
    monkeypatch.setattr("pipeline.diagnosis.spread", lambda *_: pytest.fail("something was fitted"))
    own = tmp_path / "own"
    own.mkdir()
    (write(own, "cut_modes", "return found") / "mine.yaml").write_text(values)
    words = [f"campaign={quick(tmp_path)}", f"effects_path={own}", "cluster=serial", f"output={tmp_path / 'answer'}"]
    assert main([verb, *words]) == 2
    told = capsys.readouterr().err
    assert f"{own}/{said}" in told
    assert "Traceback" not in told


@pytest.mark.parametrize("verb", ["compare", "diagnose"])
def test_a_law_that_fails_as_it_is_configured_is_told_at_once(tmp_path: Path, capsys, verb: str):
    own = tmp_path / "own"
    own.mkdir()
    write(own, "tip_modes", MODES)
    words = [f"campaign={quick(tmp_path)}", f"effects_path={own}", "effects=[mine]", "cluster=serial"]
    assert main([verb, *words, f"output={tmp_path / 'answer'}"]) == 2
    assert "mine.py: tip_modes returned modes whose damping_ratio is -0." in capsys.readouterr().err
    assert not (tmp_path / "answer").exists()


def test_whether_teeth_are_unlike_is_asked_as_forgivingly_as_all_else(tmp_path):
    law = "return replace(found, pitch=found.pitch * (1.0 - 2.0 * size))"
    model = model_with(tmp_path, "teeth", law, touches="cut")
    strict = model_with(tmp_path, "teeth", law, touches="cut", forgiving=False)
    assert not model.has_unlike_teeth(at(model, 0.9))
    with pytest.raises(OwnLawFails):
        strict.has_unlike_teeth(at(strict, 0.9))
