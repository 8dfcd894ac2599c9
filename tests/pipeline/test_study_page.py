"""The page of a study, in a real browser: hover, choose, sort, keep; light, dark, phone and print."""

import numpy as np
import pytest

from pipeline import store
from pipeline.best_cuts import best_cuts
from pipeline.places import Folder
from tests.pipeline.browser import needs_chromium, opened
from tests.pipeline.studies import sweep

pytestmark = needs_chromium
#: What a page may weigh [bytes].
LARGEST_PAGE = 5_000_000


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """A small study whose numbers are known, with its page."""
    output = tmp_path_factory.mktemp("study")
    assert sweep(output, "grid.modal_parameters=[dynamic, static]", kernel="lobes_of_a_ramp", report=True) == 0
    return output


def plotted(page, name, column, beside=None):
    """Return what a plot shows of a column, of the first source that has it, or of the one with another beside it."""
    script = """([title, column, beside]) => {
        const plots = Bokeh.documents.flatMap((own) => [...own._all_models.values()]).filter((m) => m.type === "Figure")
        const plot = plots.find((one) => one.title.text.startsWith(title))
        const source = plot.renderers.map((one) => one.data_source).find((one) => beside in one.data)
        return Array.from(source.data[column])
    }"""
    return np.array(page.evaluate(script, [name, column, beside or column]))


def limits(study, **chosen):
    with store.open_lobes(Folder(study)) as lobes:
        return lobes["limit_depth"].isel(crossing=0).sel(modal_parameters="dynamic", **chosen).values


def test_a_page_is_one_file_of_some_megabytes(study):
    assert (study / "report.html").stat().st_size < LARGEST_PAGE


def test_choices_change_what_is_shown(study):
    with opened(study / "report.html") as page:
        # As it opens: the machine's own preload, all modes.
        assert plotted(page, "Stability lobes", "limit") == pytest.approx(
            limits(study, preload=100.0, mode_count=2), rel=1e-6
        )
        page.get_by_label("preload").select_option("200 N")
        assert plotted(page, "Stability lobes", "limit") == pytest.approx(
            limits(study, preload=200.0, mode_count=2), rel=1e-6
        )
        page.get_by_label("modes").select_option("mode 1 alone")
        assert plotted(page, "Stability lobes", "limit") == pytest.approx(
            limits(study, preload=200.0, mode_count=1), rel=1e-6
        )
        assert plotted(page, "Spectral radius", "limit") == pytest.approx(
            limits(study, preload=200.0, mode_count=1), rel=1e-6
        )


def choose_margins(page, depth, speed):
    """Move the sliders of a page [%]."""
    script = """(wanted) => {
        for (const own of Bokeh.documents) for (const model of own._all_models.values())
            if (model.type === "Slider") model.value = wanted[model.title]
    }"""
    page.evaluate(script, {"margin in depth, %": depth, "margin in speed, %": speed})


def test_sliders_show_the_best_cut_that_python_finds(study):
    with store.open_lobes(Folder(study)) as opened_store:
        lobes = opened_store.isel(modal_parameters=[0]).load()
    with opened(study / "report.html") as page:
        page.get_by_label("preload").select_option("200 N")
        # Neighbours are 8 to 12 % apart: only the third and fourth take them in, the second ends on the way to them.
        for depth, speed in ((0.0, 0.0), (10.0, 2.0), (25.0, 9.5), (10.0, 20.0)):
            choose_margins(page, depth, speed)
            lobes.attrs["margins"] = {"depth_percent": depth, "speed_percent": speed}
            cut = best_cuts(lobes).set_index(["preload", "mode_count"]).loc[(200.0, 2)]
            found = [plotted(page, "Stability lobes", name, beside="depth")[0] for name in ("speed", "depth", "rate")]
            # The same arithmetic, in numbers of double precision.
            expected = cut[["spindle_speed", "axial_depth", "removal_rate_cm3_min"]].tolist()
            assert found == pytest.approx(expected, rel=1e-12)


def test_sliders_recommend_nothing_near_speeds_without_a_result(study):
    """What is known beyond a speed without a result does not stand for it."""
    # At 8000 to 13000 rpm. Within 10.5 % of 10000 rpm lies 11000 rpm, within them of 9000 rpm no other.
    known = [3.0, 3.0, 3.0, None, 1.0, 5.0]
    script = """(known) => {
        const models = Bokeh.documents.flatMap((own) => [...own._all_models.values()])
        const line = models.find((one) => one.type === "ColumnDataSource" && "rate_of_a_mm" in one.data)
        line.data = {...line.data, known: known.map((one) => one ?? NaN)}
    }"""
    with opened(study / "report.html") as page:
        choose_margins(page, 10.0, 10.5)
        page.evaluate(script, known)
        found = [plotted(page, "Stability lobes", name, beside="depth")[0] for name in ("speed", "depth")]
    assert found == pytest.approx([9000.0, 2.7], rel=1e-12)


def test_a_pointer_is_told_speed_depth_and_what_chatters(study):
    with opened(study / "report.html") as page:
        plot = page.locator(".bk-Figure").first
        plot.scroll_into_view_if_needed()
        place = page.evaluate(
            """() => {
                const plot = Bokeh.documents[0].roots().find((one) => one.title?.text?.startsWith("Stability lobes"))
                const view = Bokeh.index.find_one(plot)
                const source = plot.renderers[0].data_source
                const box = view.el.getBoundingClientRect(), frame = view.frame
                return [box.x + frame.x_scale.compute(source.data.speed[2]),
                        box.y + frame.y_scale.compute(source.data.limit[2])]
            }"""
        )
        page.mouse.move(*place)
        depth = limits(study, preload=100.0, mode_count=2)[2]
        for told in ("10000 rpm", f"{depth:.3f} mm", "1000 Hz", "2, Hopf"):
            page.get_by_text(told).locator("visible=true").first.wait_for()


def test_tables_are_sorted_by_a_click_and_by_the_keyboard(study):
    with opened(study / "report.html") as page:
        table = page.locator("table.sortable", has=page.get_by_role("columnheader", name="spindle speed, rpm")).first
        head = table.get_by_role("columnheader", name="spindle speed, rpm")
        first = lambda: float(table.locator("tbody tr td").first.inner_text())  # noqa: E731
        assert first() == 8000.0
        head.click()
        head.focus()
        page.keyboard.press("Enter")
        assert first() == 13000.0
        assert head.get_attribute("aria-sort") == "descending"


def test_tables_can_be_kept(study, tmp_path):
    with opened(study / "report.html") as page, page.expect_download() as kept:
        page.get_by_role("link", name="limit_depths.csv").click()
        kept.value.save_as(tmp_path / "kept.csv")
    assert (tmp_path / "kept.csv").read_bytes() == (study / "tables" / "limit_depths.csv").read_bytes()


@pytest.mark.parametrize(("scheme", "ink"), [("light", "#1b1f23"), ("dark", "#e6e9ec")])
def test_plots_have_the_colours_of_the_page(study, scheme, ink):
    with opened(study / "report.html", scheme=scheme) as page:
        page.wait_for_function(
            "(ink) => Bokeh.documents[0].roots().some((one) => one.title?.text_color?.value === ink"
            " || one.title?.text_color === ink)",
            arg=ink,
        )


@pytest.mark.parametrize("width", [390, 1100])
def test_nothing_is_wider_than_the_screen(study, width):
    with opened(study / "report.html", width=width) as page:
        page.wait_for_function("document.documentElement.scrollWidth <= innerWidth")


def test_on_paper_choices_are_left_out(study):
    with opened(study / "report.html") as page:
        page.emulate_media(media="print")
        assert not page.locator(".choices").is_visible()
        assert page.locator(".bk-Figure").first.is_visible()
