"""What tables, figures and page of a study say, of studies whose numbers are known."""

import matplotlib
import numpy as np
import pytest
from matplotlib.axes import Axes

from pipeline import figures, report
from pipeline.contrast.contrasted import contrast
from pipeline.contrast.lines import read
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
