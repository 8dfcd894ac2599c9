"""Whatever stands in a file: it is read, or told in sentences; nothing else happens, and nothing else is taken."""

import tracemalloc
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chatter_core.evidence import read_campaign
from pipeline.command_line import main
from tests.property.hostile import (
    EXAMPLES,
    MEMORY,
    Mutation,
    assert_read_or_told,
    every_example,
    mutations,
    problems_of,
)

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
#: Of a table of responses so many lines are enough to be read by.
LINES = 60
#: Every file of a kind that a campaign may hold, by its name.
TABLES = {
    "frf.csv": b"spindle_speed_rpm,frequency_hz,output_axis,input_axis,real_um_n,imag_um_n\n"
    + b"".join(b"0,%d,x,x,%.3f,%.3f\n" % (100 + 2 * i, 0.1 + 0.01 * i, -0.02 * i) for i in range(LINES)),
    "modes.csv": b"spindle_speed_rpm,mode,natural_frequency_hz,damping_ratio\n0,1,850.5,0.012\n12000,2,1200,\n",
    "bearing.csv": b"spindle_speed_rpm,preload_n,radial_stiffness_n_um,axial_stiffness_n_um\n"
    b"0,100,61.2,12.1\n6000,100,60,\n",
    "limits.csv": b"spindle_speed_rpm,limit_depth_mm,uncertainty_mm\n6000,0.55,0.05\n9000,0.7,0.05\n",
    "stability.csv": b"trial,spindle_speed_rpm,axial_depth_mm,outcome,chatter_frequency_hz,preload_n,direction\n"
    b"1,6000,0.5,stable,,100,down\n2,7000,1.5,chatter,1180.5,,up\n3,8000,1.0,marginal,,,\n",
}


def good_files() -> dict[str, bytes]:
    return {"machine.yaml": (CAMPAIGNS / "d01" / "machine.yaml").read_bytes(), **TABLES}


def campaign(folder: Path, name: str, changes: list[Mutation]) -> Path:
    """Write a campaign of which one file is mutated."""
    for own, content in good_files().items():
        for change in changes if own == name else []:
            content = change(content)
        (folder / own).write_bytes(content)
    return folder


def test_the_files_that_are_mutated_are_good(tmp_path):
    found = read_campaign(campaign(tmp_path, "", []))
    assert found.trials is not None
    assert found.limits is not None
    assert found.receptances
    assert found.natural_frequencies is not None
    assert found.stiffness is not None


@pytest.mark.parametrize("name", ["machine.yaml", *TABLES])
def test_a_mutated_file_is_read_or_told_in_sentences(tmp_path, name):
    @every_example
    @given(mutations())
    def tried(changes):
        folder = campaign(tmp_path, name, changes)
        assert_read_or_told(lambda: read_campaign(folder), (folder / name).stat().st_size)

    tried()


@settings(every_example, max_examples=max(1, EXAMPLES // 10))
@given(name=st.sampled_from(["machine.yaml", *TABLES]), changes=mutations())
def test_the_command_line_tells_each_problem_on_one_line_and_ends_with_two(tmp_path, capsys, name, changes):
    folder = campaign(tmp_path, name, changes)
    if problems_of(lambda: read_campaign(folder)):
        code, told = main(["compare", f"campaign={folder}", f"output={tmp_path / 'out'}"]), capsys.readouterr()
        assert code == 2
        assert told.out == ""
        assert all(line.startswith("error: ") for line in told.err.splitlines())
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "text",
    [
        "machine: !!python/object/apply:pathlib.Path.touch [{marker}]",
        "tool: !!python/object/new:os.system [touch {marker}]",
        "bearing: {{_target_: pathlib.Path.touch, _args_: [{marker}]}}",
        'process: ${{eval:\'open("{marker}", "w")\'}}',
    ],
)
def test_a_yaml_runs_nothing(tmp_path, capsys, text):
    marker, file = tmp_path / "marker", tmp_path / "machine.yaml"
    file.write_text(text.format(marker=marker))
    assert main(["point", f"machine={file}", "spindle_speed_rpm=6000", "axial_depth_mm=1"]) == 2
    assert not marker.exists()
    assert "Traceback" not in capsys.readouterr().err


def test_a_yaml_that_multiplies_itself_is_told_and_takes_no_memory(tmp_path, capsys):
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 12)]
    file = tmp_path / "machine.yaml"
    file.write_text("\n".join(lines))
    tracemalloc.start()
    assert main(["point", f"machine={file}", "spindle_speed_rpm=6000", "axial_depth_mm=1"]) == 2
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < MEMORY
    assert len(capsys.readouterr().err) < 20_000
