"""What a page opens with: the subject in focus, at once, without a jump, and sharp while focus is dragged."""

import io

import numpy as np
import pytest
from PIL import Image

import lumigraph as lg
from lumigraph import viewer
from lumigraph.viewer.encoding import Coded
from lumigraph.viewer.opening import of_views
from lumigraph.viewer.start import poster, subject, subject_focus
from viewer_pages import FAR, NEAR, served

# Whether the picture of the next frame is numbers (of the stack), and the variance of green about a place.
DETAIL = """async ([t, s]) => {
    await new Promise((done) => requestAnimationFrame(() => setTimeout(done, 0)));
    const { image, tone, device } = lumigraph.app.main, data = device.pixels(image, tone), values = [];
    for (let y = (t - 4) * image.detail; y <= (t + 4) * image.detail; y++)
        for (let x = (s - 4) * image.detail; x <= (s + 4) * image.detail; x++)
            values.push(data[4 * (y * image.nx + x) + 1]);
    const mean = values.reduce((a, b) => a + b) / values.length;
    return [Boolean(image.numbers), values.reduce((a, b) => a + (b - mean) ** 2, 0) / values.length];
}"""
MODEL = "lumigraph.app.main.model"


@pytest.mark.parametrize("plane", [NEAR, FAR])
def test_the_subject_is_found_where_there_is_detail_and_its_focus_is_that_of_its_plane(views, plane):
    faint = (np.arange(64) >= 32) == (plane == NEAR)  # the half of the other plane
    data = np.where(faint[:, None], 128 + 0.2 * (views.data - 128.0), views.data).astype(np.uint8)
    light = lg.LightField(data, views.aperture, views.lenslets, views.separation)
    t, s = subject(light)
    assert 8 <= t < 32  # near the middle
    assert s < 32 if plane == NEAR else s >= 32
    assert subject_focus(light) == pytest.approx(plane, abs=0.01)


def test_one_view_opens_with_factor_1(views):
    one = lg.LightField(views.data[:1, :1], lg.Grid((1, 1), 1.0), views.lenslets, 200.0)
    assert subject_focus(one) == 1.0


def test_the_poster_is_the_refocused_picture_to_half_a_level(views):
    found = poster(views, 0.93, 2, 255.0)
    assert isinstance(found, Coded)
    expected = np.clip(lg.refocus(views, 0.93, oversample=2), 0, 255)
    assert np.abs(found.values()[0] - expected).max() <= 0.51


@pytest.fixture
def held(open_page, views, tmp_path):
    """Exported page with its poster still shown."""
    written = viewer.export([of_views("views", views)], tmp_path / "page.html", quality=99)
    page = open_page(written.path.as_uri(), offline=True)
    page.page.evaluate(f"{MODEL}.complete = false; lumigraph.app.schedule()")
    page.wait("!lumigraph.app.main.quick.hidden")
    return page


def test_the_poster_gives_way_to_the_exact_picture_without_a_jump(held):
    with_poster = held.page.locator(".stage").screenshot()
    held.page.evaluate(f"{MODEL}.complete = true; lumigraph.app.schedule()")
    held.wait("lumigraph.app.main.quick.hidden")
    exact = held.page.locator(".stage").screenshot()
    first, then = (_grey(shot) for shot in (with_poster, exact))
    assert then.std() > 20  # there is a picture
    assert np.abs(first - then).mean() < 2.0
    assert np.abs(first.mean() - then.mean()) < 0.3
    for axis in (0, 1):  # a shift by one pixel of the screen would be worse than none
        for step in (-1, 1):
            assert np.abs(np.roll(first, step, axis) - then).mean() > 1.5 * np.abs(first - then).mean()


def test_the_poster_is_shown_for_the_settings_of_the_start_only(held):
    for change in ({"focus": 0.91}, {"aperture": 0.5}, {"shape": "round"}, {"detail": 1}):
        state = "{ ...lumigraph.app.base, ...change }"
        assert held.page.evaluate(f"change => {MODEL}.poster({state}) === null", change)
    assert held.page.evaluate(f"{MODEL}.poster(lumigraph.app.base) !== null")


def test_a_page_of_a_server_has_no_poster_and_opens_on_the_same_focus(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        assert page.page.evaluate(f"{MODEL}.arrays.poster === undefined")
        assert page.state("focus") == subject_focus(views)


@pytest.mark.parametrize("slow", [False, True])
def test_a_drag_of_the_focus_does_not_blur_the_subject_first(open_page, views, slow):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.page.evaluate(f"slow => {{ {MODEL}.slow = slow; {MODEL}.need('stack'); }}", slow)
        page.wait(f"Boolean({MODEL}.arrays.stack)")
        low, high = page.page.evaluate(f"{MODEL}.focus")
        start, place = page.state("focus"), list(subject(views))
        details = []
        for step in range(4):  # a drag begins with steps of some pixels of the slider
            page.page.evaluate("focus => lumigraph.app.set({ focus })", start + step * (high - low) / 300)
            numbers, detail = page.page.evaluate(DETAIL, place)
            assert numbers == slow
            details.append(detail)
        assert details[0] > 400
        assert min(details) > 0.97 * details[0]


def _grey(shot):
    return np.asarray(Image.open(io.BytesIO(shot)).convert("L"), float)
