"""Linked sections of a volume, what stands in for 3-D without WebGL, light fields of a few samples."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.viewer.opening import of_views, of_volume
from viewer_pages import served

SHAPE, STEPS = (5, 12, 16), (4e-6, 2e-6, 1e-6)  # z, y, x: in steps of 1 µm, 20 × 24 × 16
GAP = 6


@pytest.fixture(scope="module")
def volume():
    data = np.random.default_rng(2).integers(0, 250, SHAPE, dtype=np.uint8)
    data[0, 0, 0] = 255
    depths = tuple((np.arange(SHAPE[0]) - 1) * STEPS[0])
    return lg.Volume(data, lg.Grid(SHAPE[1:], STEPS[1:]), depths)


def test_sections_cross_where_they_are_clicked_and_are_on_one_scale(open_page, volume, violations):
    with served(of_volume("volume", volume)) as address:
        page = open_page(f"{address}#mode=volume&projection=sections&smooth=off")
        page.wait("Boolean(lumigraph.app.main.model.arrays.volume)")
        page.set(plane=1, cross=[3, 5])
        for place, (z, y, x) in (
            ((2 * 7, 9), (1, 7, 9)),  # in xy: the plane stays
            ((2 * 7, 16 + GAP + 4 * 3), (3, 7, 9)),  # in yz: the column stays
            ((24 + GAP + 4 * 2, 11), (2, 7, 11)),  # in xz: the row stays
        ):
            page.click_at(*place)
            assert page.state("plane") == z
            assert page.state("cross") == [y, x]
            page.set()
            found = page.pixels()[..., 0]
            data = volume.data.astype(float)
            assert found.shape == (24 + GAP + 20, 16 + GAP + 20)
            assert np.array_equal(found[:24, :16], data[z].repeat(2, 0))
            assert np.array_equal(found[:24, 16 + GAP :], data[:, :, x].T.repeat(2, 0).repeat(4, 1))
            assert np.array_equal(found[24 + GAP :, :16], data[:, y].repeat(4, 0))
        page.says("#plane-out", "3 of 5 · z 4 µm")
        page.says("#cross-y-out", "8 of 12 · y 2 µm")
        page.says("#cross-x-out", "12 of 16 · x 3 µm")
        page.page.locator(".stage").focus()
        page.page.keyboard.press("Shift+ArrowUp")
        assert page.state("cross") == [6, 11]
        page.page.keyboard.press("ArrowRight")
        assert page.state("plane") == 3
        page.wait("location.hash.includes('cross=6,11')")
        assert violations(page.page) == []


def test_without_webgl_the_page_says_what_stands_in_for_3d(open_page, volume):
    with served(of_volume("volume", volume)) as address:
        page = open_page(f"{address}#renderer=canvas&mode=volume&projection=brightest")
        page.wait("Boolean(lumigraph.app.main.model.arrays.volume)")
        page.wait("document.querySelector('#flat').innerText.includes('the largest value along z')")
        assert page.page.locator("#orbit").is_hidden()
        assert np.array_equal(page.pixels()[..., 0], volume.data.max(0))
        page.set(projection="plane")
        page.says("#flat", "")


@pytest.mark.parametrize("shape", [(3, 3, 7, 9), (2, 2, 1, 1)])
def test_light_fields_of_a_few_samples_are_exported_without_depth(shape, tmp_path):
    views = lg.LightField(
        np.random.default_rng(1).random(shape), lg.Grid(shape[:2], 10.0), lg.Grid(shape[2:], 1.0), 200.0
    )
    exhibit = of_views("small", views)
    assert exhibit.depth is None
    assert viewer.export([exhibit], tmp_path / "page.html").size > 1e5
    assert viewer.export_folder([exhibit], tmp_path / "page").files > 30
    with pytest.raises(lg.GeometryError, match="8 x 8 at least"):
        lg.depth.epi(views)


def test_a_light_field_of_a_few_samples_is_shown(open_page):
    views = lg.LightField(
        np.arange(36, dtype=np.uint8).reshape(3, 3, 2, 2), lg.Grid((3, 3), 10.0), lg.Grid((2, 2), 1.0), 200.0
    )
    with served(of_views("small", views)) as address:
        page = open_page(address)
        page.set(focus=1.0, detail=1)
        wanted = np.asarray(lg.refocus(views, 1.0, oversample=1))
        assert np.abs(page.pixels()[..., 0] - wanted).max() <= 1
        assert page.page.locator("#modes").is_hidden()
