"""Effects of the user's own: the worked example of docs/ as it stands, and what is said where one is not right."""

import errno
import json
import os
import pickle
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import zarr

from chatter_core.effects import activate, apply_effects, effect_class, effect_names, own_effects, variants
from chatter_core.errors import InvalidInput
from chatter_core.machine import Machine
from chatter_core.stages import Stages
from pipeline.command_line import main
from tests.pipeline.studies import WORDS

EXAMPLE = Path(__file__).parents[2] / "docs" / "examples" / "own_effects"
CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
POINT = ["point", "spindle_speed_rpm=10000", "axial_depth_mm=1", "modes=2", "format=json"]
ON = [f"effects_path={EXAMPLE}", "effects=[loosening_clamp]"]


def answer(capsys: pytest.CaptureFixture[str], *words: str) -> dict:
    assert main([*POINT, *words]) == 0
    return json.loads(capsys.readouterr().out)


def copy_of_the_example(folder: Path, name: str = "loosening_clamp") -> Path:
    for ending in ("py", "yaml"):
        (folder / f"{name}.{ending}").write_text((EXAMPLE / f"loosening_clamp.{ending}").read_text())
    return folder


def test_the_example_acts_at_a_point(capsys):
    base, softer = answer(capsys), answer(capsys, *ON)
    assert answer(capsys, f"effects_path={EXAMPLE}") == base
    assert answer(capsys, *ON, "effects.loosening_clamp.loss=0") == base
    assert softer["spectral_radius"] != base["spectral_radius"]
    both = answer(capsys, *ON[:1], "effects=[loosening_clamp,process_damping]")
    assert both["spectral_radius"] != softer["spectral_radius"]


@pytest.mark.parametrize("cluster", ["serial", "local"])
def test_the_example_goes_through_a_sweep(tmp_path: Path, cluster: str):
    words = [*(word for word in WORDS if word != "cluster=serial"), *ON, f"cluster={cluster}", "report=false"]
    words += ["cluster.workers=1"] if cluster == "local" else []
    output = tmp_path / "study"
    assert main(["sweep", *words, f"output={output}"]) == 0
    attributes = zarr.open_group(output / "lobes.zarr", mode="r").attrs.asdict()
    assert attributes["settings"]["effects"] == {"loosening_clamp": {"loss": 0.3}}
    assert list(attributes["settings"]["own_effects"]) == ["loosening_clamp"]
    assert str(EXAMPLE) not in json.dumps(attributes["settings"])
    plain = tmp_path / "plain"
    assert main(["sweep", *WORDS, "cluster=serial", "report=false", f"output={plain}"]) == 0
    one, other = (zarr.open_group(path / "lobes.zarr", mode="r")["spectral_radius"][...] for path in (output, plain))
    assert not np.array_equal(one, other, equal_nan=True)


def test_a_changed_file_is_another_study(tmp_path: Path, capsys):
    folder = tmp_path / "effects"
    folder.mkdir()
    words = [*WORDS, "cluster=serial", "report=false", f"output={tmp_path / 'study'}", "effects=[loosening_clamp]"]
    assert main(["sweep", *words, f"effects_path={copy_of_the_example(folder)}"]) == 0
    moved = tmp_path / "moved"
    folder.rename(moved)
    assert main(["sweep", *words, f"effects_path={moved}"]) == 0
    file = moved / "loosening_clamp.py"
    file.write_text(file.read_text().replace("-0.5 * loss", "-0.6 * loss"))
    assert main(["sweep", *words, f"effects_path={moved}"]) == 2
    assert "they differ in: own_effects.loosening_clamp" in capsys.readouterr().err


def test_a_copy_in_another_process_is_the_same(tmp_path: Path, reference_machine: Machine):
    active = activate("loosening_clamp", {"loss": 0.2}, EXAMPLE)
    assert pickle.loads(pickle.dumps(active)) == active
    (tmp_path / "active").write_bytes(pickle.dumps(active))
    script = "import pickle, sys; print(pickle.load(open(sys.argv[1], 'rb')))"
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "active")], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == str(active)
    assert active.effect.name() == "loosening_clamp"
    assert variants("loosening_clamp", EXAMPLE) == (active.effect,)
    assert apply_effects(reference_machine, [active]) != Stages(machine=reference_machine)


def test_own_effects_stand_among_the_programs():
    assert own_effects(EXAMPLE) == ("loosening_clamp",)
    assert set(effect_names(EXAMPLE)) - set(effect_names()) == {"loosening_clamp"}
    with pytest.raises(InvalidInput, match=r"found 'loosening_clam'; did you mean loosening_clamp\?"):
        effect_class("loosening_clam", EXAMPLE)


def test_folders_that_are_not_right_are_told_everything_at_once(tmp_path: Path):
    with pytest.raises(InvalidInput, match=r"effects_path: .*nowhere is not a folder"):
        own_effects(tmp_path / "nowhere")
    copy_of_the_example(tmp_path, "process_damping")
    copy_of_the_example(tmp_path, "Clamp-2")
    copy_of_the_example(tmp_path, "none")
    (tmp_path / "alone.py").write_text("")
    (tmp_path / "lonely.yaml").write_text("")
    (tmp_path / "short.py").write_text("")
    (tmp_path / "short.yml").write_text("")
    (tmp_path / "_helper.py").write_text("raise RuntimeError")
    with pytest.raises(InvalidInput) as told:
        own_effects(tmp_path)
    shown = [problem.removeprefix(f"effects_path: {tmp_path}") for problem in told.value.problems]
    assert [problem.lstrip("/: ") for problem in shown] == [
        "alone.py: alone.yaml is missing beside it",
        "short.py: short.yaml is missing beside it; rename short.yml",
        "lonely.yaml: lonely.py is missing beside it",
        "every .py and .yaml file in it is taken for an effect's; keep all others elsewhere",
        "Clamp-2.py: an effect's name has small letters, digits and _, a letter first",
        "none.py: none is the answer where nothing is missing; give yours another name",
        "process_damping.py: the program has an effect of this name; give yours another",
    ]


def test_folders_that_hold_no_effect_or_cannot_be_read_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """A diagnosis that took them for empty would answer without the effects that were meant."""
    (tmp_path / "_helper.py").write_text("")
    with pytest.raises(InvalidInput, match=r"holds no effect, needed: a \.py and a \.yaml of the same name"):
        effect_names(tmp_path)
    # Whoever may do everything reads a folder that nobody may: its answer is stood in for.
    monkeypatch.setattr(Path, "iterdir", _denied)
    with pytest.raises(InvalidInput, match=rf"effects_path: {EXAMPLE} cannot be read: Permission denied"):
        own_effects(EXAMPLE)


def _denied(folder: Path):
    raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(folder))


EXAMPLE_TEXT = (EXAMPLE / "loosening_clamp.py").read_text()
SETTING = '__import__("types").SimpleNamespace(name="axis", doc="which", choices=(), unused={})'


#: One parameter more.
TILT = 'Parameter(name="tilt", unit="", doc="tilt", prior_width=1.0, lower=0.0, upper=2.0)'
#: What makes a scan, without an import in the user's file.
SCAN = (
    "(lambda *own: __import__('chatter_core.effects').effects.Scan("
    "**dict(zip(('parameter', 'values', 'waves', 'shapes'), own))))"
)


def with_line(*lines: str) -> str:
    """Return the example with lines more in its class."""
    return EXAMPLE_TEXT.replace("    changes:", "".join(f"    {line}\n" for line in lines) + "    changes:")


def with_unused(unused: str) -> str:
    """Return the example with a setting that says which parameters are unused by choice."""
    setting = SETTING.replace("choices=()", 'choices=("x", "y")').replace("unused={}", f"unused={unused}")
    return with_line(f"settings: ClassVar[Any] = ({setting},)", "axis: str")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("import nothing_of_this_name", r"mine.py cannot be loaded: ModuleNotFoundError: No module named 'nothing_"),
        ("1 / 0", r"mine.py cannot be loaded: ZeroDivisionError: division by zero"),
        ("raise SystemExit(7)", r"mine.py cannot be loaded: SystemExit: 7"),
        ("def (", r"mine.py cannot be loaded: SyntaxError: "),
        ("", r"effects: .*mine.py holds 0 effects, allowed: exactly one class derived from Effect"),
        (
            EXAMPLE_TEXT.replace('name="loss"', 'name="loss_mm"'),
            r"mine.py: declared: unit of loss_mm: found 'ln', needed, by its name: mm",
        ),
        (
            EXAMPLE_TEXT.replace('"cut_modes"', '"cut_mode"'),
            r"mine.py: stage: found 'cut_mode'; did you mean cut_modes\?",
        ),
        (EXAMPLE_TEXT.replace("def transform", "def transfer"), r"mine.py: LooseningClamp does not say transform"),
        (EXAMPLE_TEXT.replace("changes:", "alters:"), r"mine.py: LooseningClamp does not say changes"),
        (EXAMPLE_TEXT.replace('"cut_modes"', "3"), r"mine.py: stage: found 3; allowed: "),
        (EXAMPLE_TEXT.replace('"cut_modes"', '"machine"'), r"mine.py: stage: found 'machine'; "),
        (
            EXAMPLE_TEXT.replace("        ),\n    )  # fmt", "        )\n    )  # fmt"),
            r"mine.py: declared: found Parameter",
        ),
        (EXAMPLE_TEXT.replace('("cut",)', '("kut",)'), r"mine.py: changes: found 'kut'; did you mean cut\?"),
        (with_line('needs: ClassVar[tuple[str, ...]] = ("gearbox",)'), r"mine.py: needs: found 'gearbox'; "),
        (
            with_line('shapes: ClassVar[tuple[str, ...]] = ("losss",)'),
            r"mine.py: shapes: found 'losss'; did you mean loss",
        ),
        (with_line('heard: ClassVar[str | None] = "hertz"'), r"mine.py: heard: found 'hertz'; "),
        (with_line(f"scan: ClassVar[Any] = type({SCAN}('loss', (0.1,)))"), r"mine.py: scan: found <class"),
        (with_line("scan: ClassVar[Any] = 0.3"), r"mine.py: scan: found 0.3, allowed: Scan\(parameter="),
        (with_line(f"scan: ClassVar[Any] = {SCAN}('los', (0.1,))"), r"mine.py: scan: found 'los'; did you mean loss"),
        (with_line(f"scan: ClassVar[Any] = {SCAN}('loss', ())"), r"mine.py: scan: found \(\), allowed: a tuple"),
        (with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1, 7.0))"), r"mine.py: scan: found 7.0, allowed: 0 to"),
        (with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1,), 10**400)"), r"mine.py: scan: waves: found 1000"),
        (with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1,), float('nan'))"), r"mine.py: scan: waves: found nan,"),
        (
            with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1,), 'ten')"),
            r"mine.py: scan: waves: found 'ten', allowed:",
        ),
        (
            with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1,), None, (0.2,))"),
            r"mine.py: scan: shapes: found \(0.2,\), allowed: beside a strength that is scanned a tuple of values",
        ),
        (
            with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1, 'a'))"),
            r"mine.py: scan: found 'a', allowed: numbers",
        ),
        (
            with_line(f"scan: ClassVar[Any] = {SCAN}('loss', (0.1,), None, 3)"),
            r"mine.py: scan: shapes: found 3, allowed",
        ),
        (
            with_line("shapes: Any = ('tilt',)", f"scan: ClassVar[Any] = {SCAN}('loss', (0.1,), None, (9.0,))").replace(
                "    )  # fmt", f"        {TILT},\n    )  # fmt"
            ),
            r"mine.py: scan: shapes: found 9.0, allowed: 0 to",
        ),
        (with_line("shapes: ClassVar[Any] = None"), r"mine.py: shapes: found None, allowed: a tuple of names"),
        (with_line('settings: ClassVar[Any] = ("axis",)'), r"mine.py: settings: found 'axis', allowed: settings"),
        (with_line(f"settings: ClassVar[Any] = ({SETTING},)"), r"mine.py: settings: axis is no field of the class"),
        (with_unused("3"), r"mine.py: settings: unused of axis: found 3, allowed: a tuple of names by choice"),
        (with_unused("{'z': ('loss',)}"), r"mine.py: settings: unused of axis: found 'z'; allowed: x, y"),
        (with_unused("{'x': 'loss'}"), r"mine.py: settings: unused of axis: found 'loss', allowed: a tuple of names"),
        (with_unused("{'x': ('los',)}"), r"mine.py: settings: unused of axis: found 'los'; did you mean loss"),
        (with_unused("{'y': ('loss',)}"), r"mine.py: declared: nothing says how strong it is with axis=y; needed: a"),
        (with_line('shapes: ClassVar[Any] = ("loss",)'), r"mine.py: declared: nothing says how strong it is; needed: "),
        (
            with_line(f"settings: ClassVar[Any] = ({SETTING},)", "axis: str"),
            r"mine.py: settings: choices of axis: found \(\), allowed: a tuple",
        ),
        (
            EXAMPLE_TEXT.replace("lower=0.0,", "lower=0.0, prior_mean=9.0,"),
            r"mine.py: declared: prior_mean of loss: found 9",
        ),
        (with_line("needed: float"), r"mine.py: needed: a field that is no setting, needed: a value, needed = "),
        (EXAMPLE_TEXT.replace("prior_width=0.2,", 'prior_width=0.2, prior_mean="a",'), r"mine.py: TypeError: "),
        (with_line("def __post_init__(self): raise ValueError('mine')"), r"mine.py, line \d+: ValueError: mine"),
        (EXAMPLE_TEXT.replace('name="loss"', 'name="lo ss"'), r"mine.py: declared: found the name 'lo ss', allowed: "),
    ],
)
def test_files_that_are_no_effect_get_one_sentence(tmp_path: Path, capsys, text: str, said: str):
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "mine.yaml").write_text("loss: 0.1\n")
    with pytest.raises(InvalidInput, match=said):
        effect_class("mine", tmp_path)
    assert main([*POINT, f"effects_path={tmp_path}", "effects=[mine]"]) == 2
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


#: A law that raises an error without words, in its fourth line.
SPEECHLESS = """
            class Mine(Exception):
                __str__ = None
            raise Mine
"""
LAW = "            factor = np.where(found.axis == 0, softer, 1.0)\n"


@pytest.mark.parametrize(
    ("found", "instead", "said"),
    [
        (LAW, "            factor = {}[loss]\n", r"mine.py, line 37: KeyError: 0.3"),
        (LAW, "            raise SystemExit(5)\n", r"mine.py, line 37: SystemExit: 5"),
        (
            LAW,
            SPEECHLESS,
            r"mine.py, line 40: Mine: what it says cannot be told, TypeError",
        ),
        ("(loss,) = values", "a, b = values", r"mine.py, line 32: ValueError: not enough values to unpack"),
        ("return cut_modes", "return None", r"mine.py: transform returned None, needed: a function as it was given"),
        ("return replace(found", "return found.axis, dict(a", r"mine.py, line 38: "),
        ("return cut_modes", "return lambda *_: 3", r"mine.py: cut_modes returned 3, needed: TipModes"),
        (
            "return cut_modes",
            "return lambda *_: np.eye(9)",
            r"mine.py: cut_modes returned one of class ndarray, needed",
        ),
        ("machine: Machine, values", "values", r"mine.py: TypeError: .*positional arguments"),
        ("(loss,) = values", "(loss,) = values; machine.spindle.nothing", r"mine.py, line 32: AttributeError: "),
    ],
)
def test_a_law_that_fails_is_told_with_its_line(tmp_path: Path, capsys, found: str, instead: str, said: str):
    assert found in EXAMPLE_TEXT
    (tmp_path / "mine.py").write_text(EXAMPLE_TEXT.replace(found, instead))
    (tmp_path / "mine.yaml").write_text("loss: 0.3\n")
    assert main([*POINT[:-1], f"effects_path={tmp_path}", "effects=[mine]"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert re.search(said, line), line


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        (
            "natural_frequency=found.natural_frequency[0]",
            r"natural_frequency has the shape \(4,\), needed: \(speed, 4\)",
        ),
        ("natural_frequency=found.natural_frequency[:, :0]", r"natural_frequency has the shape "),
        ("natural_frequency=found.natural_frequency[1:]", r"arrays are of unlike numbers of speeds"),
        ("natural_frequency=1j * found.natural_frequency", r"natural_frequency is no array of floating-point numbers"),
        ("natural_frequency=0.0 * found.natural_frequency", r"natural_frequency is not positive"),
        ("natural_frequency=list(found.natural_frequency)", r"natural_frequency is no array"),
        ("damping_ratio=found.damping_ratio.astype(object)", r"damping_ratio is no array"),
        ("modal_mass=-found.modal_mass", r"modal_mass is not positive"),
        ("axis=found.axis + 5", r"axis is neither 0 nor 1"),
        ("axis=0.5 * found.axis", r"axis is no array of whole numbers"),
        ("label=found.label[:1]", r"axis and label are not"),
    ],
)
def test_modes_that_no_chain_could_use_are_told(tmp_path: Path, capsys, changed: str, said: str):
    text = EXAMPLE_TEXT.replace("natural_frequency=found.natural_frequency * factor", changed)
    assert text != EXAMPLE_TEXT
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "mine.yaml").write_text("loss: 0.3\n")
    assert main([*POINT[:-1], f"effects_path={tmp_path}", "effects=[mine]"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "mine.py: cut_modes returned modes whose" in line
    assert re.search(said, line), line


def test_a_law_that_returns_another_shape_is_told(tmp_path: Path, capsys):
    text = EXAMPLE_TEXT.replace('= "cut_modes"', '= "seat_stiffness"')
    text = text.replace("(loss,) = values", "return lambda *arguments: before(*arguments)[0]")
    (tmp_path / "mine.py").write_text(text)
    (tmp_path / "mine.yaml").write_text("loss: 0.3\n")
    assert main([*POINT[:-1], f"effects_path={tmp_path}", "effects=[mine]"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    # At the speeds that the bearing was solved at on its way to the one asked for.
    assert re.search(r"mine.py: seat_stiffness returned an array of shape \((\d+), 2\), needed: \(2, \1, 2\)$", line)


@pytest.mark.parametrize(
    ("law", "said"),
    [
        # So fast that none of its waves in a tooth period could be resolved.
        ("            factor = 1e6\n", r"mine.py: at mine.loss 0.2 it leaves \d+ data without an answer"),
        ("            factor = np.nan\n", r"mine.py: cut_modes returned modes whose natural_frequency is not finite"),
        ("            factor = {}[loss]\n", r"mine.py, line 37: KeyError: 0.2"),
    ],
)
def test_an_effect_that_fails_is_told_before_anything_is_fitted(
    tmp_path: Path, capsys, monkeypatch, law: str, said: str
):
    monkeypatch.setattr("pipeline.diagnosis.spread", lambda *_: pytest.fail("something was fitted"))
    (tmp_path / "mine.py").write_text(EXAMPLE_TEXT.replace(LAW, law))
    (tmp_path / "mine.yaml").write_text("loss: 0.3\n")
    words = [f"campaign={CAMPAIGNS / 'r01'}", f"effects_path={tmp_path}", "cluster=serial"]
    assert main(["diagnose", *words, f"output={tmp_path / 'answer'}"]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert re.search(said, line), line


def test_no_yaml_names_a_folder(tmp_path: Path, capsys):
    machine = tmp_path / "machine.yaml"
    machine.write_text(f"effects_path: {EXAMPLE}\n")
    assert main([*POINT, f"machine={machine}"]) == 2
    assert "effects_path: unknown key" in capsys.readouterr().err
