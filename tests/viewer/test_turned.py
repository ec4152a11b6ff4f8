"""Pictures turned by quarters, lengths and regions on them: on the screen and in what is saved."""

import io

import numpy as np
import pytest
from PIL import Image

import lumigraph as lg
from lumigraph.viewer.opening import of_raw, of_views, of_volume
from viewer_pages import served

SHEET = """() => { const sheet = lumigraph.picture();
    const { data } = sheet.getContext("2d").getImageData(0, 0, sheet.width, sheet.height);
    return [sheet.height, sheet.width, Array.from(data)]; }"""


def saved(page):
    ny, nx, data = page.page.evaluate(SHEET)
    return np.array(data, np.uint8).reshape(ny, nx, 4)[..., :3]


def marked(shape=(24, 40)):
    """A raw image with three corners of their own."""
    data = np.zeros(shape, np.uint8)
    data[:6, :6], data[:6, -6:], data[-6:, :6] = 250, 160, 80
    return of_raw("raw", lg.RawImage(data))


def test_turning_is_clockwise_on_the_screen_and_in_saved_pictures(open_page):
    with served(marked()) as address:
        page = open_page(address)
        upright = saved(page)
        for quarters in range(1, 4):
            page.page.locator(".stage").focus()
            page.page.keyboard.press("r")
            assert page.state("turn") == quarters
            page.set(smooth=False)
            assert np.array_equal(saved(page), np.rot90(upright, -quarters))
            shot = Image.open(io.BytesIO(page.page.locator(".stage").screenshot())).convert("L")
            for y, x in ((2, 2), (2, 37), (21, 2), (21, 37)):  # what is seen where the page says that it is
                place = page.page.evaluate("([y, x]) => lumigraph.app.main.toScreen(y, x)", [y, x])
                assert shot.getpixel(tuple(round(k) for k in place)) == pytest.approx(upright[y, x, 0], abs=1)
                back = page.page.evaluate("([x, y]) => lumigraph.app.main.toPicture(x, y)", place)
                assert back == pytest.approx([y, x], abs=1e-6)
        assert "turn=270" in page.page.evaluate("(lumigraph.app.writeLink(), location.hash)")


def test_a_browser_canvas_turns_as_the_graphics_processor_does(open_page):
    shots = []
    with served(marked()) as address:
        for renderer in ("auto", "canvas"):
            page = open_page(f"{address}#renderer={renderer}&turn=90&smooth=off")
            shots.append(Image.open(io.BytesIO(page.page.locator(".stage").screenshot())).convert("L"))
    difference = np.abs(np.subtract(*(np.asarray(shot, float) for shot in shots)))
    assert np.mean(difference > 2) < 0.005  # edges


def test_a_drag_of_a_turned_picture_follows_the_pointer(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.set(turn=1, aperture=0.2)
        box = page.page.locator(".stage").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.page.mouse.move(*middle)
        page.page.mouse.down()
        page.page.mouse.move(middle[0], middle[1] + 0.3 * box["height"], steps=4)
        page.page.mouse.up()
        v, u = page.state("view")
        assert v == pytest.approx(2, abs=0.2)
        assert u > 3  # down on the screen is along +x of the picture


@pytest.mark.parametrize("turn", [0, 3])
def test_the_lattice_turns_with_the_raw_image(open_page, turn):
    none = np.zeros((0, 2))
    lattice = lg.Lattice(((11.0, 1.0), (-1.0, 11.0)), (5.0, 5.0))
    calibration = lg.Calibration(lattice, (60, 80), none, none, 0.0)
    with served(of_raw("raw", lg.RawImage(np.zeros((60, 80))), calibration)) as address:
        page = open_page(f"{address}#mode=raw&turn={90 * turn}")
        page.wait("Boolean(lumigraph.app.main.model.arrays.raw)")
        page.set(zoom=1)
        lit = page.page.evaluate(
            """([y, x]) => { const { main } = lumigraph.app, context = main.overlay.getContext("2d");
                const at = main.toScreen(y, x).map((k) => Math.round(k * main.ratio));
                return context.getImageData(...at, 1, 1).data[3]; }""",
            list(calibration.position(np.array([[2, 3]]))[0]),
        )
        assert lit > 100  # the cross of a lenslet stands at its centre


def test_lengths_are_measured_in_metres_and_drawn_into_what_is_saved(open_page):
    data = np.zeros((1, 60, 80), np.uint8)
    volume = lg.Volume(data, lg.Grid((60, 80), (2e-6, 1e-6)), (0.0,))
    with served(of_volume("volume", volume)) as address:
        page = open_page(f"{address}#turn=90")
        page.page.select_option("#drag", "ruler")
        ends = [page.window_place(*place) for place in ((10, 20), (30, 50))]
        page.page.mouse.move(*ends[0])
        page.page.mouse.down()
        page.page.mouse.move(*ends[1], steps=3)
        page.page.mouse.up()
        assert page.state("ruler") == pytest.approx([10, 20, 30, 50], abs=0.2)
        page.set(ruler=[10, 20, 30, 50])
        page.says("#ruler-out", "Length 50 µm (36.1 px)")  # 3-4-5
        sheet = saved(page)
        assert sheet.shape[:2] == (80, 120)
        for y, x in ((25, 42.5), (29, 48.5)):  # rows of 2 µm are 2 px tall, and turned by a quarter
            assert sheet[round(x + 0.5), round(120 - 2 * (y + 0.5))].max() > 180
        page.page.click("#clear")
        assert saved(page).max() == 0


def test_a_region_has_the_mean_and_deviation_of_its_samples(open_page, rng):
    data = rng.integers(0, 1000, (1, 40, 50)).astype(np.uint16)
    with served(of_volume("volume", lg.Volume(data, lg.Grid((40, 50), 1e-6), (0.0,)))) as address:
        page = open_page(address)
        page.set(region=[5.2, 10.1, 20.3, 7.9])
        part = data[0, 5:21, 8:11]
        spread = f"mean {part.mean():.4g}, deviation {part.std():.4g}, {part.min()} to {part.max()}"
        page.says("#region-out", f"Region 3 × 16 px: {spread}")


def test_a_region_of_a_refocused_picture_is_read_from_the_graphics_processor(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.set(focus=0.95, detail=1, region=[10, 20, 14, 29])
        found = page.page.evaluate("lumigraph.app.main.regionText(lumigraph.app.state)")
        part = lg.refocus(views, 0.95, oversample=1)[10:15, 20:30].mean(-1)
        words = found.replace(",", "").split()
        assert found.startswith("10 × 5 px: mean ")
        assert float(words[5]) == pytest.approx(part.mean(), rel=5e-4)  # four digits
        assert float(words[7]) == pytest.approx(part.std(), rel=1e-3)
