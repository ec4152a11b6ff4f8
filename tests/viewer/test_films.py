"""Films as files with the right frames, volumes seen along rays, pictures that are in focus everywhere."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.viewer.opening import of_views, of_volume
from viewer_pages import FAR, NEAR, film, frames_of, served


def test_a_pull_of_focus_has_every_frame_as_the_library_refocuses_it(open_page, views, tmp_path):
    with served(of_views("two planes.zarr", views)) as address:
        page = open_page(address)
        page.set(detail=4)
        before = page.state("focus")
        assert film(page, "pull", 1, tmp_path / "film.webm") == "two planes-focus.webm"
        assert page.state("focus") == before
        times, pictures, duration = frames_of(tmp_path / "film.webm")
        assert pictures.shape == (25, 156, 252, 3)  # (40 - 1) 4 + 1 = 157 and 253, even
        np.testing.assert_allclose(times, np.arange(25) / 25, atol=1e-3)
        assert duration == pytest.approx(1)
        low, high = page.page.evaluate("lumigraph.app.main.model.focus")
        for k in (0, 9, 12):
            alpha = low + (high - low) * (1 - np.cos(2 * np.pi * k / 25)) / 2
            expected = np.clip(lg.refocus(views, alpha, oversample=4), 0, 255)[:156, :252]
            own, other = (np.sqrt(((pictures[n] - expected) ** 2).mean()) for n in (k, k - 6))
            assert own < 12  # encoded, with half the colour samples
            assert own < 0.6 * other


def test_a_parallax_moves_with_the_viewpoint(open_page, views, tmp_path):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.set(detail=1, turn=1)
        film(page, "sway", 1, tmp_path / "film.webm")
        _, pictures, _ = frames_of(tmp_path / "film.webm")
        assert pictures.shape == (25, 64, 40, 3)
        moved = np.abs(np.diff(pictures, axis=0)).mean((1, 2, 3))
        assert (moved > 5).sum() >= 6  # from view to view of a ring
        assert page.state("aperture") == 1


def test_a_cancelled_film_is_not_saved_and_a_browser_without_encoder_says_so(open_page, views):
    with served(of_views("views", views)) as address:
        page = open_page(address)
        page.page.keyboard.press("v")
        page.page.click("#film-start")
        page.wait("document.getElementById('film-progress').value > 0")
        page.page.click("#film-stop")
        page.wait("!document.getElementById('film').open")
        page.page.evaluate("delete globalThis.VideoEncoder")
        page.page.click("#save-film")
        page.page.click("#film-start")
        page.says("#film-told", "This browser cannot write films: it has no WebCodecs.")
        assert page.page.inner_text("#status") != "Saved"
        page.page.click("#film-stop")


def blobs(shape=(20, 30, 40), spacing=(2e-6, 1e-6, 1e-6)):
    """A volume of three smooth blobs, all of different brightness and none in the middle."""
    z, y, x = (np.arange(n) * d for n, d in zip(shape, (1, 0.5, 0.5), strict=True))
    found = np.zeros(shape)
    for cz, cy, cx, bright in ((5, 4, 5, 1.0), (14, 11, 6, 0.7), (10, 6, 15, 0.4)):
        found += bright * np.exp(-((z[:, None, None] - cz) ** 2 + (y[:, None] - cy) ** 2 + (x - cx) ** 2) / 6)
    depths = tuple(np.arange(shape[0]) * spacing[0])
    return lg.Volume((60000 * found).astype(np.uint16), lg.Grid(shape[1:], spacing[1:]), depths)


def rays(page, **state):
    page.set(**state)
    picture = page.pixels()[..., 0] / 255
    return picture, page.page.evaluate("[lumigraph.app.main.image.unit, lumigraph.app.main.image.base[0]]")


@pytest.mark.parametrize(
    ("orbit", "axis", "order"),
    [([0, 0], 0, "yx"), ([90, 0], 2, "yz-"), ([0, 90], 1, "z-x"), ([-180, 0], 0, "yx-")],
)
def test_rays_along_an_axis_see_the_largest_values_where_numpy_does(open_page, orbit, axis, order):
    volume = blobs()
    data = volume.data / volume.data.max()
    expected = {
        "yx": data.max(0),
        "yz-": data.max(2)[::-1].T,
        "z-x": data.max(1)[::-1],
        "yx-": data.max(0)[:, ::-1],
    }[order]
    steps = {"yx": (1, 1), "yz-": (1, 2), "z-x": (2, 1), "yx-": (1, 1)}[order]
    with served(of_volume("volume", volume)) as address:
        page = open_page(address)
        picture, (unit, side) = rays(page, projection="brightest", orbit=orbit)
        places = [
            (np.arange(n) - (n - 1) / 2) * step * 1e-6 / unit + (side - 1) / 2
            for n, step in zip(expected.shape, steps, strict=True)
        ]
        from scipy.ndimage import map_coordinates

        found = map_coordinates(picture, np.meshgrid(*places, indexing="ij"), order=1)
        assert np.abs(found - expected).max() < 0.03
        mirrored = min(np.abs(found - other).max() for other in (expected[::-1], expected[:, ::-1]))
        assert mirrored > 0.3


def test_a_fog_hides_what_lies_behind(open_page):
    data = np.zeros((9, 9, 9), np.uint8)
    data[:3, 2:7, 2:7], data[6:, 2:7, 2:7] = 120, 240
    with served(
        of_volume("volume", lg.Volume(data, lg.Grid((9, 9), 1e-6), tuple(np.arange(9) * 1e-6)))
    ) as address:
        page = open_page(address)
        dim, (_, side) = rays(page, projection="fog", orbit=[0, 0], density=40)
        bright, _ = rays(page, orbit=[-180, 0])
        assert dim[side // 2, side // 2] == pytest.approx(120 / 255, abs=0.1)
        assert bright[side // 2, side // 2] == pytest.approx(240 / 255, abs=0.1)
        thin, _ = rays(page, density=1)
        assert thin[side // 2, side // 2] < 0.3


def test_a_volume_turns_with_the_pointer_and_with_keys(open_page):
    with served(of_volume("volume", blobs())) as address:
        page = open_page(f"{address}#projection=brightest&orbit=0,0")
        box = page.page.locator(".stage").bounding_box()
        middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
        page.page.mouse.move(*middle)
        page.page.mouse.down()
        page.page.mouse.move(middle[0] + 60, middle[1] - 40, steps=3)
        page.page.mouse.up()
        assert page.state("orbit") == pytest.approx([30, -20], abs=0.6)
        page.page.locator(".stage").focus()
        page.page.keyboard.press("Shift+ArrowRight")
        assert page.state("orbit")[0] == pytest.approx(35, abs=0.6)


def test_everything_is_in_focus_as_the_library_has_it(open_page, views):
    exhibit = of_views("views", views)
    with served(exhibit) as address:
        page = open_page(address)
        page.page.click("#sharp")
        page.wait("Boolean(lumigraph.app.main.model.arrays.sharp)")
        page.set(sharp=True)
        depth = exhibit.depth()
        factors = np.where(np.nan_to_num(depth.confidence) > 0, depth.values, np.nan)
        expected = np.clip(lg.all_in_focus(views, depth=factors, oversample=1).picture, 0, None)
        assert np.abs(page.pixels() - np.clip(expected, 0, 255)).max() <= 1.0
        for half, alpha in ((slice(4, 24), NEAR), (slice(40, 60), FAR)):
            near = lg.refocus(views, alpha, oversample=1)
            assert np.abs(page.pixels()[6:-6, half] - np.clip(near, 0, 255)[6:-6, half]).mean() < 4
