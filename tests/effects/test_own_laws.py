"""Laws of users' own that no chain could use: told with their file, wherever in the chain they act."""

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from chatter_core.chain import structure
from chatter_core.effects import activate, apply_effects, effect_class, effect_names, variants
from chatter_core.effects._own import findings_of_touches
from chatter_core.errors import InvalidInput, OwnLawFails
from chatter_core.evidence import CampaignModel, Comparison
from chatter_core.evidence.candidates import Candidate, extended
from chatter_core.floquet import MethodSettings
from chatter_core.lobes import LobeBlock
from chatter_core.machine import Machine
from chatter_core.parameters import Parameter
from chatter_core.stability import critical_multipliers
from chatter_core.variables import STATUS
from pipeline.command_line import main
from pipeline.kinds.lobes import _guarded
from tests.pipeline.studies import WORDS
from tests.synthetic import campaign, tip_machine

METHOD = MethodSettings(name="collocation", tolerance=1e-3)
SPEED, DEPTH = np.array([600.0, 1000.0]), np.array([1e-3, 1e-3])
#: An effect whose law changes ``found``, what was there before; its first line is the 18th.
EFFECT = """
from dataclasses import dataclass, replace
from typing import Any, ClassVar
import numpy as np
from chatter_core.effects import Effect
from chatter_core.parameters import Parameter
@dataclass(frozen=True, kw_only=True)
class {name}(Effect):
    stage: ClassVar[str] = "{stage}"
    changes: ClassVar[tuple[str, ...]] = ("bearing", "modes", "cut")
    declared: ClassVar[tuple[Parameter, ...]] = (
        Parameter(name="size", unit="", doc="size", prior_width=0.2, lower=0.0, upper=2.0, touches="{touches}"),
    )
    def transform(self, before, machine, values):
        size = values[0]
        def law(*given):
            found = before(*given)
            {law}
        return law
"""
JOINT = "from chatter_core.joint import Joint; return (Joint(position={}, **{}),)"
ENGAGED = "return replace(found, entry={}, exit={})"
FEEDBACK = "return replace(found, feedback=tuple(replace(one, {}) for one in found.feedback))"


def write(folder: Path, stage: str, law: str, name: str = "mine", touches: str = "structure") -> Path:
    text = EFFECT.format(name=name.capitalize(), stage=stage, law=law, touches=touches)
    (folder / f"{name}.py").write_text(text)
    (folder / f"{name}.yaml").write_text("size: 1.0\n")
    return folder


def multipliers(machine: Machine, *effects) -> np.ndarray:
    """Return the multipliers of two cuts, and have receptances computed."""
    stages = apply_effects(machine, effects)
    built = structure(stages, SPEED, mode_count=2)
    stages.receptance(built.modes, np.linspace(1e3, 1e4, 5))
    return critical_multipliers(stages, built, np.array([0, 1]), DEPTH, METHOD, np.ones(2))


@pytest.mark.parametrize(
    ("stage", "law", "said"),
    [
        ("bearing_speed", "return found * np.nan", "bearing_speed returned an array that is not finite where it was"),
        ("preload", "return -found", r"preload returned -\d+, allowed: above 0"),
        ("preload", "return found.astype(int)", "preload returned an array of int64, needed: float64"),
        ("preload", "return found * 1e9", "what it returns: the bearing at standstill does not carry its preload"),
        ("ring_growth", "return found + 1e-5j", "ring_growth returned an array of complex128, needed: float64"),
        ("seat_stiffness", "return found * np.inf", "seat_stiffness returned an array that is not finite"),
        ("seat_stiffness", "return found * 0.0", "seat_stiffness returned 0, allowed: above 0"),
        ("joints", "return (1,)", "joints whose parts are 1, needed: Joint"),
        ("joints", JOINT.format("9.0", "{}"), "TypeError: "),
        (
            "joints",
            JOINT.format("9.0", "dict(lateral_compliance=1e-9, rotational_compliance=0.0)"),
            r"position is 9.0, allowed: 0 to 0\.\d+ m",
        ),
        (
            "joints",
            JOINT.format("0.1", "dict(lateral_compliance=-1e-8, rotational_compliance=0.0)"),
            "joints whose lateral_compliance is -1e-08, allowed: from 0",
        ),
        (
            "joints",
            JOINT.format("0.1", "dict(lateral_compliance=np.nan, rotational_compliance=0.0)"),
            "joints whose lateral_compliance is nan, allowed: from 0",
        ),
        ("gyroscopic_speed", "return found * np.nan", "gyroscopic_speed returned an array that is not finite"),
        ("tip_modes", "return replace(found, damping_ratio=-found.damping_ratio)", r"damping_ratio is -0.\d+, allowed"),
        ("tip_modes", "return found.at(np.array([0]))", r"arrays over speed has the shape \(1, 4\), needed: \(2, 4\)"),
        ("tip_modes", "return replace(found, label=found.label - 1)", "label is 0, allowed: from 1"),
        (
            "cut_modes",
            "return replace(found, natural_frequency=found.natural_frequency * np.nan)",
            "natural_frequency is not finite",
        ),
        ("receptance", "return found * np.nan", "receptance returned an array that is not finite"),
        (
            "linear_system",
            "return replace(found, state_matrix=found.state_matrix * np.nan, known_spectrum=None)",
            "state_matrix is not finite",
        ),
        (
            "linear_system",
            "return replace(found, state_matrix=1.01 * found.state_matrix)",
            "known_spectrum is not that of state_matrix",
        ),
        ("engagement", ENGAGED.format("3.0", "1.0"), "an engagement whose entry is 3 and exit 1, allowed: 0 <= entry"),
        ("engagement", ENGAGED.format("np.nan", "1.0"), "an engagement whose entry is nan and exit 1, allowed: "),
        ("engagement", ENGAGED.format("'a'", "1.0"), "an engagement whose entry is 'a', needed: a number"),
        (
            "teeth",
            "return replace(found, pitch=found.pitch[:2], radius=found.radius[:2])",
            r"teeth whose pitch has the shape \(2,\), needed: \(4,\)",
        ),
        ("teeth", "return replace(found, pitch=-found.pitch)", "teeth whose pitch is -1.0, allowed: above 0"),
        ("teeth", "return replace(found, pitch=found.pitch * np.nan)", "teeth whose pitch is not finite"),
        ("teeth", "return replace(found, pitch=2.0 * found.pitch)", "teeth whose mean pitch is 2.0, allowed: 1"),
        ("force_coefficients", "return replace(found, tangential='a')", "tangential is 'a', needed: a number"),
        ("force_coefficients", "return replace(found, radial=found.radial[:0])", r"radial has the shape \(0,\)"),
        ("force_coefficients", "return replace(found, tangential=-1e8)", "tangential is -100000000.0, allowed: above"),
        ("regeneration", "return replace(found, feedback=())", "feedback is no tuple with something in it"),
        ("regeneration", "return replace(found, feedback=(None,))", "feedback has None, needed: DelayedFeedback"),
        ("regeneration", FEEDBACK.format("delay=-one.delay"), r"delay is \[-.*\], allowed: above 0 s, up to the peri"),
        ("regeneration", FEEDBACK.format("gain=lambda time: 0.0"), "gain is no array of floating-point numbers"),
        ("regeneration", FEEDBACK.format("gain=lambda time: {}[1]"), r"mine.py, line 18: KeyError: 1"),
        ("regeneration", "return replace(found, period=found.period * np.nan)", "period is not finite"),
        ("regeneration", "return replace(found, breakpoints=None)", "breakpoints are no array"),
    ],
)
def test_numbers_that_no_cut_can_have_are_told(
    tmp_path: Path, reference_machine: Machine, stage: str, law: str, said: str
):
    effect = activate("mine", {"size": 1.0}, write(tmp_path, stage, law))
    with pytest.raises(OwnLawFails) as told:
        multipliers(reference_machine, effect)
    (problem,) = told.value.problems
    assert problem.startswith(f"effects_path: {tmp_path}/mine.py")
    assert re.search(said, problem), problem


@pytest.mark.parametrize(
    "stage", ["teeth", "regeneration", "linear_system", "cut_modes", "seat_stiffness", "seat_turn", "joints"]
)
def test_a_law_that_changes_nothing_leaves_every_number(tmp_path: Path, reference_machine: Machine, stage: str):
    effect = activate("mine", {"size": 1.0}, write(tmp_path, stage, "return found"))
    assert np.array_equal(multipliers(reference_machine, effect), multipliers(reference_machine))


def test_a_cut_that_no_chain_could_use_ends_with_one_sentence(tmp_path: Path, capsys):
    write(tmp_path, "preload", "return found * 1e9")
    words = ["point", "spindle_speed_rpm=10000", "axial_depth_mm=1", f"effects_path={tmp_path}", "effects=[mine]"]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith(f"error: effects_path: {tmp_path}/mine.py: the chain cannot use what it returns: ")
    # How many modes are asked for is no matter of the law.
    write(tmp_path, "preload", "return found * 1.01")
    effect_class.cache_clear()
    assert main([*words, "modes=100"]) == 2
    assert capsys.readouterr().err.startswith("error: modes: found 100, ")


@pytest.mark.parametrize(
    ("stage", "law"),
    [
        ("cut_modes", "found.natural_frequency[:] = 1.0; return found"),
        ("cut_modes", "given[0].modal_mass *= 2.0; return found"),
        ("regeneration", "given[0].axial_depth[:] = 1e-5; return found"),
        ("force_coefficients", "found.tangential[:] = 1.0; return found"),
        ("seat_stiffness", "given[1].radial_stiffness[:] = 1.0; return found"),
    ],
)
def test_a_law_that_writes_into_what_it_was_given_is_told_with_its_line(
    tmp_path: Path, reference_machine: Machine, stage: str, law: str
):
    effect = activate("mine", {"size": 1.0}, write(tmp_path, stage, law))
    with pytest.raises(OwnLawFails, match=r"mine.py, line 18: ValueError: .*read-only"):
        multipliers(reference_machine, effect)


@pytest.mark.parametrize("stage", ["cut_modes", "receptance", "tip_modes", "preload", "joints"])
@pytest.mark.parametrize("touches", ["cut", "measurement"])
def test_what_touches_less_than_its_arrow_is_refused(tmp_path: Path, stage: str, touches: str):
    write(tmp_path, stage, "return found", touches=touches)
    said = f"mine.py: declared: touches of size: found '{touches}', allowed: structure: {stage} belongs to the struct"
    with pytest.raises(InvalidInput, match=said):
        effect_class("mine", tmp_path)


def test_an_effect_of_the_cut_touches_the_cut_at_least(tmp_path: Path):
    write(tmp_path, "teeth", "return found", touches="measurement")
    with pytest.raises(InvalidInput, match=r"found 'measurement', allowed: structure or cut: teeth changes the cut"):
        effect_class("mine", tmp_path)
    write(tmp_path, "teeth", "return found", name="other", touches="cut")
    (tmp_path / "mine.py").unlink()
    (tmp_path / "mine.yaml").unlink()
    effect_names.cache_clear()
    (parameter,) = effect_class("other", tmp_path).declared
    assert isinstance(parameter, Parameter)


@pytest.mark.parametrize("name", effect_names())
def test_the_programs_own_effects_touch_what_their_arrow_changes(name: str):
    assert not [finding for effect in variants(name) for finding in findings_of_touches(effect)]


def test_own_effects_act_after_the_programs_on_an_arrow(tmp_path: Path, reference_machine: Machine):
    law = FEEDBACK.format("gain=lambda time, gain=one.gain: 0.9 * gain(time)")
    own = activate("aaa", {"size": 1.0}, write(tmp_path, "regeneration", law, name="aaa"))
    power = activate("chip_thickness_power_law", {"exponent": 0.7})
    assert own.effect.place() > power.effect.place()
    both = multipliers(reference_machine, own, power)
    assert not np.isnan(both).any()
    assert not np.any(both == multipliers(reference_machine, power))


def test_a_law_may_answer_by_the_gain_that_it_was_lent(tmp_path: Path, reference_machine: Machine):
    effect = activate("mine", {"size": 1.0}, write(tmp_path, "regeneration", FEEDBACK.format("gain=given[0]")))
    assert np.array_equal(multipliers(reference_machine, effect), multipliers(reference_machine))


def test_a_candidate_of_the_program_acts_before_own_effects_of_the_model(tmp_path: Path):
    (own,) = variants("aaa", write(tmp_path, "regeneration", "return found", name="aaa"))
    (power,) = variants("chip_thickness_power_law")
    candidate = Candidate(name=power.name(), settings={}, term=power, shapes=(), place=power.place())
    model = CampaignModel(campaign=campaign(tip_machine()), terms=(own,))
    assert extended(Comparison(model=model), [candidate]).model.terms == (power, own)


def left(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()} if folder.exists() else set()


@pytest.mark.parametrize("law", ["fond", "return replace(found, tangential=-found.tangential)"])
@pytest.mark.parametrize("verb", [["sweep", *WORDS], ["dataset", "study=dataset_small", "cluster=serial"]])
def test_a_law_that_fails_at_the_first_cell_leaves_no_store(tmp_path: Path, capsys, verb: list[str], law: str):
    own = tmp_path / "own"
    own.mkdir()
    write(own, "force_coefficients", law)
    output = tmp_path / "out"
    assert main([*verb, f"effects_path={own}", "effects=[mine]", f"output={output}"]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert line.startswith(f"error: effects_path: {own}/mine.py")
    assert not left(output) & {"lobes.zarr", "dataset.zarr", "study.yaml"}


def test_a_slip_at_some_speed_ends_a_sweep(tmp_path: Path, capsys):
    own = tmp_path / "own"
    own.mkdir()
    write(own, "force_coefficients", "return fond if (given[1] > 1200.0).any() else found")
    words = [*WORDS, f"effects_path={own}", "effects=[mine]", f"output={tmp_path / 'out'}"]
    assert main(["sweep", *words]) == 2
    assert "mine.py, line 18: NameError: name 'fond' is not defined" in capsys.readouterr().err


def test_a_speed_without_an_answer_is_marked():
    def compute(speeds: np.ndarray) -> LobeBlock:
        raise OwnLawFails(["mine.py: no answer"])

    block, errors = _guarded(compute, np.array([100.0]), 3)
    assert (block.status == STATUS["outside_validity"]).all()
    assert "mine.py: no answer" in errors[0]


def test_a_failure_comes_from_a_worker_as_it_was():
    failure = pickle.loads(pickle.dumps(OwnLawFails(["one", "other"], hangs_on_values=False)))
    assert (failure.problems, failure.hangs_on_values) == (["one", "other"], False)
