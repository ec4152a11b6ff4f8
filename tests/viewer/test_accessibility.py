"""axe-core finds nothing on the pages, in light and dark; what the controls of a film and of light show."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.report import Page
from lumigraph.viewer.opening import of_raw, of_views, of_volume
from viewer_pages import served


def exhibits(views):
    """What each mode shows; None leaves out those of views."""
    camera = lg.load_camera("thesis-plenoptic-2-m050").replace(lenslets={"count": (3, 3)})
    raw = lg.RawImage(np.random.default_rng(1).random(camera.calibration.shape), 5e-6)
    volume = lg.Volume(np.ones((3, 20, 30)), lg.Grid((20, 30), 1e-6), (0, 1e-6, 2e-6))
    seen = {} if views is None else dict.fromkeys(("picture", "depth"), of_views("views", views))
    return seen | {
        "raw": of_raw("raw", raw, camera.calibration), "volume": of_volume("volume", volume),
    }  # fmt: skip


@pytest.mark.parametrize(
    ("mode", "scheme"), [("picture", "light"), ("depth", "dark"), ("raw", "dark"), ("volume", "light")]
)
def test_the_viewer_is_accessible(open_page, views, violations, mode, scheme):
    with served(exhibits(views)[mode]) as address:
        page = open_page(address, color_scheme=scheme)
        page.set(mode=mode)
        if mode == "depth":  # its last part comes after it shows
            page.wait("Boolean(lumigraph.app.main.model.arrays.error)")
        assert violations(page.page) == []


def test_windows_and_facts_over_the_picture_are_accessible(open_page, views, violations):
    with served(of_views("views", views)) as address:
        page = open_page(address, color_scheme="dark")
        page.page.click("#about summary")
        assert violations(page.page) == []
        for button, window in (("#help", "#keys"), ("#save-film", "#film")):
            page.page.click(button)
            page.wait(f"document.querySelector('{window}').open")
            assert violations(page.page) == []
            page.page.keyboard.press("Escape")


@pytest.mark.parametrize("projection", ["max-z", "fog"])
def test_a_volume_from_all_sides_is_accessible(open_page, violations, projection):
    with served(exhibits(None)["volume"]) as address:
        page = open_page(address, color_scheme="dark")
        page.set(mode="volume", projection=projection)
        assert violations(page.page) == []


def test_a_page_of_one_file_and_a_report_are_accessible(browser, views, violations, tmp_path):
    viewer.export([of_views("views", views)], tmp_path / "page.html")
    report = Page("Two pixels", "A report.")
    section = report.section("Numbers").table({"pitch": "14 px"}, caption="Of the lattice")
    section.figure(np.eye(9), "Nine pixels, higher than the window", zoom=200).lines("a   b")
    (tmp_path / "report.html").write_text(report.html(), "utf-8")
    context = browser.new_context(color_scheme="dark", bypass_csp=True)
    try:
        page = context.new_page()
        page.goto((tmp_path / "page.html").as_uri())
        page.wait_for_function("Boolean(window.lumigraph?.ready && lumigraph.app.first)")
        assert violations(page) == []
        page.goto((tmp_path / "report.html").as_uri())
        assert violations(page) == []
    finally:
        context.close()


def test_the_histogram_says_where_black_and_white_are(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.set(black=0.1, ev=1.0, gamma=1.5)
        label = "Histogram: black at 10 %, white at 55 % of the brightest, gamma 1.50"
        page.wait(f"document.getElementById('histogram').getAttribute('aria-label') === {label!r}")
        counts = page.page.evaluate("Array.from(lumigraph.app.controls.histogram.found.counts)")
        ends = page.page.evaluate(
            "[lumigraph.app.controls.histogram.found.low, lumigraph.app.controls.histogram.found.high]"
        )
        assert ends == [0, 1]
        step = max(1, views.data.size // 60000)
        expected = np.histogram(views.data.ravel()[::step] / 255, 120, (0, 1))[0]
        assert np.abs(np.cumsum(counts) - np.cumsum(expected)).max() <= 0.01 * sum(counts)  # edges of bins


def test_a_pull_of_focus_moves_and_ends_where_it_began(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.set(focus=1.0)
        page.page.click("#pull")
        page.wait("Math.abs(lumigraph.app.state.focus - 1) > 0.02")
        assert page.page.get_attribute("#pull", "aria-pressed") == "true"
        page.page.click("#pull")
        assert page.state("focus") == 1.0
        page.page.click("#sway")
        page.wait("lumigraph.app.state.view !== null && lumigraph.app.state.aperture < 0.01")
        page.page.click("#sway")
        assert page.state("aperture") == 1


def test_colours_of_a_depth_map_span_percentiles(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.set(mode="depth")
        page.wait("lumigraph.app.main.model.depthRange() !== null")
        known = page.page.evaluate(
            "() => { const { depth, confidence } = lumigraph.app.main.model.arrays;"
            " const numbers = [depth, confidence].map((array) => Array.from(array.numbers));"
            " return [...numbers, depth.offset, depth.scale]; }"
        )
        depths, sure = np.array(known[0]) * known[3] + known[2], np.array(known[1]) > 0
        expected = np.percentile(depths[sure], (1, 99), method="nearest")
        found = page.page.evaluate("lumigraph.app.main.model.depthRange()")
        np.testing.assert_allclose(found, expected, atol=2e-3)
        assert found[0] > depths.min()


def test_a_saved_picture_has_a_scale_bar_where_lengths_are_known(open_page):
    dark = np.zeros((1, 200, 400))
    dark[0, 0, 0] = 1
    volume = lg.Volume(dark, lg.Grid((200, 400), 1e-6), (0.0,))
    with served(of_volume("volume", volume)) as address:
        page = open_page(address)
        white = page.page.evaluate("""() => {
            const sheet = lumigraph.picture(), row = sheet.height - 18;
            const { data } = sheet.getContext("2d").getImageData(0, row, sheet.width, 1);
            const lit = Array.from({ length: sheet.width }, (_, x) => data[4 * x] === 255);
            return [lit.lastIndexOf(true) - lit.indexOf(true) + 1, sheet.width];
        }""")
        assert white == [100, 400]  # 100 µm, of samples of 1 µm
