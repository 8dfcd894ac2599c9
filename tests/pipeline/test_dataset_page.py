"""The page of a data set, in a real browser: choices change what is shown, and nothing is missing."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from pipeline import dataset
from pipeline.kinds import Dataset
from pipeline.places import DATASET as STORE
from tests.pipeline.browser import needs_chromium, opened
from tests.pipeline.test_dataset import SMALL
from tests.pipeline.test_study_page import plotted

pytestmark = needs_chromium


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    """A data set whose numbers are known, with its page."""
    folder = tmp_path_factory.mktemp("page")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Dataset, "kernel", "tests.pipeline.test_dataset:standin")
        assert dataset.run([*SMALL, f"output={folder}"]) == 0
    return folder


def test_the_chosen_cut_and_the_chosen_input_are_shown(output):
    data = xr.open_zarr(output / STORE).load()
    limit = data["limit_depth"].fillna(20.0).values.reshape(-1, 3)
    with opened(output / "report.html") as page:
        # Numbers of the page have seven digits.
        assert plotted(page, "Limit depth", "limit") == pytest.approx(limit[0], rel=1e-6)
        page.get_by_label("cut").select_option("machine 1, cut 1")
        assert plotted(page, "Limit depth", "limit") == pytest.approx(limit[3], rel=1e-6)
        lowest = plotted(page, "Lowest limit depth", "lowest")
        assert lowest == pytest.approx(limit.min(axis=1), rel=1e-6)
        page.get_by_label("input").select_option("tool.teeth")
        teeth = data["input"].sel(input_key="tool.teeth").values.ravel()
        assert np.array_equal(plotted(page, "Lowest limit depth", "value"), teeth)


def test_the_best_cut_of_the_chosen_cut_is_that_of_the_table(output):
    samples = pd.read_csv(output / "tables" / "samples.csv")
    with opened(output / "report.html") as page:
        page.get_by_label("cut").first.select_option("machine 1, cut 1")
        # Of speeds a third apart none has both its neighbours within 2 %: the best is at the middle one.
        found = [plotted(page, "Limit depth", name, beside="depth")[0] for name in ("speed", "depth", "rate")]
    columns = ["with_spindle_speed_rpm", "with_axial_depth_mm", "removal_rate_cm3_min"]
    # The table has eight digits.
    assert found == pytest.approx(
        samples[(samples["machine"] == 1) & (samples["cut"] == 1)][columns].values[0], rel=1e-7
    )


def test_lines_and_their_key_follow_the_input_that_is_chosen(output):
    with opened(output / "report.html", width=390) as page:
        page.get_by_label("by").select_option("tool.helix_angle_deg")
        names = """() => Bokeh.documents.flatMap((own) => [...own._all_models.values()]).find(
            (one) => one.type === "LegendItem" && one.label?.field === "name").get_labels_list_from_label_prop()"""
        with xr.open_zarr(output / STORE) as data:
            helix = sorted(set(data["input"].sel(input_key="tool.helix_angle_deg").values.ravel()))
        assert page.evaluate(names) == [f"{one:g}" for one in helix]
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")
