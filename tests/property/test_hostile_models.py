"""Whatever stands in values of effects, calibrated models, plans and universal files is read, or told in sentences."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings

from chatter_core.evidence import read_campaign
from chatter_core.evidence.campaign import planned_trials
from chatter_core.evidence.uff import read_uff
from pipeline import model_file
from pipeline.campaigns import model_of
from pipeline.command_line import main
from pipeline.configuration import configured_values
from pipeline.model_file import Content
from pipeline.settings import model_with
from tests.property.hostile import EXAMPLES, assert_read_or_told, every_example, mutations, problems_of
from tests.unit.test_universal_file import response, units

ROOT = Path(__file__).parents[2]
OWN = ROOT / "docs" / "examples" / "own_effects"
EFFECT = "loosening_clamp"
MACHINE = ROOT / "tests" / "data" / "campaigns" / "d01" / "machine.yaml"
CUTS = b"trial,spindle_speed_rpm,axial_depth_mm,outcome\n1,6000,0.5,stable\n2,7000,1.5,chatter\n"
PLAN = b"trial,spindle_speed_rpm,axial_depth_mm,preload_n,direction\n1,6000,0.5,100,down\n2,7000,1.5,,up\n"
#: Each is tried half as often as a table: there are as many kinds again.
of_each_kind = settings(every_example, max_examples=max(1, EXAMPLES // 3))


def laid(folder: Path) -> Path:
    """Lay out a small campaign, an effect of the user's own, a model calibrated with it, a plan and responses."""
    shutil.copytree(OWN, folder / "own")
    (folder / "campaign").mkdir()
    shutil.copy(MACHINE, folder / "campaign")
    (folder / "campaign" / "stability.csv").write_bytes(CUTS)
    (folder / "plan.csv").write_bytes(PLAN)
    (folder / "tip.uff").write_text(units(1.0, 1.0) + response())
    model = model_of(read_campaign(folder / "campaign"), Content(effects={EFFECT: {}}, effects_path=folder / "own"))
    fitted = [
        {"name": one.name, "unit": one.unit, "estimate": float(one.prior_mean), "standard_deviation": 0.1}
        for one in model.parameters
    ]
    described = {
        "effects": {EFFECT: {}},
        "parameters": fitted,
        "correlation": np.eye(len(fitted)).tolist(),
        "machine": model.campaign.machine.described(),
    }
    (folder / "model.yaml").write_text(yaml.safe_dump(described))
    return folder


def read_effects(folder: Path) -> object:
    own = folder / "own"
    return model_with(read_campaign(folder / "campaign").machine, {EFFECT: configured_values(EFFECT, own)}, own)


def read_model(folder: Path) -> object:
    campaign, own = read_campaign(folder / "campaign"), folder / "own"
    found = model_file.read(folder / "model.yaml", campaign.machine, own)
    return model_file.belief_of(found, folder / "model.yaml", model_of(campaign, found.content(own)))


def read_plan(folder: Path) -> object:
    return planned_trials(folder / "plan.csv", read_campaign(folder / "campaign").machine)


def read_responses(folder: Path) -> object:
    return read_uff(folder / "tip.uff")


#: Every kind of file: how it is read, and the words of a command that reads it.
KINDS: dict[str, tuple[Callable[[Path], object], str]] = {
    f"own/{EFFECT}.yaml": (
        read_effects,
        f"point spindle_speed_rpm=6000 axial_depth_mm=1 effects_path={{0}}/own effects=[{EFFECT}]",
    ),
    "model.yaml": (read_model, "predict campaign={0}/campaign model={0}/model.yaml effects_path={0}/own "
                   "trials={0}/plan.csv predictions={0}/out.csv"),
    "plan.csv": (read_plan, "predict campaign={0}/campaign trials={0}/plan.csv predictions={0}/out.csv"),
    "tip.uff": (read_responses, "identify frf={0}/tip.uff output={0}/out.yaml"),
}  # fmt: skip
every_kind = pytest.mark.parametrize("file", list(KINDS))


@every_kind
def test_the_files_that_are_mutated_are_good(tmp_path, file):
    assert problems_of(lambda: KINDS[file][0](laid(tmp_path))) == []


@every_kind
def test_a_mutated_file_is_read_or_told_in_sentences(tmp_path, file):
    reader, _ = KINDS[file]
    folder = laid(tmp_path)
    good = (folder / file).read_bytes()

    @of_each_kind
    @given(mutations())
    def tried(changes):
        content = good
        for change in changes:
            content = change(content)
        (folder / file).write_bytes(content)
        assert_read_or_told(lambda: reader(folder), len(content))

    tried()


@every_kind
def test_the_command_line_answers_or_tells_each_problem_on_one_line_and_ends_with_two(tmp_path, capsys, file):
    reader, words = KINDS[file]
    folder = laid(tmp_path)
    good = (folder / file).read_bytes()

    @settings(of_each_kind, max_examples=max(1, EXAMPLES // 20))
    @given(mutations())
    def tried(changes):
        content = good
        for change in changes:
            content = change(content)
        (folder / file).write_bytes(content)
        problems = problems_of(lambda: reader(folder))
        capsys.readouterr()
        code, told = main(words.format(folder).split()), capsys.readouterr()
        # What can be read may still be refused for what it says, such as too few lines to find modes in.
        assert code == 2 if problems else code in (0, 1, 2)
        assert "Traceback" not in told.err
        if problems:
            assert told.out == ""
            assert all(line.startswith("error: ") for line in told.err.splitlines())

    tried()
