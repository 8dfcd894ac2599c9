"""What tables, figures and page of a study say, of studies whose numbers are known."""

from collections import Counter

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh

from chatter_core.variables import STATUS
from pipeline import figures, report
from pipeline.contrast.contrasted import contrast
from pipeline.contrast.lines import read
from pipeline.dataset_figures import limits_over_speed
from pipeline.places import Folder
from pipeline.settings import Margins
from pipeline.study_plots import study_plots
from tests.pipeline.studies import lobes as stored
from tests.pipeline.studies import sweep

matplotlib.use("Agg")


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """The folder of a study of both kinds of parameters, the standing spindle first."""
    folder = tmp_path_factory.mktemp("study")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.report.write", lambda *_, **__: [])
        assert sweep(folder, "grid.modal_parameters=[static, dynamic]", kernel="lobes_of_a_ramp") == 0
    return folder


@pytest.fixture
def lobes(study):
    """The study, with limits of the standing spindle that are half as deep again."""
    made = stored(study)
    made["limit_depth"] *= (made["modal_parameters"] == "static") * 0.5 + 1.0
    return made


def marked(axes: Axes) -> list[list[float]]:
    """Return the speeds at which each line of a panel has a mark."""
    places = [line.get_markevery() if line.get_marker() != "None" else [] for line in axes.lines]
    return [np.asarray(line.get_xdata())[every].tolist() for line, every in zip(axes.lines, places, strict=True)]


def drawn(axes: Axes) -> list[list[float]]:
    """Return the heights of all lines of a panel."""
    return [np.asarray(line.get_ydata(), dtype=float).tolist() for line in axes.lines]


def told(lobes) -> list:
    """Return what pictures, tables and sentences say of one kind of parameters."""
    pictures = [figures.lobes_by_preload, figures.lobes_by_mode_count, figures.modes_over_speed]
    pictures.append(figures.bearing_over_speed)
    panels = [drawn(axes) for draw in pictures for axes in draw(lobes, 100.0).axes]
    plots = {name: plot for name, plot in study_plots(lobes, 100.0).items() if hasattr(plot, "renderers")}
    sources = [one.data_source.data for name in ("dominant_mode", "modal_mass") for one in plots[name].renderers]
    best = [one.data_source.data for one in plots["lobes"].renderers if "rate" in one.data_source.data][-1]
    data = [[np.asarray(values).tolist() for values in source.values()] for source in [*sources, best]]
    return [panels, data, report._findings(lobes, 100.0), report._best_table(lobes).rows]


def test_what_is_said_of_one_kind_of_parameters_is_of_the_turning_spindle_in_whatever_order_kinds_are_named(lobes):
    assert told(lobes) == told(lobes.isel(modal_parameters=[1, 0]))
    assert "dynamic parameters" in report._best_table(lobes).title


def test_of_the_standing_spindle_alone_it_is_said_that_it_is_meant(lobes):
    alone = lobes.sel(modal_parameters=["static"])
    assert "static parameters" in report._best_table(alone).title


def test_sentences_on_two_studies_are_about_the_turning_spindle(study):
    lines = read(Folder(study), Margins().said)
    both = contrast(lines, lines)
    assert set(both.pairs.labels["modal_parameters"][both.main_lines]) == {"dynamic"}


def without(lobes, speed, **places):
    """Return the study as if cells at a speed had come to nothing: no results, no limits, nothing searched."""
    here, made = lobes["spindle_speed"] == speed, lobes.copy()
    for name, at in places.items():
        here = here & (lobes[name] == at)
    for name in ("limit_depth", "spectral_radius"):
        made[name] = lobes[name].where(~here)
    made["limits_complete"] = lobes["limits_complete"].where(~here, 0)
    made["status"] = lobes["status"].where(~here, STATUS["not_converged"])
    return made


def test_speeds_without_a_result_are_not_told_as_stable_down_to_the_deepest_depth(lobes):
    failed = without(lobes, 9000.0, modal_parameters="dynamic", mode_count=1)
    # At 10000 rpm there is no limit for sure, at 11000 rpm one may have been missed.
    at = {speed: failed["spindle_speed"] == speed for speed in (10000.0, 11000.0)}
    failed["limit_depth"] = failed["limit_depth"].where(~at[10000.0] & ~at[11000.0])
    failed["limits_complete"] = failed["limits_complete"].where(~at[11000.0], 0)
    table = report._limits_table(failed, 100.0)
    column = table.columns.index("dynamic, mode 1 alone")
    assert [row[column] for row in table.rows][1:4] == ["no result", "above the grid", "no result"]
    limit = failed["limit_depth"].isel(crossing=0).sel(modal_parameters="dynamic", preload=100.0, spindle_speed=9000.0)
    assert float(table.rows[1][column + 1]) == pytest.approx(float(limit.sel(mode_count=2)), rel=1e-4)


def test_an_island_is_feared_only_where_all_depths_have_a_result(lobes):
    failed = without(lobes, 9000.0, modal_parameters="dynamic")
    assert report._warnings(Counter(), failed) == []
    doubtful = (lobes["spindle_speed"] == 10000.0) & (lobes["modal_parameters"] == "dynamic")
    failed["limits_complete"] = failed["limits_complete"].where(~doubtful, 0)
    # Of two preloads with two numbers of modes, among those of two kinds of parameters at six speeds.
    (warning,) = report._warnings(Counter(), failed)
    assert "At 4 of 48 speeds" in warning


def test_a_mode_beyond_those_that_are_kept_has_a_colour_of_its_own(lobes):
    """An effect's mode, as a workpiece has one, dominates at all depths of one speed."""
    lobes["dominant_mode"] = lobes["dominant_mode"].where(lobes["spindle_speed"] != 9000.0, 5)
    map_, bar = figures.map_of_dominant_mode(lobes, 100.0).axes
    (mesh,) = [one for one in map_.collections if isinstance(one, QuadMesh)]
    assert [mesh.norm.vmin, mesh.norm.vmax] == [0.5, 5.5]
    assert bar.get_yticks().tolist() == [1, 2, 3, 4, 5]
    colours = mesh.to_rgba(np.array([2, 5]))
    assert not np.array_equal(*colours)
    plot = study_plots(lobes, 100.0)["dominant_mode"]
    (picture,) = [one for one in plot.renderers if "image" in one.data_source.data]
    assert picture.glyph.color_mapper.high == 5.5
    assert len(picture.glyph.color_mapper.palette) == 5


def test_modes_of_both_axes_are_drawn_and_named_where_they_differ(lobes):
    def legend_and_lines(study):
        plot = study_plots(study, 100.0)["modal_mass"]
        lines = [axes.lines for axes in figures.modes_over_speed(study, 100.0).axes]
        titles = [item.label.value for legend in plot.legend for item in legend.items]
        return titles, [[line.get_linestyle() for line in own] for own in lines]

    titles, styles = legend_and_lines(lobes)
    assert titles == ["mode 1", "mode 2"]
    assert styles == [["-", "-"]] * 4
    y = lobes["axis"] == "y"
    lobes["damping_ratio"] = lobes["damping_ratio"] * (1.0 + y)
    titles, styles = legend_and_lines(lobes)
    assert titles == ["mode 1, x", "mode 2, x", "mode 1, y", "mode 2, y"]
    assert styles == [["-", "-", "--", "--"]] * 4
    assert figures.modes_over_speed(lobes, 100.0).axes[1].get_title("right") == "solid: x, dashed: y"
    for name in figures.OF_MODES:
        lobes[name] = lobes[name].where(y)
    titles, styles = legend_and_lines(lobes)
    assert titles == ["mode 1, y", "mode 2, y"]
    assert styles == [["--", "--"]] * 4


def test_a_speed_that_is_stable_down_to_the_deepest_depth_is_not_left_out_of_what_is_best(lobes):
    """The ramp's limits are 1.1 to 1.6 mm, those at rest half as deep again; cells reach down to 2 mm."""
    assert "depth times speed is largest at 13000 rpm with 1.6 mm" in report._findings(lobes, 100.0)[0]
    # At 12000 rpm the boundary lies below all cells, at 13000 rpm one was not computed.
    lobes["limit_depth"] = lobes["limit_depth"].where(lobes["spindle_speed"] < 12000.0)
    depths = report._findings(without(lobes, 13000.0), 100.0)[0]
    assert "the shallowest limit is 1.1 mm at 8000 rpm" in depths
    assert "depth times speed is largest at 12000 rpm with at least 2 mm" in depths


def test_lobes_at_rest_are_said_to_mislead_where_they_do(lobes):
    misled = [told for told in report._findings(lobes, 100.0) if "standing spindle" in told]
    assert len(misled) == 1
    assert "at least" not in misled[0]
    static = lobes["modal_parameters"] == "static"
    above = lobes.assign(limit_depth=lobes["limit_depth"].where(~static))
    assert "promise at least 2 mm where" in " ".join(report._findings(above, 100.0))
    alike = lobes.assign(limit_depth=lobes["limit_depth"] / (1.0 + 0.495 * static))
    assert "standing spindle" not in " ".join(report._findings(alike, 100.0))


def test_a_point_without_a_neighbour_is_seen(lobes):
    (axes,) = figures.lobes_by_preload(lobes, 100.0).axes
    assert marked(axes) == [[], []]
    # Between 9000 and 11000 rpm, and at the end, nothing else is known.
    unknown = lobes["spindle_speed"].isin([9000.0, 11000.0, 12000.0])
    gaps = lobes.assign(limit_depth=lobes["limit_depth"].where(~unknown))
    (axes,) = figures.lobes_by_preload(gaps, 100.0).axes
    assert marked(axes) == [[8000.0, 10000.0, 13000.0]] * 2
    one = lobes.isel(spindle_speed=[2])
    for draw in (figures.lobes_static_and_dynamic, figures.modes_over_speed, figures.bearing_over_speed):
        for axes in draw(one, 100.0).axes:
            assert marked(axes) == [[10000.0]] * len(axes.lines)
    # A page's line over speed is a mark there, too.
    plots = study_plots(one, 100.0)
    assert {type(line.glyph).__name__ for line in plots["modal_mass"].renderers} == {"Scatter"}


def test_limits_of_one_speed_are_seen_in_the_picture_of_a_data_set():
    found = {"limit_depth": [[[1.0]], [[2.0]]], "limits_complete": [[[1]], [[1]]], "status": [[[1]], [[1]]]}
    data = xr.Dataset(
        {name: (("machine", "cut", "spindle_speed"), np.array(values)) for name, values in found.items()},
        coords={"spindle_speed": [9000.0]},
        attrs={"settings": {"design": {"deepest_mm": 10.0}}},
    )
    (axes,) = limits_over_speed(data).axes
    assert marked(axes) == [[9000.0]] * 2


@pytest.mark.parametrize(("selection", "told"), [("up_to", "modes 1 to 2"), ("only", "mode 2 alone")])
def test_which_modes_are_kept_is_said(lobes, study, selection, told):
    lobes.attrs["settings"]["grid"]["mode_selection"] = selection
    assert report._findings(lobes, 100.0)[0].startswith(f"With {told} the shallowest limit is")
    assert f", {told}, " in report._best_table(lobes).title
    lines = read(Folder(study), Margins().said)
    lines.attributes["settings"]["grid"]["mode_selection"] = selection
    assert contrast(lines, lines).name_of(1) == f"static, 100 N, {told}"


def test_pictures_and_page_name_the_effects_of_a_study(lobes):
    (axes,) = figures.lobes_by_preload(lobes, 100.0).axes
    without = axes.get_title("right")
    lobes.attrs["settings"]["effects"] = {"tool_runout": {"runout_um": 5.0}, "process_damping": {}}
    (axes,) = figures.lobes_by_preload(lobes, 100.0).axes
    assert axes.get_title("right") == f"{without}, tool runout, process damping"
    assert report._with_effects(lobes.attrs) == ", with tool runout, process damping"
    del lobes.attrs["settings"]["effects"]
    assert report._with_effects(lobes.attrs) == ""
