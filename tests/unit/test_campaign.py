"""Campaigns: what was measured comes out in SI, and everything wrong in a file is told at its place."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from chatter_core.errors import InvalidInput
from chatter_core.evidence import findings, read_campaign, read_responses, table
from chatter_core.evidence.columns import NO_WORD
from chatter_core.evidence.measured import DIRECTIONS, OUTCOMES, TABLES
from chatter_core.machine import MACHINE_FILE
from chatter_core.reading import read_machine

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
HZ, RPM = 2.0 * math.pi, 2.0 * math.pi / 60.0
STABILITY = "trial,spindle_speed_rpm,axial_depth_mm,outcome,chatter_frequency_hz\n"
FRF = "spindle_speed_rpm,frequency_hz,output_axis,input_axis,real_um_n,imag_um_n\n"
FILES = "stability.csv, frf.csv, modes.csv, bearing.csv, limits.csv, *.uff, *.unv"


@pytest.fixture
def folder(tmp_path):
    """A campaign without measurements."""
    shutil.copy(CAMPAIGNS / "d01" / "machine.yaml", tmp_path)
    return tmp_path


def problems(folder):
    with pytest.raises(InvalidInput) as caught:
        read_campaign(folder)
    return caught.value.problems


def told(folder, content, file="stability.csv"):
    """Return what is said of a file, without the folder's name."""
    path = folder / file
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_text(content, encoding="utf-8")
    return [problem.replace(f"{folder}/", "") for problem in problems(folder)]


@pytest.mark.parametrize(
    ("name", "trials", "responses"),
    [
        ("d01", 92, 8),
        ("d02", 118, 2),
        ("d03", 92, 6),
        ("d04", 76, 2),
        ("d05", 65, 2),
        ("d06", 121, 2),
        ("r01", 25, 0),
        ("r02", 27, 0),
    ],
)
def test_measured_campaigns_are_read_without_a_word(name, trials, responses):
    campaign = read_campaign(str(CAMPAIGNS / name))
    assert len(campaign.trials) == trials
    assert len(campaign.receptances) == responses
    assert np.all(np.diff(campaign.trials.trial) > 0)
    assert all(np.all(np.diff(receptance.frequency) > 0) for receptance in campaign.receptances)
    assert campaign.remarks == campaign.unknown_columns == ()


def test_values_are_si_and_what_a_trial_leaves_open_is_the_machines(folder):
    (folder / "stability.csv").write_text(
        "direction,trial,spindle_speed_rpm,axial_depth_mm,outcome,chatter_frequency_hz,feed_per_tooth_mm,operator\n"
        "up,7,6000,1.5,chatter,500,,Ada\n,3,3000,0.5,marginal,,0.1,Bo\n"
    )
    trials = read_campaign(folder).trials
    assert trials.trial.tolist() == [3, 7]
    # Powers of ten and pi alone: rounding.
    assert trials.spindle_speed == pytest.approx([3000 * RPM, 6000 * RPM], rel=1e-15)
    assert trials.axial_depth == pytest.approx([0.5e-3, 1.5e-3], rel=1e-15)
    assert [OUTCOMES[code] for code in trials.outcome] == ["marginal", "chatter"]
    assert trials.chatter_frequency == pytest.approx([math.nan, 500 * HZ], rel=1e-15, nan_ok=True)
    assert trials.feed_per_tooth == pytest.approx([1e-4, math.nan], rel=1e-15, nan_ok=True)
    assert trials.direction.tolist() == [NO_WORD, DIRECTIONS.index("up")]
    assert np.isnan(trials.preload).all()
    assert trials.unknown == {"operator": ("Bo", "Ada")}
    assert read_campaign(folder).unknown_columns == ("stability.csv: operator",)


def test_responses_are_grouped_and_ascend(folder):
    (folder / "frf.csv").write_text(FRF + "0,300,x,x,0.3,-1\n500,100,y,x,3,-4\n0,100,x,x,0.1,0\n0,200,x,x,0.2,-0.2\n")
    first, second = read_campaign(folder).receptances
    assert first.frequency == pytest.approx([100 * HZ, 200 * HZ, 300 * HZ], rel=1e-15)
    assert first.value == pytest.approx([0.1e-6, 0.2e-6 - 0.2e-6j, 0.3e-6 - 1e-6j], rel=1e-15)
    assert (second.output_axis, second.input_axis, second.spindle_speed) == (1, 0, pytest.approx(500 * RPM))
    assert str(second) == "y over x at 500 rpm"


def test_a_response_across_the_axes_is_used_beside_a_direct_one_alone(folder):
    across = FRF + "0,100,y,x,0.1,0\n0,200,y,x,0.2,-0.2\n"
    (folder / "frf.csv").write_text(across)
    (folder / "limits.csv").write_text("spindle_speed_rpm,limit_depth_mm,uncertainty_mm\n9000,1.2,0.1\n")
    why = "frf.csv: receptance y over x at 0 rpm is not used; no direct one, x over x or y over y, tells how much of it"
    assert [one.startswith(why) for one in read_campaign(folder).remarks] == [True]
    assert read_campaign(folder).receptances == ()
    (folder / "frf.csv").write_text(across + "0,100,y,y,0.1,0\n0,200,y,y,0.2,-0.2\n")
    assert len(read_campaign(folder).receptances) == 2
    (folder / "limits.csv").unlink()
    (folder / "frf.csv").write_text(across)
    (problem,) = problems(folder)
    assert problem.startswith(f"{folder}: no measurement yet")
    assert why in problem


def test_words_are_read_in_any_case(folder):
    (folder / "stability.csv").write_text(STABILITY + "1,9000,1,Chatter,500\n2,9000,0.5, STABLE,\n")
    (folder / "frf.csv").write_text(FRF + "0,100,X,x,0.1,0\n0,200,X,x,0.2,-0.2\n")
    campaign = read_campaign(folder)
    assert [OUTCOMES[code] for code in campaign.trials.outcome] == ["chatter", "stable"]
    assert campaign.receptances[0].is_direct


def test_receptances_are_of_the_preload_of_the_machine(folder):
    own = read_machine(folder / "machine.yaml").spindle.preload
    lines = [f"0,{frequency},x,x,0.1,0," for frequency in (100, 200)]
    header = FRF.replace("\n", ",preload_n\n")

    def written(*preloads):
        (folder / "frf.csv").write_text(header + "\n".join(f"{a}{b}" for a, b in zip(lines, preloads, strict=True)))

    written("", f"{own:g}")
    assert read_campaign(folder).unknown_columns == ()
    assert len(read_responses(folder / "frf.csv").receptances) == 1
    why = f"receptances under another preload are a campaign of their own, with that preload in its {MACHINE_FILE}"
    written(f"{own:g}", f"{2 * own:g}")
    found = f"found {own:g} and {2 * own:g}, needed:"
    column = f"{folder / 'frf.csv'}, column preload_n"
    assert problems(folder) == [f"{column}: {found} {own:g}, the machine's own; {why}"]
    with pytest.raises(InvalidInput) as caught:
        read_responses(folder / "frf.csv")
    assert caught.value.problems == [f"{column}: {found} one for all; {why}"]
    written(f"{2 * own:g}", f"{2 * own:g}")
    assert problems(folder) == [f"{column}: found {2 * own:g}, needed: {own:g}, the machine's own; {why}"]


def test_modes_stiffness_and_limits(folder):
    (folder / "modes.csv").write_text("spindle_speed_rpm,mode,natural_frequency_hz,damping_ratio\n0,1,500,\n")
    (folder / "bearing.csv").write_text("spindle_speed_rpm,preload_n,radial_stiffness_n_um\n9000,100,35\n")
    (folder / "limits.csv").write_text("spindle_speed_rpm,limit_depth_mm,uncertainty_mm\n9000,1.2,0.1\n")
    campaign = read_campaign(folder)
    assert campaign.natural_frequencies.natural_frequency == pytest.approx([500 * HZ], rel=1e-15)
    assert np.isnan(campaign.natural_frequencies.damping_ratio).all()
    assert campaign.stiffness.radial_stiffness == pytest.approx([35e6], rel=1e-15)
    assert np.isnan(campaign.stiffness.axial_stiffness).all()
    assert campaign.limits.limit_depth == pytest.approx([1.2e-3], rel=1e-15)
    assert campaign.limits.uncertainty == pytest.approx([1e-4], rel=1e-15)
    assert campaign.trials is None
    assert campaign.receptances == ()


PLAIN = STABILITY + "1,6000.5,1.25,chatter,512.5\n2,6000,0.5,stable,\n"
GERMAN = PLAIN.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    "content",
    [
        PLAIN.encode(),
        b"\xef\xbb\xbf" + PLAIN.encode(),
        PLAIN.replace("\n", "\r\n").encode(),
        PLAIN.replace("\n", "\r").encode(),
        PLAIN.encode("utf-16"),
        PLAIN.replace(",", "\t").encode("utf-16"),
        PLAIN.replace(",", ";").encode(),
        GERMAN.encode(),
        GERMAN.replace(";", "\t").encode(),
        ("sep=;\n" + GERMAN).encode(),
        PLAIN.replace("chatter,", '"chatter",').replace("trial", '"trial"').encode(),
        PLAIN.replace("\n", ",,\n").encode(),
        (PLAIN + "\n  \n,,,,\n,,,,,,\n").encode(),
        ('\n# cut on Monday, dry; "dull\n' + PLAIN.replace("\n2", "\n# pause\n\n2")).encode(),
        PLAIN.replace(",", " , ").encode(),
        PLAIN.removesuffix("\n").encode(),
    ],
)
def test_a_table_is_read_as_people_and_spreadsheets_write_it(folder, content):
    (folder / "stability.csv").write_bytes(content)
    trials = read_campaign(folder).trials
    assert trials.spindle_speed == pytest.approx([6000.5 * RPM, 6000 * RPM], rel=1e-15)
    assert trials.axial_depth == pytest.approx([1.25e-3, 0.5e-3], rel=1e-15)
    assert trials.outcome.tolist() == [2, 0]
    assert trials.chatter_frequency == pytest.approx([512.5 * HZ, math.nan], rel=1e-15, nan_ok=True)


HEADER_COMMAS = "decimal commas need columns separated by semicolons"
OUTCOME = "allowed: one of stable, marginal, chatter"
SPEED = "allowed: a number at least 0.1 and at most 1e+06 rpm"


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", f"is empty; needed: a header line {STABILITY.rpartition(',')[0]} and a line for each measurement"),
        (
            STABILITY.replace("outcome,", ""),
            ", line 1, column outcome: missing; needed: what the cut was judged to be, one of",
        ),
        (STABILITY.replace("outcome", "outcome,trial"), ", line 1, column trial: stands twice; keep one of them"),
        (STABILITY.replace("outcome", "outcome,"), ", line 1: the name of column 5 is empty; name it or remove it"),
        (
            STABILITY.replace("speed_rpm", "speed_hz"),
            ", line 1, column spindle_speed_hz: unknown name or unit; did you mean spindle_speed_rpm?; values are in",
        ),
        (
            STABILITY.replace("depth_mm", "depth_m"),
            ", line 1, column axial_depth_m: unknown name or unit; did you mean axial_depth_mm?; values are in mm",
        ),
        (
            STABILITY.replace("depth_mm", "depth"),
            ", column axial_depth: unknown name or unit; did you mean axial_depth_mm?",
        ),
        (
            STABILITY.replace("chatter_", "chater_"),
            ", column chater_frequency_hz: unknown name or unit; did you mean chatter_",
        ),
        (STABILITY.replace("outcome", "Outcome"), ", column Outcome: unknown name or unit; did you mean outcome?"),
        (
            STABILITY.replace(",axial", ";axial"),
            ", line 1: columns are separated by commas and by semicolons; use one of them throughout",
        ),
        (PLAIN + "3,9000,1.0\n", ", line 4: found 3 cells, allowed: 5, as in the header"),
        (
            PLAIN + "3,9000,1,25,stable,\n",
            f", line 4: found 6 cells, allowed: 5, as in the header; {HEADER_COMMAS}",
        ),
        (
            PLAIN + "3,fast,1.0,stable,\n",
            f", line 4, column spindle_speed_rpm: found 'fast', {SPEED}",
        ),
        (PLAIN + "3,9000 rpm,1.0,stable,\n", f", line 4, column spindle_speed_rpm: found '9000 rpm', {SPEED}"),
        (PLAIN + "3,9_000,1.0,stable,\n", f", line 4, column spindle_speed_rpm: found '9_000', {SPEED}"),
        (PLAIN + "3,٣,1.0,stable,\n", f", line 4, column spindle_speed_rpm: found '٣', {SPEED}"),
        (
            PLAIN + '3,"9,000",1.0,stable,\n',
            f"column spindle_speed_rpm: found '9,000', {SPEED}; decimals of this file are written with '.'",
        ),
        (
            PLAIN + "3,nan,1.0,stable,\n",
            f"column spindle_speed_rpm: found 'nan', {SPEED}; a missing value is an empty cell",
        ),
        (PLAIN + "3,inf,1.0,stable,\n", f", line 4, column spindle_speed_rpm: found 'inf', {SPEED}; a missing value"),
        (PLAIN + "3,1e999,1.0,stable,\n", f", line 4, column spindle_speed_rpm: found '1e999', {SPEED}"),
        (PLAIN + "3,-9000,1.0,stable,\n", f", line 4, column spindle_speed_rpm: found '-9000', {SPEED}"),
        (PLAIN + "3,,1.0,stable,\n", ", line 4, column spindle_speed_rpm: is empty, needed: a number at least 0.1"),
        (
            PLAIN + "3,9000,0,stable,\n",
            ", column axial_depth_mm: found '0', allowed: a number at least 1e-06 and at most",
        ),
        (PLAIN + "3.5,9000,1,stable,\n", ", line 4, column trial: found '3.5', allowed: a whole number at least 0"),
        (PLAIN + "3,9000,1,stabel,\n", f", line 4, column outcome: found 'stabel', {OUTCOME}"),
        (PLAIN + "3,9000,1,,\n", f", line 4, column outcome: found '', {OUTCOME}"),
        (PLAIN + "1,9000,1,stable,\n", ", line 4: same trial as in line 2; keep one of them"),
        (
            PLAIN + "3,9000,1,stable,-\n",
            "column chatter_frequency_hz: found '-', allowed: a number at least 0.1 and at",
        ),
        (GERMAN + "3;9000;1.5;stable;\n", "column axial_depth_mm: found '1.5', allowed: a number at least 1e-06"),
        (
            GERMAN + "3;9.000,5;1;stable;\n",
            "found '9.000,5', allowed: a number at least 0.1 and at most 1e+06 rpm; decimals of",
        ),
        (PLAIN + '3,9000,1,"stable\n",\n', ", line 4: a quoted cell goes on in the next line; keep a cell in one line"),
        (PLAIN + '3,9000,1,"stable"x,\n', ", line 4: cannot be read as cells: "),
        (PLAIN + '3,9000,1,"stable,\n', ", line 4: cannot be read as cells: "),
        (
            PLAIN.encode() + b"3,9000,1,st\xe4ble,\n",
            ", line 4: no text in UTF-8 or UTF-16, byte 126 cannot be read; save it as",
        ),
        ("x" * 200_000, ", line 1: cannot be read as cells: field larger than field limit"),
        (STABILITY.strip() + ",x" * 200 + "\n", ", line 1: found 205 columns, allowed: at most 200"),
        (STABILITY.replace("outcome", "outcome,a\x1b[2J,a\x1b[2J"), ", line 1, column a\\x1b[2J: stands twice"),
        (b"PK\x03\x04\x00\x00", ": holds binary data and not text; save it as 'CSV UTF-8'"),
        (PLAIN.encode("utf-16-le"), ": holds binary data and not text"),
    ],
)
def test_what_is_wrong_in_a_table_is_told_at_its_place(folder, content, expected):
    said = told(folder, content)
    assert len(said) == 1
    assert said[0].startswith("stability.csv")
    assert expected in said[0]


def test_all_findings_of_all_files_are_told_up_to_a_dozen_for_each(folder):
    (folder / "frf.csv").write_text(FRF + "0,100,x,z,1,-1\n0,100,x,x,,-1\n")
    said = told(folder, STABILITY + "".join(f"{trial},fast,1,stable,\n" for trial in range(40)))
    assert said[:13] == [
        *(f"stability.csv, line {line}, column spindle_speed_rpm: found 'fast', {SPEED}" for line in range(2, 14)),
        "stability.csv: and 28 more findings",
    ]
    assert said[13:] == [
        "frf.csv, line 2, column input_axis: found 'z', allowed: one of x, y",
        "frf.csv, line 3, column real_um_n: is empty, needed: a number at least -1e+06 and at most 1e+06 um/N",
    ]


@pytest.mark.parametrize(
    ("file", "rows", "expected"),
    [
        (
            "frf.csv",
            FRF + "0,100,x,x,1,-1\n0,200,x,x,1,-1\n0,100.0,x,x,2,-1\n",
            "line 4: same spindle_speed_rpm, output_axis, input_axis and frequency_hz as in line 2; keep one of them",
        ),
        (
            "modes.csv",
            "spindle_speed_rpm,mode,natural_frequency_hz,damping_ratio\n0,1,500,0.02\n0,1,600,0.02\n",
            "line 3: same spindle_speed_rpm and mode as in line 2; keep one of them",
        ),
        (
            "bearing.csv",
            "spindle_speed_rpm,preload_n,radial_stiffness_n_um\n0,100,30\n0,100,31\n",
            "line 3: same spindle_speed_rpm and preload_n as in line 2; keep one of them",
        ),
        (
            "limits.csv",
            "spindle_speed_rpm,limit_depth_mm,uncertainty_mm\n9000,1,0.1\n9000,2,0.1\n",
            "line 3: same spindle_speed_rpm as in line 2; keep one of them",
        ),
    ],
)
def test_what_was_measured_once_stands_once(folder, file, rows, expected):
    assert told(folder, rows, file) == [f"{file}, {expected}"]


def test_lines_are_counted_on_through_blocks(folder, monkeypatch):
    monkeypatch.setattr(table, "BLOCK", 3)
    rows = [f"{trial},9000,1,stable," for trial in range(10)]
    rows[8] = "8,fast,1,stable,"
    rows.insert(4, "# pause")
    said = told(folder, STABILITY + "\n".join(rows))
    assert said == [f"stability.csv, line 11, column spindle_speed_rpm: found 'fast', {SPEED}"]


def test_a_decimal_mark_holds_through_blocks(folder, monkeypatch):
    monkeypatch.setattr(table, "BLOCK", 1)
    said = told(folder, GERMAN.replace("6000;0,5", "6000;0.5"))
    assert len(said) == 1
    assert "line 3, column axial_depth_mm: found '0.5'" in said[0]
    assert "decimals of this file are written with ',', as in '6000,5', and thousands are not separated" in said[0]


def test_a_slot_is_cut_at_full_immersion(folder):
    header = STABILITY.replace("\n", ",direction,radial_immersion\n")
    said = told(folder, header + "1,9000,1,stable,,slot,\n2,9000,1,stable,,slot,1\n3,9000,1,stable,,,0.5\n")
    assert said == ["stability.csv, line 2, column radial_immersion: direction slot needs 1, found 0.4"]


def test_the_folder_itself_is_checked(tmp_path):
    assert problems(tmp_path / "nowhere") == [
        f"{tmp_path}/nowhere: no such folder; a campaign is a folder with machine.yaml and measurements"
    ]
    assert problems(tmp_path) == [
        f"{tmp_path}/machine.yaml: no such file; needed: the machine as it is believed to be; "
        "`python -m pipeline template output=DIR` writes one to fill in",
        f"{tmp_path}: no measurement yet; needed: rows in one at least of {FILES}",
    ]


def test_a_campaign_without_a_measurement_says_so(folder):
    nothing = f"{folder}: no measurement yet; needed: rows in one at least of {FILES}"
    assert problems(folder) == [nothing]
    (folder / "stability.csv").write_text(STABILITY)
    assert problems(folder) == [nothing]
    (folder / "Frf.CSV").write_text(FRF)
    (folder / "stability.csv").unlink()
    assert problems(folder) == [f"{nothing} (Frf.CSV: is not read; did you mean frf.csv?)"]


def test_a_wrong_machine_is_told_together_with_wrong_tables(folder):
    text = (folder / "machine.yaml").read_text()
    (folder / "machine.yaml").write_text(text.replace("teeth: 4", "teeth: 0"))
    said = told(folder, PLAIN + "3,9000,1,stabel,\n")
    assert said == [
        "machine.yaml: tool.teeth: found 0, allowed: at least 1",
        f"stability.csv, line 4, column outcome: found 'stabel', {OUTCOME}",
    ]


@pytest.mark.parametrize("name", ["machine.yaml", "stability.csv"])
def test_a_path_does_not_lead_out_of_the_folder(tmp_path, name):
    folder, outside = tmp_path / "campaign", tmp_path / name
    folder.mkdir()
    shutil.copy(CAMPAIGNS / "r01" / name, outside)
    shutil.copy(CAMPAIGNS / "r01" / "machine.yaml", folder)
    shutil.copy(CAMPAIGNS / "r01" / "stability.csv", folder)
    (folder / name).unlink()
    (folder / name).symlink_to(outside)
    assert problems(folder) == [f"{folder / name}: leads out of its folder; put the file itself there"]


def test_a_link_to_itself_is_no_table(folder):
    (folder / "frf.csv").symlink_to(folder / "frf.csv")
    assert problems(folder) == [f"{folder / 'frf.csv'}: is no file"]


def test_a_folder_is_no_table(folder):
    (folder / "frf.csv").mkdir()
    assert problems(folder) == [f"{folder / 'frf.csv'}: is no file"]


def test_a_file_has_a_largest_size(folder, monkeypatch):
    monkeypatch.setattr(findings, "LARGEST_TABLE", 1600)
    content = PLAIN + "\n" * 2000
    assert told(folder, content) == [
        f"stability.csv: found {len(content)} bytes, allowed: at most 1600; keep fewer lines"
    ]


@pytest.mark.parametrize(
    ("file", "content", "remark"),
    [
        (
            "frf.csv",
            FRF + "0,100,x,x,0.2,0.1\n0,200,x,x,0.1,3\n",
            "receptance x over x at 0 rpm has a positive imaginary part at its peak",
        ),
        (
            "frf.csv",
            FRF + "0,100,y,y,2e-7,0\n0,200,y,y,0,-3e-7\n",
            "receptance y over y at 0 rpm has a median of 2.5e-07 um/N, usual are 0.001 to 100; is its unit right?",
        ),
        (
            "stability.csv",
            PLAIN + "3,9000,1,stable,400\n",
            "1 stable trials name a chatter frequency, line 4 the first; it is not used",
        ),
        (
            "stability.csv",
            STABILITY + "1,7.5,1.25,chatter,\n2,8.1,0.5,stable,\n",
            "spindle_speed_rpm is 8.1 at most; is its unit right, and are thousands not separated?",
        ),
        (
            "stability.csv",
            STABILITY + "1,9000,0.00125,chatter,\n2,9000,0.0005,stable,\n",
            "axial_depth_mm is 0.00125 at most; is its unit right, and are thousands not separated?",
        ),
        (
            "stability.csv",
            PLAIN + "3,9000,1,chatter,0.51\n4,9000,1,chatter,510\n",
            "chatter frequencies below a tenth of the spindle's revolutions: 1, the first in line 4; is their unit",
        ),
        ("trials.csv", PLAIN, "is not read"),
        ("modes.csv", "spindle_speed_rpm,mode,natural_frequency_hz\n", "holds a header and no rows"),
    ],
)
def test_what_is_odd_is_remarked(folder, file, content, remark):
    (folder / "stability.csv").write_text(PLAIN)
    (folder / file).write_text(content)
    remarks = read_campaign(folder).remarks
    assert len(remarks) == 1
    assert remarks[0].startswith(f"{file}: ")
    assert remark in remarks[0]


def test_a_preload_is_nothing_to_measured_tip_modes(tmp_path):
    shutil.copy(CAMPAIGNS / "r01" / "machine.yaml", tmp_path)
    (tmp_path / "stability.csv").write_text(STABILITY.replace("\n", ",preload_n\n") + "1,9000,1,chatter,,200\n")
    assert read_campaign(tmp_path).remarks == (
        "stability.csv: preload_n is not used, the machine's measured tip modes know no preload",
    )


def test_bearings_are_nothing_to_measured_tip_modes(tmp_path):
    shutil.copy(CAMPAIGNS / "r01" / "machine.yaml", tmp_path)
    (tmp_path / "bearing.csv").write_text("spindle_speed_rpm,preload_n,radial_stiffness_n_um\n3000,200,100\n")
    said = "bearing.csv: is not used, the machine's measured tip modes know no bearings"
    (problem,) = problems(tmp_path)
    assert "no measurement yet" in problem
    assert said in problem
    (tmp_path / "stability.csv").write_text(STABILITY + "1,9000,1,chatter,\n")
    found = read_campaign(tmp_path)
    assert found.stiffness is None
    assert found.remarks == (said,)


@pytest.mark.parametrize("size", ["0", "1e-300"])
def test_a_response_without_motion_is_refused(folder, size):
    (folder / "frf.csv").write_text(FRF + f"0,100,x,y,{size},0\n0,110,x,y,0,-{size}\n0,100,x,x,1,-1\n")
    said = "receptance x over y at 0 rpm is zero on every line; leave it out where nothing was measured"
    assert problems(folder) == [f"{folder / 'frf.csv'}: {said}"]
    with pytest.raises(InvalidInput, match="is zero on every line"):
        read_responses(folder / "frf.csv")


def test_a_frequency_that_a_stable_trial_names_is_not_passed_on(folder):
    (folder / "stability.csv").write_text(STABILITY + "1,9000,1,stable,400\n2,9000,1,marginal,410\n")
    assert np.isnan(read_campaign(folder).trials.chatter_frequency).tolist() == [True, False]


def test_every_column_says_what_it_means_and_allows():
    for declared in TABLES:
        names = [column.name for column in declared.columns]
        assert len(set(names)) == len(names)
        assert set(declared.identity) <= {column.key for column in declared.columns if not column.optional}
        for column in declared.columns:
            assert column.doc
            assert bool(column.choices) != bool(str(column.bounds))
