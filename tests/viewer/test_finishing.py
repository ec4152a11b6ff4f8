"""A plane that leans, sharpening where in focus, and a picture with less noise."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph.viewer.opening import of_views
from viewer_pages import FAR, NEAR, served, two_planes


def test_tilted_pictures_are_those_of_the_library(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        for focus, tilt in ((1.0, (0.1, 0.0)), (1.02, (0.0, -0.15)), (0.95, (-0.08, 0.12))):
            for detail in (1, 2):
                page.set(focus=focus, tilt=list(tilt), detail=detail)
                expected = np.clip(lg.refocus(views, focus, tilt=tilt, oversample=detail), 0, 255)
                assert np.abs(page.pixels() - expected).max() <= 1


def test_a_click_moves_the_tilted_plane_to_the_place(open_page, views):
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        page.set(focus=1.0, tilt=[0.05, -0.1], detail=1)
        page.click_at(30, 12)
        alpha = page.state("focus") + 0.05 * (30 / 39 - 0.5) - 0.1 * (12 / 63 - 0.5)
        assert alpha == pytest.approx(NEAR, abs=0.02)
        for key, change in (("t", (1, 0)), ("Shift+T", (-1, 0)), ("y", (0, 1)), ("Shift+Y", (0, -1))):
            before = np.array(page.state("tilt"))
            page.page.keyboard.press(key)
            after = np.array(page.state("tilt"))
            assert (np.sign(after - before) == change).all()
        page.wait("location.hash.includes('tilt=0.05,-0.1')")


def test_only_what_is_in_focus_is_sharpened(open_page, views):
    near, far = (slice(6, -6), slice(6, 26)), (slice(6, -6), slice(40, 58))
    with served(of_views("two planes", views)) as address:
        page = open_page(address)
        page.set(focus=FAR, detail=1, trust=0)
        before = page.pixels()
        page.set(sharpen=1.0)
        page.wait("Boolean(lumigraph.app.main.model.arrays.confidence)")
        page.set(sharpen=1.0)
        after = page.pixels()
        assert after[far].std() > 1.15 * before[far].std()
        assert np.abs(after[near] - before[near]).mean() < 0.5
        page.set(sharpen=0)
        assert (page.pixels() == before).all()


@pytest.mark.parametrize("colour", [True, False])
def test_noise_falls_and_edges_stay(open_page, rng, colour):
    kind, (y, x) = two_planes(), np.mgrid[:40, :64]
    clean = np.where((y // 13 + x // 16) % 2, 190.0, 60.0)
    truth = np.repeat(clean[..., None], 3, -1)
    shape = (5, 5, 40, 64, 3) if colour else (5, 5, 40, 64)
    noisy = (truth if colour else clean) + rng.normal(0, 8, shape)
    views = lg.LightField(noisy.astype(np.uint8), kind.aperture, kind.lenslets, kind.separation)
    with served(of_views("noisy", views)) as address:
        page = open_page(address)
        page.set(aperture=0.001, view=[2, 2], focus=1.0, detail=1)
        before = page.pixels()
        page.set(denoise=0.6)
        rms = [np.sqrt(np.mean((one - truth) ** 2)) for one in (before, page.pixels())]
        assert 7 < rms[0] < 9
        assert rms[1] < 0.5 * rms[0]  # a blur that ignores edges of 130 levels would add to it
        noise = page.page.evaluate("(({ noise, scale }) => noise / scale)(lumigraph.app.main.model.views)")
        assert noise == pytest.approx(8, rel=0.3)
        page.set(aperture=1.0)  # 25 views leave a fifth of the noise, and hardly anything to average
        assert np.abs(page.pixels() - truth)[2:-2, 2:-2].mean() < 3
