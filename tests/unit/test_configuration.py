"""From words to settings: what wins over what, and what is said of words that cannot be."""

import shutil
from pathlib import Path

import pytest
import yaml

from chatter_core.errors import InvalidInput
from pipeline import configuration, shipped
from pipeline.configuration import compose_settings, sort_words
from pipeline.settings import Settings


def settings(*words: str) -> Settings:
    return compose_settings(sort_words(list(words), ("output",)))


def problems(*words: str) -> list[str]:
    with pytest.raises(InvalidInput) as refused:
        settings(*words)
    return refused.value.problems


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "teeth: 2\n diameter_mm: 3\n",
            r"configs/tool/mine.yaml, line 2: no valid yaml: mapping values are not allowed",
        ),
        ("teeth: ${\n", r"configs: cannot be composed: "),
        ("defaults: 3\n", r"configs: cannot be composed: Invalid defaults list"),
        ("defaults:\n  - override /grid: smokes\n", r"configs: cannot be composed: "),
    ],
)
def test_a_config_that_cannot_be_composed_is_told(text, said, tmp_path: Path, monkeypatch):
    copied = tmp_path / "configs"
    shutil.copytree(configuration.CONFIGS, copied)
    (copied / "tool" / "mine.yaml").write_text(text)
    for module in (configuration, shipped):
        monkeypatch.setattr(module, "CONFIGS", copied)
    (problem,) = problems("study=smoke", "tool=mine")
    assert said in problem
    assert "\n" not in problem


@pytest.fixture
def machine_file(tmp_path: Path) -> str:
    """A machine of the user's own: the reference machine with three teeth and 150 N."""
    described = settings("study=smoke").machine.described()
    described["tool"]["teeth"] = 3
    described["spindle"]["preload_n"] = 150.0
    path = tmp_path / "machine.yaml"
    path.write_text(yaml.safe_dump(described))
    return str(path)


@pytest.fixture
def tip_file(tmp_path: Path) -> str:
    described = settings("study=smoke").machine.described()
    modes = [{"axis": a, "natural_frequency_hz": 900.0, "damping_ratio": 0.02, "stiffness_n_um": 20.0} for a in "xy"]
    path = tmp_path / "tip.yaml"
    parts = {key: described[key] for key in ("tool", "cutting", "process")}
    path.write_text(yaml.safe_dump({"tip": {"modes": modes}, **parts}))
    return str(path)


def test_a_file_replaces_the_machine_and_words_win_over_the_file(machine_file: str) -> None:
    assert settings("study=smoke", f"machine={machine_file}").machine.tool.teeth == 3
    assert settings("study=smoke", f"machine={machine_file}", "tool.teeth=5").machine.tool.teeth == 5


def test_a_part_chosen_by_name_wins_over_the_file(machine_file: str) -> None:
    assert settings("study=smoke", f"machine={machine_file}", "tool=endmill_4x16").machine.tool.teeth == 4


@pytest.mark.parametrize("study", ["smoke", "reference"])
def test_a_preload_that_the_user_names_is_the_one_computed(machine_file: str, study: str) -> None:
    assert settings(f"study={study}", "spindle.preload_n=250").preloads.tolist() == [250.0]
    assert settings(f"study={study}", f"machine={machine_file}").preloads.tolist() == [150.0]


def test_preloads_named_for_the_grid_win(machine_file: str) -> None:
    words = ("study=smoke", f"machine={machine_file}", "grid.preload_n=[60, 70]")
    assert settings(*words).preloads.tolist() == [60.0, 70.0]
    assert settings("study=reference").preloads.tolist() == [50.0, 100.0, 200.0, 400.0]


def test_measured_tip_modes_have_one_preload_of_zero_and_refuse_others(tip_file: str) -> None:
    assert settings("study=smoke", f"machine={tip_file}", "grid.mode_count=[1]").preloads.tolist() == [0.0]
    [problem] = problems("study=smoke", f"machine={tip_file}", "grid.preload_n=[100]")
    assert problem.startswith("grid.preload_n: not allowed for a machine of measured tip modes")


def test_words_of_bearing_and_spindle_are_refused_by_name_beside_measured_tip_modes(tip_file: str) -> None:
    words = ("spindle.preload_n", "bearing.ball_count", "spindle.sections[0].length_mm")
    assert problems("study=smoke", f"machine={tip_file}", *(f"{word}=12" for word in words)) == [
        f"{word}: has no meaning for a machine of measured tip modes, which has no bearing and spindle"
        for word in words
    ]
    assert problems("study=smoke", f"machine={tip_file}", "spindle=reference") == [
        "spindle=reference: has no meaning for a machine of measured tip modes, which has no bearing and spindle"
    ]


@pytest.mark.parametrize(
    ("word", "values"),
    [
        ("grid.axial_depth_mm=[0.5, 2]", [0.5, 2.0]),
        ("grid.axial_depth_mm={start: 1, stop: 2, count: 3}", [1.0, 1.5, 2.0]),
        ("grid.axial_depth_mm={values: [1, 4]}", [1.0, 4.0]),
        ("grid.axial_depth_mm=1.5", [1.5]),
    ],
)
def test_an_axis_is_a_range_or_a_list_whatever_the_study_has(word: str, values: list[float]) -> None:
    assert settings("study=smoke", word).grid.axial_depth_mm.points().tolist() == values


def test_an_entry_of_a_list_is_reached_as_messages_write_it() -> None:
    found = settings("study=smoke", "spindle.bearings[0].count=3").machine
    assert found.spindle is not None
    assert [seat.count for seat in found.spindle.bearings] == [3, 2]


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("tool.teeth=-3", "tool.teeth: found -3, allowed: at least 1"),
        ("tool.teth=4", "tool.teth: unknown key; did you mean teeth?"),
        ("spindel.preload_n=200", "spindel: unknown key; did you mean spindle?"),
        ("study=smok", "study: found 'smok'; did you mean smoke?"),
        ("teeth", "teeth: expected key=value"),
        ("process.direction=slot", "process: direction 'slot' needs radial_immersion 1, found 0.4"),
    ],
)
def test_a_mistake_is_told_in_one_sentence(word: str, sentence: str) -> None:
    assert problems(word) == [sentence]


def test_all_mistakes_are_told_at_once() -> None:
    told = problems("tool.teeth=-3", "cutting.kn=.nan", "grid.mode_count=[2, 1]", "cluster.workers=0")
    assert [problem.split(":")[0] for problem in told] == [
        "tool.teeth",
        "cutting.kn",
        "cluster.workers",
        "grid.mode_count",
    ]


def test_nothing_in_a_value_is_resolved_or_executed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("TEETH", "7")
    monkeypatch.chdir(tmp_path)
    assert problems("tool.teeth=${oc.env:TEETH}")[0].startswith("tool.teeth: found '${oc.env:TEETH}'")
    path = tmp_path / "machine.yaml"
    path.write_text("tool: !!python/object/apply:os.system ['touch executed']\n")
    [problem] = problems(f"machine={path}")
    assert f"{path}, line 1: no valid yaml" in problem
    assert not (tmp_path / "executed").exists()


def test_a_grid_too_large_is_refused_before_anything_is_allocated() -> None:
    [problem] = problems("study=smoke", "grid.spindle_speed_rpm.count=1000000", "grid.axial_depth_mm.count=1000000")
    assert problem == "grid: found 4000000000000 cells, allowed: at most 2000000000"


def test_the_fingerprint_follows_the_science_and_not_where_it_runs() -> None:
    base = settings("study=smoke").fingerprint()
    assert settings("study=smoke", "cluster=serial", "output=elsewhere").fingerprint() == base
    assert settings("study=smoke", "cutting.kt_mpa=900").fingerprint() == base
    changed = ("tool.teeth=2", "method.tolerance=1.0e-5", "grid.mode_count=[1]", "spindle.beam=euler_bernoulli")
    assert len({base, *(settings("study=smoke", word).fingerprint() for word in changed)}) == 5
