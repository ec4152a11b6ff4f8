"""What notebooks show: a table, a picture, or the whole page in a frame that reaches nothing."""

import base64
import io
import re

import numpy as np
import pytest
from PIL import Image

import lumigraph as lg
from lumigraph.core import picture
from lumigraph.errors import FormatError


def shown(thing):
    """The text of a card and its picture."""
    html = thing._repr_html_()
    found = re.search(r"data:image/png;base64,([^\"]+)", html)
    return html, np.asarray(Image.open(io.BytesIO(base64.b64decode(found[1])))) if found else None


def test_a_png_holds_what_it_was_given(rng):
    for shape in ((5, 7), (4, 3, 3)):
        data = rng.integers(0, 256, shape, dtype=np.uint8)
        np.testing.assert_array_equal(np.asarray(Image.open(io.BytesIO(picture.png(data)))), data)


def test_raw_images_light_fields_and_volumes_show_sizes_units_and_a_picture(views, xp):
    data = np.linspace(0, 1000, 600 * 300).reshape(600, 300)
    html, image = shown(lg.RawImage(xp.asarray(data), pixel_pitch=5e-6, metadata={"<b>": 1}))
    assert "600 × 300 px" in html
    assert "5 µm" in html
    assert image.shape == (200, 100)  # means over 3 × 3
    assert image[0].max() < 3
    assert image[-1].min() > 252
    html, image = shown(views)
    assert "5 × 5" in html
    assert image.shape == (40, 64, 3)
    volume = lg.Volume(np.zeros((2, 8, 9)), lg.Grid((8, 9), 1e-6), (-1e-6, 2e-6))
    assert "-1 µm to 2 µm" in shown(volume)[0]
    broken = shown(lg.RawImage(np.full((3, 3), np.nan)))
    assert "none finite" in broken[0]


def test_calibrations_cameras_maps_and_operators_show_their_tables():
    camera = lg.load_camera("thesis-2f")
    assert "f-number" in shown(camera)[0]
    assert "2000 × 2000 px" in shown(camera.operator())[0]
    focused = lg.load_camera("thesis-plenoptic-2-m050").calibration
    html, image = shown(focused)
    assert "pitch" in html
    assert (image == 255).sum() == len(focused.centers)  # a dot for each, none on another
    found = lg.depth.DepthMap(np.array([[1e-3, np.nan]]), np.ones((1, 2)), "depth")
    assert "1 mm to 1 mm" in shown(found)[0]


def test_text_is_escaped():
    assert "&lt;script&gt;" in picture.card("<script>", [("a", "b")])


def test_the_page_stands_in_a_frame_without_an_origin(browser, views):
    frame = lg.view_inline(views, height=300, quality=100)._repr_html_()
    assert 'sandbox="allow-scripts allow-downloads"' in frame
    context = browser.new_context(offline=True)
    page = context.new_page()
    errors = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.set_content(f"<!doctype html>{frame}")
    inside = page.frames[1]
    for _ in range(500):
        if inside.evaluate("Boolean(window.lumigraph?.ready)"):
            break
        page.wait_for_timeout(20)
    assert inside.evaluate("lumigraph.app.main.model.views !== null")
    assert not errors
    context.close()


def test_what_has_no_page_is_refused(views):
    with pytest.raises(FormatError, match="a dict has no page"):
        lg.view_inline({})
    with pytest.raises(FormatError, match="a LightField needs no calibration"):
        lg.view_inline(views, object())
