"""The legend of a depth map has the digits that its range needs, and room for them."""

import numpy as np
import pytest

import lumigraph as lg
from lumigraph import viewer
from viewer_pages import served, two_planes

FITS = """() => [...document.querySelectorAll('.ends:has(#legend-low), .ends:has(#legend-low) > span')]
    .every(e => e.scrollWidth <= e.clientWidth + 1 || getComputedStyle(e).display === 'inline')
    && document.getElementById('legend-high').getBoundingClientRect().right
        <= document.getElementById('legend-bar').getBoundingClientRect().right + 1"""


def shown(low, high, **options):
    """Exhibit of views whose disparities go from low to high [px per view]."""
    views = two_planes()
    per = views.aperture.pitch[1] / views.lenslets.pitch[1]
    disparities = np.linspace(low, high, 40 * 64).reshape(40, 64)
    depth = lg.DepthMap(1 - disparities / per, np.ones((40, 64)), "alpha")
    return viewer.Exhibit("views", views=views, depth=lambda: depth, **options)


@pytest.mark.parametrize(
    ("low", "high", "digits"), [(-0.005, 0.012, 3), (-0.5, 1.2, 2), (-0.00005, 0.00012, 5)]
)
def test_small_disparities_have_digits_in_the_legend(open_page, low, high, digits):
    with served(shown(low, high, relative=True)) as address:
        page = open_page(f"{address}#mode=depth")
        page.wait("Boolean(document.getElementById('legend-high').textContent)")
        words = [page.page.inner_text(f"#legend-{end}").split()[0] for end in ("low", "high")]
        # 1 % at each end is left out of the colours; α' rises where the disparity falls.
        inner = sorted((high - 0.01 * (high - low), low + 0.01 * (high - low)))
        found = sorted(float(word.replace("−", "-")) for word in words)
        assert found == pytest.approx(inner, abs=0.51 * 10**-digits)
        assert all(len(word.split(".")[1]) == digits for word in words)
        assert page.page.evaluate(FITS)


def test_a_long_legend_is_not_cut_off_on_a_narrow_screen(open_page):
    with served(shown(-12.345678, 0.00001, relative=True)) as address:
        page = open_page(f"{address}#mode=depth", viewport={"width": 320, "height": 640})
        page.wait("Boolean(document.getElementById('legend-high').textContent)")
        assert page.page.evaluate(FITS)
