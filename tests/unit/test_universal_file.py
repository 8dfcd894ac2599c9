"""Universal files: dataset 58 written as its definition lays it out becomes receptance in m/N."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest

from chatter_core.errors import InvalidInput
from chatter_core.evidence import read_campaign

CAMPAIGNS = Path(__file__).parents[1] / "data" / "campaigns"
HZ = 2.0 * math.pi
HERTZ = np.array([100.0, 150.0, 200.0, 250.0, 300.0])
#: One mode of 200 Hz, damping 5 %, 10 N/um: receptance in m/N.
RECEPTANCE = 1e-7 / (1.0 - (HERTZ / 200.0) ** 2 + 2j * 0.05 * HERTZ / 200.0)
#: Length and force factors of dataset 164 for metres and newtons, and for millimetres and newtons.
SI, MM = (1.0, 1.0), (1000.0, 1.0)
# What a campaign says when a file names no units.
ASSUMED = "tip.uff: names no units (dataset 164), SI is assumed"


def response(
    *,
    value=RECEPTANCE,
    hertz=HERTZ,
    ids=(),
    function=4,
    directions=(1, 1),
    nodes=(7, 7),
    ordinate=(8, "m"),
    denominator=(13, "N"),
    abscissa=(18, "Hz"),
    points=None,
    even=True,
):
    """Return dataset 58 in double precision: complex, even or uneven in frequency."""

    def axis(kind, unit):
        return f"{kind:10d}{0:5d}{0:5d}{0:5d} {'NONE':20s} {unit:20s}"

    spacing = (int(even), hertz[0], hertz[1] - hertz[0]) if even else (0, 0.0, 0.0)
    lines = ["    -1", "    58", *(f"{line:80s}" for line in [*ids, *["NONE"] * 5][:5])]
    lines.append(
        f"{function:5d}{1:10d}{0:5d}{0:10d} {'NONE':10s}{nodes[0]:10d}{directions[0]:4d}"
        f" {'NONE':10s}{nodes[1]:10d}{directions[1]:4d}"
    )
    lines.append(f"{6:10d}{points or len(hertz):10d}{spacing[0]:10d}{spacing[1]:13.5E}{spacing[2]:13.5E}{0.0:13.5E}")
    lines += [axis(*abscissa), axis(*ordinate), axis(*denominator), axis(0, "NONE")]
    if even:
        lines += [f"{v.real:20.12E}{v.imag:20.12E}" for v in value]
    else:
        lines += [f"{f:13.5E}{v.real:20.12E}{v.imag:20.12E}" for f, v in zip(hertz, value, strict=True)]
    return "\n".join([*lines, "    -1", ""])


def units(length, force):
    """Return dataset 164."""
    factors = f"{length:25.16E}{force:25.16E}{1.0:25.16E}".replace("E", "D")
    return f"    -1\n   164\n{9:10d}{'mine':20s}{2:10d}\n{factors}\n{0.0:25.16E}\n    -1\n".replace("E", "D")


@pytest.fixture
def read(tmp_path):
    """Read a campaign whose only measurement is a universal file."""
    shutil.copy(CAMPAIGNS / "d01" / "machine.yaml", tmp_path)

    def reading(*datasets):
        (tmp_path / "tip.uff").write_text("".join(datasets))
        return read_campaign(tmp_path)

    return reading


def problems(read, *datasets):
    with pytest.raises(InvalidInput) as caught:
        read(*datasets)
    return [problem.rpartition("/tip.uff")[2] for problem in caught.value.problems]


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize(("code", "label", "derivatives"), [(8, "m", 0), (11, "m/s", 1), (12, "(m/s^2)/N", 2)])
def test_mobility_and_accelerance_become_receptance(read, code, label, derivatives, even):
    measured = RECEPTANCE * (1j * HERTZ * HZ) ** derivatives
    campaign = read(units(*SI), response(value=measured, ordinate=(code, label), even=even))
    (found,) = campaign.receptances
    # Twelve digits are written.
    assert found.value == pytest.approx(RECEPTANCE, rel=1e-11)
    assert found.frequency == pytest.approx(HERTZ * HZ, rel=1e-12)
    assert (found.source, found.spindle_speed, found.output_axis, found.input_axis) == ("tip.uff", 0.0, 0, 0)
    assert campaign.remarks == ()


def test_units_of_the_file_lead_to_si(read):
    campaign = read(units(*MM), response(value=RECEPTANCE * 1000.0, ordinate=(8, "mm")))
    assert campaign.receptances[0].value == pytest.approx(RECEPTANCE, rel=1e-11)
    # Pounds over inches: 39.37 inches a metre, 0.2248 pounds a newton.
    inches = RECEPTANCE * 39.37 / 0.2248
    assert read(units(39.37, 0.2248), response(value=inches)).receptances[0].value == pytest.approx(
        RECEPTANCE, rel=1e-11
    )


@pytest.mark.parametrize(
    ("directions", "axes", "sign"), [((1, 2), (0, 1), 1), ((-1, 1), (0, 0), -1), ((-2, -2), (1, 1), 1)]
)
def test_directions_give_axes_and_sign(read, directions, axes, sign):
    # One across the axes is used beside a direct one.
    beside = [response()] if axes[0] != axes[1] else []
    *_, found = read(units(*SI), *beside, response(value=RECEPTANCE * sign, directions=directions)).receptances
    assert (found.output_axis, found.input_axis) == axes
    assert found.value == pytest.approx(RECEPTANCE, rel=1e-11)


def test_an_id_line_states_the_speed(read):
    campaign = read(
        units(*SI), response(), response(ids=("running", "spindle_speed_rpm = 8000, warm"), value=0.9 * RECEPTANCE)
    )
    assert [receptance.spindle_speed for receptance in campaign.receptances] == pytest.approx([0.0, 8000 * HZ / 60])


def test_what_is_left_out_or_assumed_is_remarked(read):
    accelerance = RECEPTANCE * (1j * HERTZ * HZ) ** 2
    hertz = np.array([0.0, 50.0, 100.0, 150.0, 200.0])
    campaign = read(
        response(function=6),
        response(directions=(3, 1)),
        response(value=accelerance, hertz=hertz, ordinate=(12, "m/s^2")),
    )
    assert campaign.remarks == (
        "tip.uff: record 1 is no frequency response and is left out",
        ASSUMED,
        "tip.uff: record 2 is along z, which the model does not know, and is left out",
        "tip.uff: record 3 has no displacement at 0 Hz, that line is left out",
    )
    assert len(campaign.receptances[0].frequency) == 4


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"directions": (4, 1)}, "found response direction 4, allowed: the translations 1, 2, 3 and -1, -2, -3"),
        ({"directions": (1, 0)}, "found reference direction 0, allowed: the translations"),
        (
            {"ordinate": (3, "NONE")},
            "found an ordinate of type 3, allowed: 8 displacement, 11 velocity, 12 acceleration",
        ),
        ({"denominator": (12, "m/s^2")}, "found a denominator of type 12, allowed: 13 or 9, a force"),
        ({"abscissa": (17, "s")}, "found an abscissa of type 17, allowed: 18, frequency in Hz"),
        ({"abscissa": (18, "rad/s")}, "found an abscissa of type 18, allowed: 18, frequency in Hz"),
        ({"points": 9}, "found 5 lines, its header says 9; the file is cut off"),
        ({"ordinate": (8, "mm")}, "found units 'mm' over 'n', allowed: m over n; export in SI units"),
        ({"ordinate": (12, "g")}, "found units 'g' over 'n', allowed: m/s2 over n; export in SI units"),
        ({"denominator": (13, "lbf")}, "found units 'm' over 'lbf', allowed: m over n; export in SI units"),
        (
            {"ids": ("spindle_speed_rpm=fast",)},
            "found 'spindle_speed_rpm=fast', allowed: spindle_speed_rpm=N, a number at least 0 and at most 1e+06 rpm",
        ),
        ({"ids": ("spindle_speed_hz=80",)}, "found 'spindle_speed_hz=80', allowed: spindle_speed_rpm=N"),
        ({"ids": ("spindle_speed_rpm=12,000",)}, "found 'spindle_speed_rpm=12,000', allowed: spindle_speed_rpm=N"),
        ({"value": np.full(5, math.inf)}, "real: found "),
        ({"hertz": -HERTZ}, "frequency: found -300, allowed: a number at least 0 and at most 1e+06 Hz"),
        ({"hertz": np.full(5, 100.0), "even": False}, "frequency 100 Hz stands twice; keep one of them"),
    ],
)
def test_what_is_no_receptance_of_the_tip_is_refused(read, change, expected):
    said = problems(read, response(**change))
    assert any(problem.startswith(f": record 1: {expected}") for problem in said)


def test_a_number_too_many_is_refused(read):
    lines = response().splitlines()
    lines.insert(-len(HERTZ) - 1, f"{0.0:20.12E}")
    assert "found 6 frequencies for 5 responses; the file is damaged" in problems(read, "\n".join([*lines, ""]))[0]


def test_gravities_are_refused_beside_units_of_length_too(read):
    said = problems(read, units(*SI), response(ordinate=(12, "g")))
    assert said == [": record 2: found units 'g' over 'n', allowed: m/s2 over n; export in SI units"]


def test_a_file_is_of_one_node_and_one_system_of_units(read):
    said = problems(read, units(*SI), units(*MM), response(nodes=(7, 9)))
    assert said == [
        ": dataset 164 needs one positive factor each for length and force; export in SI units",
        ": found nodes 7, 9, allowed: one, the tool tip; export it alone",
    ]


def test_a_file_without_responses_or_sense_is_refused(read):
    assert problems(read, units(*SI)) == [": holds no frequency response in dataset 58"]
    assert problems(read, "nothing of the kind") == [": holds no frequency response in dataset 58"]
    torn = response().replace("    58\n", "    58\n\n\n")
    assert problems(read, torn) == [": cannot be read as a universal file; export it again, as ASCII dataset 58"]


def test_what_two_records_hold_is_refused(read, tmp_path):
    (tmp_path / "frf.csv").write_text(
        "spindle_speed_rpm,frequency_hz,output_axis,input_axis,real_um_n,imag_um_n\n0,100,x,x,0.1,-0.1\n"
    )
    assert problems(read, units(*SI), response(), response(directions=(2, 2))) == [
        ": receptance x over x at 0 rpm stands in frf.csv too; keep one of them"
    ]


def test_a_file_in_binary_is_read(read, tmp_path):
    read(response())
    head = response().splitlines()[2:13]
    content = np.column_stack([RECEPTANCE.real, RECEPTANCE.imag]).astype("<f8").tobytes()
    # Little endian, IEEE floating point, 11 lines of text before the numbers.
    kind = f"    58b{1:6d}{2:6d}{11:12d}{len(content):12d}{0:6d}{0:6d}{0:12d}{0:12d}"
    (tmp_path / "tip.uff").unlink()
    (tmp_path / "tip.UNV").write_bytes("\n".join(["    -1", kind, *head, ""]).encode() + content + b"\n    -1\n")
    (found,) = read_campaign(tmp_path).receptances
    assert np.array_equal(found.value, RECEPTANCE)
    assert found.source == "tip.UNV"


def test_a_long_file_is_not_read(read, monkeypatch):
    monkeypatch.setattr("chatter_core.evidence.findings.LARGEST_TABLE", 100)
    assert problems(read, response())[0].endswith("bytes, allowed: at most 100; keep fewer lines")
