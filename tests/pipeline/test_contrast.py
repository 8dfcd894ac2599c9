"""Two studies held against each other: differences that are known, what cannot be compared, and the page."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from chatter_core.errors import InvalidInput
from pipeline import dataset, store
from pipeline.command_line import main
from pipeline.contrast.contrasted import TOLD, changed_shares, changes, contrast
from pipeline.contrast.findings import findings, warnings
from pipeline.contrast.lines import BEST, Lines, read
from pipeline.kinds import Dataset
from pipeline.places import DATASET as STORE
from pipeline.places import Folder
from pipeline.settings import Margins
from tests.pipeline.browser import needs_chromium, opened
from tests.pipeline.test_study_page import plotted

MARGINS = Margins().said


def ramp(limit, speed, **other):
    """Return a sweep of one line with these limit depths [mm], chattering at 1 kHz in one mode."""
    speed, limit = np.asarray(speed, dtype=float), np.asarray(limit, dtype=float)
    depth = np.array([1.0, 2.0, 4.0])
    said = {
        "place": "somewhere",
        "attributes": {"settings": {"grid": {"mode_selection": "up_to"}}},
        "labels": pd.DataFrame({"modal_parameters": ["dynamic"], "preload": [100.0], "mode_count": [2]}),
        "speed": speed,
        "deepest": 4.0,
        "limit": limit[None],
        "frequency": np.full((1, len(speed)), 1000.0),
        "mode": np.full((1, len(speed)), 1),
        "loss": np.ones((1, len(speed)), dtype=int),
        "known": np.ones((1, len(speed)), dtype=bool),
        "best": pd.DataFrame({"spindle_speed_rpm": [1.0], "axial_depth_mm": [1.0], "removal_rate_cm3_min": [1.0]}),
        "depth": depth,
        "radius": (depth[None, :] / limit[:, None])[None],
    }
    return Lines(**{**said, **other})


@pytest.fixture(scope="module")
def doubled(tmp_path_factory):
    """A sweep by the real physics, and the same with cutting coefficients twice as large."""
    folder = tmp_path_factory.mktemp("doubled")
    words = ["study=smoke", "tool.helix_angle_deg=0", "cluster=serial", "grid.modal_parameters=[dynamic]"]
    words += ["grid.spindle_speed_rpm=[9000, 10000, 11000, 12000]", "grid.mode_count=[2]"]
    words += ["grid.axial_depth_mm=[0.3, 0.6, 1.2, 2.4, 4.8, 20]"]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.report.write", lambda *_, **__: [])
        for name, energy in (("first", 900), ("second", 1800)):
            assert main(["sweep", *words, f"cutting.kt_mpa={energy}", f"output={folder / name}"]) == 0
    words = [f"{name}={folder / name}" for name in ("first", "second")]
    assert main(["contrast", *words, f"output={folder / 'answer'}"]) == 0
    return folder


def test_twice_the_cutting_coefficient_halves_all_limit_depths(doubled):
    """With straight teeth the equation knows depth times coefficient alone."""
    both = contrast(*(read(Folder(doubled / name), MARGINS) for name in ("first", "second")))
    # Each limit depth is found to a ten-thousandth at worst.
    assert both.ratio == pytest.approx(np.full((1, 4), 0.5), rel=2e-4)
    limits = [lines.limit[0] for lines in both.studies]
    _, depth, codes = changes(both, 0)
    expected = np.array([[1 if d < b else 3 if d < a else 2 for d in depth] for a, b in zip(*limits, strict=True)])
    assert np.array_equal(codes, expected)
    # A cell that is unstable in the first is so in the second at half the depth: what changes lies between.
    assert (codes == 3).any()
    table = pd.read_csv(doubled / "answer" / "tables" / "settings.csv")
    assert table.values.tolist() == [["cutting.kt_mpa", 900.0, 1800.0]]
    best = pd.read_csv(doubled / "answer" / "tables" / "best_cuts.csv")
    assert best["ratio_of_rates"].tolist() == pytest.approx([0.5], rel=2e-4)


def test_a_study_is_the_same_as_itself(doubled):
    lines = read(Folder(doubled / "first"), MARGINS)
    both = contrast(lines, lines)
    assert np.array_equal(both.ratio, np.ones((1, 4)))
    assert not np.isin(changes(both, 0)[2], (3, 4)).any()


def test_between_speeds_of_one_lobe_limits_are_interpolated():
    coarse, fine = [10000.0, 10200.0, 10400.0], np.linspace(9950.0, 10450.0, 6)
    both = contrast(ramp([1.0, 1.1, 1.2], coarse), ramp(2e-4 * fine, fine))
    # The finer one is a straight line over speed, which interpolation keeps.
    assert both.limit[1][0] == pytest.approx(2e-4 * np.array(coarse), rel=1e-12)
    assert (both.told == TOLD.index("both")).all()


@pytest.mark.parametrize(
    "other",
    [
        {"mode": np.array([[1, 2, 2]])},
        {"loss": np.array([[1, 2, 2]])},
        # From 1000 Hz to 1200 Hz at 10000 rpm: 1.2 waves more in a revolution.
        {"frequency": np.array([[1000.0, 1200.0, 1200.0]])},
        {"limit": [1.0, 1.3, 1.3]},
        {"limit": [1.0, np.nan, 1.2]},
    ],
)
def test_between_lobes_nothing_is_told(other):
    own, shifted = [10000.0, 10200.0, 10400.0], [9900.0, 10100.0, 10300.0]
    both = contrast(ramp([1.0, 1.1, 1.2], own), ramp(**{"limit": [1.0, 1.1, 1.2], "speed": shifted, **other}))
    assert both.pairs.speed.tolist() == [10000.0, 10200.0]
    assert both.told[0, 0] == TOLD.index("between lobes")
    assert np.isnan(both.ratio[0, 0])


def test_boundaries_above_the_grid_are_told_and_have_no_ratio():
    first = ramp([1.0, np.nan, np.nan, 1.0], [1e4, 2e4, 3e4, 4e4])
    second = ramp([2.0, 2.0, np.nan, np.nan], [1e4, 2e4, 3e4, 4e4])
    both = contrast(first, second)
    assert [TOLD[code] for code in both.told[0]] == ["both", "none in first", "none in either", "none in second"]
    assert both.ratio[0] == pytest.approx([2.0, np.nan, np.nan, np.nan], nan_ok=True)


def test_a_study_that_looked_less_deep_is_not_said_to_have_the_deeper_limit():
    """Above 4 mm the first knows nothing: its limit may be 5 mm as well as 20 mm."""
    deeper = {"deepest": 8.0, "depth": np.array([1.0, 2.0, 4.0, 8.0])}
    limit, speed = np.array([7.0, 7.0]), [1e4, 2e4]
    second = ramp(limit, speed, **deeper, radius=(deeper["depth"][None, :] / limit[:, None])[None])
    both = contrast(ramp([np.nan, 2.0], speed), second)
    assert [TOLD[code] for code in both.told[0]] == ["none in first", "both"]
    # Down to 4 mm, which both looked at: nothing changes at the first speed, a half of it at the second.
    assert both.settled[:, 0].tolist() == [[4.0, 2.0], [4.0, 4.0]]
    assert any("that each study looked at" in told for told in warnings(both))


def test_cells_that_change_are_counted_over_all_lines_as_far_as_they_are_known():
    labels = pd.DataFrame({"modal_parameters": "dynamic", "preload": [100.0, 200.0], "mode_count": 2})
    ones = {name: np.ones((2, 1), dtype=int) for name in ("frequency", "mode", "loss")}
    ones |= {"labels": labels, "best": pd.DataFrame({name: [1.0, 1.0] for name in BEST})}
    ones["known"] = np.ones((2, 1), dtype=bool)
    # Of the first line three cells are known, of which one changes; of the second one, which does.
    radius = np.array([[[0.5, 2.0, 3.0]], [[0.5, np.nan, np.nan]]])
    radii = (radius, radius + 0.6)
    first, second = (dataclasses.replace(ramp([1.0], [1e4], **ones, radius=one), limit=ones["mode"]) for one in radii)
    both = contrast(first, second)
    assert changed_shares(both)["becomes_unstable_percent"].tolist() == pytest.approx([100.0 / 3.0, 100.0])
    assert "Of all cells that both have 50 % are stable in the first alone" in " ".join(findings(both))


def test_single_values_that_differ_are_what_is_held_against_each_other():
    second = ramp([2.0, 2.0], [1e4, 2e4])
    second = dataclasses.replace(second, labels=second.labels.assign(preload=200.0))
    both = contrast(ramp([1.0, 1.0], [1e4, 2e4]), second)
    assert both.name_of(0) == "dynamic, 100 and 200 N, modes 1 to 2"
    assert both.ratio.tolist() == [[2.0, 2.0]]


def test_numbers_of_modes_that_differ_are_named_as_what_they_mean():
    for selection, told in (("up_to", "modes: 2 and 3"), ("only", "modes: 2 and 3, each alone")):
        attributes = {"settings": {"grid": {"mode_selection": selection}}}
        first, second = (ramp([1.0, 1.0], [1e4, 2e4], attributes=attributes) for _ in range(2))
        second = dataclasses.replace(second, labels=second.labels.assign(mode_count=3))
        assert contrast(first, second).name_of(0) == f"dynamic, 100 N, {told}"


@pytest.mark.parametrize(
    ("second", "told"),
    [
        (
            ramp([1.0, 1.0], [3e4, 4e4]),
            "spindle_speed: found 10000 to 20000 rpm in first, 30000 to 40000 rpm in second",
        ),
        (
            ramp([1.0], [1e4], attributes={"settings": {"grid": {"mode_selection": "only"}}}),
            "grid.mode_selection: found first up_to, second only",
        ),
        (
            ramp(
                [1.0],
                [1e4],
                labels=pd.DataFrame({"modal_parameters": "dynamic", "preload": [200.0, 300.0], "mode_count": 2}),
            ),
            "preload: found 100 in first, 200, 300 in second; none is in both",
        ),
    ],
)
def test_what_cannot_be_compared_is_told(second, told):
    with pytest.raises(InvalidInput) as caught:
        contrast(ramp([1.0, 1.0], [1e4, 2e4]), second)
    assert told in str(caught.value)


@pytest.fixture(scope="module")
def datasets(tmp_path_factory):
    """Data sets of one design around two machines, one of other machines, and one of other keys."""
    folder = tmp_path_factory.mktemp("datasets")
    vary = ["vary.spindle.preload_n=[100, 200]", "vary.tool.teeth=[2, 4]"]
    words = ["study=parameter_study", "cluster=serial", "design.spindle_speed_rpm=[6000, 9000, 12000]"]
    others = {
        "first": vary,
        "second": [*vary, "cutting.kt_mpa=1700"],
        "other_values": ["vary.spindle.preload_n=[100, 300]", "vary.tool.teeth=[2, 4]"],
        "other_keys": vary[:1],
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
        patch.setattr(Dataset, "report", lambda self, place: [])
        for name, own in others.items():
            assert dataset.run([*words, *own, f"output={folder / name}"]) == 0
    return folder


def test_data_sets_of_one_design_are_compared_cut_by_cut(datasets, capsys):
    words = [f"{name}={datasets / name}" for name in ("first", "second")]
    assert main(["contrast", *words, f"output={datasets / 'answer'}"]) == 0
    # The stand-in's limits are exp(preload / 200 + kt / 4000), of 900 and 1700 MPa, to the store's seven digits.
    out = capsys.readouterr().out
    assert "Settings differ in cutting.kt_mpa (900.0 and 1700.0)." in out
    assert f"are {np.exp(0.2):.4g} times those of the first" in out
    table = pd.read_csv(datasets / "answer" / "tables" / "limit_depths.csv")
    assert table["ratio"].tolist() == pytest.approx([np.exp(0.2)] * 12, rel=1e-6)
    with xr.open_zarr(datasets / "first" / STORE) as data:
        gained = np.expm1(0.2) * data["limit_depth"].values.mean(axis=-1).ravel()
    lines = pd.read_csv(datasets / "answer" / "tables" / "lines.csv")
    # Of ten millimetres that were looked down to.
    assert lines["becomes_stable_percent"].tolist() == pytest.approx((10.0 * gained).tolist(), rel=1e-6)


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ("other_values", "machine 2, cut 0 is another one in second than in first"),
        ("other_keys", "first varies spindle.preload_n, tool.teeth; second spindle.preload_n"),
        ("nowhere", "second: "),
    ],
)
def test_data_sets_of_other_designs_are_refused(datasets, capsys, other, told):
    output = datasets / "refused"
    assert main(["contrast", f"first={datasets / 'first'}", f"second={datasets / other}", f"output={output}"]) == 2
    assert told in capsys.readouterr().err
    assert not output.exists()


def test_a_store_in_other_units_is_refused(datasets, monkeypatch):
    place = Folder(datasets / "first", STORE)
    in_metres = store.open_lobes(place)
    in_metres["limit_depth"].attrs["units"] = "m"
    monkeypatch.setattr(store, "open_lobes", lambda _: in_metres)
    with pytest.raises(InvalidInput, match=r"limit_depth in m, allowed: mm"):
        read(place, MARGINS)


def test_studies_of_two_kinds_are_refused_and_no_study_is_written_over(datasets, doubled, capsys):
    first = f"first={datasets / 'first'}"
    assert main(["contrast", first, f"second={doubled / 'first'}"]) == 2
    assert "first is a data set, second a sweep" in capsys.readouterr().err
    assert main(["contrast", first, f"second={datasets / 'second'}", f"output={datasets / 'first'}"]) == 2
    assert "is the folder of a study; name another" in capsys.readouterr().err
    in_store = f"output={datasets / 'first' / STORE / 'answer'}"
    assert main(["contrast", first, f"second={datasets / 'second'}", in_store]) == 2
    assert "is the folder of a study; name another" in capsys.readouterr().err
    (doubled / "other").mkdir()
    (doubled / "other" / "report.html").write_text("mine")
    assert main(["contrast", first, f"second={datasets / 'second'}", f"output={doubled / 'other'}"]) == 2
    assert "holds a report.html that another verb has written" in capsys.readouterr().err
    for mine in ("tables/settings.csv", "figures/contrast.png"):
        place = doubled / mine.partition("/")[0] / mine
        place.parent.mkdir(parents=True)
        place.write_text("mine")
        asked = ["contrast", first, f"second={datasets / 'second'}", f"output={place.parents[1]}"]
        assert main(asked) == 2
        assert f"holds a {mine} that no earlier answer has written" in capsys.readouterr().err
        assert place.read_text() == "mine"
    assert main(["contrast", first, "study=smoke"]) == 2
    told = capsys.readouterr().err
    assert "second: missing" in told
    assert "study: not for contrast" in told


@needs_chromium
def test_a_page_shows_the_line_that_is_chosen_on_a_phone_too(datasets):
    words = [f"{name}={datasets / name}" for name in ("first", "second")]
    assert main(["contrast", *words, f"output={datasets / 'page'}"]) == 0
    table = pd.read_csv(datasets / "page" / "tables" / "limit_depths.csv")
    with opened(datasets / "page" / "report.html", width=390, scheme="dark") as page:
        page.get_by_label("line").select_option("machine 3, cut 0: preload_n 200, teeth 4")
        for name in ("first", "second"):
            expected = table[table["machine"] == 3][f"{name}_limit_depth_mm"].tolist()
            # Numbers of the page have seven digits.
            assert plotted(page, "Limit depths", name) == pytest.approx(expected, rel=1e-6)
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
