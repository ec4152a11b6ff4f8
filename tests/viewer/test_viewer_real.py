"""Real files on the page, and how fast it is; measured by software rendering, so left out of `make test`."""

import numpy as np
import pytest

import lumigraph as lg
from data_folder import real
from lumigraph import viewer
from lumigraph.errors import SamplingWarning
from lumigraph.viewer.opening import open_exhibit
from viewer_pages import served

pytestmark = pytest.mark.long

_MOVE = """async count => {
  const { app } = lumigraph, [low, high] = app.main.model.focus, start = performance.now();
  for (let k = 0; k < count; k++) {
    await new Promise((next) => requestAnimationFrame(next));
    app.set({ focus: low + ((high - low) * ((7 * k) % 33)) / 32 });
  }
  return (1000 * count) / (performance.now() - start);
}"""


def test_81_views_are_shown_and_refocus_as_the_library_does(open_page):
    exhibit = open_exhibit(real("hci_antinous"))
    with served(exhibit) as address:
        open_page(address).close()  # starts the browser's graphics process
        page = open_page(address, viewport={"width": 1280, "height": 800})
        first = page.page.evaluate("lumigraph.app.first")
        print(f"first picture after {first:.0f} ms")
        for alpha in (0.8, 1.0, 1.13):
            page.set(focus=alpha)
            picture = np.clip(lg.refocus(exhibit.views, alpha, oversample=1), 0, 255)
            assert np.abs(page.pixels() - picture).max() <= 2
        page.wait("lumigraph.app.main.model.need('stack') !== null", 60)
        page.page.evaluate(_MOVE, 40)
        rate = page.page.evaluate(_MOVE, 60)
        print(f"{rate:.0f} pictures of the focal stack per second")


def test_a_plenoptic_camera_1_shows_pictures_lattice_and_depth(open_page):
    folder = real("letters_plenoptic1")
    origin = viewer.Origin(white=folder / "letters_ULF_M1_white.png")
    exhibit = open_exhibit(folder / "letters_ULF_M1.png", origin)
    with served(exhibit) as address:
        page = open_page(address)
        white = page.page.evaluate("lumigraph.app.main.model.views.white")
        page.set(focus=0.95)
        times = page.page.evaluate("lumigraph.app.main.model.views.detail")
        picture = np.clip(lg.refocus(exhibit.views, 0.95, oversample=times) / white, 0, 1) * 255
        assert np.abs(page.pixels() - picture[..., None]).max() <= 2
        assert page.page.locator("#modes button:visible").count() == 3


def test_a_multi_focus_camera_2_shows_pictures_and_three_kinds_of_lenslets(open_page):
    folder = real("raytrix_r42_multifocus")
    with pytest.warns(SamplingWarning, match="maker's lattice was moved"):
        exhibit = open_exhibit(folder / "sc2_klein.png", viewer.Origin(calibration=folder / "sc2_klein.xml"))
    with served(exhibit) as address:
        page = open_page(address)
        assert page.page.evaluate("lumigraph.app.main.model.about.raw.lattice.kinds") == 3
        assert page.page.inner_text("#focus-label") == "Patch"
        middle = page.page.evaluate("lumigraph.app.main.base.map(n => n / 2)")
        page.click_at(*middle)
        assert page.state("point") is not None
