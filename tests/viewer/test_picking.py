"""White balance and exposure from a place that is clicked, or reached by keys."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from viewer_pages import served

CAST = np.array((1.0, 0.5, 0.25))
LIGHT = 0.4


@pytest.fixture(scope="module")
def tinted():
    """A grey wall in warm light, with one bright and one black patch."""
    data = np.full((24, 32, 3), LIGHT) * CAST
    data[:4, :4] = 1.0
    data[20:, 28:] = 0.0
    data[10:14, 10:14] = 0.2 * CAST
    return viewer.Exhibit("tinted", raw=lg.RawImage(np.round(data * 65535).astype(np.uint16), bit_depth=16))


def shown(page, y, x):
    return page.pixels()[y, x].astype(int)


@pytest.mark.parametrize("renderer", ["auto", "canvas"])
def test_a_click_on_grey_removes_the_cast_of_the_light(open_page, tinted, renderer):
    with served(tinted) as address:
        page = open_page(f"{address}#mode=raw&renderer={renderer}")
        before = shown(page, 16, 16)
        page.page.click("#pick-grey")
        assert page.page.get_attribute("#pick-grey", "aria-pressed") == "true"
        page.click_at(16, 16)
        page.wait("lumigraph.app.state.balance[2] > 1.9")
        page.set(mode="raw")
        assert page.page.get_attribute("#pick-grey", "aria-pressed") == "false"
        found = shown(page, 16, 16)
        assert np.ptp(before) > 60
        assert np.ptp(found) <= 1
        assert found[1] == pytest.approx(before[1], abs=1)  # green stays
        assert np.ptp(shown(page, 11, 11)) <= 1


def test_a_click_exposes_for_a_place_and_keys_do_the_same(open_page, tinted):
    with served(tinted) as address:
        page = open_page(f"{address}#mode=raw&channel=green")
        page.page.click("#pick-exposure")
        page.click_at(11, 11)
        mean = 0.2 * CAST.mean()
        page.wait("lumigraph.app.state.ev !== 0")
        assert page.page.evaluate("lumigraph.app.state.ev") == pytest.approx(np.log2(0.18 / mean), abs=0.01)
        page.set(ev=0)
        page.page.mouse.move(*page.window_place(16, 16))
        page.page.keyboard.press("x")
        page.wait("lumigraph.app.state.ev !== 0")
        expected = np.log2(0.18 / (LIGHT * CAST.mean()))
        assert page.page.evaluate("lumigraph.app.state.ev") == pytest.approx(expected, abs=0.01)
        page.page.keyboard.press("w")
        page.wait("lumigraph.app.state.balance[2] > 1.9")


def test_black_places_set_nothing_and_say_so(open_page, tinted):
    with served(tinted) as address:
        page = open_page(f"{address}#mode=raw")
        page.page.click("#pick-grey")
        page.click_at(22, 30)
        page.wait("document.getElementById('status').textContent.includes('too little light')")
        assert page.page.evaluate("lumigraph.app.state.balance") == [1, 1, 1]
