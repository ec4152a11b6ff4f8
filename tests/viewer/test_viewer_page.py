"""The page in a real browser: every control changes the picture as the library's own function does."""

import io

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from lumigraph.core.stack import Stack
from lumigraph.viewer.exhibit import focal_stack
from lumigraph.viewer.opening import of_raw, of_stack, of_views, of_volume
from viewer_pages import FAR, NEAR, served, two_planes

ARRAYS = "lumigraph.app.main.model.arrays"
LEVELS = 1.0  # of 255: rounding is 0.5; another interpolation or border differs by 3 and more


def shown(picture, white=255.0, ev=0.0, gamma=1.0):
    """A picture as bytes from 0 to 255, by the formula that docs/reference/viewer-numbers.md gives."""
    levels = np.clip(2.0**ev * np.asarray(picture, float) / white, 0, 1) ** (1 / gamma) * 255
    return levels if levels.ndim == 3 else np.repeat(levels[..., None], 3, -1)


def test_pictures_are_those_of_the_library(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        for alpha in (1.0, NEAR, 1.0371, FAR, 0.7):
            page.set(focus=alpha, detail=1)
            assert np.abs(page.pixels() - shown(lg.refocus(views, alpha, oversample=1))).max() <= LEVELS
        page.set(focus=0.93, detail=4)
        assert np.abs(page.pixels() - shown(lg.refocus(views, 0.93, oversample=4))).max() <= LEVELS
        page.set(detail=1)
        for fraction, shape in ((0.6, "square"), (0.6, "round"), (1.0, "round"), (0.4, "square")):
            page.set(aperture=fraction, shape=shape, focus=0.95)
            small = lg.reduce_aperture(views, fraction, shape=shape)
            assert np.abs(page.pixels() - shown(lg.refocus(small, 0.95, oversample=1))).max() <= LEVELS
        page.set(aperture=0.001, shape="square", focus=1.0, view=[1, 3])
        assert np.abs(page.pixels() - shown(lg.sub_aperture(views, 1, 3))).max() <= LEVELS
        page.set(view=[1.25, 2.6])  # between views: the nearest, since a mean would show every edge twice
        assert np.abs(page.pixels() - shown(lg.sub_aperture(views, 1, 3))).max() <= LEVELS


def test_between_views_what_is_in_focus_stays_and_has_every_edge_once(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        near, found = (slice(4, -4), slice(4, 26)), []
        for view in ([1, 3], [1.45, 2.55], [1.55, 2.45], [2, 2]):
            page.set(aperture=0.001, view=view, focus=NEAR, detail=1)
            found.append(page.pixels()[near])
        assert (
            np.abs(np.diff(found, axis=0)).max() < 8
        )  # cubic interpolation leaves 4; a mean at 1.0 more than 20


def test_a_view_refocused_has_no_black_bar(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        page.set(aperture=0.001, view=[0, 0], focus=FAR, detail=1)
        assert page.pixels()[:, :2].max(-1).min() > 0
        assert page.pixels()[:, -2:].max(-1).min() > 0


def test_the_black_point_moves_the_dark_end(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        for black in (0.25, -0.5):
            page.set(focus=1.0, detail=1, black=black)
            levels = (
                np.clip(
                    (np.asarray(lg.refocus(views, 1.0, oversample=1), float) / 255 - black) / (1 - black),
                    0,
                    1,
                )
                * 255
            )
            assert np.abs(page.pixels() - levels).max() <= 2 * LEVELS


def test_every_control_has_a_name_and_a_tooltip(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        for slider in page.page.locator("input, select").all():
            name = slider.evaluate("e => e.ariaLabel || [...e.labels].map(l => l.textContent).join(' ')")
            assert name.strip(), slider.get_attribute("id")
        for control in page.page.locator("button, input, select, [role=slider], summary").all():
            assert control.evaluate("e => e.closest('[title]')?.title"), control.evaluate("e => e.outerHTML")


def test_samples_that_are_not_valid_are_left_out(open_page, views, rng):
    valid = rng.random(views.data.shape[:4]) > 0.3
    holed = lg.LightField(views.data, views.aperture, views.lenslets, views.separation, valid)
    with served(of_views("holed", holed)) as address:
        page = open_page(address)
        page.set(focus=0.93, detail=1)
        assert np.abs(page.pixels() - shown(lg.refocus(holed, 0.93, oversample=1))).max() <= LEVELS


def test_places_that_few_valid_samples_show_take_the_nearest_known_as_in_the_library(open_page, views):
    valid = np.ones(views.data.shape[:4], bool)
    valid[..., 10:19, 30:39] = False  # more than any disparity between the views moves it
    valid[..., 25:, 50:53] = valid[..., 33:36, 5:9] = False
    valid[2, 2, 20:25, 12:17] = False
    holed = lg.LightField(views.data, views.aperture, views.lenslets, views.separation, valid)
    with served(of_views("holed", holed)) as address:
        page = open_page(address)
        for alpha, detail in ((1.0, 1), (0.93, 1), (0.93, 2), (1.1, 2)):
            page.set(focus=alpha, detail=detail)
            assert np.abs(page.pixels() - shown(lg.refocus(holed, alpha, oversample=detail))).max() <= LEVELS
        page.set(focus=0.95, detail=1, aperture=0.6, shape="round")
        small = lg.reduce_aperture(holed, 0.6, shape="round")
        assert np.abs(page.pixels() - shown(lg.refocus(small, 0.95, oversample=1))).max() <= LEVELS


def test_light_and_colour_follow_their_formula(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        picture = np.asarray(lg.refocus(views, 0.9, oversample=1), float)
        page.set(focus=0.9, ev=0.7, gamma=1.8, detail=1)
        assert np.abs(page.pixels() - shown(picture, ev=0.7, gamma=1.8)).max() <= LEVELS
        page.set(channel="green")
        assert np.abs(page.pixels() - shown(picture[..., 1], ev=0.7, gamma=1.8)).max() <= LEVELS
        page.set(channel="mono", ev=0, gamma=1)
        mono = picture @ np.array([0.2126, 0.7152, 0.0722])
        assert np.abs(page.pixels() - shown(mono)).max() <= LEVELS
        page.set(map="viridis")
        matplotlib = pytest.importorskip("matplotlib")
        wanted = matplotlib.colormaps["viridis"](mono / 255)[..., :3] * 255
        assert np.abs(page.pixels() - wanted).max() <= 4  # 33 colours and straight lines between them


def test_a_click_focuses_on_what_is_there_and_the_link_says_so(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        page.click_at(20, 14)
        assert page.state("focus") == pytest.approx(NEAR, abs=0.004)
        page.click_at(18, 50)
        assert page.state("focus") == pytest.approx(FAR, abs=0.004)
        page.page.keyboard.press("e")
        page.wait("location.hash.includes('epi=on')")
        link = page.page.url
        assert "focus=1.1" in link
        page.click_at(20, 14)
        again = open_page(link)
        assert again.state("focus") == pytest.approx(FAR, abs=0.004)
        assert again.state("epi") is True


def test_drags_keys_and_controls_change_the_settings(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        box = page.page.locator(".stage").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.page.mouse.move(*middle)
        page.page.mouse.down()
        page.page.mouse.move(middle[0] + 0.3 * box["width"], middle[1], steps=4)
        page.page.mouse.up()
        v, u = page.state("view")
        assert v == pytest.approx(2, abs=0.2)
        assert u > 3.5  # near things follow the pointer to the right, as they move with u
        page.says("#aperture-out", "1 × 1 views")
        page.page.click("#open")
        page.says("#aperture-out", "5 × 5 views")
        page.page.locator(".stage").focus()
        before = page.state("focus")
        assert min(abs(before - plane) for plane in (NEAR, FAR)) < 0.03  # it opened on something sharp
        page.page.keyboard.press("ArrowRight")
        assert page.state("focus") > before
        page.page.mouse.move(*middle)
        page.page.mouse.wheel(0, -300)
        page.wait("lumigraph.app.state.zoom > 1.3")
        page.page.keyboard.press("0")
        assert page.state("zoom") == 1
        page.page.locator("#ev").focus()
        page.page.keyboard.press("ArrowRight")
        assert page.state("ev") == pytest.approx(0.05)
        page.says("#ev-out", "+0.05 EV")
        with page.page.expect_download() as download:
            page.page.keyboard.press("s")
        from PIL import Image

        saved = np.array(Image.open(io.BytesIO(download.value.path().read_bytes())))[..., :3]
        assert np.array_equal(saved, page.pixels())


def test_the_exported_page_is_the_same_offline(open_page, views, tmp_path):
    views16 = two_planes(np.uint16, 4000)
    for name, light in (("eight", views), ("sixteen", views16)):
        written = viewer.export([of_views(name, light)], tmp_path / f"{name}.html", quality=100)
        assert written.size == (tmp_path / f"{name}.html").stat().st_size
    exported = open_page((tmp_path / "eight.html").as_uri(), offline=True)
    with served(of_views("eight", views)) as address:
        page = open_page(address)
        for state in ({"focus": 0.93}, {"focus": 1.1, "aperture": 0.6, "shape": "round"}, {"mode": "depth"}):
            page.set(**state)
            exported.set(**state)
            if state.get("mode"):
                for each in (page, exported):
                    each.wait(f"Boolean({ARRAYS}.confidence && {ARRAYS}.depth)")
            assert np.array_equal(page.pixels(), exported.pixels())
    sixteen = open_page((tmp_path / "sixteen.html").as_uri(), offline=True)
    sixteen.set(focus=0.95, detail=1)
    white = float(views16.data.max())
    assert np.abs(sixteen.pixels() - shown(lg.refocus(views16, 0.95, oversample=1), white)).max() <= LEVELS
    numbers = sixteen.page.evaluate("Array.from(lumigraph.app.main.model.views.numbers.slice(0, 500))")
    assert np.array_equal(numbers, views16.data.ravel()[:500])  # 16 bits keep their range


@pytest.mark.long
def test_a_lossy_page_looks_the_same(open_page, views, tmp_path):
    viewer.export([of_views("lossy", views)], tmp_path / "lossy.html", quality=90)
    page = open_page((tmp_path / "lossy.html").as_uri(), offline=True)
    page.set(focus=NEAR, detail=1)
    difference = page.pixels() - shown(lg.refocus(views, NEAR, oversample=1))
    assert np.sqrt((difference**2).mean()) < 5  # WebP keeps half the colour samples; noise images suffer most


def test_without_webgl_the_focal_stack_is_shown(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(f"{address}#renderer=canvas")
        assert page.page.evaluate("lumigraph.app.main.device.kind") == "canvas"
        page.wait(f"(lumigraph.app.schedule(), Boolean({ARRAYS}.stack))")
        page.set(focus=NEAR + 0.001)
        alpha = page.page.evaluate(
            "lumigraph.app.main.model.image(lumigraph.app.state, lumigraph.app.main.device, true).position"
        )
        planes = focal_stack(views)
        nearest = np.argmin(np.abs(np.array(planes.positions) - NEAR - 0.001))
        assert alpha == pytest.approx(planes.positions[nearest])
        assert np.abs(page.pixels() - shown(planes.data[nearest])).max() <= LEVELS
        page.set(aperture=0.001, view=[0, 4])
        assert np.abs(page.pixels() - shown(lg.sub_aperture(views, 0, 4))).max() <= LEVELS


def test_raw_images_show_every_pixel_and_volumes_their_planes(open_page, rng):
    raw = lg.RawImage(rng.integers(0, 4096, (60, 80), dtype=np.uint16), bit_depth=12)
    none = np.zeros((0, 2))
    calibration = lg.Calibration(lg.Lattice.square(10.0, origin=(5, 5)), (60, 80), none, none, 0.0)
    data = rng.integers(0, 1000, (4, 20, 30), dtype=np.uint16)
    volume = lg.Volume(data, lg.Grid((20, 30), (2e-6, 1e-6)), (-2e-6, 0.0, 2e-6, 4e-6))
    with served(of_raw("raw", raw, calibration), of_volume("volume", volume)) as address:
        page = open_page(address)
        page.set(mode="raw")
        page.wait("Boolean(lumigraph.app.main.model.arrays.raw)")
        page.set(zoom=1)
        assert np.abs(page.pixels() - shown(raw.data, 4095)).max() <= LEVELS
        overlay = "Array.from(lumigraph.app.main.overlay.getContext('2d').getImageData(0, 0, 300, 300).data)"
        assert max(page.page.evaluate(overlay)[3::4]) > 100  # the lattice is drawn
        page.page.click("#lattice")
        page.set(zoom=1)
        assert page.page.evaluate("lumigraph.app.main.overlay.hidden")
        page.set(mode="volume", plane=3)
        page.wait("Boolean(lumigraph.app.panes[1].model.arrays.volume)")
        page.set(plane=3)
        assert np.abs(page.pixels(1) - shown(data[3], data.max())).max() <= LEVELS
        for axis, name in enumerate(("max-z", "max-y", "max-x")):
            page.set(projection=name)
            wanted = data.max(axis) if axis < 2 else data.max(2).T
            assert np.abs(page.pixels(1) - shown(wanted, data.max())).max() <= LEVELS
        assert page.page.inner_text("#title") == "raw and volume"


def test_stacks_focus_where_they_are_clicked(open_page, views):
    alphas = np.linspace(0.8, 1.25, 10)
    stack = Stack(lg.refocus_stack(views, alphas, oversample=1), tuple(alphas), "alpha")
    with served(of_stack("stack.tiff", stack)) as address:
        page = open_page(address)
        page.click_at(20, 14)
        assert page.state("focus") == pytest.approx(NEAR, abs=0.03)
        page.click_at(20, 50)
        assert page.state("focus") == pytest.approx(FAR, abs=0.03)


def test_a_quilt_has_the_views_from_left_to_right_from_the_bottom_up(open_page, views):
    from PIL import Image

    with served(of_views("two planes.zarr", views)) as address:
        page = open_page(address)
        page.set(focus=1.0, detail=1)
        with page.page.expect_download() as download:
            page.page.click("#quilt")
        assert download.value.suggested_filename == "two planes_qs8x6a1.6.png"
        found = np.array(Image.open(io.BytesIO(download.value.path().read_bytes())))[..., :3].astype(float)
        assert found.shape == (6 * 40, 8 * 64, 3)
        assert np.abs(found[-40:, :64] - shown(lg.sub_aperture(views, 2, 0))).max() <= LEVELS
        assert np.abs(found[:40, -64:] - shown(lg.sub_aperture(views, 2, 4))).max() <= LEVELS
        assert page.state("aperture") == 1


def test_a_phone_has_no_sideways_scrolling(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address, viewport={"width": 390, "height": 844}, has_touch=True)
        assert page.page.evaluate("document.documentElement.scrollWidth") <= 390
        assert page.page.evaluate("document.getElementById('panel').scrollWidth") <= 390
        box = page.page.locator(".stage").bounding_box()
        page.page.touchscreen.tap(box["x"] + 0.25 * box["width"], box["y"] + 0.5 * box["height"])
        page.wait("lumigraph.app.state.point !== null")
        assert page.state("focus") == pytest.approx(NEAR, abs=0.004)
